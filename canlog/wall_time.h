#pragma once

// Dates as other tools write them: local time, without the zone. They are read in the zone of this
// process (TZ), as by the tools that write them.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace vgyro::canlog {

struct WallTime {
  int year = 1970;
  unsigned month = 1;
  unsigned day = 1;
  unsigned hour = 0;
  unsigned minute = 0;
  unsigned second = 0;
  std::int64_t ns = 0;  ///< within the second
};

/// Nanoseconds since the epoch; nothing before 1970 or beyond 2200.
std::optional<std::int64_t> local_to_epoch_ns(const WallTime& wall);

/// "2023-11-14 22:13:20.123456"; the fraction is optional.
std::optional<WallTime> iso_date(std::string_view text);

/// The text after "date" in files of Vector's tools: "Tue Nov 14 10:13:20.123 pm 2023", "Die Nov 14
/// 22:13:20.123 2023", in English or German, with or without fraction and am/pm; or "14.11.2023
/// 22:13:20.123".
std::optional<WallTime> vector_date(std::string_view text);

/// "Tue Nov 14 10:13:20.000 PM 2023", which Vector's tools, python-can and asc2log read.
std::string to_vector_date(std::int64_t epoch_ns);

}  // namespace vgyro::canlog
