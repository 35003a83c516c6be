#pragma once

// Several hypotheses about the same data, kept side by side until the data decide between them:
// when both gyros are steady, the platform stands, or it turns steadily and both have kept their
// drifts; when their difference jumps, either gyro has stepped. Each hypothesis is a bank of drift
// filters of its own, weighted by its predictions and its prior. The output is the mixture: its
// mean, and the spread between the hypotheses as part of its σ. docs/optimal.md derives the
// weights. No clock, no samples; nothing is allocated after the start.

#include <array>
#include <cstddef>
#include <utility>

#include "fusion/drift_bank.h"

namespace vgyro::fusion {

/// Both gyros steady over one window.
struct SteadyWindow {
  DriftMeasurement standing{0};    ///< the measurement if the platform stands
  DriftMeasurement turning{0};     ///< the measurement if it turns; no rows with one gyro alone
  std::array<double, 2> weight{};  ///< of each gyro in the level
  double level_dps = 0.0;          ///< weighted readings less the rate at a stop
  double level_variance = 0.0;     ///< from noise
  double length_s = 0.0;
  /// Log odds of a turn against a stop, without the evidence of the level: at the first window of a
  /// run the prior, at later ones only the change.
  double log_turning = 0.0;
  bool elsewhere = true;  ///< the platform has moved on since the last steady run
};

class Readings {
 public:
  /// Hypotheses that are kept; the least likely beyond are dropped.
  static constexpr std::size_t kKept = 4;
  /// A hypothesis with less weight, relative to the likeliest, is dropped.
  static constexpr double kGone = 1e-6;
  /// Least probability that is reported.
  static constexpr double kWorthTelling = 0.05;
  static constexpr std::size_t kNoGyro = 2;
  /// Kinds of steady turn: perfectly constant, like a ship's, like a car's.
  static constexpr std::size_t kTurnKinds = 3;
  /// One window may turn every hypothesis into three; the kept bank may be one more beforehand.
  static constexpr std::size_t kSlots = 3 * (kKept + 1);

  explicit Readings(const std::array<GyroParameters, 2>& gyros);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  void begin(const std::array<double, 2>& white_dps_rthz, const std::array<double, 2>& bias_dps,
             const Symmetric& covariance);
  void resume(const DriftMemory& memory, double age_s);
  /// Copies the bank of the likeliest hypothesis, for a later go_back() or add_back().
  void copy_likeliest(DriftBank& bank) const { bank = slots_[likeliest()].bank; }
  /// Replaces all hypotheses by `bank`, extrapolated over the `gone_s` seconds since its copy.
  void go_back(const DriftBank& bank, double gone_s);
  /// Adds a hypothesis: no change in the last `gone_s` seconds was a drift of either gyro.
  void add_back(const DriftBank& bank, double gone_s);
  void save(DriftMemory& memory) const { slots_[likeliest()].bank.save(memory); }

  void predict(double length_s);
  /// Learns a measurement that every hypothesis sees alike, as the gyros' difference or a
  /// calibration block, and weighs the hypotheses by it.
  void learn(double length_s, const DriftMeasurement& measurement);
  /// A window of a steady run. The first one splits every hypothesis in two.
  void learn_steady(const SteadyWindow& window);
  /// The run of steady windows has ended.
  void end_steady();
  /// The difference y₁ − y₂ has jumped by `away_dps`: gyro 1 has stepped, with probability
  /// `first_share`, or gyro 2 has.
  void split_step(double away_dps, double variance, double first_share);
  /// A window of the difference deviates from its prediction by `away_dps`: noise, unexplained
  /// turns, or a step of one gyro. `doubted` is the measurement for the case without a step, with
  /// its noise enlarged.
  void learn_maybe_step(double length_s, const DriftMeasurement& measurement,
                        const DriftMeasurement& doubted, double away_dps, double variance,
                        double first_share);
  /// This gyro has fallen out, so it was probably the cause of the contradiction.
  void suspect(std::size_t gyro);
  void set_temperature(const std::array<double, 2>& temperature_c);
  void observe_at(const std::array<double, 2>& temperature_c);

  [[nodiscard]] DriftEstimate estimate() const;
  /// Probability that the platform stands, in a run of steady windows; 0 outside.
  [[nodiscard]] double standing() const;
  /// Probability that the platform turns steadily, in a run of steady windows; 0 outside.
  [[nodiscard]] double turning() const;
  /// Probability that this gyro has made a step that is not settled yet.
  [[nodiscard]] double stepped(std::size_t gyro) const;
  /// Two hypotheses are likely, and differ by more than their σ.
  [[nodiscard]] bool ambiguous() const;
  /// A window updates few filters: there is one hypothesis, and its bank is small.
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
    Steady last = Steady::kNo;                  ///< what the platform did in the last run
    double last_turn_dps = 0.0;                 ///< rate of the last turn, or of the present one
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
  std::array<bool, 2> suspected_{};  ///< by suspect(), since the last step
  double swell_variance_ = 0.0;      ///< of the level between runs at one place
  double last_level_dps_ = 0.0;
  std::array<Reading, kSlots> slots_;
  std::size_t count_ = 0;
};

}  // namespace vgyro::fusion
