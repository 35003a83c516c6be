#pragma once

// What is to be explained: readings of one gyro less the true rate, or, without a reference, of
// both at rest and their difference elsewhere. Cut into blocks, a part of which is set aside, with
// all that an error may depend on at each sample. And what effects say of it. Never changes once
// made.

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "gap/kinds.h"
#include "gap/noise.h"
#include "gap/result.h"
#include "gap/signals.h"
#include "gap/unseen_motion.h"
#include "model/effect.h"

namespace vgyro::gap {

using Effects = std::vector<model::Effect>;

/// One sample of one channel.
struct Observation {
  double t_s = 0.0;
  Channel channel = Channel::kGyro1;
  double observed_dps = 0.0;  ///< reading less true rate, or the difference of the readings
  double rate_dps = 0.0;      ///< the true rate
};

/// How far the inputs moved where a gyro was seen.
struct Excitation {
  std::array<double, kInputCount> range{};  ///< in the inputs' own units; of the rate its magnitude
  std::array<bool, kInputCount> known{};

  [[nodiscard]] double of(Input input) const { return range[static_cast<std::size_t>(input)]; }
  [[nodiscard]] bool knows(Input input) const { return known[static_cast<std::size_t>(input)]; }
  /// All of these inputs, by bits, moved far enough to show something.
  [[nodiscard]] bool moves(Inputs needs) const;
};

/// Samples of a curve that stand in others' observations: gyro 2's in a difference (slot 1), the
/// reference's everywhere (slot 2). A slot is the place in a block's gains.
struct Interpolated {
  const SampledCurve* curve = nullptr;
  std::size_t slot = 0;
};

/// What all observations of a recording have in common.
struct Circumstances {
  double seconds = 0.0;  ///< of the recording
  bool with_reference = false;
  std::array<double, 2> interval_s{};  ///< of the gyros' even clocks
  /// A gyro's values are so far apart that rounding is no noise: only great effects can be judged.
  std::array<bool, 2> coarse{};
  std::array<std::shared_ptr<const Signals>, 2> signals;  ///< as each gyro is judged against
};

/// One of several recordings whose observations stand behind each other.
struct Drive {
  std::size_t first = 0;  ///< of its samples
  std::size_t count = 0;
  double from_s = 0.0;  ///< its first frame: zero of its own signals' time, and of the model's
  std::array<std::shared_ptr<const Signals>, 2> signals;
};

class Observations {
 public:
  std::array<bool, 2> holds{};  ///< which gyros
  Circumstances about;
  Layout layout;
  std::vector<double> t_s;       ///< of each sample, in the order of the layout
  std::vector<Channel> channel;  ///< of each sample
  Eigen::VectorXd observed_dps;  ///< of each sample
  /// What the error of gyro k depends on, at each sample.
  std::array<std::vector<SampledCurve::Point>, 2> rate;
  std::array<std::vector<model::Surroundings>, 2> surroundings;
  std::array<std::vector<double>, 2> rate_by_other_dps;  ///< empty where `rate` is by no gyro
  std::array<Excitation, 2> excitation;
  std::vector<Drive> drives;  ///< empty: one recording, with the signals of `about`

  /// Of one recording: an instant that comes once can be told, and a phase that is kept.
  [[nodiscard]] bool is_one() const { return drives.empty(); }
  [[nodiscard]] Eigen::Index size() const { return observed_dps.size(); }

  /// What is observed less what the effects say, of every sample.
  [[nodiscard]] Eigen::VectorXd residual(const Effects& effects) const;
  /// The same, with lateness reckoned by the motion in the other gyro's readings, not by these.
  [[nodiscard]] Eigen::VectorXd residual_by_motion(const Effects& effects) const;
  /// What effects of one gyro add to what is observed, in deg/s.
  [[nodiscard]] Eigen::VectorXd contribution(std::size_t gyro, const Effects& effects) const;
  /// What `effect` adds to it beside `others`.
  [[nodiscard]] Eigen::VectorXd contribution_beside(const Effects& others,
                                                    const model::Effect& effect) const;
  /// d contribution / d parameter beside `others`.
  [[nodiscard]] Eigen::VectorXd derivative(const Effects& others, const model::Effect& effect,
                                           const Free& free) const;
  /// What a parameter of an effect of this gyro can be, for all that was recorded.
  [[nodiscard]] double most_of(const Limit& limit, std::size_t gyro) const;
  /// Learns what motion between the samples adds to the noise, from what `effects` leave.
  void learn_unseen_motion(const FastMotion& motion, const Effects& effects);
  /// Of blocks that know the motion's power.
  void learn_unseen_motion(const Effects& effects);
  /// The same samples of the same gyros with another motion. Precondition: one recording without a
  /// reference, or as before.
  [[nodiscard]] Observations with_motion(
      const std::array<std::shared_ptr<const Signals>, 2>& signals) const;
  /// With these seconds for the fit. `spans`: all such.
  [[nodiscard]] Observations with_for_fit(const std::vector<Span>& spans) const;

 private:
  [[nodiscard]] Drive whole() const;
  /// By what lateness is reckoned where the other gyro tells the motion: by its readings as they
  /// are, whose noise is late with them; or by the motion in them, which is how a fit should move:
  /// by the slopes of the noise its steps would be far too small.
  enum class By { kReadings, kMotion };
  [[nodiscard]] Eigen::VectorXd lateness_dps(std::size_t gyro, const Effects& moving, By by) const;
  [[nodiscard]] Eigen::VectorXd contribution(std::size_t gyro, const Effects& effects, By by) const;
  [[nodiscard]] Eigen::VectorXd residual(const Effects& effects, By by) const;
  [[nodiscard]] Eigen::VectorXd late_with(const Effects& others, const model::Effect& effect,
                                          By by) const;
  void add(std::size_t gyro, const Effects& added, const Eigen::VectorXd& lateness,
           Eigen::VectorXd& sum) const;

  /// The last answers of lateness_dps, which are dear and asked for again and again.
  struct Remembered {
    std::size_t gyro = 0;
    By by = By::kReadings;
    Effects moving;
    Eigen::VectorXd values;
  };
  mutable std::vector<Remembered> remembered_;
  mutable std::size_t forget_next_ = 0;
};

/// Several recordings' observations as one, each `from_s` later than its own time says. What a gyro
/// is stays the same; its drift begins anew in each. Precondition: all hold the same gyros.
/// `effects`: what is known of the gyros.
Observations join(const std::vector<const Observations*>& parts, const std::vector<double>& from_s,
                  const Effects& effects);

/// Samples in any order. `reference_variance`: of one sample of the rate, (deg/s)².
Observations make_observations(std::vector<Observation> samples, const Circumstances& about,
                               std::array<bool, 2> holds, const Interpolated& other,
                               double reference_variance, const std::vector<Span>& for_fit);

}  // namespace vgyro::gap
