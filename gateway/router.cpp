#include "gateway/router.h"

namespace vgyro::gateway {

Router::Router(const Plan& plan) : standard_(plan.buses.size()) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::uint8_t role = gyro == 0 ? kGyro1 : kGyro2;
    if (plan.gyros[gyro].axes.empty()) add(plan.gyros[gyro].match, role);
    for (const GyroPlan& axis : plan.gyros[gyro].axes)
      add(axis.match, role);
  }
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
