#include "cli/fleet/packed.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vgyro::cli {

namespace {

constexpr std::string_view kDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr double kCorrelationSteps = 32767.0;

constexpr std::array<std::int8_t, 256> values() {
  std::array<std::int8_t, 256> table{};
  for (std::int8_t& value : table)
    value = -1;
  for (std::size_t i = 0; i < kDigits.size(); ++i)
    table[static_cast<unsigned char>(kDigits[i])] = static_cast<std::int8_t>(i);
  return table;
}
constexpr auto kValues = values();

}  // namespace

std::string base64(std::string_view bytes) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = word << 8U | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k > bytes.size() ? '=' : kDigits[word >> (18U - 6U * k) & 63U];
  }
  return text;
}

std::optional<std::string> from_base64(std::string_view text) {
  if (text.size() % 4 != 0) return std::nullopt;
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3);
  const std::size_t pads = text.ends_with("==") ? 2 : text.ends_with("=") ? 1 : 0;
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_pad = i + pads >= text.size();
    const int value = is_pad ? 0 : kValues[static_cast<unsigned char>(text[i])];
    if (value < 0) return std::nullopt;
    word = word << 6U | static_cast<std::uint32_t>(value);
    if (i % 4 != 3) continue;
    for (const unsigned shift : {16U, 8U, 0U})
      bytes += static_cast<char>(word >> shift & 255U);
    word = 0;
  }
  bytes.erase(bytes.size() - std::min(pads, bytes.size()));
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
  // The sign in the lowest bit.
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
