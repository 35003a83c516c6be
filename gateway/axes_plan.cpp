#include "gateway/axes_plan.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include <fmt/core.h>

#include "base/angle.h"
#include "gateway/model_plan.h"

namespace vgyro::gateway {

namespace {

const GyroPlan* sensor_axis(const GyroPlan& unit, std::size_t axis) {
  const auto found = std::find_if(unit.axes.begin(), unit.axes.end(),
                                  [&](const GyroPlan& one) { return one.sensor_axis == axis; });
  return found == unit.axes.end() ? nullptr : &*found;
}

bool tells(const GyroPlan& unit, std::size_t axis) {
  for (std::size_t sensor = 0; sensor < kAxes; ++sensor) {
    const bool missed = std::abs(unit.mount.at(axis, sensor)) > kShareMissed;
    if (missed && sensor_axis(unit, sensor) == nullptr) return false;
  }
  return true;
}

std::string names_of(const std::vector<std::size_t>& axes) {
  std::string text;
  for (const std::size_t axis : axes)
    text += fmt::format("{}{}", text.empty() ? "" : ", ", kAxisNames[axis]);
  return text.empty() ? "none" : text;
}

std::vector<std::size_t> axes_of(const GyroPlan& unit) {
  std::vector<std::size_t> axes;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (tells(unit, axis)) axes.push_back(axis);
  }
  return axes;
}

// Assigns a sensor axis to each axis of the vehicle, each once and as parallel as possible: health
// and known effects of a pair are those of its two sensor axes.
std::array<std::size_t, kAxes> nearest_sensors(const GyroPlan& unit,
                                               const std::vector<std::size_t>& axes) {
  std::array<std::size_t, kAxes> order{0, 1, 2};
  std::array<std::size_t, kAxes> best = order;
  double best_product = -1.0;
  do {
    double product = 1.0;
    for (const std::size_t axis : axes) {
      const bool there = sensor_axis(unit, order[axis]) != nullptr;
      product *= there ? std::abs(unit.mount.at(axis, order[axis])) : 0.0;
    }
    if (product <= best_product) continue;
    best_product = product;
    best = order;
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

// --- one axis ------------------------------------------------------------------------------------

GyroPlan gyro_about(const GyroPlan& unit, std::size_t axis, std::size_t sensor) {
  GyroPlan gyro = *sensor_axis(unit, sensor);
  gyro.mount = unit.mount;
  gyro.flipped = unit.mount.at(axis, sensor) < 0.0;
  if (gyro.flipped) gyro.rate.scale = -gyro.rate.scale;
  if (gyro.flipped) gyro.rate.shift = -gyro.rate.shift;
  gyro.axes.clear();
  return gyro;
}

bool depends_on_other_axes(const model::Effect& effect) {
  return (model::info(effect.kind).needs & model::kNeedsOtherAxes) != 0;
}

// The effects of these two sensor axes, and those of the whole units.
model::Model effects_about(const model::Model& model, const Plan& pair) {
  model::Model own{.file = model.file, .effects = {}};
  std::copy_if(model.effects.begin(), model.effects.end(), std::back_inserter(own.effects),
               [&](const model::Effect& effect) {
                 return !effect.of_axis || *effect.of_axis == pair.gyros[effect.gyro].sensor_axis;
               });
  return own;
}

// A cross-axis effect needs a rate that is in the same frame, so the pair's own input reads it.
void read_other_axes(const model::Model& model, const Plan& platform, Plan& pair) {
  for (const model::Effect& effect : model.effects) {
    if (!depends_on_other_axes(effect)) continue;
    name_other_axis(platform.gyros[effect.gyro], static_cast<std::size_t>(effect.parameters[0]),
                    pair.gyros[effect.gyro]);
  }
}

void set_true_rate(const CalibrationPlan& configured, std::size_t place, std::size_t axis,
                   CalibrationPlan& calibration) {
  if (!configured.axis_rate_dps.empty()) {
    calibration.rate_dps = configured.axis_rate_dps[place];
  } else if (!configured.latitude_deg) {
    calibration.rate_dps = 0.0;
    calibration.doubt_dps = kEarthRate_dps / std::sqrt(3.0);
  } else {
    const double up_dps = kEarthRate_dps * std::sin(*configured.latitude_deg * kRadPerDeg);
    const double north_dps = kEarthRate_dps * std::cos(*configured.latitude_deg * kRadPerDeg);
    const double heading_rad = configured.heading_deg.value_or(0.0) * kRadPerDeg;
    const bool known = axis == 2 || configured.heading_deg.has_value();
    const std::array<double, kAxes> rate_dps{north_dps * std::cos(heading_rad),
                                             north_dps * std::sin(heading_rad), up_dps};
    calibration.rate_dps = known ? rate_dps[axis] : 0.0;
    calibration.doubt_dps = known ? 0.0 : north_dps / std::sqrt(2.0);
  }
  calibration.stop_rate_dps = calibration.rate_dps;
  // A reference gives the true rate during the calibration only, not at later stops.
  const bool is_told = !configured.axis_rate_dps.empty() || configured.latitude_deg;
  if (!configured.from_reference || is_told) return;
  calibration.stop_rate_dps = std::nullopt;
  calibration.doubt_dps = 0.0;
}

// Keeps the reference's rate about this axis, or drops the reference if it has none.
void set_reference(std::size_t axis, Plan& pair) {
  if (!pair.reference) return;
  if (const auto rate = pair.reference->axes[axis]) {
    pair.reference->rate = *rate;
  } else {
    pair.reference.reset();
  }
}

void set_output(const OutputPlan& configured, std::size_t axis, OutputPlan& output) {
  const auto step = static_cast<std::uint32_t>(axis) * kAxisIdStep;
  output.rate_id = configured.rate_id + step;
  output.bias_id = configured.bias_id + step;
  output.model_id = configured.model_id + step;
  output.layouts.clear();  // they belong to the platform
}

void set_noise(Plan& pair) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    fusion::GyroParameters& known = pair.corrector.gyros[gyro];
    known = {};
    known.resolution_dps = pair.gyros[gyro].rate.step;
    known.max_bias_dps = pair.gyros[gyro].max_bias_dps;
    known.learns_temperature = pair.gyros[gyro].temperature.has_value();
  }
}

Plan plan_about(const Plan& platform, std::size_t place,
                const std::array<std::array<std::size_t, kAxes>, 2>& sensors,
                std::vector<Error>& errors) {
  const std::size_t axis = platform.output.axes[place];
  Plan pair = platform;
  pair.axes.clear();
  pair.axis = axis;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    pair.gyros[gyro] = gyro_about(platform.gyros[gyro], axis, sensors[gyro][axis]);
  set_true_rate(platform.calibration, place, axis, pair.calibration);
  set_reference(axis, pair);
  set_output(platform.output, axis, pair.output);
  set_noise(pair);
  if (!platform.model) return pair;
  const model::Model own = effects_about(*platform.model, pair);
  pair.model.reset();
  read_other_axes(own, platform, pair);
  apply_model(own, pair, errors);
  return pair;
}

// An effect that belongs to all axes causes the same error for each: keep the first.
void drop_repeated(std::vector<Error>& errors) {
  const auto same = [](const Error& a, const Error& b) {
    return a.where == b.where && a.what == b.what;
  };
  for (std::size_t i = 0; i < errors.size(); ++i) {
    errors.erase(std::remove_if(errors.begin() + static_cast<std::ptrdiff_t>(i) + 1, errors.end(),
                                [&](const Error& other) { return same(errors[i], other); }),
                 errors.end());
  }
}

}  // namespace

