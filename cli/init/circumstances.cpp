#include "cli/init/circumstances.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "cli/init/words.h"
#include "gateway/surroundings.h"
#include "gateway/units.h"

namespace vgyro::cli {

namespace {

using gateway::Dimension;

constexpr double kGapMost_s = 0.5;          // longer gaps are not interpolated
constexpr double kSpeedRateLeast_hz = 2.0;  // the gateway ignores a speed after 1 s
constexpr double kAccRateLeast_hz = 5.0;
constexpr double kSpeedMost_m_s = 150.0;
constexpr double kSameSpeed = 0.03;  // wheels of a car differ by this in bends
constexpr double kStanding_m_s = gateway::Surroundings::kStandingBelow_m_s;

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// --- rest ----------------------------------------------------------------------------------------

std::optional<analysis::Stretch> find_rest(const Candidate& a, const Candidate& b, double sign,
                                           double begin_s) {
  analysis::SeriesBuilder builder;
  std::size_t next = 0;
  for (std::size_t i = 0; i < a.series.t_s.size(); ++i) {
    const double t_s = a.series.t_s[i];
    const auto& other_s = b.series.t_s;
    while (next < other_s.size() && other_s[next] < t_s)
      ++next;
    if (next == 0 || next == other_s.size()) continue;
    const double span_s = other_s[next] - other_s[next - 1];
    if (span_s > kGapMost_s) continue;
    const double share = (t_s - other_s[next - 1]) / span_s;
    const double other =
        b.series.value[next - 1] + share * (b.series.value[next] - b.series.value[next - 1]);
    builder.add(t_s - begin_s, {a.series.value[i], sign * other});
  }
  const auto paired = builder.finish();
  if (paired[0].size() == 0) return std::nullopt;
  return analysis::find_motion(paired).rest;
}

// --- speed ---------------------------------------------------------------------------------------

struct Speed {
  SpeedFound found;
  analysis::StampedSignal series;
  double mean_m_s = 0.0;
  double peak_m_s = 0.0;
  bool named = false;
};

std::optional<Speed> speed_of(const Found& found, const dbc::Signal& signal) {
  const auto unit = gateway::convert_unit(Dimension::kSpeed, signal.unit);
  const std::string name = lower(signal.name) + " " + lower(found.message->name);
  if (!unit || signal.condition || found.stream->frames_per_s() < kSpeedRateLeast_hz)
    return std::nullopt;
  if (has_any(name,
              {"cruise", "target", "limit", "wind", "setspeed", "set_speed", "lead", "relativ"}))
    return std::nullopt;
  Speed speed{{&found, &signal}, series_of(found, signal, unit->scale)};
  if (speed.series.value.empty()) return std::nullopt;
  double least = speed.series.value.front();
  for (const double value : speed.series.value) {
    least = std::min(least, value);
    speed.peak_m_s = std::max(speed.peak_m_s, value);
    speed.mean_m_s += value / static_cast<double>(speed.series.value.size());
  }
  if (speed.peak_m_s > kSpeedMost_m_s || speed.peak_m_s - least <= 0.0) return std::nullopt;
  speed.named = has_any(lower(signal.name), {"veh", "wheel", "whl", "speed", "geschw"});
  return speed;
}

std::optional<double> resting_speed(const Speed& speed, const analysis::Stretch& rest,
                                    double begin_s) {
  std::vector<double> values;
  for (std::size_t i = 0; i < speed.series.t_s.size(); ++i) {
    const double t_s = speed.series.t_s[i] - begin_s;
    if (t_s >= rest.from_s && t_s < rest.to_s) values.push_back(std::abs(speed.series.value[i]));
  }
  if (values.empty()) return std::nullopt;
  return median(std::move(values));
}

/// The speed that most others agree with; of equal ones, a wheel's or the vehicle's by name, then
/// the one that is zero when the gyros rest, then the faster one.
std::optional<SpeedFound> find_speed(const std::vector<Found>& messages,
                                     const std::optional<analysis::Stretch>& rest, double begin_s) {
  std::vector<Speed> speeds;
  for (const Found& found : messages) {
    for (const dbc::Signal& signal : found.message->signals) {
      if (auto speed = speed_of(found, signal)) speeds.push_back(std::move(*speed));
    }
  }
  const Speed* best = nullptr;
  const auto rank = [](const Speed& speed) {
    const bool stands = speed.found.resting_m_s && *speed.found.resting_m_s < kStanding_m_s;
    return std::tuple(stands, speed.found.agreeing, speed.named,
                      speed.found.found->stream->frames_per_s());
  };
  for (Speed& speed : speeds) {
    for (const Speed& other : speeds) {
      const bool same = &other != &speed && std::abs(other.mean_m_s - speed.mean_m_s) <=
                                                kSameSpeed * std::max(speed.mean_m_s, 1.0);
      speed.found.agreeing += same ? 1 : 0;
    }
    if (rest) speed.found.resting_m_s = resting_speed(speed, *rest, begin_s);
    if (best == nullptr || rank(speed) > rank(*best)) best = &speed;
  }
  if (best == nullptr) return std::nullopt;
  return best->found;
}

// --- accelerations -------------------------------------------------------------------------------

/// 0, 1, 2 for x, y, z; nothing if the name has no axis.
std::optional<std::size_t> axis_of(const dbc::Signal& signal) {
  const std::string name = lower(signal.name);
  constexpr std::array kAxes{'x', 'y', 'z'};
  for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
    const std::string end(1, kAxes[axis]);
    if (name.ends_with(end) || name.starts_with(end + "_") || name.starts_with("a" + end) ||
        name.find("_" + end + "_") != name.npos || name.find("acc" + end) != name.npos)
      return axis;
  }
  if (has_any(name, {"longit", "laengs", "längs"})) return 0;
  if (has_any(name, {"lateral", "quer"})) return 1;
  if (has_any(name, {"vertic", "vertik"})) return 2;
  return std::nullopt;
}

double median_magnitude(const AccelerometerFound& with) {
  std::array<analysis::StampedSignal, 3> series;
  std::size_t size = SIZE_MAX;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto unit = gateway::convert_unit(Dimension::kAcceleration, with.axes[axis]->unit);
    series[axis] = series_of(*with.found, *with.axes[axis], unit ? unit->scale : 1.0);
    size = std::min(size, series[axis].value.size());
  }
  std::vector<double> magnitudes;
  for (std::size_t i = 0; i < size; ++i) {
    magnitudes.push_back(std::hypot(series[0].value[i], series[1].value[i], series[2].value[i]));
  }
  return median(std::move(magnitudes));
}

