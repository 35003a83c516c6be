#pragma once

// Shared by all forms of lines: noise around a line, fields, numbers. Nothing allocates.

#include <charconv>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/time.h"

namespace vgyro::canlog {

inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Removes what is not part of a line: its carriage return, a byte-order mark (joined files also
/// have one in the middle), and everything up to its last NUL byte, as after a power cut. `skipped`
/// grows by the bytes before and among the NULs.
inline std::string_view clean_line(std::string_view line, std::uint64_t& skipped) {
  if (const std::size_t nul = line.rfind('\0'); nul != line.npos) {
    skipped += nul + 1;
    line.remove_prefix(nul + 1);
  }
  if (line.starts_with(kByteOrderMark)) line.remove_prefix(kByteOrderMark.size());
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

inline bool is_blank(char c) {
  return c == ' ' || c == '\t';
}
inline bool is_decimal(char c) {
  return c >= '0' && c <= '9';
}
inline std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front()))
    text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back()))
    text.remove_suffix(1);
  return text;
}

/// The words of a line in sequence.
class Words {
 public:
  explicit Words(std::string_view line) : rest_(trimmed(line)) {}
  /// Empty at the end.
  std::string_view next() {
    std::size_t end = 0;
    while (end < rest_.size() && !is_blank(rest_[end]))
      ++end;
    const std::string_view word = rest_.substr(0, end);
    while (end < rest_.size() && is_blank(rest_[end]))
      ++end;
    rest_.remove_prefix(end);
    return word;
  }
  [[nodiscard]] std::string_view rest() const { return rest_; }
  [[nodiscard]] bool at_end() const { return rest_.empty(); }

 private:
  std::string_view rest_;
};

/// The whole of `text` as a number without a sign.
template <class T>
std::optional<T> number_of(std::string_view text, int base = 10) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (text.empty() || text.front() == '-' || error != std::errc{} ||
      end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

/// A stamp beyond this (the year 2255) would not fit 64 bits in nanoseconds.
inline constexpr std::int64_t kStampMax_ns = 9'000'000'000'000'000'000;

/// "12.345678" in units of `unit_ns` → nanoseconds, exact to the last digit of a nanosecond;
/// `digits` counts those after the point. Neither sign nor exponent.
struct DecimalTime {
  std::int64_t ns = 0;
  unsigned digits = 0;
};
std::optional<DecimalTime> decimal_time(std::string_view text, std::int64_t unit_ns);

}  // namespace vgyro::canlog
