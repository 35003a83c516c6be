#include "tests/canlog/log_text.h"

#include <algorithm>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "canlog/text_line.h"

namespace vgyro::canlog {

bool operator==(const XlFrame& a, const XlFrame& b) {
  return std::tie(a.priority, a.vcid, a.flags, a.sdt, a.acceptance, a.length) ==
             std::tie(b.priority, b.vcid, b.flags, b.sdt, b.acceptance, b.length) &&
         std::equal(a.data.begin(), a.data.begin() + a.length, b.data.begin());
}

bool operator==(const ReadRecord& a, const ReadRecord& b) {
  return std::tie(a.stamp_ns, a.interface, a.fraction_digits, a.direction) ==
             std::tie(b.stamp_ns, b.interface, b.fraction_digits, b.direction) &&
         a.frame == b.frame && a.xl == b.xl;
}

std::ostream& operator<<(std::ostream& out, const ReadRecord& record) {
  const can::Frame& frame = record.frame;
  const bool is_xl = !record.xl.empty();
  const auto* data = is_xl ? record.xl[0].data.data() : frame.data.data();
  const std::size_t length = is_xl ? record.xl[0].length : frame.length;
  return out << fmt::format("{} ns {} id {:X} flags {:02X} length {} raw DLC {} XL {} {:02X}",
                            record.stamp_ns, record.interface,
                            is_xl ? record.xl[0].priority : frame.id, frame.flags, length,
                            frame.raw_dlc, is_xl, fmt::join(data, data + length, " "));
}

namespace {

ReadRecord with_name(const LogRecord& record, const InterfaceTable& interfaces, const XlFrame& xl) {
  return {to_ns(record.stamp),
          interfaces.name(record.bus),
          record.fraction_digits,
          record.direction,
          record.is_xl ? can::Frame{} : record.frame,
          record.is_xl ? std::vector<XlFrame>{xl} : std::vector<XlFrame>{}};
}

}  // namespace

ReadLog read_all(std::unique_ptr<LogSource> source) {
  ReadLog log;
  CandumpReader reader(std::move(source));
  LogRecord record;
  while (reader.next(record))
    log.records.push_back(with_name(record, reader.interfaces(), reader.xl()));
  // next() must stay false at the end.
  if (reader.next(record)) log.error = "next() went on behind the end";
  log.counts = reader.counts();
  log.interfaces = reader.interfaces().names();
  if (reader.error()) log.error = reader.error()->message();
  return log;
}

ReadLog read_text(const std::string& text, std::size_t chunk) {
  return read_all(log_from_text(text, chunk));
}

ReadLog read_by_parse_line(const std::string& text) {
  ReadLog log;
  InterfaceTable interfaces;
  LogRecord record;
  XlFrame xl;
  std::size_t at = 0;
  for (std::size_t end = text.find('\n'); end != text.npos; end = text.find('\n', at)) {
    ++log.counts.lines;
    const LineResult result = parse_line(
        clean_line(std::string_view(text).substr(at, end - at), log.counts.skipped_bytes),
        interfaces, record, xl);
    at = end + 1;
    if (result.kind == LineKind::kFrame) ++log.counts.frames;
    if (result.kind == LineKind::kXl) ++log.counts.xl_frames;
    if (result.kind == LineKind::kOther) ++log.counts.other_lines;
    if (result.kind == LineKind::kMalformed) {
      ++log.counts.malformed_lines;
      if (log.counts.first_malformed.size() < LogCounts::kFirstMalformedMax) {
        log.counts.first_malformed.push_back({log.counts.lines, result.why});
      }
      continue;
    }
    if (result.kind != LineKind::kOther) log.records.push_back(with_name(record, interfaces, xl));
  }
  if (at < text.size()) ++log.counts.cut_off_lines;
  log.interfaces = interfaces.names();
  return log;
}

std::vector<std::string> malformed(const LogCounts& counts) {
  std::vector<std::string> lines;
  for (const MalformedLine& line : counts.first_malformed)
    lines.push_back(fmt::format("{}: {}", line.line, line.why));
  return lines;
}

std::string told(const LogCounts& counts) {
  return fmt::format(
      "{} lines, {} frames, {} XL, {} other, {} malformed, {} cut off, {} skipped; {}",
      counts.lines, counts.frames, counts.xl_frames, counts.other_lines, counts.malformed_lines,
      counts.cut_off_lines, counts.skipped_bytes, fmt::join(malformed(counts), "; "));
}

can::Frame frame_with(std::uint32_t id, unsigned flags, std::vector<std::uint8_t> bytes) {
  can::Frame frame;
  frame.id = id;
  frame.flags = static_cast<std::uint8_t>(flags);
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

can::Frame random_frame(std::mt19937_64& random) {
  can::Frame frame;
  const auto below = [&random](std::size_t n) { return static_cast<unsigned>(random() % n); };
  const unsigned kind = below(8);
  const bool extended = below(2) == 1;
  frame.id =
      static_cast<std::uint32_t>(random()) & (extended ? can::kExtendedIdMax : can::kStandardIdMax);
  frame.flags = extended ? can::kExtended : 0;
  frame.length = static_cast<std::uint8_t>(below(3) == 0 ? below(9) : 8);
  if (kind == 0) frame.flags |= can::kRemote;
  if (kind == 1) {
    frame.id = static_cast<std::uint32_t>(random()) & can::kExtendedIdMax;
    frame.flags = can::kError;
  }
  if (kind == 2 || kind == 3) {
    frame.flags |= can::kFd;
    if (below(2) == 1) frame.flags |= can::kBitRateSwitch;
    if (below(2) == 1) frame.flags |= can::kErrorStateIndicator;
    frame.length = static_cast<std::uint8_t>(can::fd_padded_length(below(65)));
  }
  if ((kind < 2 || kind == 4) && frame.length == 8 && below(2) == 1) {
    frame.raw_dlc = static_cast<std::uint8_t>(9 + below(7));
  }
  for (std::size_t i = 0; i < frame.length && !frame.has(can::kRemote); ++i)
    frame.data[i] = static_cast<std::uint8_t>(random());
  return frame;
}

XlFrame random_xl_frame(std::mt19937_64& random) {
  XlFrame xl;
  xl.priority = random() & can::kStandardIdMax;
  xl.vcid = static_cast<std::uint8_t>(random());
  xl.flags = static_cast<std::uint8_t>(random());
  xl.sdt = static_cast<std::uint8_t>(random());
  xl.acceptance = static_cast<std::uint32_t>(random());
  xl.length = static_cast<std::uint16_t>(1 + random() % kXlBytesMax);
  for (std::size_t i = 0; i < xl.length; ++i)
    xl.data[i] = static_cast<std::uint8_t>(random());
  return xl;
}

}  // namespace vgyro::canlog
