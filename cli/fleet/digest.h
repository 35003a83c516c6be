#pragma once

// Digests of recordings, files and evidence: sixteen hexadecimal digits, from two 32-bit FNV-1a
// hashes with different initial values. The same on every machine and in every version; not secure
// against forgery.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "base/fnv1a.h"

namespace vgyro::cli {

class Digest {
 public:
  // Both hashes in one pass, so that the processor overlaps their multiplications.
  void add(std::string_view text) {
    std::uint32_t first = first_;
    std::uint32_t second = second_ ^ static_cast<std::uint32_t>(text.size());
    for (const char c : text) {
      first = fnv1a({&c, 1}, first);
      second = fnv1a({&c, 1}, second);
    }
    first_ = first;
    second_ = second;
  }
  void add(const std::vector<double>& values) {
    add({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)});
  }
  [[nodiscard]] std::string text() const { return fmt::format("{:08x}{:08x}", first_, second_); }

 private:
  std::uint32_t first_ = kFnv1aBegin;
  std::uint32_t second_ = kFnv1aBegin ^ 0x9e3779b9U;
};

}  // namespace vgyro::cli
