#include "canlog/asc.h"

#include <algorithm>
#include <string>

#include "canlog/text_line.h"
#include "canlog/wall_time.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr unsigned kChannelMax = 255;

bool same(std::string_view a, std::string_view lower_b) {
  return a.size() == lower_b.size() &&
         std::equal(a.begin(), a.end(), lower_b.begin(), [](char x, char y) {
           return (x >= 'A' && x <= 'Z' ? static_cast<char>(x - 'A' + 'a') : x) == y;
         });
}

/// What follows the stamp of an event.
enum class Event : std::uint8_t { kOther, kClassic, kFd };

struct Opening {
  DecimalTime stamp;
  Event event = Event::kOther;
  unsigned channel = 0;  ///< channel of a classic frame
};

// "   0.010001 2 …", "   0.04 CANFD …"
std::optional<Opening> read_opening(Words& words) {
  const auto stamp = decimal_time(words.next(), kSecond_ns);
  if (!stamp || stamp->digits == 0) return std::nullopt;
  Opening opening{*stamp, Event::kOther, 0};
  Words ahead = words;
  const std::string_view word = ahead.next();
  if (same(word, "canfd")) {
    opening.event = Event::kFd;
    words = ahead;
  } else if (const auto channel = number_of<unsigned>(word)) {
    // Events of other buses begin with other words: "L1", "Fr".
    opening.event = *channel >= 1 && *channel <= kChannelMax ? Event::kClassic : Event::kOther;
    opening.channel = *channel;
    words = ahead;
  }
  return opening;
}

std::optional<Direction> direction_of(std::string_view word) {
  if (same(word, "rx")) return Direction::kReceived;
  if (same(word, "tx")) return Direction::kTransmitted;
  return std::nullopt;
}

// "123", "12345678x"
const char* read_id(std::string_view word, int base, can::Frame& frame) {
  if (word.ends_with('x') || word.ends_with('X')) {
    frame.flags |= can::kExtended;
    word.remove_suffix(1);
  }
  const auto id = number_of<std::uint32_t>(word, base);
  if (!id) return "identifier: no number";
  if (*id > (frame.has(can::kExtended) ? can::kExtendedIdMax : can::kStandardIdMax)) {
    return "identifier: larger than its kind can be";
  }
  frame.id = *id;
  return nullptr;
}

// "123 Rx d 8 11 22 …", "123 Rx r 5"; "Length = …" and more may follow.
Parsed read_classic(Words words, int base, LogRecord& record) {
  const std::string_view id = words.next();
  if (same(id, "errorframe")) {
    set_error_frame(record.frame);
    return {Verdict::kFrame, ""};
  }
  const auto direction = direction_of(words.next());
  // Statistics, J1939 parameter groups, requests to send ("TxRq"), chip states …
  if (!direction) return {Verdict::kOther, ""};
  record.direction = *direction;
  const std::string_view kind = words.next();
  const bool remote = same(kind, "r");
  if (!remote && !same(kind, "d")) return {Verdict::kOther, ""};
  if (const char* why = read_id(id, base, record.frame)) return {Verdict::kMalformed, why};
  const auto dlc = number_of<unsigned>(words.next(), base);
  if (remote) {
    record.frame.flags |= can::kRemote;
    // Vector's tools before version 8.5 write no length code for remote frames.
    if (!dlc) return {Verdict::kFrame, ""};
  }
  if (!dlc) return {Verdict::kMalformed, "length code: no number"};
  if (const char* why = set_dlc(*dlc, record.frame)) return {Verdict::kMalformed, why};
  if (remote) return {Verdict::kFrame, ""};
  if (const char* why = read_payload(words, record.frame, base)) {
    return {Verdict::kMalformed, why};
  }
  return {Verdict::kFrame, ""};
}

/// Bits of the flags of a CANFD line.
constexpr std::uint32_t kFlagRemote = 1U << 4U;
constexpr std::uint32_t kFlagFd = 1U << 12U;

// Reads what follows the bytes of a CANFD line: duration, length, flags, … Makes the frame classic
// if the flags say so.
void apply_flags(Words words, can::Frame& frame) {
  words.next();
  words.next();
  const auto flags = number_of<std::uint32_t>(words.next(), 16);
  if (!flags) return;  // older files have none
  if ((*flags & kFlagRemote) != 0) frame.flags |= can::kRemote;
  // Loggers of FD buses also write classic frames in this form.
  if ((*flags & kFlagFd) != 0 || frame.length > can::kClassicBytesMax) return;
  constexpr unsigned kOfFd = can::kFd | can::kBitRateSwitch | can::kErrorStateIndicator;
  frame.flags &= static_cast<std::uint8_t>(~kOfFd);
}

bool is_bit(std::string_view word) {
  return word == "0" || word == "1";
}

