#include "canlog/asc_writer.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "canlog/frame_fields.h"
#include "canlog/wall_time.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kMicro_ns = 1'000;

using Text = fmt::memory_buffer;

void put_stamp(Text& text, std::int64_t ns, unsigned digits) {
  auto to = std::back_inserter(text);
  if (digits == 9) {
    fmt::format_to(to, "{:>4}.{:09} ", ns / kSecond_ns, ns % kSecond_ns);
  } else {
    fmt::format_to(to, "{:>4}.{:06} ", ns / kSecond_ns, ns % kSecond_ns / kMicro_ns);
  }
}

void put_bytes(Text& text, const can::Frame& frame) {
  for (std::size_t i = 0; i < frame.length; ++i)
    fmt::format_to(std::back_inserter(text), " {:02X}", frame.data[i]);
}

std::string id_text(const can::Frame& frame) {
  return fmt::format("{:X}{}", frame.id, frame.has(can::kExtended) ? "x" : "");
}

void put_classic(Text& text, const can::Frame& frame, unsigned channel, const char* direction) {
  auto to = std::back_inserter(text);
  const bool remote = frame.has(can::kRemote);
  fmt::format_to(to, "{}  {:<15} {:<4} {} {:x}", channel, id_text(frame), direction,
                 remote ? 'r' : 'd', frame.length);
  if (!remote) put_bytes(text, frame);
}

// Columns as in python-can: name (none), BRS, ESI, code, length, bytes, duration, bits, flags, CRC,
// bit timings.
void put_fd(Text& text, const can::Frame& frame, unsigned channel, const char* direction) {
  constexpr unsigned kFdFlag = 1U << 12U;
  constexpr unsigned kRateSwitchFlag = 1U << 13U;
  constexpr unsigned kErrorStateFlag = 1U << 14U;
  const bool rate_switch = frame.has(can::kBitRateSwitch);
  const bool error_state = frame.has(can::kErrorStateIndicator);
  auto to = std::back_inserter(text);
  fmt::format_to(to, "CANFD {:>3} {:<4} {:>9} {:>32} {:d} {:d} {:x} {:>2}", channel, direction,
                 id_text(frame), "", rate_switch, error_state, dlc_of(frame.length), frame.length);
  put_bytes(text, frame);
  fmt::format_to(
      to, " {:>8} {:>4} {:>8X} {:>8} {:>8} {:>8} {:>8} {:>8}", 0, 0,
      kFdFlag | (rate_switch ? kRateSwitchFlag : 0U) | (error_state ? kErrorStateFlag : 0U), 0, 0,
      0, 0, 0);
}

}  // namespace

void AscWriter::begin(TimePoint first) {
  const std::int64_t ns = std::max<std::int64_t>(to_ns(first), 0);
  zero_ns_ = ns - ns % kSecond_ns;
  const std::string date = to_vector_date(*zero_ns_);
  sink_.write(
      fmt::format("date {}\nbase hex  timestamps absolute\ninternal events logged\n"
                  "Begin Triggerblock {}\n   0.000000 Start of measurement\n",
                  date, date));
}

void AscWriter::put(const LogRecord& record, std::string_view bus, const XlFrame* /*xl*/) {
  if (record.is_xl) return omit("CAN XL frames");
  if (!zero_ns_) begin(record.stamp);
  const std::int64_t since_ns = to_ns(record.stamp) - *zero_ns_;
  if (since_ns < 0) return omit("frames stamped before the second of the first frame");
  Text text;
  put_stamp(text, since_ns,
            options_.fraction_digits != 0 ? options_.fraction_digits : record.fraction_digits);
  const unsigned channel = channels_.channel_of(bus);
  const char* direction = record.direction == Direction::kTransmitted ? "Tx" : "Rx";
  if (record.frame.has(can::kError)) {
    fmt::format_to(std::back_inserter(text), "{}  ErrorFrame", channel);
  } else if (record.frame.has(can::kFd)) {
    put_fd(text, record.frame, channel, direction);
  } else {
    // asc2log drops a classic frame with such a code, python-can reads it as one of 64 bytes.
    if (record.frame.raw_dlc > 0) omit("length codes above 8 of classic frames");
    put_classic(text, record.frame, channel, direction);
  }
  text.push_back('\n');
  sink_.write({text.data(), text.size()});
}

void AscWriter::finish() {
  if (!zero_ns_) begin({});
  sink_.write("End TriggerBlock\n");
}

}  // namespace vgyro::canlog
