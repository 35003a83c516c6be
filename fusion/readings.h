#pragma once

// Several hypotheses about the same data, kept side by side until the data decide between them:
// when both gyros are steady, the platform stands, or it turns steadily and both have kept their
// drifts; when their difference jumps, one gyro has stepped, or the other one. Each hypothesis is a
// bank of drift filters of its own, weighted by its predictions and its prior.
// The output is the mixture: its mean, and the spread between the hypotheses as part of its σ.
// docs/optimal.md derives the weights. No clock, no samples; nothing is allocated after start.

#include <array>
#include <cstddef>
#include <utility>

#include "fusion/drift_bank.h"

namespace vgyro::fusion {

/// Both gyros steady over one window.
struct SteadyWindow {
  DriftMeasurement standing{0};    ///< what it measures if the platform stands
  DriftMeasurement turning{0};     ///< if it turns; without rows where one gyro is alone
  std::array<double, 2> weight{};  ///< of each gyro in the level
  double level_dps = 0.0;          ///< weighted readings less the rate at a stop
  double level_variance = 0.0;     ///< from noise
  double length_s = 0.0;
  /// Log of how much likelier a turn is than a stop, before the level is looked at; beyond the
  /// first window of a run only its change.
  double log_turning = 0.0;
  bool elsewhere = true;  ///< the platform has moved on since the last steady run
};

class Readings {
 public:
  /// Kept; of more, the least likely are dropped.
  static constexpr std::size_t kKept = 4;
  /// A hypothesis with less weight is dropped.
  static constexpr double kGone = 1e-6;
  /// Least probability that is reported.
  static constexpr double kWorthTelling = 0.05;
  static constexpr std::size_t kNoGyro = 2;
  /// How steady turns are: perfectly, as a ship's, as a car's.
  static constexpr std::size_t kTurnKinds = 3;
  /// Every hypothesis may become three, and the kept bank may return as one more.
  static constexpr std::size_t kSlots = 3 * (kKept + 1);

  explicit Readings(const std::array<GyroParameters, 2>& gyros);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  void begin(const std::array<double, 2>& white_dps_rthz, const std::array<double, 2>& bias_dps,
             const Symmetric& covariance);
  void resume(const DriftMemory& memory, double age_s);
  /// Keeps the likeliest hypothesis at present, for a return.
  void copy_likeliest(DriftBank& bank) const { bank = slots_[likeliest()].bank; }
  /// Returns to it; nothing is learned from the `gone_s` since.
  void go_back(const DriftBank& bank, double gone_s);
  /// One more hypothesis: no change in the last `gone_s` was either gyro's drift.
  void add_back(const DriftBank& bank, double gone_s);
  void save(DriftMemory& memory) const { slots_[likeliest()].bank.save(memory); }

  void predict(double length_s);
  /// Both gyros' difference, or a certain measurement; weighs the hypotheses by it.
  void learn(double length_s, const DriftMeasurement& measurement);
  /// A window of a steady run. The first one splits every hypothesis in two.
  void learn_steady(const SteadyWindow& window);
  /// The run of steady windows has ended.
  void end_steady();
  /// The difference y₁ − y₂ has jumped by so much: gyro 1 has stepped with probability
  /// `first_share`, or gyro 2.
  void split_step(double away_dps, double variance, double first_share);
  /// A window of the difference deviates from its prediction by `away_dps`: noise, unexplained
  /// turns, or a step of one gyro. `doubted` is the measurement with the noise of the
  /// first case.
  void learn_maybe_step(double length_s, const DriftMeasurement& measurement,
                        const DriftMeasurement& doubted, double away_dps, double variance,
                        double first_share);
  /// This gyro has fallen out: the contradiction was likely its own fault.
  void suspect(std::size_t gyro);
  void set_temperature(const std::array<double, 2>& temperature_c);
  void observe_at(const std::array<double, 2>& temperature_c);

  [[nodiscard]] DriftEstimate estimate() const;
  /// Probability that the platform stands, in a run of steady windows; 0 outside.
  [[nodiscard]] double standing() const;
  /// The same that it turns steadily.
  [[nodiscard]] double turning() const;
  /// Probability that this gyro has made a step that is not settled yet.
  [[nodiscard]] double stepped(std::size_t gyro) const;
  /// Two hypotheses are likely, and further apart than their σ.
  [[nodiscard]] bool ambiguous() const;
  /// No filter of one window: how many filters a window costs.
  [[nodiscard]] bool few() const { return slots_[0].bank.few() && count_ == 1; }

 private:
  struct Reading;
  template <std::size_t Count, std::size_t... I>
  static std::array<Reading, Count> empty_slots(const std::array<GyroParameters, 2>& gyros,
                                                std::index_sequence<I...> numbers);

  enum class Steady : std::uint8_t { kNo, kStands, kTurns };
  /// The level of a steady turn, followed by a filter of its own.
  struct SteadyTurn {
    double level_dps = 0.0;
    double variance = 0.0;
    double weight = 0.5;
  };
  struct Reading {
    DriftBank bank;
    double log_weight = 0.0;
    Steady steady = Steady::kNo;
    std::array<SteadyTurn, kTurnKinds> turn{};  ///< the level while it turns
    Steady last = Steady::kNo;   ///< the last run, while the platform has not moved on
    double last_turn_dps = 0.0;  ///< its rate, where it turned
    std::size_t stepped = kNoGyro;
  };
  [[nodiscard]] double turn_density(const Reading& reading, const SteadyWindow& window,
                                    const DriftEstimate& estimate) const;
  static double log_turning(const Reading& reading, const SteadyWindow& window);
  [[nodiscard]] bool goes_on(const SteadyWindow& window);
  void step(Reading& reading, std::size_t gyro, double away_dps, double doubt, double share);
  void follow_swell(const SteadyWindow& window);
  void stand(Reading& reading, const SteadyWindow& window);
  static bool surprise(Reading& reading, const SteadyWindow& window, const DriftEstimate& known);
  static void begin_turn(Reading& reading, const SteadyWindow& window);
  static double follow_turn(Reading& reading, const SteadyWindow& window, double turn_dps,
                            double drift_growth);
  void begin_steady(const SteadyWindow& window);
  void go_on_steady(const SteadyWindow& window);
  [[nodiscard]] double beyond_limits(const DriftEstimate& estimate) const;
  void settle();
  void join_alike();
  [[nodiscard]] std::size_t likeliest() const;

  std::array<GyroParameters, 2> gyros_;
  std::array<bool, 2> suspected_{};  ///< since the last step
  double swell_variance_ =
      0.0;  ///< of the level from run to run of a platform that does not move on
  double last_level_dps_ = 0.0;
  std::array<Reading, kSlots> slots_;
  std::size_t count_ = 0;
};

}  // namespace vgyro::fusion
