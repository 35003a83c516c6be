#include "cli/gap/sha256.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <vector>

#include <fmt/format.h>

namespace vgyro::cli {

namespace {

constexpr std::size_t kPieceBytes = 1U << 16;  // of a file that are in memory at a time

}  // namespace

Sha256::Sha256() {
  sha256_init(&context_);
}

void Sha256::add(std::string_view bytes) {
  sha256_update(&context_, bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()));
}

std::string Sha256::text() const {
  sha256_ctx whole = context_;
  std::array<std::uint8_t, SHA256_DIGEST_SIZE> digest{};
  sha256_digest(&whole, digest.size(), digest.data());
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

Expected<std::string> sha256_of_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return fail(path, "is no regular file");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(path, "cannot be opened");
  Sha256 sum;
  std::vector<char> piece(kPieceBytes);
  while (file) {
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    sum.add({piece.data(), static_cast<std::size_t>(file.gcount())});
  }
  if (file.bad()) return fail(path, "cannot be read to its end");
  return sum.text();
}

}  // namespace vgyro::cli
