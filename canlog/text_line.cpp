#include "canlog/text_line.h"

#include <chrono>

namespace vgyro::canlog {

namespace {
// A stamp beyond this would not fit 64 bits in nanoseconds.
constexpr std::int64_t kStampMax_ns = 9'000'000'000'000'000'000;
}  // namespace

std::optional<DecimalTime> decimal_time(std::string_view text, std::int64_t unit_ns) {
  const std::size_t point = text.find('.');
  const auto whole = number_of<std::int64_t>(text.substr(0, point));
  if (!whole || *whole > kStampMax_ns / unit_ns) return std::nullopt;
  DecimalTime time{*whole * unit_ns, 0};
  if (point == text.npos) return time;
  const std::string_view fraction = text.substr(point + 1);
  if (fraction.empty()) return std::nullopt;
  std::int64_t digit_ns = unit_ns;
  for (const char c : fraction) {
    if (!is_decimal(c)) return std::nullopt;
    digit_ns /= 10;
    time.ns += (c - '0') * digit_ns;
  }
  time.digits = static_cast<unsigned>(fraction.size());
  return time;
}

std::int64_t epoch_seconds(int year, unsigned month, unsigned day, unsigned hour, unsigned minute,
                           unsigned second) {
  const std::chrono::sys_days date =
      std::chrono::year(year) / std::chrono::month(month) / std::chrono::day(day);
  return std::int64_t{date.time_since_epoch().count()} * 86'400 + hour * 3600 + minute * 60 +
         second;
}

}  // namespace vgyro::canlog
