#include "canlog/trc.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>

#include "canlog/text_line.h"
#include "canlog/wall_time.h"

namespace vgyro::canlog {

namespace {

using Columns = TrcReader::Columns;

constexpr std::int64_t kMilli_ns = 1'000'000;
constexpr std::int64_t kMicro_ns = 1'000;
constexpr unsigned kChannelMax = 255;
// A line of version 1.0 has this in place of an identifier to report the state of the bus.
constexpr std::string_view kNoIdentifier = "FFFFFFFF";

// The columns of versions that do not name them. "-" is an ignored column, "N" the number of the
// line.
constexpr std::string_view kColumns10 = "NOILD";
constexpr std::string_view kColumns11 = "NOTILD";
constexpr std::string_view kColumns12 = "NOBTILD";
constexpr std::string_view kColumns13 = "NOBTI-LD";

std::string_view columns_of(unsigned version) {
  switch (version) {
    case 100:
      return kColumns10;
    case 101:
      return kColumns11;
    case 102:
      return kColumns12;
    default:
      return kColumns13;
  }
}

Columns split(std::string_view line, std::string_view letters) {
  Columns columns;
  Words words(line);
  for (const char letter : letters) {
    if (letter == 'D') {
      columns.data = words.rest();
      break;
    }
    const std::string_view word = words.next();
    switch (letter) {
      case 'O':
        columns.time = word;
        break;
      case 'T':
        columns.type = word;
        break;
      case 'B':
        columns.bus = word;
        break;
      case 'I':
        columns.id = word;
        break;
      case 'd':
        columns.direction = word;
        break;
      case 'L':
        columns.dlc = word;
        break;
      case 'l':
        columns.length = word;
        break;
      default:
        break;
    }
  }
  return columns;
}

// Days since 1899-12-30, local time, as a decimal fraction.
std::optional<std::int64_t> ole_date_ns(std::string_view text) {
  double days = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), days);
  // 1970 and 2200.
  constexpr double kDaysMin = 25'569.0;
  constexpr double kDaysMax = 109'575.0;
  if (error != std::errc{} || !(days >= kDaysMin) || !(days < kDaysMax)) return std::nullopt;
  constexpr std::int64_t kDay_us = 86'400'000'000;
  const double whole = std::floor(days);
  auto micros = static_cast<std::int64_t>(std::llround((days - whole) * 86'400e6));
  // PEAK's own dates have ten digits, or 9 µs, for times in whole milliseconds.
  const std::size_t point = text.find('.');
  constexpr std::size_t kDigitsOfMillis = 10;
  constexpr std::int64_t kMicrosPerMilli = 1000;
  if (point == text.npos || text.size() - point - 1 <= kDigitsOfMillis) {
    micros = (micros + kMicrosPerMilli / 2) / kMicrosPerMilli * kMicrosPerMilli;
  }
  const std::chrono::sys_days date = std::chrono::sys_days(std::chrono::year(1899) / 12 / 30) +
                                     std::chrono::days(static_cast<int>(whole)) +
                                     std::chrono::days(micros / kDay_us);
  micros %= kDay_us;
  const std::chrono::year_month_day day(date);
  const std::chrono::hh_mm_ss clock{std::chrono::microseconds(micros)};
  WallTime wall{int{day.year()},
                unsigned{day.month()},
                unsigned{day.day()},
                static_cast<unsigned>(clock.hours().count()),
                static_cast<unsigned>(clock.minutes().count()),
                static_cast<unsigned>(clock.seconds().count()),
                clock.subseconds().count() * kMicro_ns};
  return local_to_epoch_ns(wall);
}

// ";   Start time: 18.07.2011 14:25:07.065.0" in version 1.0; other tools use other formats.
std::optional<std::int64_t> start_line_ns(std::string_view text) {
  Words words(text);
  const std::string_view day = words.next();
  std::string_view clock = words.next();
  // The milliseconds are followed by a tenth of one.
  if (std::count(clock.begin(), clock.end(), '.') == 2) clock = clock.substr(0, clock.rfind('.'));
  const auto wall = vector_date(std::string(day) + ' ' + std::string(clock));
  return wall ? local_to_epoch_ns(*wall) : std::nullopt;
}

// Four digits, or eight; python-can also writes seven.
const char* read_id(std::string_view word, can::Frame& frame) {
  constexpr std::size_t kStandardDigits = 4;
  const auto id = number_of<std::uint32_t>(word, 16);
  if (!id) return "identifier: no hex number";
  if (word.size() > kStandardDigits) frame.flags |= can::kExtended;
  if (*id > (frame.has(can::kExtended) ? can::kExtendedIdMax : can::kStandardIdMax)) {
    return "identifier: larger than its kind can be";
  }
  frame.id = *id;
  return nullptr;
}

const char* read_length(const Columns& columns, can::Frame& frame) {
  if (!columns.length.empty()) {
    const auto bytes = number_of<unsigned>(columns.length);
    return bytes ? set_length(*bytes, frame) : "length: no number";
  }
  const auto dlc = number_of<unsigned>(columns.dlc);
  return dlc ? set_dlc(*dlc, frame) : "length code: no number";
}

enum class Type : std::uint8_t { kFrame, kRemote, kError, kOther };

// For version 2: the type of a line, and the flags of FD.
Type type_of(std::string_view word, can::Frame& frame) {
  if (word == "DT") return Type::kFrame;
  if (word == "RR") return Type::kRemote;
  if (word == "ER") return Type::kError;
  if (word.size() != 2 || (word[0] != 'F' && word != "BI")) return Type::kOther;
  if (word != "FD" && word != "FB" && word != "FE" && word != "BI") return Type::kOther;
  frame.flags |= can::kFd;
  if (word == "FB" || word == "BI") frame.flags |= can::kBitRateSwitch;
  if (word == "FE" || word == "BI") frame.flags |= can::kErrorStateIndicator;
  return Type::kFrame;
}

// For version 1: the direction is in the column of the type.
Type type_of_first(const Columns& columns, can::Frame& /*frame*/) {
  if (columns.type == "Error") return Type::kError;
  if (!columns.type.empty() && columns.type != "Rx" && columns.type != "Tx") return Type::kOther;
  return columns.id == kNoIdentifier ? Type::kOther : Type::kFrame;
}

Parsed read_columns(const Columns& columns, unsigned version, LogRecord& record) {
  can::Frame& frame = record.frame;
  const bool first = version < 200;
  const std::string_view direction = first ? columns.type : columns.direction;
  if (direction == "Rx") record.direction = Direction::kReceived;
  if (direction == "Tx") record.direction = Direction::kTransmitted;
  const Type type = first ? type_of_first(columns, frame) : type_of(columns.type, frame);
  if (type == Type::kOther) return {Verdict::kOther, ""};
  if (type == Type::kError) {
    set_error_frame(frame);
    return {Verdict::kFrame, ""};
  }
  if (const char* why = read_id(columns.id, frame)) return {Verdict::kMalformed, why};
  if (const char* why = read_length(columns, frame)) return {Verdict::kMalformed, why};
  if (type == Type::kRemote || columns.data.starts_with("RTR")) {
    frame.flags |= can::kRemote;
    return {Verdict::kFrame, ""};
  }
  Words bytes(columns.data);
  if (const char* why = read_payload(bytes, frame, 16)) return {Verdict::kMalformed, why};
  return {Verdict::kFrame, ""};
}

}  // namespace

bool is_trc_line(std::string_view line) {
  if (line.starts_with(";$FILEVERSION=") || line.starts_with(";$STARTTIME=") ||
      line.starts_with(";$COLUMNS=")) {
    return true;
  }
  // "     1)      1841 0001 8 00 …": version 1.0 has no other mark.
  Words words(line);
  const std::string_view number = words.next();
  if (!number.ends_with(')') || !number_of<unsigned>(number.substr(0, number.size() - 1))) {
    return false;
  }
  LogRecord record;
  const Columns columns = split(line, kColumns10);
  return decimal_time(columns.time, kMilli_ns) &&
         read_columns(columns, 100, record).verdict == Verdict::kFrame;
}

Parsed TrcReader::parse_head(std::string_view line) {
  const auto value_of = [&](std::string_view key) {
    return line.starts_with(key) ? std::optional(trimmed(line.substr(key.size()))) : std::nullopt;
  };
  if (const auto version = value_of(";$FILEVERSION=")) {
    const std::size_t point = version->find('.');
    const auto major = number_of<unsigned>(version->substr(0, point));
    const auto minor =
        point == version->npos ? std::nullopt : number_of<unsigned>(version->substr(point + 1));
    if (!major || !minor || *major < 1 || *major > 2 || *minor > 9) {
      return malformed("version: neither 1.x nor 2.x");
    }
    version_ = *major * 100 + *minor;
  } else if (const auto start = value_of(";$STARTTIME=")) {
    const auto ns = ole_date_ns(*start);
    if (!ns) return malformed("start time: not understood; the stamps count from zero");
    zero_ns_ = *ns;
  } else if (const auto columns = value_of(";$COLUMNS=")) {
    columns_.fill('\0');
    std::size_t count = 0;
    for (const char c : *columns)
      if (c != ',' && count + 1 < columns_.size()) columns_[count++] = c;
  } else if (const std::size_t at = line.find("Start time:"); at != line.npos && version_ == 100) {
    zero_ns_ = start_line_ns(line.substr(at + 11)).value_or(0);
  }
  return head();
}

Parsed TrcReader::parse(std::string_view line, LogRecord& record) {
  line = trimmed(line);
  if (line.empty()) return head();
  if (line.front() == ';') return parse_head(line);
  const std::string_view letters =
      version_ >= 200 ? std::string_view(columns_.data()) : columns_of(version_);
  if (letters.empty()) return malformed("no $COLUMNS before it");
  const Columns columns = split(line, letters);
  const auto time = decimal_time(columns.time, kMilli_ns);
  if (!time) return malformed("stamp: no number");
  const Parsed result = read_columns(columns, version_, record);
  if (result.verdict != Verdict::kFrame) return result;
  const auto channel = columns.bus.empty() || columns.bus == "-" ? std::optional(1U)
                                                                 : number_of<unsigned>(columns.bus);
  if (!channel || *channel < 1 || *channel > kChannelMax) return malformed("bus: no number");
  if (!set_channel(*channel, record)) return malformed(kTooManyBuses);
  if (time->ns > kStampMax_ns - zero_ns_) return malformed("stamp: beyond the year 2255");
  record.stamp = time_from_ns(zero_ns_ + time->ns);
  return result;
}

}  // namespace vgyro::canlog
