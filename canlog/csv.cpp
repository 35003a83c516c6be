#include "canlog/csv.h"

#include <array>
#include <charconv>
#include <cmath>

#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kMicro_ns = 1'000;
constexpr unsigned kBusMax = 254;

/// The fields of a line; fields beyond any known form are ignored.
struct Fields {
  explicit Fields(std::string_view line) {
    while (count < values.size()) {
      const std::size_t comma = line.find(',');
      values[count++] = trimmed(line.substr(0, comma));
      if (comma == line.npos) return;
      line.remove_prefix(comma + 1);
    }
  }
  [[nodiscard]] std::string_view at(int index) const {
    return index < 0 || static_cast<std::size_t>(index) >= count
               ? std::string_view()
               : values[static_cast<std::size_t>(index)];
  }
  static constexpr std::size_t kMax = 80;
  std::array<std::string_view, kMax> values;
  std::size_t count = 0;
};

int base64_value(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// Decodes `count` bytes. Returns null, or what is wrong.
const char* read_base64(std::string_view text, can::Frame& frame, std::size_t& count) {
  while (text.ends_with('='))
    text.remove_suffix(1);
  std::uint32_t bits = 0;
  unsigned held = 0;
  count = 0;
  for (const char c : text) {
    const int value = base64_value(c);
    if (value < 0) return "payload: no base64";
    bits = bits << 6U | static_cast<std::uint32_t>(value);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    if (count == can::kFdBytesMax) return "payload: more bytes than the frame can hold";
    frame.data[count++] = static_cast<std::uint8_t>(bits >> held);
  }
  return nullptr;
}

bool is_true(std::string_view text) {
  return text == "1" || text == "true" || text == "True" || text == "TRUE";
}
bool is_false(std::string_view text) {
  return text == "0" || text == "false" || text == "False" || text == "FALSE";
}
bool is_truth(std::string_view text) {
  return is_true(text) || is_false(text);
}

// "0x1a2", "1A2"
std::optional<std::uint32_t> hex_id(std::string_view text) {
  if (text.starts_with("0x") || text.starts_with("0X")) text.remove_prefix(2);
  return number_of<std::uint32_t>(text, 16);
}

const char* set_hex_id(std::string_view text, bool extended, can::Frame& frame) {
  const auto id = hex_id(text);
  return id ? set_id(*id, extended, frame) : "identifier: no hex number";
}

// Seconds as Python prints a float: "1700000000.25", small ones as "1e-05".
std::optional<DecimalTime> python_seconds(std::string_view text) {
  if (text.find('e') == text.npos) return decimal_time(text, kSecond_ns);
  double seconds = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (error != std::errc{} || end != text.data() + text.size() || !(seconds >= 0.0) ||
      seconds > 1.0) {
    return std::nullopt;
  }
  constexpr unsigned kDigits = 9;
  return DecimalTime{std::llround(seconds * 1e9), kDigits};
}

constexpr std::string_view kPythonCanHead =
    "timestamp,arbitration_id,extended,remote,error,dlc,data";

Parsed read_python_can(const Fields& fields, LogRecord& record) {
  constexpr std::size_t kFields = 7;
  if (fields.count != kFields) return {Verdict::kMalformed, "not seven columns"};
  const auto stamp = python_seconds(fields.at(0));
  if (!stamp) return {Verdict::kMalformed, "stamp: no number of seconds"};
  record.stamp = time_from_ns(stamp->ns);
  record.fraction_digits = stamp->digits > 6 ? 9 : 6;
  can::Frame& frame = record.frame;
  if (!is_truth(fields.at(2)) || !is_truth(fields.at(3)) || !is_truth(fields.at(4))) {
    return {Verdict::kMalformed, "extended, remote, error: neither 0 nor 1"};
  }
  if (is_true(fields.at(4))) {
    set_error_frame(frame);
    return {Verdict::kFrame, ""};
  }
  if (const char* why = set_hex_id(fields.at(1), is_true(fields.at(2)), frame)) {
    return {Verdict::kMalformed, why};
  }
  const auto length = number_of<unsigned>(fields.at(5));
  if (!length) return {Verdict::kMalformed, "length: no number"};
  if (*length > can::kClassicBytesMax) frame.flags |= can::kFd;
  if (const char* why = set_length(*length, frame)) return {Verdict::kMalformed, why};
  if (is_true(fields.at(3))) {
    frame.flags |= can::kRemote;
    return {Verdict::kFrame, ""};
  }
  std::size_t count = 0;
  if (const char* why = read_base64(fields.at(6), frame, count)) return {Verdict::kMalformed, why};
  if (count != frame.length) {
    return {Verdict::kMalformed, "payload: does not match its length"};
  }
  return {Verdict::kFrame, ""};
}

bool names_savvycan_columns(std::string_view line) {
  return line.starts_with("Time Stamp,ID,Extended,");
}

}  // namespace

