#include "canlog/candump_screen.h"

#include <algorithm>
#include <optional>
#include <string>

#include "canlog/line_reader.h"
#include "canlog/text_line.h"
#include "canlog/wall_time.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::size_t kInterfaceNameMax = 31;  // as in candump logs

enum class StampKind : std::uint8_t {
  kAbsolute,  ///< -ta; also -td and -tz, which the reader distinguishes
  kDate       ///< -tA
};

struct Stamp {
  StampKind kind = StampKind::kAbsolute;
  std::int64_t ns = 0;
  unsigned digits = 0;
};

// Removes "(…)" from the beginning of the line.
std::optional<Stamp> take_stamp(std::string_view& line) {
  if (!line.starts_with('(')) return std::nullopt;
  const std::size_t end = line.find(')');
  if (end == line.npos) return std::nullopt;
  const std::string_view text = line.substr(1, end - 1);
  line.remove_prefix(end + 1);
  Stamp stamp;
  const std::size_t point = text.find('.');
  if (point == text.npos) return std::nullopt;
  stamp.digits = static_cast<unsigned>(text.size() - point - 1);
  if (const auto wall = iso_date(text)) {
    const auto ns = local_to_epoch_ns(*wall);
    if (!ns) return std::nullopt;
    stamp.kind = StampKind::kDate;
    stamp.ns = *ns;
    return stamp;
  }
  const auto time = decimal_time(text, kSecond_ns);
  if (!time) return std::nullopt;
  stamp.ns = time->ns;
  return stamp;
}

// Colours: ESC [ … m.
std::string without_colours(std::string_view line) {
  std::string plain;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] != '\x1B') {
      plain += line[i];
      continue;
    }
    while (i < line.size() && (line[i] < '@' || line[i] > '~' || line[i] == '['))
      ++i;
  }
  return plain;
}

// "[8]", or "[08]" for FD; "{B}" for a raw DLC.
const char* read_length(std::string_view word, can::Frame& frame) {
  if (word.size() < 3) return "no length in brackets";
  const std::string_view inside = word.substr(1, word.size() - 2);
  if (word.front() == '{' && word.back() == '}') {
    const auto dlc = number_of<unsigned>(inside, 16);
    return dlc ? set_dlc(*dlc, frame) : "length code: no hex digit";
  }
  const auto bytes = number_of<unsigned>(inside);
  if (word.front() != '[' || word.back() != ']' || !bytes) return "no length in brackets";
  if (inside.size() == 2) frame.flags |= can::kFd;
  return set_length(*bytes, frame);
}

// "123", "12345678"; error frames have 20000000 added.
const char* read_id(std::string_view word, can::Frame& frame) {
  constexpr std::uint32_t kErrorBit = 0x20000000U;
  const auto id = number_of<std::uint32_t>(word, 16);
  if (!id || (word.size() != 3 && word.size() != 8))
    return "identifier: neither 3 nor 8 hex digits";
  if (word.size() == 3) {
    if (*id > can::kStandardIdMax) return "identifier: above 7FF needs 8 digits";
    frame.id = *id;
    return nullptr;
  }
  if ((*id & ~(kErrorBit | can::kExtendedIdMax)) != 0) return "identifier: above 1FFFFFFF";
  frame.id = *id & can::kExtendedIdMax;
  frame.flags = (*id & kErrorBit) != 0 ? can::kError : can::kExtended;
  return nullptr;
}

// The additions of -x: "RX B E"; the last two occur with FD only.
void read_extra(Words& words, LogRecord& record, std::string_view direction) {
  record.direction = direction == "TX" ? Direction::kTransmitted : Direction::kReceived;
  if (words.next() == "B") record.frame.flags |= can::kBitRateSwitch;
  if (words.next() == "E") record.frame.flags |= can::kErrorStateIndicator;
}

// "11 22", in binary digits with -i; with -S "22`11", the last byte first.
const char* read_bytes(std::string_view text, can::Frame& frame) {
  const std::string_view shown = trimmed(text);
  if (shown.starts_with("remote request")) {
    frame.flags |= can::kRemote;
    return nullptr;
  }
  constexpr std::size_t kBinaryDigits = 8;
  const std::size_t first_end = std::min(shown.find_first_of(" `"), shown.size());
  const int base = first_end == kBinaryDigits ? 2 : 16;
  const bool swapped = first_end < shown.size() && shown[first_end] == '`';
  const std::size_t width = base == 2 ? kBinaryDigits : 2;
  for (std::size_t i = 0; i < frame.length; ++i) {
    const std::size_t at = i * (width + 1);
    if (at + width > shown.size()) return "payload: shorter than its length";
    const auto byte = number_of<std::uint8_t>(shown.substr(at, width), base);
    if (!byte) return "payload: a byte is not a number";
    frame.data[swapped ? frame.length - 1 - i : i] = *byte;
  }
  return nullptr;
}

