#include "tests/canlog/opened_log.h"

#include "canlog/unpack.h"

namespace vgyro::canlog {

ReadLog read_whole(LogReader& reader) {
  ReadLog log;
  LogRecord record;
  while (reader.next(record)) {
    ReadRecord read{
        to_ns(record.stamp), reader.interfaces().name(record.bus),       record.fraction_digits,
        record.direction,    record.is_xl ? can::Frame{} : record.frame, {}};
    if (record.is_xl) read.xl.push_back(*reader.xl_frame());
    log.records.push_back(std::move(read));
  }
  if (reader.next(record)) log.error = "next() went on behind the end";
  log.counts = reader.counts();
  log.interfaces = reader.interfaces().names();
  if (reader.error()) log.error = reader.error()->message();
  return log;
}

ReadLog open_and_read(const std::string& bytes, std::size_t chunk) {
  auto plain = unpacked(bytes_from_text(bytes, chunk));
  auto reader = plain ? open_log(std::move(*plain)) : tl::unexpected(plain.error());
  if (reader) return read_whole(**reader);
  ReadLog log;
  log.error = reader.error().message();
  return log;
}

std::vector<std::string> as_candump(const ReadLog& log) {
  std::vector<std::string> lines;
  for (const ReadRecord& record : log.records) {
    char text[kLineBytesMax];
    const std::size_t size =
        format_line(text, time_from_ns(record.stamp_ns), record.interface, record.frame,
                    static_cast<unsigned>(record.fraction_digits), record.direction);
    lines.emplace_back(text, size - 1);
  }
  return lines;
}

}  // namespace vgyro::canlog
