#include "dbc/e2e.h"

#include <array>
#include <cstddef>

namespace vgyro::dbc {

namespace {

constexpr unsigned kCounterMax11 = 14;
constexpr std::size_t kHeaderBytes5 = 3;

/// What a CRC register of W bits becomes after one byte, for each value of its topmost byte.
template <class W>
constexpr std::array<W, 256> crc_table(unsigned polynomial) {
  constexpr unsigned kBits = 8 * sizeof(W);
  constexpr unsigned kTop = 1U << (kBits - 1);
  std::array<W, 256> table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte << (kBits - 8);
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & kTop) != 0 ? (crc << 1U) ^ polynomial : crc << 1U;
    table[byte] = static_cast<W>(crc);
  }
  return table;
}

constexpr auto kCrc8 = crc_table<std::uint8_t>(0x1D);
constexpr auto kCrc16 = crc_table<std::uint16_t>(0x1021);

std::uint8_t crc8_step(std::uint8_t crc, unsigned byte) {
  return kCrc8[(crc ^ byte) & 0xFFU];
}

std::uint16_t crc16_step(std::uint16_t crc, unsigned byte) {
  return static_cast<std::uint16_t>((crc << 8U) ^ kCrc16[((crc >> 8U) ^ byte) & 0xFFU]);
}

unsigned low_byte(unsigned word) {
  return word & 0xFFU;
}
unsigned high_byte(unsigned word) {
  return word >> 8U;
}

}  // namespace

E2eProfile11C::E2eProfile11C(std::uint16_t data_id) : data_id_(data_id) {}

void E2eProfile11C::protect(std::span<std::uint8_t, 8> payload) {
  const unsigned nibble = high_byte(data_id_) & 0x0FU;
  payload[1] = static_cast<std::uint8_t>(nibble << 4U | counter_);
  payload[0] = crc(payload);
  counter_ = static_cast<std::uint8_t>(counter_ == kCounterMax11 ? 0 : counter_ + 1);
}

std::uint8_t E2eProfile11C::crc(std::span<const std::uint8_t, 8> payload) const {
  // The nibble variant carries the high byte in the payload and counts it as zero here.
  std::uint8_t crc = crc8_step(crc8_step(0, low_byte(data_id_)), 0);
  for (const std::uint8_t byte : payload.subspan<1>())
    crc = crc8_step(crc, byte);
  return crc;
}

bool E2eProfile11C::check(std::span<const std::uint8_t, 8> payload) const {
  const unsigned counter = payload[1] & 0x0FU;
  const unsigned nibble = payload[1] >> 4U;
  return counter <= kCounterMax11 && nibble == (high_byte(data_id_) & 0x0FU) &&
         payload[0] == crc(payload);
}

E2eProfile5::E2eProfile5(std::uint16_t data_id) : data_id_(data_id) {}

void E2eProfile5::protect(std::span<std::uint8_t> payload) {
  payload[2] = counter_++;
  const unsigned value = crc(payload);
  payload[0] = static_cast<std::uint8_t>(low_byte(value));
  payload[1] = static_cast<std::uint8_t>(high_byte(value));
}

std::uint16_t E2eProfile5::crc(std::span<const std::uint8_t> payload) const {
  std::uint16_t crc = 0xFFFF;
  for (const std::uint8_t byte : payload.subspan(2))
    crc = crc16_step(crc, byte);
  return crc16_step(crc16_step(crc, low_byte(data_id_)), high_byte(data_id_));
}

bool E2eProfile5::check(std::span<const std::uint8_t> payload) const {
  if (payload.size() < kHeaderBytes5) return false;
  const unsigned carried = payload[0] | static_cast<unsigned>(payload[1]) << 8U;
  return carried == crc(payload);
}

}  // namespace vgyro::dbc
