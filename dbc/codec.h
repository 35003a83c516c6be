#pragma once

// One signal of one message, with its bit positions resolved once: converts payload bytes to a
// value and back. Never reads a payload shorter than the signal: call fits() first.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>

#include "base/error.h"
#include "dbc/database.h"

namespace vgyro::dbc {

struct Reading {
  /// Bit pattern as a number; for floats the IEEE bits, for 64-bit unsigned values two's
  /// complement.
  std::int64_t raw = 0;
  double value = 0.0;  ///< physical: raw · factor + offset; for floats, of the float value
};

class SignalCodec {
 public:
  /// Error if the signal is longer than 64 bits, of zero length, or not inside `message_bytes`, or
  /// if it is a float of a length other than 32 or 64. `where` names the place in the error.
  static Expected<SignalCodec> make(const Signal& signal, std::size_t message_bytes,
                                    const std::string& where);

  [[nodiscard]] bool fits(std::size_t payload_bytes) const {
    return payload_bytes >= bytes_needed_;
  }
  [[nodiscard]] std::size_t bytes_needed() const { return bytes_needed_; }

  /// Precondition: fits(payload.size()).
  [[nodiscard]] Reading decode(std::span<const std::uint8_t> payload) const;
  /// Reading::raw alone. Precondition: fits(payload.size()).
  [[nodiscard]] std::int64_t decode_raw(std::span<const std::uint8_t> payload) const;

  /// Rounds to the nearest raw value and saturates at the range of raw values. NaN is a caller's
  /// error and becomes the smallest raw value. Precondition: fits(payload.size()).
  void encode(double value, std::span<std::uint8_t> payload) const;
  /// Writes the lowest bits of `raw`. Precondition: fits(payload.size()).
  void encode_raw(std::uint64_t raw, std::span<std::uint8_t> payload) const;

  /// All bits of the signal, at the low end of a word.
  [[nodiscard]] std::uint64_t raw_mask() const { return ~std::uint64_t{0} >> shift_down_; }
  /// The smallest raw value of an integer signal.
  [[nodiscard]] std::int64_t raw_min() const {
    return type_ == ValueType::kSigned ? -static_cast<std::int64_t>(raw_mask() / 2) - 1 : 0;
  }
  /// The physical value of a raw value, exactly as decode() computes it.
  [[nodiscard]] double value_of(std::int64_t raw) const { return number(raw) * factor_ + offset_; }

  /// Physical values of the smallest and the largest raw value; for floats ± the largest finite
  /// number.
  [[nodiscard]] double representable_min() const;
  [[nodiscard]] double representable_max() const;

  friend bool operator==(const SignalCodec&, const SignalCodec&) = default;

 private:
  SignalCodec() = default;

  void place(const Signal& signal);
  [[nodiscard]] bool is_float() const;
  [[nodiscard]] std::uint64_t load_window(const std::uint8_t* payload) const;
  [[nodiscard]] std::uint64_t gather(const std::uint8_t* payload) const;
  [[nodiscard]] double number(std::int64_t raw) const;
  [[nodiscard]] std::uint64_t nearest_raw(double value) const;
  [[nodiscard]] double number_min() const;
  [[nodiscard]] double number_max() const;

  static constexpr std::uint32_t kWindowBytes = 8;
  static constexpr std::uint32_t kNoWindow = 0xFFFFFFFF;  ///< beyond any payload

  double factor_ = 1.0;
  double offset_ = 0.0;
  // The eight bytes that end with the signal's last byte (or the payload's first eight) hold the
  // whole signal, unless it straddles nine.
  std::uint32_t window_byte_ = 0;
  std::uint32_t bytes_needed_ = 0;
  std::uint32_t lowest_byte_ = 0;  ///< holds the least significant bit
  std::uint8_t lowest_bit_ = 0;    ///< in that byte
  std::uint8_t span_bytes_ = 0;
  std::uint8_t shift_up_ = 0;    ///< shifts the signal to the high end of the window
  std::uint8_t shift_down_ = 0;  ///< shifts it from the high end of a word to the low end
  ByteOrder byte_order_ = ByteOrder::kIntel;
  ValueType type_ = ValueType::kUnsigned;
};

/// Does the signal have a range, and can its scale reach that range to within a step? Some real
/// files have other ranges. `codec` belongs to the same signal.
bool has_reachable_range(const Signal& signal, const SignalCodec& codec);

inline std::uint64_t SignalCodec::load_window(const std::uint8_t* payload) const {
  std::uint64_t word = 0;
  std::memcpy(&word, payload + window_byte_, sizeof word);
  const bool host_is_intel = std::endian::native == std::endian::little;
  return (byte_order_ == ByteOrder::kIntel) == host_is_intel ? word : __builtin_bswap64(word);
}

inline double SignalCodec::number(std::int64_t raw) const {
  if (type_ == ValueType::kSigned) return static_cast<double>(raw);
  if (type_ == ValueType::kUnsigned) {
    // Cheaper than the unsigned conversion, and the same below 2^63.
    return raw >= 0 ? static_cast<double>(raw)
                    : static_cast<double>(static_cast<std::uint64_t>(raw));
  }
  if (type_ == ValueType::kFloat32) return std::bit_cast<float>(static_cast<std::uint32_t>(raw));
  return std::bit_cast<double>(raw);
}

inline std::int64_t SignalCodec::decode_raw(std::span<const std::uint8_t> payload) const {
  const std::uint64_t top = payload.size() >= std::size_t{window_byte_} + kWindowBytes
                                ? load_window(payload.data()) << shift_up_
                                : gather(payload.data()) << shift_down_;
  return type_ == ValueType::kSigned ? static_cast<std::int64_t>(top) >> shift_down_
                                     : static_cast<std::int64_t>(top >> shift_down_);
}

inline Reading SignalCodec::decode(std::span<const std::uint8_t> payload) const {
  const std::int64_t raw = decode_raw(payload);
  return {raw, value_of(raw)};
}

}  // namespace vgyro::dbc
