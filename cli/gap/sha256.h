#pragma once

// SHA-256 of FIPS 180-4, the sum that `sha256sum` prints: says later whether a file is still the
// one that was read.

#include <nettle/sha2.h>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro::cli {

class Sha256 {
 public:
  Sha256();
  void add(std::string_view bytes);

  /// 64 hexadecimal digits of everything that was added.
  [[nodiscard]] std::string text() const;

 private:
  sha256_ctx context_{};
};

/// Of a file's bytes as they are on disk, read in pieces. Only of regular files: a pipe has no
/// second reading.
Expected<std::string> sha256_of_file(const std::string& path);

}  // namespace vgyro::cli
