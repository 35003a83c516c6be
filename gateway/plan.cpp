#include "gateway/plan.h"

#include <algorithm>

#include <fmt/core.h>

namespace vgyro::gateway {

bool FrameMatch::carries(std::uint32_t frame_id, bool frame_extended) const {
  if (frame_extended != extended || ((frame_id ^ id) & mask) != 0) return false;
  return std::none_of(others.begin(), others.end(), [frame_id](std::uint32_t other) {
    return dbc::same_sender(frame_id, other);
  });
}

// The codes are at the top of the raw values; those below are measurements.
double Quantity::sendable_lowest() const {
  if (codes.empty()) return codec.representable_min();
  const double top = codec.value_of(static_cast<std::int64_t>(codes.first - 1));
  return std::min(top, codec.value_of(codec.raw_min()));
}

double Quantity::sendable_highest() const {
  if (codes.empty()) return codec.representable_max();
  const double top = codec.value_of(static_cast<std::int64_t>(codes.first - 1));
  return std::max(top, codec.value_of(codec.raw_min()));
}

std::vector<FrameMatch> Plan::inputs() const {
  std::vector<FrameMatch> matches;
  const auto add = [&](const FrameMatch& match) {
    if (std::find(matches.begin(), matches.end(), match) == matches.end()) matches.push_back(match);
  };
  for (const GyroPlan& gyro : gyros) {
    if (gyro.axes.empty()) matches.push_back(gyro.match);
    for (const GyroPlan& one : gyro.axes)
      add(one.match);
  }
  if (reference) matches.push_back(reference->match);
  if (accelerometer) matches.push_back(accelerometer->match);
  if (speed) matches.push_back(speed->match);
  return matches;
}

std::string to_string(const FrameId& id) {
  return id.extended ? fmt::format("{:08X}", id.id) : fmt::format("{:03X}", id.id);
}

std::vector<FrameId> output_ids(const OutputPlan& plan, can::BusIndex bus) {
  std::vector<FrameId> ids;
  if (plan.vgyro_frames && plan.bus == bus) {
    const std::vector<std::size_t> axes =
        plan.axes.empty() ? std::vector<std::size_t>{0} : plan.axes;
    for (const std::size_t axis : axes) {
      const auto step = static_cast<std::uint32_t>(axis) * kAxisIdStep;
      const bool has_rate = !plan.rate_is_shared || axis == axes.front();
      if (has_rate) ids.push_back({plan.rate_id + (plan.rate_is_shared ? 0 : step), false});
      ids.push_back({plan.bias_id + step, false});
      ids.push_back({plan.model_id + step, false});
    }
  }
  for (const OutputLayout& layout : plan.layouts) {
    if (layout.bus == bus) ids.push_back({layout.id, layout.extended});
  }
  return ids;
}

// The buses' names are compared with the inputs that are read from them.
bool same_but_output(const Plan& a, const Plan& b) {
  return a.gyros == b.gyros && a.reference == b.reference && a.accelerometer == b.accelerometer &&
         a.speed == b.speed && a.calibration == b.calibration && a.corrector == b.corrector &&
         a.model == b.model;
}

}  // namespace vgyro::gateway
