#pragma once

// Turns aligned pairs into virtual rates: first the calibration, at rest or against the reference,
// or in its place biases of an earlier run; then the corrector. Owns everything learned, and
// decides what is worth keeping. Has no frames and no time-outs: the pipeline decides which gyros
// are in use, and passes `both_in_use`. Times are on the axis of fusion::StampGuard; nothing is
// allocated after construction.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/time.h"
#include "fusion/alignment.h"
#include "fusion/calibration.h"
#include "fusion/corrector.h"
#include "fusion/pair_relation.h"
#include "gateway/output_frames.h"
#include "gateway/plan.h"
#include "gateway/reference_calibration.h"
#include "gateway/saved_state.h"
#include "gateway/status.h"
#include "gateway/surroundings.h"

namespace vgyro::gateway {

/// The corrector of the plan's method.
std::unique_ptr<fusion::Corrector> make_corrector(const Plan& plan);

class Estimator {
 public:
  /// The age of saved biases when the clock cannot give it, because it is before their stamp.
  static constexpr double kUnknownAge_s = 30 * 86400.0;

  /// `plan` must outlive this object.
  Estimator(const Plan& plan, std::unique_ptr<fusion::Corrector> corrector);

  /// Offers a saved state before the first pair, which takes it up instead of a calibration. Error
  /// if it belongs to other gyros, or if the method keeps no state; nothing has changed then.
  Expected<void> offer(const SavedState& state);
  /// Call at the first pair, of time `t`, which is `stamp` on the clock of the frames. The
  /// estimation's seconds count from here.
  [[gnu::cold, gnu::noinline]] void begin(TimePoint t, TimePoint stamp);
  [[nodiscard]] bool begun() const { return begun_; }
  [[nodiscard]] bool calibrated() const { return calibrated_; }
  /// May the rate of one gyro alone be used? With no method if it was never compared with the
  /// other.
  [[nodiscard]] bool knows_gyros() const { return calibrated_ && begun_; }

  /// The corrector's other inputs from now on: wheels, vibration, temperatures …
  void hear(const Surroundings& surroundings, TimePoint t);
  /// … and the smallest step that this gyro's values have shown, deg/s.
  void set_resolution(std::size_t gyro, double step_dps);

  /// Checks every pair, calibrated or not: can both gyros be on one platform?
  void compare(const fusion::AlignedPair& pair) { relation_.add(seconds(pair.t), pair.rate_dps); }
  /// One gyro is set aside, which ends the comparison.
  void break_off_comparison() { relation_.break_off(); }
  /// They cannot. Nothing shows which one is wrong, so no rate is valid and nothing is learned.
  [[nodiscard]] bool contradicted() const { return relation_.contradicts(); }

  /// Set from now on: evidence of the platform's other axes; the variance that these leave in the
  /// gyros' difference; the true rate at a stop.
  void set_elsewhere(const fusion::Elsewhere& elsewhere) { corrector_->set_elsewhere(elsewhere); }
  void set_cross_variance(double variance_dps2) { corrector_->set_cross_variance(variance_dps2); }
  void set_stop_rate(double rate_dps) { corrector_->set_stop_rate(rate_dps); }
  /// The platform moved about another axis, so the data gathered for this one were not at rest.
  [[gnu::cold, gnu::noinline]] void restart_calibration();
  /// The platform moved about another axis after resting long enough for that axis's calibration:
  /// this axis's calibration ends too, or begins again where it has too little data yet.
  [[gnu::cold, gnu::noinline]] void end_calibration(TimePoint t, TimePoint still_until);
  /// Until when the platform rested, if motion ended the calibration early.
  [[nodiscard]] const std::optional<TimePoint>& calibration_cut_at() const { return cut_at_; }
  /// Motion occurred during the calibration and was accepted.
  [[nodiscard]] bool moved_in_calibration() const {
    return moved_in_calibration_ || (!calibrated_ && calibrator_.moved());
  }
  void note_motion_in_calibration();
  [[nodiscard]] std::uint64_t calibration_restarts() const { return calibrator_.restarts(); }

  /// Takes a pair while not calibrated().
  [[gnu::noinline]] void calibrate(const fusion::AlignedPair& pair);
  /// A reference rate, which may complete the calibration.
  void add_reference(TimePoint t, double rate_dps);

  /// The next pair. Precondition: calibrated().
  fusion::VirtualRate update(const fusion::AlignedPair& pair);
  /// The next sample of one gyro alone. Precondition: knows_gyros().
  fusion::VirtualRate update_alone(std::size_t gyro, TimePoint t, double rate_dps);

  /// The weight of each gyro in the newest rate.
  [[nodiscard]] std::array<double, 2> shares() const { return corrector_->shares(); }
  /// The corrector's findings, as of the newest rate.
  [[nodiscard]] const fusion::Condition& condition() const { return condition_; }
  /// Grows when condition() or calibrated() changes.
  [[nodiscard]] std::uint64_t condition_edition() const {
    return 2 * condition_edition_ + (calibrated_ ? 1 : 0);
  }
  /// The drifts at `t`. Precondition: knows_gyros().
  [[nodiscard]] fusion::Drift drift(TimePoint t) const { return corrector_->drift(seconds(t)); }
  /// Do the gyros disagree at present, or contradict each other altogether?
  [[nodiscard]] bool disagree(bool both_in_use) const {
    return (both_in_use && condition_.disagree) || contradicted();
  }
  /// Windows learned from so far.
  [[nodiscard]] std::uint64_t windows() const { return corrector_->windows().completed; }
  [[nodiscard]] Quality quality(bool both_in_use) const;
  [[nodiscard]] BiasMode bias_mode(bool both_in_use, bool any_in_use) const;

  /// The state to keep across a restart. `t` is the time of the last rate, t − clock_offset that
  /// time on the clock of the frames. Nothing before anything worth keeping was learned; an offered
  /// state that was not taken up yet is returned unchanged.
  [[nodiscard]] std::optional<SavedState> memory(
      TimePoint t, Duration clock_offset,
      const std::array<std::optional<double>, 2>& temperature_c) const;

  void tell(Status& status) const;

 private:
  void calibrate_with_reference();
  void read_condition();
  void calibrate_with(const fusion::AlignedPair& pair, double true_rate_dps);
  void take_result();
  [[nodiscard]] bool result_can_be() const;
  [[nodiscard]] double seconds(TimePoint t) const { return to_seconds(t - origin_); }

  const Plan& plan_;
  std::unique_ptr<fusion::Corrector> corrector_;
  fusion::Calibrator calibrator_;
  ReferenceCalibration reference_;
  fusion::Condition condition_;
  std::uint64_t condition_edition_ = 0;
  fusion::PairRelation relation_;
  TimePoint origin_;  ///< zero of the estimation's seconds: the first pair
  bool begun_ = false;
  bool calibrated_;
  bool moved_in_calibration_ = false;  ///< and the calibration was accepted
  std::optional<TimePoint> cut_at_;

  std::optional<SavedState> saved_;  ///< to be taken up by the first pair
  Restored restored_ = Restored::kNothing;
  double restored_age_s_ = 0.0;
  double restored_bias_sigma_dps_ = 0.0;
};

}  // namespace vgyro::gateway
