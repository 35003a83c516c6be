#include "gateway/plan.h"

namespace vgyro::gateway {

std::vector<FrameMatch> Plan::inputs() const {
  std::vector<FrameMatch> matches{gyros[0].match, gyros[1].match};
  if (reference) matches.push_back(reference->match);
  if (accelerometer) matches.push_back(accelerometer->match);
  if (speed) matches.push_back(speed->match);
  return matches;
}

std::vector<FrameId> output_ids(const OutputPlan& plan, can::BusIndex bus) {
  std::vector<FrameId> ids;
  if (plan.vgyro_frames && plan.bus == bus) {
    for (const std::uint32_t id : {plan.rate_id, plan.bias_id, plan.model_id})
      ids.push_back({id, false});
  }
  for (const OutputLayout& layout : plan.layouts) {
    if (layout.bus == bus) ids.push_back({layout.id, layout.extended});
  }
  return ids;
}

// The names of the buses stand in what is read from them.
bool same_but_output(const Plan& a, const Plan& b) {
  return a.gyros == b.gyros && a.reference == b.reference && a.accelerometer == b.accelerometer &&
         a.speed == b.speed && a.calibration == b.calibration && a.corrector == b.corrector &&
         a.model == b.model;
}

}  // namespace vgyro::gateway
