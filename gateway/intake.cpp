#include "gateway/intake.h"

#include "gateway/gyro_health.h"

namespace vgyro::gateway {

StampResult judge_stamp(std::size_t stream, TimePoint stamp, fusion::StampGuard& guard) {
  StampResult result{.judged = true, .reject = {}, .clock_step = false, .t = {}};
  switch (guard.check(stream, stamp, result.t)) {
    case fusion::StampGuard::StampVerdict::kRepeated:
      result.reject = Reject::kStampRepeated;
      break;
    case fusion::StampGuard::StampVerdict::kUnconfirmed:
      result.reject = Reject::kStampJump;
      break;
    case fusion::StampGuard::StampVerdict::kClockStep:
      result.clock_step = true;
      break;
    case fusion::StampGuard::StampVerdict::kAccepted:
      break;
  }
  return result;
}

bool is_timed(const std::optional<Reject>& reject, Timed timed) {
  if (!reject) return true;
  return timed == Timed::kSickToo && GyroHealth::tells_of_sensor(*reject);
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
