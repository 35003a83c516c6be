#include "dbc/codec.h"

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

using Bytes = std::vector<std::uint8_t>;

Signal signal_of(std::uint16_t start, std::uint16_t length, ByteOrder order, ValueType type,
                 double factor = 1.0, double offset = 0.0) {
  Signal signal;
  signal.name = "S";
  signal.start_bit = start;
  signal.length_bits = length;
  signal.byte_order = order;
  signal.type = type;
  signal.factor = factor;
  signal.offset = offset;
  return signal;
}

SignalCodec codec_of(const Signal& signal, std::size_t message_bytes) {
  return SignalCodec::make(signal, message_bytes, "test").value();
}

std::size_t bit_position(const Signal& signal, std::size_t weight) {
  if (signal.byte_order == ByteOrder::kIntel) return signal.start_bit + weight;
  const std::size_t place =
      signal.start_bit / 8U * 8U + 7U - signal.start_bit % 8U + signal.length_bits - 1U - weight;
  return place / 8 * 8 + 7 - place % 8;
}

/// Reads bit by bit, following the definition of a DBC signal.
std::uint64_t bits_of(const Signal& signal, const Bytes& payload) {
  std::uint64_t bits = 0;
  for (std::size_t weight = 0; weight < signal.length_bits; ++weight) {
    const std::size_t bit = bit_position(signal, weight);
    const std::uint64_t byte = payload[bit / 8];
    bits |= (byte >> (bit % 8) & 1U) << weight;
  }
  return bits;
}

std::int64_t expected_raw(const Signal& signal, const Bytes& payload) {
  const std::uint64_t bits = bits_of(signal, payload);
  const bool negative = (bits >> (signal.length_bits - 1U) & 1U) != 0;
  if (signal.type != ValueType::kSigned || !negative || signal.length_bits == 64) {
    return static_cast<std::int64_t>(bits);
  }
  return static_cast<std::int64_t>(bits - (std::uint64_t{1} << signal.length_bits));
}

Bytes random_bytes(std::mt19937& rng, std::size_t size) {
  Bytes bytes(size);
  for (std::uint8_t& byte : bytes)
    byte = static_cast<std::uint8_t>(rng());
  return bytes;
}

// A signal of every position, length and byte order that a payload of this size can hold reads as
// its definition says, from a payload of exactly the bytes it needs and from longer ones.
void check_all_positions(std::size_t size) {
  std::mt19937 rng(7);
  const Bytes payload = random_bytes(rng, size);
  for (std::uint16_t start = 0; start < size * 8; ++start) {
    for (std::uint16_t length = 1; length <= 64; ++length) {
      for (const ByteOrder order : {ByteOrder::kIntel, ByteOrder::kMotorola}) {
        for (const ValueType type : {ValueType::kUnsigned, ValueType::kSigned}) {
          const Signal signal = signal_of(start, length, order, type);
          const auto codec = SignalCodec::make(signal, size, "test");
          if (!codec) continue;
          const std::int64_t raw = expected_raw(signal, payload);
          ASSERT_EQ(codec->decode(payload).raw, raw) << start << '|' << length;
          const Bytes shortest(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(
                                                                      codec->bytes_needed()));
          ASSERT_EQ(codec->decode(shortest).raw, raw) << start << '|' << length;
        }
      }
    }
  }
}

TEST(SignalCodec, ReadsEveryPositionOfAClassicPayload) {
  check_all_positions(8);
}
TEST(SignalCodec, ReadsEveryPositionOfAnFdPayload) {
  check_all_positions(64);
}
TEST(SignalCodec, ReadsEveryPositionOfAShortPayload) {
  check_all_positions(3);
}

