#pragma once

// A recording made ready to be asked: transport checked, instants aligned, motion known as well as
// it can be. With a reference each gyro is judged by itself. Without one, both are judged against
// the known rate where the platform rests, and only their difference elsewhere.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/observations.h"
#include "gap/recording.h"
#include "gap/signals.h"
#include "gap/timing.h"
#include "gap/transport.h"
#include "model/effect.h"

namespace vgyro::gap {

/// Never changes: another motion, or another choice of samples, is another study.
class Study {
 public:
  /// Error when the recording cannot be judged. The recording outlives all studies of it.
  static Expected<std::shared_ptr<const Study>> begin(const Recording& recording,
                                                      const Effects& effects);
  /// Of several recordings of one pair, each with a study of its own: transport, rest and motion
  /// know nothing of the others, and only the observations stand behind each other. One recording
  /// is a study as above.
  static Expected<std::shared_ptr<const Study>> begin(const std::vector<Recording>& recordings,
                                                      const Effects& effects);

  /// When each of several recordings begins and ends, on the time that they have in common; empty
  /// for one.
  [[nodiscard]] std::vector<Span> drives() const;

  /// One with a reference for each gyro, otherwise one for both.
  [[nodiscard]] const std::vector<std::shared_ptr<const Observations>>& observations() const {
    return observations_;
  }
  /// In which of them a gyro is.
  [[nodiscard]] std::size_t place_of(std::size_t gyro) const;
  [[nodiscard]] const Observations& observations_of(std::size_t gyro) const {
    return *observations_[place_of(gyro)];
  }
  /// Precondition of both: one recording.
  [[nodiscard]] const Transport& transport(std::size_t gyro) const;
  [[nodiscard]] const Signals& signals(std::size_t gyro) const { return *signals_[gyro]; }
  [[nodiscard]] const std::vector<Finding>& findings() const;
  [[nodiscard]] const std::vector<std::string>& notes() const;
  /// Of several: names, what is configured, and how long they last behind each other.
  [[nodiscard]] const Recording& recording() const;
  /// By so much it came late, which is taken off already; 0: it did not.
  [[nodiscard]] double reference_late_s() const;
  /// Its values are so far apart that rounding is no noise: only great effects can be judged.
  [[nodiscard]] bool is_coarse(std::size_t gyro) const;

  /// With what `effects` tell of the motion: without a reference the rate anew, from both gyros
  /// less what they say; and what is left of the motion between the samples. It depends on the
  /// effects alone, not on the motion of this one.
  [[nodiscard]] std::shared_ptr<const Study> with_motion(const Effects& effects) const;

  /// The same to try effects by: what is known of the motion between the samples stays, so that
  /// trials can be compared.
  [[nodiscard]] std::shared_ptr<const Study> with_motion_on_trial(const Effects& effects) const;
  /// The same for effects that are little else than those of this one: it begins with its motion.
  [[nodiscard]] std::shared_ptr<const Study> with_motion_moved(const Effects& effects) const;

  /// What was set aside of these seconds is no longer.
  [[nodiscard]] std::shared_ptr<const Study> with_used_for_fit(Span span) const;

 private:
  struct Facts;
  struct Joint;

  Study() = default;
  static std::shared_ptr<const Study> joined(std::vector<std::shared_ptr<const Study>> parts,
                                             std::shared_ptr<const Joint> joint,
                                             const Effects& effects);
  void observe(std::vector<Observations> list, const Effects& effects);
  [[nodiscard]] std::vector<Observations> observed() const;
  [[nodiscard]] std::vector<Observations> observed_with_motion() const;
  void set_signals(const Recording& recording);
  void learn_motion(const Effects& effects, bool anew = true);
  void learn_motion_of_reference();
  void learn_motion_of_pair(const Effects& effects, bool anew);
  [[nodiscard]] std::shared_ptr<const Study> on_trial(const Effects& effects, bool anew) const;
  [[nodiscard]] Observations against_reference(std::size_t gyro) const;
  [[nodiscard]] Observations of_pair() const;
  [[nodiscard]] Circumstances circumstances() const;

  std::shared_ptr<const Facts> facts_;  ///< what no motion changes
  std::array<std::shared_ptr<const Signals>, 2> signals_;
  std::vector<Span> for_fit_;
  std::vector<std::shared_ptr<const Observations>> observations_;
  std::shared_ptr<const Joint> joint_;  ///< of several recordings; none of one
  std::vector<std::shared_ptr<const Study>> parts_;
};

}  // namespace vgyro::gap
