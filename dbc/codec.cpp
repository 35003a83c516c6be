#include "dbc/codec.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/core.h>

#include "dbc/layout.h"

namespace vgyro::dbc {

namespace {

double power_of_two(int exponent) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(1023 + exponent) << 52U);
}

}  // namespace

Expected<SignalCodec> SignalCodec::make(const Signal& signal, std::size_t message_bytes,
                                        const std::string& where) {
  if (signal.length_bits == 0 || signal.length_bits > kSignalBitsMax) {
    return fail(where, fmt::format("signal {} is {} bits long", signal.name, signal.length_bits),
                fmt::format("1 to {} bits", kSignalBitsMax));
  }
  const std::size_t float_bits = signal.type == ValueType::kFloat32 ? 32 : 64;
  SignalCodec codec;
  codec.type_ = signal.type;
  if (codec.is_float() && signal.length_bits != float_bits) {
    return fail(where,
                fmt::format("signal {} is a float of {} bits", signal.name, signal.length_bits),
                fmt::format("{} bits", float_bits));
  }
  const BitPlace bits = bit_place(signal);
  if (bits.last_byte >= message_bytes) {
    return fail(where, fmt::format("signal {} ends in byte {} of a message of {} bytes",
                                   signal.name, bits.last_byte, message_bytes));
  }
  codec.factor_ = signal.factor;
  codec.offset_ = signal.offset;
  codec.byte_order_ = signal.byte_order;
  codec.place(signal);
  return codec;
}

void SignalCodec::place(const Signal& signal) {
  const BitPlace bits = bit_place(signal);
  const bool intel = byte_order_ == ByteOrder::kIntel;
  bytes_needed_ = static_cast<std::uint32_t>(bits.last_byte + 1);
  span_bytes_ = static_cast<std::uint8_t>(bits.last_byte - bits.first_byte + 1);
  lowest_byte_ = static_cast<std::uint32_t>(intel ? bits.first_byte : bits.last_byte);
  lowest_bit_ = bits.lowest_bit;
  shift_down_ = static_cast<std::uint8_t>(64 - signal.length_bits);

  if (span_bytes_ > kWindowBytes) {
    window_byte_ = kNoWindow;
    return;
  }
  window_byte_ = bytes_needed_ < kWindowBytes ? 0 : bytes_needed_ - kWindowBytes;
  const std::size_t bytes_below =
      intel ? lowest_byte_ - window_byte_ : window_byte_ + 7 - lowest_byte_;
  shift_up_ = static_cast<std::uint8_t>(shift_down_ - 8 * bytes_below - lowest_bit_);
}

bool SignalCodec::is_float() const {
  return type_ == ValueType::kFloat32 || type_ == ValueType::kFloat64;
}

std::uint64_t SignalCodec::gather(const std::uint8_t* payload) const {
  const bool intel = byte_order_ == ByteOrder::kIntel;
  std::uint64_t bits = payload[lowest_byte_] >> lowest_bit_;
  for (std::size_t i = 1; i < span_bytes_; ++i) {
    const std::uint64_t byte = payload[intel ? lowest_byte_ + i : lowest_byte_ - i];
    bits |= byte << (8 * i - lowest_bit_);
  }
  return bits;
}

void SignalCodec::encode_raw(std::uint64_t raw, std::span<std::uint8_t> payload) const {
  const bool intel = byte_order_ == ByteOrder::kIntel;
  const std::uint64_t mask = ~std::uint64_t{0} >> shift_down_;
  const std::uint64_t bits = raw & mask;
  const auto put = [&](std::size_t index, std::uint64_t byte_mask, std::uint64_t byte) {
    const std::uint64_t kept = payload[index] & ~byte_mask;
    payload[index] = static_cast<std::uint8_t>((kept | byte) & 0xFFU);
  };
  put(lowest_byte_, mask << lowest_bit_, bits << lowest_bit_);
  for (std::size_t i = 1; i < span_bytes_; ++i) {
    const std::size_t shift = 8 * i - lowest_bit_;
    put(intel ? lowest_byte_ + i : lowest_byte_ - i, mask >> shift, bits >> shift);
  }
}

void SignalCodec::encode(double value, std::span<std::uint8_t> payload) const {
  encode_raw(nearest_raw((value - offset_) / factor_), payload);
}

std::uint64_t SignalCodec::nearest_raw(double value) const {
  const double clamped = std::clamp(value, number_min(), number_max());
  if (type_ == ValueType::kFloat64) return std::bit_cast<std::uint64_t>(clamped);
  if (type_ == ValueType::kFloat32)
    return std::bit_cast<std::uint32_t>(static_cast<float>(clamped));

  // NaN fails the comparison, so it becomes the minimum. The limit above is a power of two, because
  // the largest 64-bit raw value is not a double.
  const bool is_signed = type_ == ValueType::kSigned;
  const int value_bits = 64 - shift_down_ - (is_signed ? 1 : 0);
  const std::uint64_t raw_max = ~std::uint64_t{0} >> shift_down_ >> (is_signed ? 1U : 0U);
  const double rounded = std::round(value);
  if (!(rounded > number_min())) return is_signed ? ~raw_max : 0;
  if (rounded >= power_of_two(value_bits)) return raw_max;
  return is_signed ? static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded))
                   : static_cast<std::uint64_t>(rounded);
}

double SignalCodec::number_min() const {
  if (type_ == ValueType::kFloat32) return std::numeric_limits<float>::lowest();
  if (type_ == ValueType::kFloat64) return std::numeric_limits<double>::lowest();
  return type_ == ValueType::kSigned ? -power_of_two(63 - shift_down_) : 0.0;
}

double SignalCodec::number_max() const {
  if (type_ == ValueType::kFloat32) return std::numeric_limits<float>::max();
  if (type_ == ValueType::kFloat64) return std::numeric_limits<double>::max();
  return power_of_two(64 - shift_down_ - (type_ == ValueType::kSigned ? 1 : 0)) - 1.0;
}

double SignalCodec::representable_min() const {
  return (factor_ < 0.0 ? number_max() : number_min()) * factor_ + offset_;
}

double SignalCodec::representable_max() const {
  return (factor_ < 0.0 ? number_min() : number_max()) * factor_ + offset_;
}

bool has_reachable_range(const Signal& signal, const SignalCodec& codec) {
  const double step = std::abs(signal.factor);
  return signal.minimum < signal.maximum && signal.minimum >= codec.representable_min() - step &&
         signal.maximum <= codec.representable_max() + step;
}

}  // namespace vgyro::dbc
