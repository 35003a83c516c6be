#include "simulation/profile.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "base/file.h"
#include "base/spelling.h"

namespace vgyro::simulation {

namespace {

struct Column {
  std::string_view name;
  double minimum;
  double maximum;
  bool required;
};
constexpr std::size_t kTime = 0;
constexpr std::size_t kRate = 1;
constexpr std::size_t kTemperature = 2;
constexpr std::size_t kAcceleration = 3;
constexpr std::size_t kSupply = 6;
constexpr std::size_t kOtherRates = 7;
constexpr std::array<Column, 10> kColumns{{{"t_s", -1e9, 1e9, true},
                                           {"rate_dps", -1e5, 1e5, false},
                                           {"temperature_c", -273.15, 1000.0, false},
                                           {"acc_x_g", -1000.0, 1000.0, false},
                                           {"acc_y_g", -1000.0, 1000.0, false},
                                           {"acc_z_g", -1000.0, 1000.0, false},
                                           {"supply_v", 0.0, 1000.0, false},
                                           {"rate_x_dps", -1e5, 1e5, false},
                                           {"rate_y_dps", -1e5, 1e5, false},
                                           {"rate_z_dps", -1e5, 1e5, false}}};
static_assert(kColumns[kTemperature].name == "temperature_c" &&
              kColumns[kAcceleration].name == "acc_x_g" && kColumns[kSupply].name == "supply_v" &&
              kColumns[kOtherRates].name == "rate_x_dps");
constexpr const char* kHeaderForm =
    "t_s,rate_dps[,temperature_c][,acc_x_g,acc_y_g,acc_z_g][,supply_v]"
    "[,rate_x_dps,rate_y_dps,rate_z_dps]";
// Temperature, acceleration and voltage are from sensors with noise of their own.
constexpr std::size_t kSlowPoints = 6;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin);
}

// Splits off the text before the next `separator`.
std::string_view take(std::string_view& rest, char separator) {
  const std::size_t end = std::min(rest.find(separator), rest.size());
  const std::string_view part = rest.substr(0, end);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return part;
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  const auto commas = std::count(line.begin(), line.end(), ',');
  for (auto i = 0 * commas; i <= commas; ++i)
    cells.push_back(trimmed(take(line, ',')));
  return cells;
}

std::string suggestion(std::string_view name) {
  std::vector<std::string> names;
  names.reserve(kColumns.size());
  for (const Column& column : kColumns)
    names.emplace_back(column.name);
  return suggest_name(name, names);
}

class Table {
 public:
  Table(std::string_view text, const std::string& file) : rest_(text), file_(file) {}

  Expected<void> read();
  [[nodiscard]] const std::vector<double>& column(std::size_t i) const { return values_[i]; }
  [[nodiscard]] bool has(std::size_t i) const {
    return std::find(order_.begin(), order_.end(), i) != order_.end();
  }

 private:
  bool next_line(std::string_view& line);
  Expected<void> read_header(std::string_view line);
  Expected<void> read_row(std::string_view line);
  [[nodiscard]] Expected<double> number(const Column& column, std::string_view cell) const;
  [[nodiscard]] std::string here() const { return at_line(file_, line_); }

  std::string_view rest_;
  const std::string& file_;
  unsigned line_ = 0;
  std::vector<std::size_t> order_;  ///< cell → column
  std::array<std::vector<double>, kColumns.size()> values_;
};

// Skips blank lines and comments.
bool Table::next_line(std::string_view& line) {
  while (!rest_.empty()) {
    ++line_;
    line = trimmed(take(rest_, '\n'));
    if (!line.empty() && line.front() != '#') return true;
  }
  return false;
}

Expected<void> Table::read_header(std::string_view line) {
  const bool other_separator = line.find(',') == std::string_view::npos &&
                               line.find_first_of("; \t") != std::string_view::npos;
  if (other_separator) return fail(here(), "the columns are not separated by commas", kHeaderForm);
  for (const std::string_view name : cells_of(line)) {
    const auto* const column = std::find_if(kColumns.begin(), kColumns.end(),
                                            [&](const Column& c) { return c.name == name; });
    if (column == kColumns.end()) {
      const char first = name.empty() ? 'x' : name.front();
      const bool is_number = (first >= '0' && first <= '9') || first == '-' || first == '.';
      return is_number ? fail(here(), "the header line is missing", kHeaderForm)
                       : fail(here(), fmt::format("unknown column \"{}\"", name), suggestion(name));
    }
    const auto i = static_cast<std::size_t>(column - kColumns.begin());
    if (has(i)) return fail(here(), fmt::format("column {} is there twice", name));
    order_.push_back(i);
  }
  for (std::size_t i = 0; i < kColumns.size(); ++i) {
    const bool stands_in =
        i == kRate && (has(kOtherRates) || has(kOtherRates + 1) || has(kOtherRates + 2));
    if ((!kColumns[i].required && i != kRate) || has(i) || stands_in) continue;
    return fail(here(), fmt::format("column {} is missing", kColumns[i].name), kHeaderForm);
  }
  return {};
}

