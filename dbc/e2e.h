#pragma once

// End-to-end protection of frames: the check value that a sender puts into its frames, for both the
// frames that the gateway sends and those it reads. AUTOSAR profiles 1 and 11 (variants A, B, C), 2
// and 22, and 5, and two older ones that cars use. Sources: AUTOSAR Foundation, "E2E Protocol
// Specification"; SAE J1850. Whether a frame is new follows from its counter, which the receiver
// checks.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace vgyro::dbc {

/// The method of the check value. "Header": the byte of the check value and the next one, whose low
/// nibble is the counter.
enum class E2eKind : std::uint8_t {
  kProfile1A,  ///< CRC-8 (0x1D) over both bytes of the data ID and the data; also profile 11 A
  kProfile1B,  ///< the data ID's low byte for even counters, its high byte for odd ones
  kProfile1C,  ///< its low byte; the high byte's low nibble is in the header; also 11 C
  kProfile2,   ///< CRC-8H2F (0x2F) over the data and one of 16 data IDs, by counter; also 22
  kProfile5,   ///< CRC-16 (0x1021) over the data and the data ID, low byte first
  kCrc8J1850,  ///< CRC-8 (0x1D, init and final xor 0xFF) over the data alone
  kToyota      ///< sum of the CAN identifier's bytes, the length and the data
};
inline constexpr std::size_t kE2eDataIdsMost = 16;

/// "profile_11c" and the like; accepts both names of equal profiles.
std::optional<E2eKind> e2e_kind_from(std::string_view name);
/// All names, for messages.
std::span<const std::string_view> e2e_kind_names();

class E2eProtection {
 public:
  struct Layout {
    E2eKind kind = E2eKind::kProfile1C;
    std::size_t crc_byte = 0;                               ///< for profile 5, the first of two
    std::size_t bytes = 8;                                  ///< number of protected bytes in the
                                                            ///< payload
    std::array<std::uint16_t, kE2eDataIdsMost> data_ids{};  ///< all of them for profile 2,
                                                            ///< otherwise only the first
    std::uint32_t can_id = 0;                               ///< for kToyota

    friend bool operator==(const Layout&, const Layout&) = default;
  };

  /// Precondition: header and check value lie inside the protected bytes.
  explicit E2eProtection(const Layout& layout) : layout_(layout) {}

  /// Bytes that the kind needs in a payload, from the check value on.
  static std::size_t header_bytes(E2eKind kind);

  [[nodiscard]] E2eKind kind() const { return layout_.kind; }
  [[nodiscard]] std::size_t bytes() const { return layout_.bytes; }
  /// The same protection for frames with another identifier.
  [[nodiscard]] E2eProtection for_can_id(std::uint32_t can_id) const;
  /// The check value that this payload should carry. Precondition, here and below: bytes() bytes.
  [[nodiscard]] std::uint16_t value(std::span<const std::uint8_t> payload) const;
  /// True if check value and data ID nibble are right, and the counter has a value that a sender
  /// can send.
  [[nodiscard]] bool check(std::span<const std::uint8_t> payload) const;
  /// Writes the check value and the data ID nibble. The payload must hold the counter already.
  void seal(std::span<std::uint8_t> payload) const;

  friend bool operator==(const E2eProtection&, const E2eProtection&) = default;

 private:
  [[nodiscard]] std::uint8_t header(std::span<const std::uint8_t> payload) const;
  [[nodiscard]] std::uint16_t carried(std::span<const std::uint8_t> payload) const;

  Layout layout_;
};

/// Sender of Profile 11C: byte 0 CRC-8, bits 8…11 counter 0…14, bits 12…15 data ID nibble.
class E2eProfile11C {
 public:
  explicit E2eProfile11C(std::uint16_t data_id);
  /// Fills in the header of an 8-byte payload with the present counter, then increments it.
  void protect(std::span<std::uint8_t, 8> payload);
  /// The CRC that a payload should carry in byte 0.
  [[nodiscard]] std::uint8_t crc(std::span<const std::uint8_t, 8> payload) const;
  /// True if CRC and data ID nibble are right, and the counter has a value that a sender can send.
  [[nodiscard]] bool check(std::span<const std::uint8_t, 8> payload) const;

 private:
  E2eProtection protection_;
  std::uint8_t nibble_;     ///< the data ID's nibble, shifted into place
  std::uint8_t crc_of_id_;  ///< CRC of the bytes that precede the payload
  std::uint8_t counter_ = 0;
};

/// Sender of Profile 5: bytes 0…1 CRC-16, byte 2 counter 0…255. Payloads have any length of at
/// least three bytes; check() refuses shorter ones.
class E2eProfile5 {
 public:
  explicit E2eProfile5(std::uint16_t data_id) : data_id_(data_id) {}
  void protect(std::span<std::uint8_t> payload);
  [[nodiscard]] std::uint16_t crc(std::span<const std::uint8_t> payload) const;
  [[nodiscard]] bool check(std::span<const std::uint8_t> payload) const;

 private:
  [[nodiscard]] E2eProtection of_length(std::size_t bytes) const;

  std::uint16_t data_id_;
  std::uint8_t counter_ = 0;
};

}  // namespace vgyro::dbc
