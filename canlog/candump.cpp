#include "canlog/candump.h"

#include <algorithm>
#include <bit>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

// Beyond this a stamp in nanoseconds would not fit 64 bits.
constexpr std::int64_t kSecondsMax = 9'000'000'000;
// parse_usual() reads at most this many bytes from the start of a line.
constexpr std::ptrdiff_t kLookaheadBytes = 96;

constexpr std::array<std::int8_t, 256> make_hex_values() {
  std::array<std::int8_t, 256> table{};
  for (auto& entry : table)
    entry = -1;
  for (std::size_t i = 0; i < 10; ++i)
    table[std::size_t{'0'} + i] = static_cast<std::int8_t>(i);
  for (std::size_t i = 0; i < 6; ++i) {
    table[std::size_t{'a'} + i] = static_cast<std::int8_t>(10 + i);
    table[std::size_t{'A'} + i] = static_cast<std::int8_t>(10 + i);
  }
  return table;
}
constexpr auto kHexValues = make_hex_values();

int hex_value(char c) {
  return kHexValues[static_cast<unsigned char>(c)];
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

std::uint64_t load_word(const char* p) {
  std::uint64_t word = 0;
  std::memcpy(&word, p, sizeof word);
  return word;
}

std::uint32_t load_half_word(const char* p) {
  std::uint32_t word = 0;
  std::memcpy(&word, p, sizeof word);
  return word;
}

// Eight ASCII digits, the first in the lowest byte.
bool all_digits(std::uint64_t word) {
  return (((word + 0x4646464646464646U) | (word - 0x3030303030303030U)) & 0x8080808080808080U) == 0;
}
std::uint64_t digits_value(std::uint64_t word) {
  word = (word & 0x0F0F0F0F0F0F0F0FU) * 2561U >> 8U;
  word = (word & 0x00FF00FF00FF00FFU) * 6553601U >> 16U;
  return (word & 0x0000FFFF0000FFFFU) * 42949672960001U >> 32U;
}

#if defined(__SSE2__)
// Packs the hex digits at `p` (16 characters are readable) into bytes at `out`; returns how many
// leading characters are hex digits.
[[gnu::always_inline]] inline unsigned unpack_hex16(const char* p, std::uint8_t* out) {
  const __m128i text = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
  // Shift the wanted range to the bottom of the signed numbers, so that one comparison suffices.
  const auto first_of = [](__m128i characters, char first, char count) {
    const __m128i moved = _mm_add_epi8(characters, _mm_set1_epi8(static_cast<char>(-128 - first)));
    return _mm_cmplt_epi8(moved, _mm_set1_epi8(static_cast<char>(-128 + count)));
  };
  const __m128i decimal = first_of(text, '0', 10);
  const __m128i letter = first_of(_mm_or_si128(text, _mm_set1_epi8(0x20)), 'a', 6);
  // The low nibble of 'A' and of 'a' is 1.
  const __m128i nibble = _mm_add_epi8(_mm_and_si128(text, _mm_set1_epi8(0x0F)),
                                      _mm_and_si128(letter, _mm_set1_epi8(9)));
  const __m128i pairs = _mm_and_si128(
      _mm_or_si128(_mm_slli_epi16(nibble, 4), _mm_srli_epi16(nibble, 8)), _mm_set1_epi16(0xFF));
  _mm_storel_epi64(reinterpret_cast<__m128i*>(out), _mm_packus_epi16(pairs, pairs));
  const auto valid = static_cast<unsigned>(_mm_movemask_epi8(_mm_or_si128(decimal, letter)));
  return static_cast<unsigned>(std::countr_one(valid));
}
#else
unsigned unpack_hex16(const char* p, std::uint8_t* out) {
  unsigned count = 0;
  while (count < 16 && hex_value(p[count]) >= 0)
    ++count;
  for (unsigned i = 0; i + 1 < count; i += 2) {
    out[i / 2] = static_cast<std::uint8_t>(hex_value(p[i]) << 4 | hex_value(p[i + 1]));
  }
  return count;
}
#endif

// A cursor over one line; every step returns whether it was possible.
class Cursor {
 public:
  explicit Cursor(std::string_view text) : text_(text) {}
  [[nodiscard]] bool at_end() const { return text_.empty(); }
  [[nodiscard]] char peek() const { return text_.empty() ? '\0' : text_.front(); }
  [[nodiscard]] std::string_view rest() const { return text_; }
  bool skip(char c) {
    if (peek() != c || text_.empty()) return false;
    text_.remove_prefix(1);
    return true;
  }
  void skip_blanks() {
    while (peek() == ' ' || peek() == '\t')
      text_.remove_prefix(1);
  }
  std::string_view word() {
    const std::size_t end = std::min(text_.find_first_of(" \t"), text_.size());
    const std::string_view found = text_.substr(0, end);
    text_.remove_prefix(end);
    return found;
  }
  std::string_view digits() { return take_while(is_digit); }
  std::string_view hex() {
    return take_while([](char c) { return hex_value(c) >= 0; });
  }

 private:
  template <class Predicate>
  std::string_view take_while(Predicate accept) {
    std::size_t end = 0;
    while (end < text_.size() && accept(text_[end]))
      ++end;
    const std::string_view found = text_.substr(0, end);
    text_.remove_prefix(end);
    return found;
  }
  std::string_view text_;
};

std::uint32_t hex_number(std::string_view digits) {
  std::uint32_t value = 0;
  for (const char c : digits)
    value = value << 4U | static_cast<std::uint32_t>(hex_value(c));
  return value;
}

// asc2log of can-utils up to 2020.11 carries microseconds above a million into the seconds, but
// prints exactly a million unchanged. No writer of more than six digits writes seven.
constexpr std::string_view kMissedCarry = "1000000";

const char* parse_stamp(Cursor& at, LogRecord& record) {
  const std::string_view whole = at.digits();
  if (whole.empty() || whole.size() > 10) return "stamp: the seconds are not a number";
  std::int64_t seconds = 0;
  for (const char c : whole)
    seconds = seconds * 10 + (c - '0');
  if (seconds > kSecondsMax) return "stamp: beyond the year 2255";
  if (!at.skip('.')) return "stamp: no decimal point";
  std::string_view fraction = at.digits();
  if (fraction == kMissedCarry) {
    ++seconds;
    fraction = "000000";
  }
  if (fraction.empty() || fraction.size() > 9) return "stamp: the fraction needs 1 to 9 digits";
  std::int64_t ns = 0;
  for (std::size_t i = 0; i < 9; ++i)
    ns = ns * 10 + (i < fraction.size() ? fraction[i] - '0' : 0);
  if (!at.skip(')')) return "stamp: no closing parenthesis";
  record.stamp = time_from_ns(seconds * 1'000'000'000 + ns);
  record.fraction_digits = fraction.size() > 6 ? 9 : 6;
  return nullptr;
}

const char* set_id(std::string_view digits, can::Frame& frame) {
  const std::uint32_t value = hex_number(digits);
  if (digits.size() == 3) {
    if (value > can::kStandardIdMax) return "identifier: above 7FF needs 8 digits";
    frame.id = value;
    return nullptr;
  }
  if (digits.size() != 8) return "identifier: neither 3 nor 8 hex digits";
  constexpr std::uint32_t kErrorBit = 0x20000000U;
  if ((value & ~(kErrorBit | can::kExtendedIdMax)) != 0) return "identifier: above 1FFFFFFF";
  frame.id = value & can::kExtendedIdMax;
  frame.flags = (value & kErrorBit) != 0 ? can::kError : can::kExtended;
  return nullptr;
}

// Bytes as hex pairs, optionally with dots between them.
const char* parse_bytes(Cursor& at, std::uint8_t* out, std::size_t bytes_max, std::size_t& count) {
  count = 0;
  while (true) {
    if (count > 0) at.skip('.');
    if (hex_value(at.peek()) < 0 || at.at_end()) return nullptr;
    const int high = hex_value(at.peek());
    at.skip(at.peek());
    if (at.at_end() || hex_value(at.peek()) < 0) return "payload: an odd number of hex digits";
    const int low = hex_value(at.peek());
    at.skip(at.peek());
    if (count == bytes_max) return "payload: more bytes than the frame can hold";
    out[count++] = static_cast<std::uint8_t>(high << 4 | low);
  }
}

const char* parse_raw_dlc(Cursor& at, can::Frame& frame) {
  if (!at.skip('_')) return nullptr;
  const int dlc = hex_value(at.peek());
  if (at.at_end() || dlc < 9) return "raw DLC: \"_\" must be followed by 9 to F";
  at.skip(at.peek());
  if (frame.length != can::kClassicBytesMax) return "raw DLC: only with 8 bytes";
  frame.raw_dlc = static_cast<std::uint8_t>(dlc);
  return nullptr;
}

const char* parse_remote(Cursor& at, can::Frame& frame) {
  frame.flags |= can::kRemote;
  if (is_digit(at.peek())) {
    if (at.peek() > '8') return "remote frame: length above 8";
    frame.length = static_cast<std::uint8_t>(at.peek() - '0');
    at.skip(at.peek());
  }
  return parse_raw_dlc(at, frame);
}

const char* parse_classic(Cursor& at, can::Frame& frame) {
  if (at.skip('R') || at.skip('r')) return parse_remote(at, frame);
  std::size_t count = 0;
  const char* why = parse_bytes(at, frame.data.data(), can::kClassicBytesMax, count);
  frame.length = static_cast<std::uint8_t>(count);
  return why != nullptr ? why : parse_raw_dlc(at, frame);
}

const char* parse_fd(Cursor& at, can::Frame& frame) {
  constexpr int kBrsNibble = 1;
  constexpr int kEsiNibble = 2;
  const int nibble = hex_value(at.peek());
  if (at.at_end() || nibble < 0) return "FD frame: no flags after \"##\"";
  at.skip(at.peek());
  frame.flags |= can::kFd;
  if ((nibble & kBrsNibble) != 0) frame.flags |= can::kBitRateSwitch;
  if ((nibble & kEsiNibble) != 0) frame.flags |= can::kErrorStateIndicator;
  std::size_t count = 0;
  const char* why = parse_bytes(at, frame.data.data(), can::kFdBytesMax, count);
  frame.length = static_cast<std::uint8_t>(count);
  return why;
}

// VVPPP#FF:SS:AAAAAAAA#DATA, with VV and PPP already read as `id`.
const char* parse_xl(std::string_view id, Cursor& at, XlFrame& xl) {
  const std::string_view flags = at.hex();
  const bool first = flags.size() == 2 && at.skip(':');
  const std::string_view sdt = at.hex();
  const bool second = first && sdt.size() == 2 && at.skip(':');
  const std::string_view acceptance = at.hex();
  if (!second || acceptance.size() != 8 || !at.skip('#'))
    return "XL frame: not VVPPP#FF:SS:AAAAAAAA#";
  xl.vcid = static_cast<std::uint8_t>(hex_number(id.substr(0, 2)));
  xl.priority = static_cast<std::uint16_t>(hex_number(id.substr(2)));
  if (xl.priority > can::kStandardIdMax) return "XL frame: priority above 7FF";
  xl.flags = static_cast<std::uint8_t>(hex_number(flags));
  xl.sdt = static_cast<std::uint8_t>(hex_number(sdt));
  xl.acceptance = hex_number(acceptance);
  std::size_t count = 0;
  const char* why = parse_bytes(at, xl.data.data(), kXlBytesMax, count);
  xl.length = static_cast<std::uint16_t>(count);
  return why;
}

const char* parse_frame_text(Cursor& at, LogRecord& record, XlFrame& xl) {
  can::Frame& frame = record.frame;
  frame.flags = 0;
  frame.length = 0;
  frame.raw_dlc = 0;
  frame.id = 0;
  const std::string_view id = at.hex();
  if (!at.skip('#')) return "no \"#\" after the identifier";
  if (id.size() == 5) {
    record.is_xl = true;
    return parse_xl(id, at, xl);
  }
  if (const char* why = set_id(id, frame)) return why;
  return at.skip('#') ? parse_fd(at, frame) : parse_classic(at, frame);
}

const char* parse_direction(Cursor& at, LogRecord& record) {
  const bool apart = at.peek() == ' ' || at.peek() == '\t';
  at.skip_blanks();
  if (apart && at.skip('R')) {
    record.direction = Direction::kReceived;
  } else if (apart && at.skip('T')) {
    record.direction = Direction::kTransmitted;
  }
  at.skip_blanks();
  return at.at_end() ? nullptr : "unexpected text after the frame";
}

}  // namespace

LineResult parse_line(std::string_view line, InterfaceTable& interfaces, LogRecord& record,
                      XlFrame& xl) {
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  Cursor at(line);
  if (!at.skip('(')) return {LineKind::kOther, ""};
  record.is_xl = false;
  record.direction = Direction::kUnknown;
  if (const char* why = parse_stamp(at, record)) return {LineKind::kMalformed, why};
  at.skip_blanks();
  const std::string_view name = at.word();
  if (name.empty() || name.find('#') != name.npos) {
    return {LineKind::kMalformed, "no interface name"};
  }
  if (name.size() > kInterfaceNameMax) {
    return {LineKind::kMalformed, "the interface name is longer than 31 characters"};
  }
  at.skip_blanks();
  if (const char* why = parse_frame_text(at, record, xl)) return {LineKind::kMalformed, why};
  if (const char* why = parse_direction(at, record)) return {LineKind::kMalformed, why};
  const auto bus = interfaces.index_of(name);
  if (!bus) return {LineKind::kMalformed, "more than 64 different interfaces"};
  record.bus = *bus;
  return {record.is_xl ? LineKind::kXl : LineKind::kFrame, ""};
}

CandumpReader::CandumpReader(std::unique_ptr<LogSource> source)
    : blocks_(std::move(source)), xl_(std::make_unique<XlFrame>()) {}

// Compares with all entries without a branch: two buses alternate in an order that no processor
// predicts.
inline const CandumpReader::KnownInterface& CandumpReader::known_interface(
    std::uint64_t word) const {
  const auto is = [&](std::size_t i) { return (word & known_[i].mask) == known_[i].word; };
  static_assert(kKnownMax == 4);
  std::size_t found = kKnownMax;
  found = is(3) ? 3 : found;
  found = is(2) ? 2 : found;
  found = is(1) ? 1 : found;
  found = is(0) ? 0 : found;
  return known_[found];
}

void CandumpReader::remember_interface(can::BusIndex bus) {
  const std::string& name = interfaces_.name(bus);
  // The fast path takes only the first few names of up to seven characters.
  if (known_count_ == kKnownMax || name.size() > 7) return;
  KnownInterface& known = known_[known_count_++];
  char text[8] = {};
  std::copy(name.begin(), name.end(), text);
  text[name.size()] = ' ';
  known.length = static_cast<std::uint8_t>(name.size() + 1);
  known.mask = known.length == 8 ? ~0ULL : (1ULL << (8U * known.length)) - 1;
  known.word = load_word(text) & known.mask;
  known.bus = bus;
}

// Reads "(SSSSSSSSSS." of a new second.
bool CandumpReader::read_second(const char* p) {
  if (p[0] != '(' || p[11] != '.') return false;
  const std::uint64_t high = load_word(p + 1);
  const std::uint64_t low = load_word(p + 3);
  if (!all_digits(high) || !all_digits(low)) return false;
  const auto seconds =
      static_cast<std::int64_t>(digits_value(high) * 100 + digits_value(low) % 100);
  if (seconds > kSecondsMax) return false;
  second_ns_ = seconds * 1'000'000'000;
  std::memcpy(second_text_.data(), p, second_text_.size());
  return true;
}

// Parses "(SSSSSSSSSS.FFFFFF) IFACE ID#HEX\n", the usual form of a candump line. Returns the start
// of the next line, or null if the line has another form, which parse_line() then judges.
// Precondition: kLookaheadBytes are readable at `p`.
inline const char* CandumpReader::parse_usual(const char* p, LogRecord& record) {
  if constexpr (std::endian::native != std::endian::little) return nullptr;
  const bool same_second = load_word(p) == load_word(second_text_.data()) &&
                           load_half_word(p + 8) == load_half_word(second_text_.data() + 8);
  if (!same_second && !read_second(p)) return nullptr;
  // Maps digits to 0…9 and the characters after them to 0.
  constexpr std::uint64_t kZeros = 0x2029'3030'3030'3030U;       // "000000) "
  constexpr std::uint64_t kBeyondMost = 0x7F7F'7676'7676'7676U;  // 9 in a digit, 0 after it
  const std::uint64_t fraction = load_word(p + 12) ^ kZeros;
  if (((fraction | (fraction + kBeyondMost)) & 0x8080808080808080U) != 0) return nullptr;
  const KnownInterface& known = known_interface(load_word(p + 20));
  if (known.length == 0) return nullptr;

  can::Frame& frame = record.frame;
  p += 20 + known.length;
  if (p[3] == '#') {
    const int a = hex_value(p[0]);
    const int b = hex_value(p[1]);
    const int c = hex_value(p[2]);
    if ((a | b | c) < 0 || a > 7) return nullptr;
    frame.id = static_cast<std::uint32_t>(a << 8 | b << 4 | c);
    frame.flags = 0;
    p += 4;
  } else if (p[8] == '#') {
    std::uint8_t bytes[8];
    if (unpack_hex16(p, bytes) != 8 || bytes[0] > 0x1F) return nullptr;
    frame.id = static_cast<std::uint32_t>(bytes[0]) << 24U |
               static_cast<std::uint32_t>(bytes[1]) << 16U |
               static_cast<std::uint32_t>(bytes[2]) << 8U | bytes[3];
    frame.flags = can::kExtended;
    p += 9;
  } else {
    return nullptr;
  }
  const unsigned digits = unpack_hex16(p, frame.data.data());
  if (digits % 2 != 0 || p[digits] != '\n') return nullptr;
  frame.length = static_cast<std::uint8_t>(digits / 2);
  frame.raw_dlc = 0;
  record.stamp =
      time_from_ns(second_ns_ + static_cast<std::int64_t>(digits_value(fraction << 16U)) * 1000);
  record.bus = known.bus;
  record.fraction_digits = 6;
  record.direction = Direction::kUnknown;
  record.is_xl = false;
  return p + digits + 1;
}

bool CandumpReader::refill() {
  const std::string_view block = blocks_.next(counts_);
  at_ = block.data();
  end_ = at_ + block.size();
  return !block.empty();
}

bool CandumpReader::next(LogRecord& record) {
  return next_batch({&record, 1}) == 1;
}

std::size_t CandumpReader::next_batch(std::span<LogRecord> room) {
  std::size_t count = 0;
  while (count == 0) {
    if (at_ == end_ && !refill()) return 0;
    count = take_from_block(room);
  }
  return count;
}

// Returns as many records as fit, or as many as are left in the block, perhaps none.
std::size_t CandumpReader::take_from_block(std::span<LogRecord> room) {
  std::size_t count = 0;
  while (count < room.size() && at_ != end_) {
    const std::size_t before = count;
    if (end_ - at_ >= kLookaheadBytes) {
      while (count < room.size()) {
        const char* const next_line = parse_usual(at_, room[count]);
        if (next_line == nullptr) break;
        at_ = next_line;
        ++count;
        if (end_ - at_ < kLookaheadBytes) break;
      }
      counts_.lines += count - before;
      counts_.frames += count - before;
    }
    if (count < room.size() && at_ != end_ && take_line(room[count])) ++count;
  }
  return count;
}

// Reads one line of any form. False if it holds no record.
bool CandumpReader::take_line(LogRecord& record) {
  ++counts_.lines;
  const auto* newline =
      static_cast<const char*>(std::memchr(at_, '\n', static_cast<std::size_t>(end_ - at_)));
  const std::string_view line =
      clean_line({at_, static_cast<std::size_t>(newline - at_)}, counts_.skipped_bytes);
  at_ = newline + 1;
  const std::size_t interfaces_before = interfaces_.names().size();
  const LineResult result = parse_line(line, interfaces_, record, *xl_);
  if (interfaces_.names().size() > interfaces_before) {
    remember_interface(static_cast<can::BusIndex>(interfaces_before));
  }
  switch (result.kind) {
    case LineKind::kFrame:
      ++counts_.frames;
      return true;
    case LineKind::kXl:
      ++counts_.xl_frames;
      return true;
    case LineKind::kOther:
      ++counts_.other_lines;
      break;
    case LineKind::kMalformed:
      counts_.add_malformed(result.why);
      break;
  }
  return false;
}

}  // namespace vgyro::canlog
