#pragma once

// AUTOSAR end-to-end protection of output frames: Profile 11 variant C (classic CAN) and
// Profile 5 (CAN FD). Source: AUTOSAR E2E Protocol Specification, PRS_E2E profiles 11 and 5.
// The state is the sender's counter; check() looks at one frame and leaves the watch for repeated
// or lost frames to the receiver.

#include <cstdint>
#include <span>

namespace vgyro::dbc {

/// Profile 11C header: byte 0 CRC-8 (poly 0x1D, init 0, no xor), bits 8…11 counter 0…14,
/// bits 12…15 low nibble of the data ID's high byte.
class E2eProfile11C {
 public:
  explicit E2eProfile11C(std::uint16_t data_id);
  /// Fills in the header of an 8-byte payload with the present counter, then counts on.
  void protect(std::span<std::uint8_t, 8> payload);
  /// The CRC that a payload should carry in byte 0.
  [[nodiscard]] std::uint8_t crc(std::span<const std::uint8_t, 8> payload) const;
  /// CRC and data ID nibble are right and the counter is one that a sender can have.
  [[nodiscard]] bool check(std::span<const std::uint8_t, 8> payload) const;

 private:
  std::uint16_t data_id_;
  std::uint8_t counter_ = 0;
};

/// Profile 5 header: bytes 0…1 CRC-16 (poly 0x1021, init 0xFFFF; low byte first), byte 2 counter
/// 0…255. Payloads have at least these three bytes; check() refuses shorter ones.
class E2eProfile5 {
 public:
  explicit E2eProfile5(std::uint16_t data_id);
  void protect(std::span<std::uint8_t> payload);
  [[nodiscard]] std::uint16_t crc(std::span<const std::uint8_t> payload) const;
  [[nodiscard]] bool check(std::span<const std::uint8_t> payload) const;

 private:
  std::uint16_t data_id_;
  std::uint8_t counter_ = 0;
};

}  // namespace vgyro::dbc