bool is_python_can_csv_line(std::string_view line) {
  if (trimmed(line) == kPythonCanHead) return true;
  // A log that was appended to, or cut, has no head.
  LogRecord record;
  const Fields fields(line);
  return fields.at(1).starts_with("0x") &&
         read_python_can(fields, record).verdict == Verdict::kFrame;
}

Parsed PythonCanCsvReader::parse(std::string_view line, LogRecord& record) {
  if (trimmed(line).empty() || trimmed(line) == kPythonCanHead) return head();
  const Parsed result = read_python_can(Fields(line), record);
  if (result.verdict == Verdict::kFrame && !set_channel(1, record)) return malformed(kTooManyBuses);
  return result;
}

bool is_savvycan_csv_line(std::string_view line) {
  return names_savvycan_columns(trimmed(line));
}

Parsed SavvyCanCsvReader::parse(std::string_view line, LogRecord& record) {
  line = trimmed(line);
  if (line.empty()) return head();
  const Fields fields(line);
  if (names_savvycan_columns(line)) {
    const auto place = [&](std::string_view name) {
      for (std::size_t i = 0; i < fields.count; ++i)
        if (fields.values[i] == name) return static_cast<int>(i);
      return kNone;
    };
    time_ = place("Time Stamp");
    id_ = place("ID");
    extended_ = place("Extended");
    direction_ = place("Dir");
    bus_ = place("Bus");
    length_ = place("LEN");
    data_ = place("D1");
    return head();
  }
  if (length_ == kNone || data_ == kNone) return malformed("the first line names no LEN and D1");
  const auto stamp = decimal_time(fields.at(time_), kMicro_ns);
  if (!stamp) return malformed("stamp: no number of microseconds");
  record.stamp = time_from_ns(stamp->ns);
  record.fraction_digits = stamp->digits > 0 ? 9 : 6;
  if (!is_truth(fields.at(extended_))) return malformed("extended: neither true nor false");
  can::Frame& frame = record.frame;
  if (const char* why = set_hex_id(fields.at(id_), is_true(fields.at(extended_)), frame)) {
    return malformed(why);
  }
  const auto length = number_of<unsigned>(fields.at(length_));
  if (!length) return malformed("length: no number");
  if (*length > can::kClassicBytesMax) frame.flags |= can::kFd;
  if (const char* why = set_length(*length, frame)) return malformed(why);
  for (int i = 0; i < frame.length; ++i) {
    const auto byte = number_of<std::uint8_t>(fields.at(data_ + i), 16);
    if (!byte) return malformed("payload: too few bytes, or an invalid one");
    frame.data[static_cast<std::size_t>(i)] = *byte;
  }
  if (fields.at(direction_) == "Rx") record.direction = Direction::kReceived;
  if (fields.at(direction_) == "Tx") record.direction = Direction::kTransmitted;
  const auto bus = bus_ == kNone ? std::optional(0U) : number_of<unsigned>(fields.at(bus_));
  if (!bus || *bus > kBusMax) return malformed("bus: no number");
  return set_channel(*bus + 1, record) ? LineReader::frame() : malformed(kTooManyBuses);
}

}  // namespace vgyro::canlog
