#include "gateway/attendance.h"

#include <algorithm>

namespace vgyro::gateway {

Attendance::Attendance(const Plan& plan, const fusion::Aligner& aligner,
                       const fusion::StampGuard& guard)
    : aligner_(aligner),
      guard_(guard),
      health_{GyroHealth(plan.gyros[0]), GyroHealth(plan.gyros[1])} {}

std::uint8_t Attendance::health_bits() const {
  const auto missing = [&](std::size_t gyro) {
    return !in_use_[gyro] && !health_[gyro].set_aside();
  };
  unsigned bits = 0;
  if (missing(0)) bits |= kGyro1Missing;
  if (missing(1)) bits |= kGyro2Missing;
  if (health_[0].suspect()) bits |= kGyro1Suspect;
  if (health_[1].suspect()) bits |= kGyro2Suspect;
  return static_cast<std::uint8_t>(bits);
}

std::optional<Reject> Attendance::judge(std::size_t gyro, TimePoint t, double rate_dps,
                                        bool can_go_alone) {
  const GyroHealth* other = in_use_[1 - gyro] ? &health_[1 - gyro] : nullptr;
  return health_[gyro].judge(t, rate_dps, other, other != nullptr && can_go_alone);
}

void Attendance::set_opinion(TimePoint t, const fusion::Condition& condition) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    health_[gyro].set_opinion(t, condition.noisy[gyro], condition.blind[gyro]);
}

void Attendance::hear(std::size_t gyro, TimePoint t) {
  in_use_[gyro] = true;
  without_in_row_[gyro] = 0;
  last_heard_[gyro] = std::max(last_heard_[gyro], t);
}

bool Attendance::hear_refused(std::size_t gyro, TimePoint t) {
  if (!health_[gyro].set_aside()) return false;
  last_heard_[gyro] = std::max(last_heard_[gyro], t);
  if (!in_use_[gyro]) return false;
  in_use_[gyro] = false;
  pairing_ = false;
  return true;
}

bool Attendance::go_without(std::size_t gyro, bool at_once) {
  // Up to two holes in a row are tolerated, as if those frames had been lost.
  constexpr std::uint32_t kHolesMost = 2;
  const bool goes = ++without_in_row_[gyro] > kHolesMost || at_once;
  if (!goes || !in_use_[gyro]) return false;
  in_use_[gyro] = false;
  pairing_ = false;
  return true;
}

bool Attendance::hear_pair() {
  if (pairing_) return false;
  pairing_ = true;
  alone_ = kNobody;
  return true;
}

bool Attendance::may_speak_alone(std::size_t gyro, TimePoint t, bool paired) const {
  if (pairing_) return false;
  if (in_use_[1 - gyro]) return gyro == alone_;  // the other one is back, but not paired yet
  return paired || t - waiting_since_ > kTimeOutMax;
}

Attendance::Silence Attendance::look_for_silence(TimePoint t) {
  Silence silence;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!in_use_[gyro] && !health_[gyro].set_aside()) continue;
    const TimePoint until = last_heard_[gyro] + time_out(gyro);
    if (t < until) {
      silence.next = std::min(silence.next, until);
      continue;
    }
    if (in_use_[gyro]) pairing_ = false;
    in_use_[gyro] = false;
    health_[gyro].fall_silent(last_heard_[gyro]);
    silence.fell_silent[gyro] = true;
  }
  return silence;
}

// The limit is for a clock that was set during those samples: the measured interval is then wrong.
Duration Attendance::usual_interval(std::size_t gyro) const {
  return std::min<Duration>(aligner_.interval(gyro), fusion::StampGuard::kSlowest);
}

Duration Attendance::time_out(std::size_t gyro) const {
  const bool chosen = aligner_.chosen();
  const Duration interval = chosen ? usual_interval(gyro) : guard_.interval(gyro);
  const Duration most = std::max<Duration>(kTimeOutMax, kTimeOutIntervalsMin * interval);
  if (!chosen) return most;
  return std::clamp<Duration>(kTimeOutIntervals * interval, kTimeOutMin, most);
}

Duration Attendance::pair_interval() const {
  return aligner_.chosen() ? usual_interval(aligner_.pacing_gyro()) : Duration::zero();
}

void Attendance::tell(Status& status) const {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    GyroStatus& own = status.gyros[gyro];
    own.heard = in_use_[gyro];
    own.fault = health_[gyro].fault();
    own.faults = health_[gyro].records();
    for (FaultRecord& record : own.faults)
      record.last -= guard_.offset();
  }
}

}  // namespace vgyro::gateway
