#include "canlog/text_line.h"

namespace vgyro::canlog {

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

}  // namespace vgyro::canlog
