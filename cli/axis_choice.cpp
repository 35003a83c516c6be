#include "cli/axis_choice.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "gateway/axes_plan.h"

namespace vgyro::cli {

namespace {

// Largest deviation of a mount from quarter turns: beyond it a sensor feels more than a hundredth
// of a percent of another axis's rate, which is the cross_axis of good sensors.
constexpr double kTiltMost = 1e-4;

std::optional<Error> tilted_unit(const std::string& config, const gateway::Plan& plan) {
  for (const gateway::GyroPlan& unit : plan.gyros) {
    const auto& elements = unit.mount.matrix;
    const bool tilted = std::any_of(elements.begin(), elements.end(), [](double element) {
      return std::abs(element - std::round(element)) > kTiltMost;
    });
    if (!tilted) continue;
    return Error{
        config,
        fmt::format("the mount of gyro {} tilts it by other than quarter turns, and noise and "
                    "effects belong to the sensors' own axes",
                    unit.name),
        "a copy of the configuration with a mount of 0, 90 or 180 degrees, or with none; what the "
        "axes are apart then shows up as cross_axis"};
  }
  return std::nullopt;
}

void name_other_axes(const gateway::GyroPlan& unit, gateway::GyroPlan& gyro) {
  for (std::size_t from = 0; from < gateway::kAxes; ++from) {
    if (from != gyro.sensor_axis) gateway::name_other_axis(unit, from, gyro);
  }
}

std::string names_of(const std::vector<gateway::Plan>& axes) {
  std::vector<std::string> names;
  names.reserve(axes.size());
  for (const gateway::Plan& pair : axes)
    names.push_back(axis_name(pair));
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

std::string axis_name(const gateway::Plan& pair) {
  return pair.output.axes.empty() ? "" : std::string(1, gateway::kAxisNames[pair.axis]);
}

std::string about_axis(const gateway::Plan& pair) {
  return pair.output.axes.empty() ? "" : " about " + axis_name(pair);
}

std::string path_of_axis(const std::string& path, const std::string& axis) {
  if (axis.empty() || path.empty()) return path;
  const std::filesystem::path whole(path);
  const std::string name =
      fmt::format("{}-{}{}", whole.stem().string(), axis, whole.extension().string());
  return (whole.parent_path() / name).string();
}

Expected<std::vector<gateway::Plan>> chosen_pairs(const std::string& config,
                                                  const gateway::Plan& plan,
                                                  const std::string& axis) {
  if (plan.axes.empty()) {
    if (axis.empty()) return std::vector{plan};
    return fail(config, "has two gyros of one axis each",
                "leave --axis out; rate_x, rate_y, rate_z in [[gyro]] name a unit's axes");
  }
  if (auto tilted = tilted_unit(config, plan)) return tl::unexpected(*std::move(tilted));
  std::vector<gateway::Plan> pairs;
  for (const gateway::Plan& about : plan.axes) {
    if (!axis.empty() && axis_name(about) != axis) continue;
    pairs.push_back(about);
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      name_other_axes(plan.gyros[gyro], pairs.back().gyros[gyro]);
  }
  if (!pairs.empty()) return pairs;
  return fail(config,
              fmt::format("has no axis {}: its units measure {}", axis, names_of(plan.axes)),
              "one of these for --axis, or none for all of them");
}

}  // namespace vgyro::cli
