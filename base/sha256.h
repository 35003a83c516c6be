#pragma once

// SHA-256 of FIPS 180-4, the sum that `sha256sum` prints: says later whether a file is still the
// one that was read.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro {

class Sha256 {
 public:
  void add(std::string_view bytes);

  /// 64 hexadecimal digits of everything that was added.
  [[nodiscard]] std::string text() const;

 private:
  static constexpr std::size_t kBlockBytes = 64;

  void add_block(const std::uint8_t* block);

  std::array<std::uint32_t, 8> state_{0x6a09e667U, 0xbb67ae85U, 0x3c6ef372U, 0xa54ff53aU,
                                      0x510e527fU, 0x9b05688cU, 0x1f83d9abU, 0x5be0cd19U};
  std::array<std::uint8_t, kBlockBytes> rest_{};  ///< bytes that fill no block yet
  std::uint64_t bytes_ = 0;                       ///< of all
};

/// Of a file's bytes as they are on disk, read in pieces. Only of regular files: a pipe has no
/// second reading.
Expected<std::string> sha256_of_file(const std::string& path);

}  // namespace vgyro