// Raw bits that are written read back the same, and no other bit of the payload changes.
TEST(SignalCodec, WritesOnlyItsOwnBits) {
  std::mt19937 rng(11);
  for (int round = 0; round < 20000; ++round) {
    const std::size_t size = 1 + rng() % 64;
    const auto start = static_cast<std::uint16_t>(rng() % (size * 8));
    const auto length = static_cast<std::uint16_t>(1 + rng() % 64);
    const ByteOrder order = rng() % 2 == 0 ? ByteOrder::kIntel : ByteOrder::kMotorola;
    const Signal signal = signal_of(start, length, order, ValueType::kUnsigned);
    const auto codec = SignalCodec::make(signal, size, "test");
    if (!codec) continue;
    const Bytes before = random_bytes(rng, size);
    Bytes after = before;
    const std::uint64_t raw = static_cast<std::uint64_t>(rng()) << 32U | rng();
    codec->encode_raw(raw, after);
    ASSERT_EQ(bits_of(signal, after),
              length == 64 ? raw : raw & ((std::uint64_t{1} << length) - 1));
    codec->encode_raw(bits_of(signal, before), after);
    ASSERT_EQ(after, before);
  }
}

// The physical value is raw · factor + offset, to the last bit.
TEST(SignalCodec, ScalesTheRawValue) {
  const Bytes payload = {0x00, 0x7D, 0xFF, 0xFF};
  const auto j1939 =
      codec_of(signal_of(0, 16, ByteOrder::kIntel, ValueType::kUnsigned, 1.0 / 128, -250), 4);
  EXPECT_EQ(j1939.decode(payload).value, 0.0);
  const auto minus_one =
      codec_of(signal_of(16, 16, ByteOrder::kIntel, ValueType::kSigned, -0.5, 3), 4);
  EXPECT_EQ(minus_one.decode(payload).raw, -1);
  EXPECT_EQ(minus_one.decode(payload).value, 3.5);
}

// A 64-bit unsigned value above the signed range is not read as negative.
TEST(SignalCodec, Reads64BitUnsignedAbove2To63) {
  const Bytes payload(8, 0xFF);
  const auto codec = codec_of(signal_of(0, 64, ByteOrder::kIntel, ValueType::kUnsigned), 8);
  EXPECT_EQ(codec.decode(payload).value, 0x1p64);
  EXPECT_EQ(codec.decode(payload).raw, -1);
}

Bytes with_float(float value, bool motorola) {
  auto bits = std::bit_cast<std::uint32_t>(value);
  if (motorola) bits = __builtin_bswap32(bits);
  const auto bytes = std::bit_cast<std::array<std::uint8_t, 4>>(bits);
  return {bytes.begin(), bytes.end()};
}

// Floats are read in both byte orders; NaN and infinity stay what they are.
TEST(SignalCodec, ReadsFloatsWithNanAndInfinity) {
  const auto intel = codec_of(signal_of(0, 32, ByteOrder::kIntel, ValueType::kFloat32), 4);
  const auto motorola = codec_of(signal_of(7, 32, ByteOrder::kMotorola, ValueType::kFloat32, 2), 4);
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(intel.decode(with_float(-1.25F, false)).value, -1.25);
  EXPECT_EQ(motorola.decode(with_float(-1.25F, true)).value, -2.5);
  EXPECT_EQ(motorola.decode(with_float(-1.25F, true)).raw, 0xBFA00000);
  EXPECT_EQ(intel.decode(with_float(infinity, false)).value, infinity);
  EXPECT_TRUE(std::isnan(intel.decode(with_float(std::nanf(""), false)).value));
  const auto wide = codec_of(signal_of(3, 64, ByteOrder::kIntel, ValueType::kFloat64), 9);
  Bytes payload(9);
  wide.encode(-1e300, payload);
  EXPECT_EQ(wide.decode(payload).value, -1e300);
}

// Encoding rounds to the nearest raw value, halves away from zero.
TEST(SignalCodec, EncodesTheNearestRawValue) {
  const auto codec = codec_of(signal_of(0, 16, ByteOrder::kIntel, ValueType::kSigned, 0.5, 10), 2);
  Bytes payload(2);
  const auto raw_of = [&](double value) {
    codec.encode(value, payload);
    return codec.decode(payload).raw;
  };
  EXPECT_EQ(raw_of(10.0), 0);
  EXPECT_EQ(raw_of(10.24), 0);
  EXPECT_EQ(raw_of(10.25), 1);
  EXPECT_EQ(raw_of(9.75), -1);
  EXPECT_EQ(raw_of(9.76), 0);
}

struct Limits {
  std::uint16_t length;
  ValueType type;
  std::int64_t lowest;
  std::int64_t highest;
};