void name_other_axis(const GyroPlan& unit, std::size_t from, GyroPlan& gyro) {
  const GyroPlan* other = sensor_axis(unit, from);
  if (other != nullptr && other->match == gyro.match) gyro.*kOtherAxes[from] = other->rate;
}

void find_axes(TomlReader& root, Plan& plan) {
  const std::array<bool, 2> is_unit{!plan.gyros[0].axes.empty(), !plan.gyros[1].axes.empty()};
  if (!is_unit[0] && !is_unit[1]) return;
  if (is_unit[0] != is_unit[1]) {
    const std::size_t unit = is_unit[0] ? 0 : 1;
    root.complain(
        root.where("gyro"),
        fmt::format("gyro {} has {} axes, and gyro {} has one", plan.gyros[unit].name,
                    plan.gyros[unit].axes.size(), plan.gyros[1 - unit].name),
        "rate_x, rate_y, rate_z instead of rate in both [[gyro]] tables, or rate in both");
    return;
  }
  std::array<std::vector<std::size_t>, 2> axes{axes_of(plan.gyros[0]), axes_of(plan.gyros[1])};
  if (axes[0] != axes[1]) {
    root.complain(
        root.where("gyro"),
        fmt::format("gyro {} measures the vehicle's axes {}, and gyro {} measures {}",
                    plan.gyros[0].name, names_of(axes[0]), plan.gyros[1].name, names_of(axes[1])),
        "the same axes of both, as mounted: name the missing one, or leave it out of both");
    return;
  }
  if (axes[0].size() < 2) {
    root.complain(root.where("gyro"),
                  fmt::format("as they are mounted, the units measure {} whole axis of the vehicle",
                              names_of(axes[0])),
                  "the sensor's third axis, or a mount that turns about it");
    return;
  }
  plan.output.axes = axes[0];
}

void build_axes(Plan& plan, std::vector<Error>& errors) {
  if (plan.output.axes.empty()) return;
  const std::array sensors{nearest_sensors(plan.gyros[0], plan.output.axes),
                           nearest_sensors(plan.gyros[1], plan.output.axes)};
  std::vector<Plan> axes;
  for (std::size_t place = 0; place < plan.output.axes.size(); ++place)
    axes.push_back(plan_about(plan, place, sensors, errors));
  drop_repeated(errors);
  plan.axes = std::move(axes);
}

}  // namespace vgyro::gateway