Expected<double> Table::number(const Column& column, std::string_view cell) const {
  double value = 0.0;
  const bool plus = cell.starts_with('+');
  const char* const begin = cell.data() + (plus ? 1 : 0);
  const char* const end = cell.data() + cell.size();
  const auto [stop, trouble] = std::from_chars(begin, end, value);
  if (trouble != std::errc() || stop != end) {
    return fail(here(), fmt::format("{} is \"{}\"", column.name, cell),
                "a number with a decimal point");
  }
  if (value >= column.minimum && value <= column.maximum) return value;
  return fail(here(), fmt::format("{} is {}", column.name, cell),
              fmt::format("{:g} to {:g}", column.minimum, column.maximum));
}

Expected<void> Table::read_row(std::string_view line) {
  const std::vector<std::string_view> cells = cells_of(line);
  if (cells.size() != order_.size()) {
    return fail(here(), fmt::format("has {} values", cells.size()),
                fmt::format("the header has {} columns", order_.size()));
  }
  if (values_[kTime].size() == kProfileRowsMax) {
    return fail(here(), "the profile is too long", fmt::format("at most {} rows", kProfileRowsMax));
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto value = number(kColumns[order_[i]], cells[i]);
    if (!value) return tl::unexpected(value.error());
    values_[order_[i]].push_back(*value);
  }
  const std::vector<double>& times_s = values_[kTime];
  const std::size_t rows = times_s.size();
  if (rows < 2 || times_s[rows - 1] > times_s[rows - 2]) return {};
  return fail(here(),
              fmt::format("t_s is {}, which is not after {}", times_s[rows - 1], times_s[rows - 2]),
              "times must grow from row to row");
}

Expected<void> Table::read() {
  if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
  std::string_view line;
  if (!next_line(line)) return fail(file_, "is empty", kHeaderForm);
  if (auto good = read_header(line); !good) return good;
  while (next_line(line)) {
    if (auto good = read_row(line); !good) return good;
  }
  const std::size_t rows = values_[kTime].size();
  if (rows >= 2) return {};
  return fail(file_, fmt::format("has {} rows of values", rows), "a motion needs at least two");
}

}  // namespace

bool Profile::has_acceleration() const {
  return std::any_of(acceleration_g.begin(), acceleration_g.end(),
                     [](const std::optional<Curve>& axis) { return axis.has_value(); });
}

Expected<Profile> parse_profile(std::string_view text, const std::string& file) {
  Table table(text, file);
  if (const auto good = table.read(); !good) return tl::unexpected(good.error());
  std::vector<double> times_s = table.column(kTime);
  const double begin_s = times_s.front();
  for (double& t_s : times_s)
    t_s -= begin_s;
  const std::vector<double> still(times_s.size(), 0.0);
  const std::size_t upright = kOtherRates + 2;
  const std::vector<double>& rate_dps =
      table.has(kRate) ? table.column(kRate) : (table.has(upright) ? table.column(upright) : still);
  Profile profile{.file = file,
                  .length_s = times_s.back(),
                  .has_rate = table.has(kRate),
                  .rate_dps = Curve(times_s, rate_dps),
                  .temperature_c = {},
                  .acceleration_g = {},
                  .supply_v = {},
                  .other_rate_dps = {}};
  if (table.has(kTemperature))
    profile.temperature_c = Curve(times_s, table.column(kTemperature), kSlowPoints);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!table.has(kAcceleration + axis)) continue;
    profile.acceleration_g[axis] = Curve(times_s, table.column(kAcceleration + axis), kSlowPoints);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (table.has(kOtherRates + axis))
      profile.other_rate_dps[axis] = Curve(times_s, table.column(kOtherRates + axis));
  }
  if (table.has(kSupply)) profile.supply_v = Curve(times_s, table.column(kSupply), kSlowPoints);
  return profile;
}

Profile turned(const Profile& profile, const std::array<double, 3>& rate,
               const std::array<std::array<double, 3>, 3>& others) {
  const auto mixed = [&](const std::array<double, 3>& share) {
    std::vector<std::pair<double, const Curve*>> parts;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& curve = profile.other_rate_dps[axis];
      if (curve && share[axis] != 0.0) parts.emplace_back(share[axis], &*curve);
    }
    return Curve::mixed(profile.rate_dps, parts);
  };
  Profile own = profile;
  own.rate_dps = mixed(rate);
  for (std::size_t axis = 0; axis < 3; ++axis)
    own.other_rate_dps[axis] = mixed(others[axis]);
  return own;
}

Expected<Profile> load_profile(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return tl::unexpected(text.error());
  return parse_profile(*text, path);
}

}  // namespace vgyro::simulation
