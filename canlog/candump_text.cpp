#include <algorithm>
#include <cstring>

#include "canlog/candump.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <fmt/format.h>

namespace vgyro::canlog {

namespace {

constexpr std::array<char, 512> make_hex_pairs() {
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::array<char, 512> table{};
  for (std::size_t i = 0; i < 256; ++i) {
    table[2 * i] = kDigits[i >> 4U];
    table[2 * i + 1] = kDigits[i & 15U];
  }
  return table;
}
constexpr auto kHexPairs = make_hex_pairs();

constexpr std::array<char, 200> make_decimal_pairs() {
  std::array<char, 200> table{};
  for (std::size_t i = 0; i < 100; ++i) {
    table[2 * i] = static_cast<char>('0' + i / 10);
    table[2 * i + 1] = static_cast<char>('0' + i % 10);
  }
  return table;
}
constexpr auto kDecimalPairs = make_decimal_pairs();

// Writes `value`, which has at most `digits` decimal digits.
template <unsigned digits>
char* put_decimal(char* out, std::uint32_t value) {
  for (unsigned i = digits; i >= 2; i -= 2) {
    std::memcpy(out + i - 2, &kDecimalPairs[2 * std::size_t{value % 100}], 2);
    value /= 100;
  }
  if constexpr (digits % 2 != 0) out[0] = static_cast<char>('0' + value % 10);
  return out + digits;
}

char* put_standard_id(char* out, std::uint32_t id) {
  *out++ = kHexPairs[2 * std::size_t{id >> 8U & 15U} + 1];
  std::memcpy(out, &kHexPairs[2 * std::size_t{id & 0xFFU}], 2);
  return out + 2;
}

char* put_hex(char* out, std::uint32_t value, unsigned digits) {
  for (unsigned i = digits; i-- > 0; value >>= 4U)
    out[i] = kHexPairs[2 * (value & 15U) + 1];
  return out + digits;
}

#if defined(__SSE2__)
char* put_bytes8(char* out, const std::uint8_t* data) {
  const __m128i bytes = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(data));
  const __m128i low_nibble = _mm_set1_epi8(0x0F);
  const __m128i nibbles = _mm_unpacklo_epi8(_mm_and_si128(_mm_srli_epi16(bytes, 4), low_nibble),
                                            _mm_and_si128(bytes, low_nibble));
  const __m128i is_letter = _mm_cmpgt_epi8(nibbles, _mm_set1_epi8(9));
  const __m128i to_letter = _mm_and_si128(is_letter, _mm_set1_epi8('A' - '0' - 10));
  const __m128i text = _mm_add_epi8(_mm_add_epi8(nibbles, _mm_set1_epi8('0')), to_letter);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out), text);
  return out + 16;
}
#endif

char* put_bytes(char* out, const std::uint8_t* data, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(out, &kHexPairs[2 * static_cast<std::size_t>(data[i])], 2);
    out += 2;
  }
  return out;
}

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::size_t kSecondsTextBytes = 12;  // "(SSSSSSSSSS."

// `second_ns` is the start of a second, not negative.
void put_seconds(char* out, std::int64_t second_ns) {
  const auto seconds = static_cast<std::uint64_t>(second_ns / kSecond_ns);
  const auto high_digits = static_cast<std::uint32_t>(seconds / 100'000'000);
  *out++ = '(';
  out = put_decimal<2>(out, high_digits);
  out = put_decimal<8>(out, static_cast<std::uint32_t>(seconds - high_digits * 100'000'000ULL));
  *out = '.';
}

char* put_fraction(char* out, std::uint32_t ns, std::string_view interface, unsigned digits) {
  out = digits == 9 ? put_decimal<9>(out, ns) : put_decimal<6>(out, ns / 1000);
  *out++ = ')';
  *out++ = ' ';
  const std::size_t length = std::min(interface.size(), kInterfaceNameMax);
  for (std::size_t i = 0; i < length; ++i)
    out[i] = interface[i];
  out += length;
  *out++ = ' ';
  return out;
}

char* put_prefix(char* out, TimePoint stamp, std::string_view interface, unsigned fraction_digits) {
  const std::int64_t ns = std::max<std::int64_t>(to_ns(stamp), 0);
  put_seconds(out, ns - ns % kSecond_ns);
  return put_fraction(out + kSecondsTextBytes, static_cast<std::uint32_t>(ns % kSecond_ns),
                      interface, fraction_digits);
}

