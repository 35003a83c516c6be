#include "analysis/field.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace vgyro::analysis {

namespace {

constexpr std::size_t kValuesLeast = 8;  // a coarse car sensor on a straight road has a dozen
constexpr double kStepMost = 0.2;        // of the range, rms; of chance 0.41
constexpr double kLeapMost = 0.75;       // of the range: a knock; a wrap leaps across all of it
constexpr double kOneWayMost = 0.9;      // exceeded by counters and values that only grow
constexpr double kCertain = 5.0;         // standard deviations of chance

}  // namespace

FieldFigures field_figures(const std::vector<double>& values) {
  FieldFigures figures;
  if (values.size() < 2) return figures;
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  figures.range = *high - *low;
  std::set<double> different;
  double power = 0.0;
  std::size_t up = 0;
  std::size_t down = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = values[i] - values[i - 1];
    power += step * step;
    figures.leap = std::max(figures.leap, std::abs(step));
    up += step > 0.0 ? 1U : 0U;
    down += step < 0.0 ? 1U : 0U;
    if (different.size() < kValuesCounted) different.insert(values[i]);
  }
  figures.values = different.size();
  figures.step = std::sqrt(power / static_cast<double>(values.size() - 1));
  if (up + down > 0)
    figures.one_way = static_cast<double>(std::max(up, down)) / static_cast<double>(up + down);
  return figures;
}

bool moves_as_a_rate(const FieldFigures& figures) {
  return figures.values >= kValuesLeast && figures.one_way <= kOneWayMost &&
         figures.step <= kStepMost * figures.range && figures.leap <= kLeapMost * figures.range;
}

// If a quantity is cut in two at any bit, the steps of both parts are correlated by −1/6 of a
// squared unit of the upper part; the steps of two independent quantities are not.
bool carries_into(const std::vector<std::int64_t>& raw, unsigned bits) {
  const double unit = std::ldexp(1.0, static_cast<int>(bits));
  double upper_power = 0.0;
  double lower_power = 0.0;
  double product = 0.0;
  for (std::size_t i = 1; i < raw.size(); ++i) {
    const std::int64_t upper = (raw[i] >> bits) - (raw[i - 1] >> bits);
    const auto step = static_cast<double>(raw[i] - raw[i - 1]) / unit;
    const double lower = step - static_cast<double>(upper);
    upper_power += static_cast<double>(upper) * static_cast<double>(upper);
    lower_power += lower * lower;
    product += static_cast<double>(upper) * lower;
  }
  const double chance = std::sqrt(upper_power * lower_power / static_cast<double>(raw.size()));
  return -product > kCertain * chance;
}

}  // namespace vgyro::analysis
