#include "gateway/intake.h"

#include "gateway/gyro_health.h"

namespace vgyro::gateway {

bool is_timed(Reject reject, Timed timed) {
  return timed == Timed::kSickToo && GyroHealth::tells_of_sensor(reject);
}

ScalarIntake reference_intake(const ReferencePlan& plan) {
  return {kReferenceStream, {{&plan.rate}, plan.e2e}};
}

ScalarIntake speed_intake(const SpeedPlan& plan) {
  return {kSpeedStream, {{&plan.speed}, plan.e2e}};
}

AxesIntake accelerometer_intake(const AccelerometerPlan& plan) {
  return {kAccelerometerStream, {{&plan.axes[0], &plan.axes[1], &plan.axes[2]}, plan.e2e}};
}

}  // namespace vgyro::gateway