void find_accelerometer(const std::vector<Found>& messages, Circumstances& all) {
  std::string others;
  for (const Found& found : messages) {
    if (found.stream->frames_per_s() < kAccRateLeast_hz) continue;
    AccelerometerFound here{&found};
    std::string names;
    for (const dbc::Signal& signal : found.message->signals) {
      if (!gateway::convert_unit(Dimension::kAcceleration, signal.unit) || signal.condition)
        continue;
      names += fmt::format("{}{}.{}", names.empty() ? "" : ", ", found.message->name, signal.name);
      const auto axis = axis_of(signal);
      if (axis && here.axes[*axis] == nullptr) here.axes[*axis] = &signal;
    }
    if (names.empty()) continue;
    const bool whole =
        here.axes[0] != nullptr && here.axes[1] != nullptr && here.axes[2] != nullptr;
    if (whole) {
      here.magnitude_g = median_magnitude(here);
      const auto off = [](const AccelerometerFound& one) {
        return std::abs(one.magnitude_g - 1.0);
      };
      if (!all.accelerometer || off(here) < off(*all.accelerometer)) all.accelerometer = here;
    } else {
      others += (others.empty() ? "" : ", ") + names;
    }
  }
  if (!all.accelerometer && !others.empty()) {
    all.remarks.push_back(fmt::format(
        "No [accelerometer]: it takes three axes of one message; there are only {}", others));
  }
}

}  // namespace

Circumstances find_circumstances(const std::vector<Found>& messages,
                                 const std::vector<Candidate>& candidates, const Choice& choice,
                                 double begin_s) {
  Circumstances all;
  if (choice.pair) {
    const double sign = choice.pair->likeness.scale < 0.0 ? -1.0 : 1.0;
    all.rest =
        find_rest(candidates[choice.pair->first], candidates[choice.pair->second], sign, begin_s);
  }
  all.speed = find_speed(messages, all.rest, begin_s);
  find_accelerometer(messages, all);
  return all;
}

}  // namespace vgyro::cli