// Values beyond the range become its end, for every width including 1 and 64 bits.
TEST(SignalCodec, SaturatesAtTheRangeOfRawValues) {
  const std::int64_t max64 = std::numeric_limits<std::int64_t>::max();
  const std::array<Limits, 6> cases = {{{1, ValueType::kUnsigned, 0, 1},
                                        {1, ValueType::kSigned, -1, 0},
                                        {24, ValueType::kSigned, -8388608, 8388607},
                                        {12, ValueType::kUnsigned, 0, 4095},
                                        {64, ValueType::kSigned, -max64 - 1, max64},
                                        {64, ValueType::kUnsigned, 0, -1}}};
  for (const Limits& c : cases) {
    const auto codec = codec_of(signal_of(0, c.length, ByteOrder::kIntel, c.type), 8);
    Bytes payload(8);
    for (const double huge : {1e30, std::numeric_limits<double>::infinity()}) {
      codec.encode(huge, payload);
      EXPECT_EQ(codec.decode(payload).raw, c.highest) << c.length;
      codec.encode(-huge, payload);
      EXPECT_EQ(codec.decode(payload).raw, c.lowest) << c.length;
    }
    codec.encode(std::nan(""), payload);
    EXPECT_EQ(codec.decode(payload).raw, c.lowest) << c.length;
  }
}

// For a finite value a float32 signal never becomes infinite.
TEST(SignalCodec, SaturatesFloatsAtTheLargestFiniteValue) {
  const auto codec = codec_of(signal_of(0, 32, ByteOrder::kIntel, ValueType::kFloat32), 4);
  Bytes payload(4);
  codec.encode(1e300, payload);
  EXPECT_EQ(codec.decode(payload).value, std::numeric_limits<float>::max());
  codec.encode(-1e300, payload);
  EXPECT_EQ(codec.decode(payload).value, std::numeric_limits<float>::lowest());
}

// The representable range is in physical units, with the smaller value first for a negative scale,
// too.
TEST(SignalCodec, TellsItsRepresentableRange) {
  const auto codec = codec_of(signal_of(0, 8, ByteOrder::kIntel, ValueType::kSigned, -0.5, 1), 1);
  EXPECT_EQ(codec.representable_min(), -62.5);
  EXPECT_EQ(codec.representable_max(), 65.0);
}

// Unreadable signals are refused when the codec is made, with place and cause.
TEST(SignalCodec, RefusesSignalsThatCannotBeRead) {
  const auto refused = [](const Signal& signal, std::size_t bytes) {
    const auto codec = SignalCodec::make(signal, bytes, "a.dbc:3");
    return !codec && codec.error().where == "a.dbc:3" && !codec.error().what.empty();
  };
  const auto kIntel = ByteOrder::kIntel;
  EXPECT_TRUE(refused(signal_of(0, 0, kIntel, ValueType::kUnsigned), 8));
  EXPECT_TRUE(refused(signal_of(0, 65, kIntel, ValueType::kUnsigned), 16));
  EXPECT_TRUE(refused(signal_of(57, 8, kIntel, ValueType::kUnsigned), 8));
  EXPECT_TRUE(refused(signal_of(56, 9, ByteOrder::kMotorola, ValueType::kUnsigned), 8));
  EXPECT_TRUE(refused(signal_of(0, 31, kIntel, ValueType::kFloat32), 8));
  EXPECT_TRUE(refused(signal_of(0, 64, kIntel, ValueType::kFloat32), 8));
  EXPECT_TRUE(refused(signal_of(0, 32, kIntel, ValueType::kFloat64), 8));
  EXPECT_TRUE(refused(signal_of(65535, 64, kIntel, ValueType::kUnsigned), 64));
  EXPECT_FALSE(refused(signal_of(56, 8, kIntel, ValueType::kUnsigned), 8));
}

// fits() is exact to the byte for a payload that ends before the signal does.
TEST(SignalCodec, TellsWhetherATruncatedPayloadHoldsIt) {
  const auto codec = codec_of(signal_of(12, 10, ByteOrder::kIntel, ValueType::kUnsigned), 8);
  EXPECT_EQ(codec.bytes_needed(), 3U);
  EXPECT_TRUE(codec.fits(3));
  EXPECT_FALSE(codec.fits(2));
  EXPECT_FALSE(codec.fits(0));
}

}  // namespace
}  // namespace vgyro::dbc