char* put_direction(char* out, Direction direction) {
  if (direction != Direction::kUnknown) {
    *out++ = ' ';
    *out++ = direction == Direction::kReceived ? 'R' : 'T';
  }
  *out++ = '\n';
  return out;
}

char* put_frame(char* out, const can::Frame& frame) {
  constexpr std::uint32_t kErrorBit = 0x20000000U;
  if (frame.has(can::kError)) {
    out = put_hex(out, frame.id | kErrorBit, 8);
  } else if (frame.has(can::kExtended)) {
    out = put_hex(out, frame.id, 8);
  } else {
    out = put_standard_id(out, frame.id);
  }
  *out++ = '#';
  if (frame.has(can::kFd)) {
    *out++ = '#';
    const unsigned nibble = (frame.has(can::kBitRateSwitch) ? 1U : 0U) |
                            (frame.has(can::kErrorStateIndicator) ? 2U : 0U);
    out = put_hex(out, nibble, 1);
    return put_bytes(out, frame.data.data(), std::min<std::size_t>(frame.length, can::kFdBytesMax));
  }
  const std::size_t length = std::min<std::size_t>(frame.length, can::kClassicBytesMax);
  if (length == can::kClassicBytesMax && (frame.flags & can::kRemote) == 0 && frame.raw_dlc == 0) {
#if defined(__SSE2__)
    return put_bytes8(out, frame.data.data());
#else
    return put_bytes(out, frame.data.data(), can::kClassicBytesMax);
#endif
  }
  if (frame.has(can::kRemote)) {
    *out++ = 'R';
    if (length > 0) *out++ = static_cast<char>('0' + length);
  } else {
    out = put_bytes(out, frame.data.data(), length);
  }
  if (frame.raw_dlc > 8 && length == can::kClassicBytesMax) {
    *out++ = '_';
    out = put_hex(out, frame.raw_dlc, 1);
  }
  return out;
}

}  // namespace

std::size_t format_line(char* out, TimePoint stamp, std::string_view interface,
                        const can::Frame& frame, unsigned fraction_digits, Direction direction) {
  char* at = put_prefix(out, stamp, interface, fraction_digits);
  at = put_frame(at, frame);
  at = put_direction(at, direction);
  return static_cast<std::size_t>(at - out);
}

LineFormatter::LineFormatter(std::string_view interface) {
  char* end = middle_.data();
  *end++ = ')';
  *end++ = ' ';
  end = std::copy_n(interface.data(), std::min(interface.size(), kInterfaceNameMax), end);
  *end++ = ' ';
  middle_bytes_ = static_cast<std::size_t>(end - middle_.data());
}

std::size_t LineFormatter::format(char* out, TimePoint stamp, const can::Frame& frame,
                                  unsigned fraction_digits) {
  const std::int64_t ns = std::max<std::int64_t>(to_ns(stamp), 0);
  if (second_ns_ < 0 || ns < second_ns_ || ns - second_ns_ >= kSecond_ns) {
    second_ns_ = ns - ns % kSecond_ns;
    put_seconds(prefix_.data(), second_ns_);
  }
  // Copies a fixed size, which may exceed the text: the next fields overwrite the rest.
  std::memcpy(out, prefix_.data(), prefix_.size());
  const auto fraction_ns = static_cast<std::uint32_t>(ns - second_ns_);
  char* at = out + kSecondsTextBytes;
  at = fraction_digits == 9 ? put_decimal<9>(at, fraction_ns)
                            : put_decimal<6>(at, fraction_ns / 1000);
  std::memcpy(at, middle_.data(), middle_.size());
  at = put_frame(at + middle_bytes_, frame);
  *at++ = '\n';
  return static_cast<std::size_t>(at - out);
}

std::string format_xl_line(TimePoint stamp, std::string_view interface, const XlFrame& frame,
                           unsigned fraction_digits, Direction direction) {
  std::string text(kLineBytesMax + 2 * kXlBytesMax, '\0');
  char* at = put_prefix(text.data(), stamp, interface, fraction_digits);
  at = fmt::format_to(at, "{:02X}{:03X}#{:02X}:{:02X}:{:08X}#", frame.vcid, frame.priority,
                      frame.flags, frame.sdt, frame.acceptance);
  at = put_bytes(at, frame.data.data(), std::min<std::size_t>(frame.length, kXlBytesMax));
  at = put_direction(at, direction);
  text.resize(static_cast<std::size_t>(at - text.data()));
  return text;
}

}  // namespace vgyro::canlog