const char* read_frame(std::string_view line, LogRecord& record, std::string_view& bus) {
  Words words(line);
  bus = words.next();
  if (bus.empty() || bus.size() > kInterfaceNameMax)
    return "no interface name, or one of more than 31 characters";
  std::string_view word = words.next();
  std::uint8_t marks = 0;
  if (word == "RX" || word == "TX") {
    read_extra(words, record, word);
    marks = record.frame.flags;
    word = words.next();
  }
  if (const char* why = read_id(word, record.frame)) return why;
  if (const char* why = read_length(words.next(), record.frame)) return why;
  if (record.frame.has(can::kFd)) record.frame.flags |= marks;
  return read_bytes(words.rest(), record.frame);
}

class ScreenReader final : public LineReader {
 public:
  ScreenReader(std::unique_ptr<ByteSource> bytes, bool deltas)
      : LineReader(std::move(bytes)), deltas_(deltas) {}

 private:
  Parsed parse(std::string_view line, LogRecord& record) override {
    std::string plain;
    if (line.find('\x1B') != line.npos) {
      plain = without_colours(line);
      line = plain;
    }
    line = trimmed(line);
    if (line.empty()) return head();
    if (!line.starts_with('(')) return other();
    const auto stamp = take_stamp(line);
    if (!stamp) return malformed("stamp: neither seconds nor a date");
    // A delta counts even if its frame cannot be read.
    const std::int64_t from_ns = deltas_ ? now_ns_ : 0;
    if (stamp->ns > kStampMax_ns - from_ns) return malformed("stamp: beyond the year 2255");
    now_ns_ = from_ns + stamp->ns;
    std::string_view bus;
    if (const char* why = read_frame(line, record, bus)) return malformed(why);
    if (!set_bus(bus, record)) return malformed(kTooManyBuses);
    record.stamp = time_from_ns(now_ns_);
    record.fraction_digits = stamp->digits > 6 ? 9 : 6;
    return frame();
  }

  bool deltas_;
  std::int64_t now_ns_ = 0;
};

// -td and -tz look alike. Frames come at uneven intervals, so intervals soon decrease, while the
// time since the beginning does not; nor does that time stand still.
class DeltaJudge {
 public:
  void add(std::int64_t ns) {
    fell_ = fell_ || (count_ > 0 && ns < last_ns_);
    stood_ = (count_ < 2 || (stood_ && ns == last_ns_));
    last_ns_ = ns;
    ++count_;
  }
  [[nodiscard]] bool is_sure() const { return fell_ || count_ == kLinesMax; }
  [[nodiscard]] bool are_deltas() const { return fell_ || (stood_ && count_ > 3); }

 private:
  static constexpr unsigned kLinesMax = 32;
  bool fell_ = false;
  bool stood_ = true;
  unsigned count_ = 0;
  std::int64_t last_ns_ = 0;
};

// Whether the log begins with the deltas of -td. Reads no further than necessary: the source may be
// live.
bool begins_with_deltas(HeadedSource& source) {
  constexpr std::size_t kShortSecondDigits = 3;  // "(000.012345)"; -ta has ten
  DeltaJudge judge;
  std::size_t from = 0;
  while (!judge.is_sure()) {
    const std::size_t end = source.head().find('\n', from);
    if (end == source.head().npos) {
      if (!source.grow()) break;
      continue;
    }
    std::uint64_t skipped = 0;
    const std::string plain =
        without_colours(clean_line(source.head().substr(from, end - from), skipped));
    from = end + 1;
    std::string_view line = trimmed(plain);
    const std::size_t point = line.find('.');
    const auto stamp = take_stamp(line);
    if (!stamp) continue;
    if (stamp->kind == StampKind::kDate || point > kShortSecondDigits + 3) return false;
    judge.add(stamp->ns);
  }
  return judge.are_deltas();
}

// Interface, identifier and length, as after a stamp.
bool is_frame_text(std::string_view line) {
  LogRecord record;
  std::string_view bus;
  return read_frame(line, record, bus) == nullptr;
}

}  // namespace

bool is_candump_screen_line(std::string_view line) {
  const std::string plain = without_colours(line);
  line = trimmed(plain);
  return take_stamp(line) && is_frame_text(line);
}

Expected<std::unique_ptr<LogReader>> open_candump_screen(std::unique_ptr<ByteSource> bytes) {
  auto source = std::make_unique<HeadedSource>(std::move(bytes));
  const bool deltas = begins_with_deltas(*source);
  return std::make_unique<ScreenReader>(std::move(source), deltas);
}

bool is_stampless_screen_line(std::string_view line) {
  const std::string plain = without_colours(line);
  // The blanks are candump's own: "  can0  123   [8]  …".
  return plain.starts_with("  ") && is_frame_text(trimmed(plain));
}

Expected<std::unique_ptr<LogReader>> refuse_stampless_screen(std::unique_ptr<ByteSource> bytes) {
  return fail(bytes->name(), "is what candump prints without stamps, so it holds no times",
              "record with `candump -l` or `candump -L`, which also keep all bits of a frame");
}

}  // namespace vgyro::canlog
