#pragma once

// Numbers packed into a JSON string as base64. Correlations are little-endian integers of two
// bytes; sums are whole numbers in as many groups of seven bits as they need.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/sums.h"

namespace vgyro::cli {

std::string base64(std::string_view bytes);
/// Nothing if the text is no base64.
std::optional<std::string> from_base64(std::string_view text);

/// Values from −1 to 1 in steps of 1/32767, two bytes each.
std::string packed_correlations(const std::vector<double>& values);
/// Nothing if the text does not hold `count` correlations.
std::optional<std::vector<double>> correlations_of(std::string_view text, std::size_t count);

class WholeWriter {
 public:
  void put(fleet::Whole value);
  [[nodiscard]] std::string text() const { return base64(bytes_); }

 private:
  std::string bytes_;
};

class WholeReader {
 public:
  explicit WholeReader(std::string_view text);
  /// The next number; 0 from the first error on.
  fleet::Whole get();
  /// Whether every get() succeeded and nothing is left.
  [[nodiscard]] bool good() const { return good_ && at_ == bytes_.size(); }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

}  // namespace vgyro::cli