// "1 Rx 123 [name] 1 0 9 12 11 22 … duration length flags …"
Parsed read_fd(Words words, int base, LogRecord& record, unsigned& channel) {
  const auto number = number_of<unsigned>(words.next());
  const auto direction = direction_of(words.next());
  if (!number || *number < 1 || *number > kChannelMax || !direction) return {Verdict::kOther, ""};
  channel = *number;
  record.direction = *direction;
  const std::string_view id = words.next();
  if (same(id, "errorframe")) {
    set_error_frame(record.frame);
    return {Verdict::kFrame, ""};
  }
  can::Frame& frame = record.frame;
  frame.flags = can::kFd;
  if (const char* why = read_id(id, base, frame)) return {Verdict::kMalformed, why};
  std::string_view rate_switch = words.next();
  if (!is_bit(rate_switch)) rate_switch = words.next();  // that was a name
  const std::string_view state = words.next();
  if (!is_bit(rate_switch) || !is_bit(state)) {
    return {Verdict::kMalformed, "BRS and ESI: neither 0 nor 1"};
  }
  if (rate_switch == "1") frame.flags |= can::kBitRateSwitch;
  if (state == "1") frame.flags |= can::kErrorStateIndicator;
  const auto dlc = number_of<unsigned>(words.next(), 16);
  const auto bytes = number_of<unsigned>(words.next());
  if (!dlc || !bytes) return {Verdict::kMalformed, "length: no number"};
  if (const char* why = set_length(*bytes, frame)) return {Verdict::kMalformed, why};
  if (const char* why = read_payload(words, frame, base)) return {Verdict::kMalformed, why};
  apply_flags(words, frame);
  // A remote frame has a length and no bytes.
  if (frame.has(can::kRemote) && frame.length == 0) {
    if (const char* why = set_dlc(*dlc, frame)) return {Verdict::kMalformed, why};
  }
  return {Verdict::kFrame, ""};
}

// "base hex timestamps absolute"
bool read_base(Words words, int& base, bool& relative) {
  if (!same(words.next(), "base")) return false;
  const std::string_view which = words.next();
  if (!same(which, "hex") && !same(which, "dec")) return false;
  base = same(which, "hex") ? 16 : 10;
  if (same(words.next(), "timestamps")) relative = same(words.next(), "relative");
  return true;
}

bool begins_block(Words words) {
  return same(words.next(), "begin") && same(words.next(), "triggerblock");
}

// "End TriggerBlock", "internal events logged", "no internal events logged"
bool is_closing(std::string_view line) {
  return same(line, "end triggerblock") || same(line, "internal events logged") ||
         same(line, "no internal events logged");
}

}  // namespace

bool is_asc_line(std::string_view line) {
  Words words(line);
  int base = 0;
  bool relative = false;
  if (read_base(words, base, relative) || begins_block(words)) return true;
  if (same(Words(line).next(), "date")) return vector_date(line.substr(4)).has_value();
  const auto opening = read_opening(words);
  if (!opening || opening->event == Event::kOther) return false;
  LogRecord record;
  unsigned channel = 0;
  // Without the head the base is unknown; bytes of either base are valid as hexadecimal ones.
  const Parsed result = opening->event == Event::kFd ? read_fd(words, 16, record, channel)
                                                     : read_classic(words, 16, record);
  return result.verdict == Verdict::kFrame;
}

Parsed AscReader::parse(std::string_view line, LogRecord& record) {
  line = trimmed(line);
  if (line.empty() || line.starts_with("//")) return head();
  return is_decimal(line.front()) ? parse_event(line, record) : parse_head(line);
}

Parsed AscReader::parse_head(std::string_view line) {
  Words words(line);
  if (read_base(words, base_, relative_)) return head();
  const bool is_block = begins_block(words);
  if (!is_block && !same(words.next(), "date")) return is_closing(line) ? head() : other();
  if (is_block) {
    words = Words(line);
    words.next();
    words.next();
    if (words.at_end()) return head();
  }
  const auto wall = vector_date(words.rest());
  const auto date_ns = wall ? local_to_epoch_ns(*wall) : std::nullopt;
  if (!date_ns) return malformed("date: not understood; the stamps count from zero");
  if (is_block) {
    block_ns_ = date_ns;
  } else {
    date_ns_ = zero_ns_ = *date_ns;
  }
  return head();
}

// A block that begins with the measurement has its start with more digits than the file's date;
// python-can's date is the time of writing. In a block that begins with a trigger, stamps count
// from the file's date.
void AscReader::settle_zero(std::int64_t stamp_ns) {
  if (stamp_ns == 0 || !date_ns_) zero_ns_ = *block_ns_;
  block_ns_.reset();
}

Parsed AscReader::parse_event(std::string_view line, LogRecord& record) {
  Words words(line);
  const auto opening = read_opening(words);
  if (!opening) return other();
  const std::int64_t from_ns = relative_ ? now_ns_ : 0;
  if (opening->stamp.ns > kStampMax_ns - from_ns) return malformed("stamp: beyond the year 2255");
  if (block_ns_) settle_zero(opening->stamp.ns);
  now_ns_ = from_ns + opening->stamp.ns;
  if (opening->event == Event::kOther) {
    return same(words.rest(), "start of measurement") ? head() : other();
  }
  unsigned channel = opening->channel;
  const Parsed result = opening->event == Event::kFd ? read_fd(words, base_, record, channel)
                                                     : read_classic(words, base_, record);
  if (result.verdict != Verdict::kFrame) return result;
  if (!set_channel(channel, record)) return malformed(kTooManyBuses);
  if (now_ns_ > kStampMax_ns - zero_ns_) return malformed("stamp: beyond the year 2255");
  record.stamp = time_from_ns(zero_ns_ + now_ns_);
  record.fraction_digits = opening->stamp.digits > 6 ? 9 : 6;
  return result;
}

}  // namespace vgyro::canlog
