#include "gateway/plan.h"

namespace vgyro::gateway {

std::vector<FrameMatch> Plan::inputs() const {
  std::vector<FrameMatch> matches{gyros[0].match, gyros[1].match};
  if (reference) matches.push_back(reference->match);
  if (accelerometer) matches.push_back(accelerometer->match);
  if (speed) matches.push_back(speed->match);
  return matches;
}

// The names of the buses stand in what is read from them.
bool same_but_output(const Plan& a, const Plan& b) {
  return a.gyros == b.gyros && a.reference == b.reference && a.accelerometer == b.accelerometer &&
         a.speed == b.speed && a.calibration == b.calibration && a.corrector == b.corrector &&
         a.model == b.model;
}

}  // namespace vgyro::gateway
