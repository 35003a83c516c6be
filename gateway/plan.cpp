#include "gateway/plan.h"

namespace vgyro::gateway {

std::vector<FrameMatch> Plan::inputs() const {
  std::vector<FrameMatch> matches{gyros[0].match, gyros[1].match};
  if (reference) matches.push_back(reference->match);
  if (accelerometer) matches.push_back(accelerometer->match);
  if (speed) matches.push_back(speed->match);
  return matches;
}

}  // namespace vgyro::gateway
