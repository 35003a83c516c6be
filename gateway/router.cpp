#include "gateway/router.h"

namespace vgyro::gateway {

Router::Router(const Plan& plan) : standard_(plan.buses.size()) {
  add(plan.gyros[0].match, kGyro1);
  add(plan.gyros[1].match, kGyro2);
  if (plan.reference) add(plan.reference->match, kReference);
  if (plan.accelerometer) add(plan.accelerometer->match, kAccelerometer);
  if (plan.speed) add(plan.speed->match, kSpeed);
}

void Router::add(const FrameMatch& match, std::uint8_t role) {
  if (match.extended) {
    extended_.push_back({match, role});
    return;
  }
  for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
    if ((id & match.mask) == (match.id & match.mask)) standard_[match.bus][id] |= role;
  }
}

std::uint8_t Router::extended_roles(can::BusIndex bus, std::uint32_t id) const {
  std::uint8_t roles = 0;
  for (const Entry& entry : extended_) {
    if (entry.match.bus == bus && entry.match.carries(id, true)) roles |= entry.role;
  }
  return roles;
}

}  // namespace vgyro::gateway
