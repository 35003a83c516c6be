#include "cli/fleet/packed.h"

#include <algorithm>
#include <cmath>
#include <nettle/base64.h>

namespace vgyro::cli {

namespace {

constexpr double kCorrelationSteps = 32767.0;

}  // namespace

std::string base64(std::string_view bytes) {
  std::string text(BASE64_ENCODE_RAW_LENGTH(bytes.size()), '\0');
  base64_encode_raw(text.data(), bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()));
  return text;
}

std::optional<std::string> from_base64(std::string_view text) {
  std::string bytes(BASE64_DECODE_LENGTH(text.size()), '\0');
  std::size_t size = 0;
  base64_decode_ctx context{};
  base64_decode_init(&context);
  if (base64_decode_update(&context, &size, reinterpret_cast<std::uint8_t*>(bytes.data()),
                           text.size(), text.data()) != 1 ||
      base64_decode_final(&context) != 1)
    return std::nullopt;
  bytes.resize(size);
  return bytes;
}

std::string packed_correlations(const std::vector<double>& all) {
  std::string bytes;
  for (const double value : all) {
    const auto steps =
        static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0, 1.0) * kCorrelationSteps));
    bytes += static_cast<char>(steps & 255);
    bytes += static_cast<char>(steps >> 8 & 255);
  }
  return base64(bytes);
}

std::optional<std::vector<double>> correlations_of(std::string_view text, std::size_t count) {
  const auto bytes = from_base64(text);
  if (!bytes || bytes->size() != 2 * count) return std::nullopt;
  std::vector<double> all(count);
  for (std::size_t i = 0; i < count; ++i) {
    const unsigned low = static_cast<unsigned char>((*bytes)[2 * i]);
    const unsigned high = static_cast<unsigned char>((*bytes)[2 * i + 1]);
    all[i] = static_cast<std::int16_t>(low | high << 8U) / kCorrelationSteps;
    if (std::abs(all[i]) > 1.0) return std::nullopt;
  }
  return all;
}

void WholeWriter::put(fleet::Whole value) {
  __extension__ using Bits = unsigned __int128;
  // Zigzag encoding: the sign goes into the lowest bit.
  auto bits = static_cast<Bits>(value) << 1U ^ static_cast<Bits>(value >> 127);
  while (bits > 127U) {
    bytes_ += static_cast<char>(static_cast<unsigned>(bits & 127U) | 128U);
    bits >>= 7U;
  }
  bytes_ += static_cast<char>(bits);
}

WholeReader::WholeReader(std::string_view text) {
  auto bytes = from_base64(text);
  good_ = bytes.has_value();
  if (good_) bytes_ = *std::move(bytes);
}

fleet::Whole WholeReader::get() {
  __extension__ using Bits = unsigned __int128;
  constexpr unsigned kBits = 126;
  Bits bits = 0;
  for (unsigned shift = 0; good_ && shift < kBits; shift += 7U) {
    if (at_ == bytes_.size()) break;
    const auto byte = static_cast<unsigned char>(bytes_[at_++]);
    bits |= static_cast<Bits>(byte & 127U) << shift;
    if (byte < 128U)
      return static_cast<fleet::Whole>(bits >> 1U) ^ -static_cast<fleet::Whole>(bits & 1U);
  }
  good_ = false;
  return 0;
}

}  // namespace vgyro::cli
