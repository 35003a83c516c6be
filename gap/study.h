#pragma once

// A recording made ready to be asked: transport checked, instants aligned, motion known as well as
// it can be, samples cut into blocks, and a part of them set aside. With a reference each gyro is
// judged by itself. Without one, both are judged against the known rate where the platform rests,
// and only their difference elsewhere.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/error.h"
#include "gap/noise.h"
#include "gap/recording.h"
#include "gap/rest.h"
#include "gap/signals.h"
#include "gap/transport.h"
#include "model/effect.h"

namespace vgyro::gap {

/// Observations that hang together: one gyro against the reference, or both.
struct Problem {
  std::array<bool, 2> holds{};  ///< which gyros
  Layout layout;
  std::vector<double> t_s;       ///< of each sample, in the order of the layout
  std::vector<Channel> channel;  ///< likewise
  Eigen::VectorXd observed_dps;  ///< reading less true rate, or the difference of the readings
  /// What the error of gyro k depends on, at each sample.
  std::array<std::vector<SampledCurve::Point>, 2> rate;
  std::array<std::vector<model::Surroundings>, 2> surroundings;

  [[nodiscard]] Eigen::Index size() const { return observed_dps.size(); }
};

struct Excitation {
  double rate_max_dps = 0.0;
  double temperature_range_c = 0.0;
  double temperature_slope_range_c_s = 0.0;
  std::array<double, 3> acceleration_range_g{};
  double vibration_range_g2 = 0.0;
  bool knows_temperature = false;
  bool knows_acceleration = false;
};

class Study {
 public:
  /// Error when the recording cannot be judged.
  static Expected<std::unique_ptr<Study>> begin(const Recording& recording,
                                                const std::vector<model::Effect>& effects);

  [[nodiscard]] const std::vector<Problem>& problems() const { return problems_; }
  [[nodiscard]] const Transport& transport(std::size_t gyro) const { return transports_[gyro]; }
  [[nodiscard]] const Signals& signals(std::size_t gyro) const { return signals_[gyro]; }
  [[nodiscard]] const Excitation& excitation(std::size_t gyro) const { return excitations_[gyro]; }
  [[nodiscard]] const std::vector<Finding>& findings() const { return findings_; }
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] const Recording& recording() const { return recording_; }
  /// Its values are so far apart that rounding is no noise: only great effects can be judged.
  [[nodiscard]] bool is_coarse(std::size_t gyro) const;
  [[nodiscard]] std::size_t problem_of(std::size_t gyro) const;

  /// Without a reference: the rate anew, from both gyros less what `effects` say of them.
  void learn_motion(const std::vector<model::Effect>& effects);

  /// What was set aside of these seconds is no longer.
  void use_for_fit(double from_s, double to_s);

  /// Observed less what the effects say: of every sample of a problem.
  [[nodiscard]] Eigen::VectorXd residual(const Problem& problem,
                                         const std::vector<model::Effect>& effects) const;
  /// What effects of one gyro add to the observations.
  [[nodiscard]] Eigen::VectorXd contribution(const Problem& problem, std::size_t gyro,
                                             const std::vector<model::Effect>& effects) const;

 private:
  /// What a gyro feels less the true rate, in deg/s, at each sample that holds the gyro: what
  /// delay, low-passes and clock skew make of the motion.
  [[nodiscard]] Eigen::VectorXd lateness_dps(const Problem& problem, std::size_t gyro,
                                             const std::vector<model::Effect>& moving) const;
  explicit Study(const Recording& recording) : recording_(recording) {}
  Expected<void> check() const;
  Expected<void> check_spans() const;
  void build();
  void cache(Problem& problem);
  void set_aside(Problem& problem) const;
  Problem build_against_reference(std::size_t gyro);
  Problem build_pair();

  /// The last answers of lateness_dps: dear, and asked for again and again.
  struct Remembered {
    const Problem* problem = nullptr;
    model::Effect effect;
    Eigen::VectorXd values;
  };

  const Recording& recording_;
  mutable std::vector<Remembered> remembered_;
  mutable std::size_t forget_next_ = 0;
  std::array<Transport, 2> transports_;
  std::array<Signals, 2> signals_;
  std::array<Excitation, 2> excitations_;
  std::array<SampledCurve, 2> readings_;  ///< unmasked samples
  RestingSeconds rest_;                   ///< without a reference only
  std::vector<std::array<double, 2>> for_fit_s_;
  std::vector<Problem> problems_;
  std::vector<Finding> findings_;
  std::vector<std::string> notes_;
};

}  // namespace vgyro::gap
