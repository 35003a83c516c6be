#include "canlog/wall_time.h"

#include <array>
#include <ctime>

#include <fmt/core.h>

#include "base/spelling.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr int kYearMin = 1970;
constexpr int kYearMax = 2200;

constexpr std::array<std::string_view, 12> kMonths{"jan", "feb", "mar", "apr", "may", "jun",
                                                   "jul", "aug", "sep", "oct", "nov", "dec"};
struct MonthName {
  std::string_view name;
  unsigned month;
};
// In UTF-8 and in the Windows code page.
constexpr std::array kGermanMonths{MonthName{"m\xC3\xA4r", 3}, MonthName{"m\xE4r", 3},
                                   MonthName{"mrz", 3},        MonthName{"mai", 5},
                                   MonthName{"okt", 10},       MonthName{"dez", 12}};

// Zero for any other word.
unsigned month_of(const std::string& word) {
  for (unsigned i = 0; i < kMonths.size(); ++i)
    if (word.starts_with(kMonths[i])) return i + 1;
  for (const MonthName& german : kGermanMonths)
    if (word.starts_with(german.name)) return german.month;
  return 0;
}

// "22:13:20.123"
bool read_clock(std::string_view text, WallTime& wall) {
  const std::size_t first = text.find(':');
  const std::size_t second = first == text.npos ? first : text.find(':', first + 1);
  if (second == text.npos) return false;
  const auto hour = number_of<unsigned>(text.substr(0, first));
  const auto minute = number_of<unsigned>(text.substr(first + 1, second - first - 1));
  const auto seconds = decimal_time(text.substr(second + 1), kSecond_ns);
  if (!hour || !minute || !seconds) return false;
  wall.hour = *hour;
  wall.minute = *minute;
  wall.second = static_cast<unsigned>(seconds->ns / kSecond_ns);
  wall.ns = seconds->ns % kSecond_ns;
  return wall.hour < 24 && wall.minute < 60 && seconds->ns < 61 * kSecond_ns;
}

// "14.11.2023"
bool read_dotted_day(std::string_view text, WallTime& wall) {
  const std::size_t first = text.find('.');
  const std::size_t second = first == text.npos ? first : text.find('.', first + 1);
  if (second == text.npos) return false;
  const auto day = number_of<unsigned>(text.substr(0, first));
  const auto month = number_of<unsigned>(text.substr(first + 1, second - first - 1));
  const auto year = number_of<int>(text.substr(second + 1));
  if (!day || !month || !year) return false;
  wall.day = *day;
  wall.month = *month;
  wall.year = *year;
  return true;
}

bool is_possible(const WallTime& wall) {
  return wall.year >= kYearMin && wall.year <= kYearMax && wall.month >= 1 && wall.month <= 12 &&
         wall.day >= 1 && wall.day <= 31;
}

// Twelve o'clock begins each half of the day.
bool set_half_of_day(std::string_view half, WallTime& wall) {
  constexpr unsigned kNoon = 12;
  if (wall.hour < 1 || wall.hour > kNoon) return false;
  wall.hour = wall.hour % kNoon + (half == "pm" ? kNoon : 0);
  return true;
}

}  // namespace

std::optional<std::int64_t> local_to_epoch_ns(const WallTime& wall) {
  if (!is_possible(wall)) return std::nullopt;
  constexpr int kTmYearZero = 1900;
  std::tm local{};
  local.tm_year = wall.year - kTmYearZero;
  local.tm_mon = static_cast<int>(wall.month) - 1;
  local.tm_mday = static_cast<int>(wall.day);
  local.tm_hour = static_cast<int>(wall.hour);
  local.tm_min = static_cast<int>(wall.minute);
  local.tm_sec = static_cast<int>(wall.second);
  local.tm_isdst = -1;
  const std::time_t seconds = std::mktime(&local);
  if (seconds < 0) return std::nullopt;
  return std::int64_t{seconds} * kSecond_ns + wall.ns;
}

std::optional<WallTime> iso_date(std::string_view text) {
  constexpr std::size_t kDayLetters = 10;
  if (text.size() < kDayLetters || text[4] != '-' || text[7] != '-') return std::nullopt;
  WallTime wall;
  const auto year = number_of<int>(text.substr(0, 4));
  const auto month = number_of<unsigned>(text.substr(5, 2));
  const auto day = number_of<unsigned>(text.substr(8, 2));
  if (!year || !month || !day) return std::nullopt;
  wall.year = *year;
  wall.month = *month;
  wall.day = *day;
  const std::string_view clock = trimmed(text.substr(kDayLetters));
  if (!is_possible(wall) || !read_clock(clock, wall)) return std::nullopt;
  return wall;
}

std::optional<WallTime> vector_date(std::string_view text) {
  WallTime wall;
  bool has_clock = false;
  bool has_day = false;
  bool has_month = false;
  bool has_year = false;
  std::string half;
  Words words(text);
  for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
    const std::string name = lower(word);
    if (word.find(':') != word.npos) {
      has_clock = read_clock(word, wall);
    } else if (name == "am" || name == "pm") {
      half = name;
    } else if (read_dotted_day(word, wall)) {
      has_day = has_month = has_year = true;
    } else if (const auto number = number_of<unsigned>(word)) {
      constexpr std::size_t kYearDigits = 4;
      if (word.size() == kYearDigits) {
        wall.year = static_cast<int>(*number);
        has_year = true;
      } else {
        wall.day = *number;
        has_day = true;
      }
    } else if (const unsigned month = month_of(name); month != 0 && !has_month) {
      wall.month = month;
      has_month = true;
    }
  }
  if (!has_clock || !has_day || !has_month || !has_year || !is_possible(wall)) return std::nullopt;
  if (!half.empty() && !set_half_of_day(half, wall)) return std::nullopt;
  return wall;
}

std::string to_vector_date(std::int64_t epoch_ns) {
  constexpr std::array<const char*, 7> kDayNames{"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array<const char*, 12> kMonthNames{"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                                    "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  constexpr std::int64_t kMilli_ns = 1'000'000;
  const std::time_t seconds = epoch_ns / kSecond_ns;
  std::tm local{};
  ::localtime_r(&seconds, &local);
  const int hour = local.tm_hour % 12 == 0 ? 12 : local.tm_hour % 12;
  return fmt::format("{} {} {} {:02}:{:02}:{:02}.{:03} {} {}",
                     kDayNames[static_cast<std::size_t>(local.tm_wday)],
                     kMonthNames[static_cast<std::size_t>(local.tm_mon)], local.tm_mday, hour,
                     local.tm_min, local.tm_sec, epoch_ns % kSecond_ns / kMilli_ns,
                     local.tm_hour < 12 ? "AM" : "PM", 1900 + local.tm_year);
}

}  // namespace vgyro::canlog
