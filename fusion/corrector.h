#pragma once

// The interface between the pipeline and a correction method: aligned pairs in, virtual rate out.
// Times are seconds on one monotone axis, rates deg/s. After construction nothing is allocated. A
// method knows no frames, stamps or states; the pipeline decides when it is called.

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>

#include "fusion/calibration.h"
#include "fusion/drift_memory.h"
#include "fusion/gyro_parameters.h"

namespace vgyro::fusion {

struct RatePair {
  double t_s = 0.0;
  std::array<double, 2> rate_dps{};
  /// White-noise variance of each rate relative to one raw sample of its gyro: below 1 where it was
  /// interpolated or averaged.
  std::array<double, 2> noise_gain{1.0, 1.0};
};

struct VirtualRate {
  double rate_dps = 0.0;
  double sigma_dps = 0.0;                 ///< NaN where the method gives none
  std::array<double, 2> corrected_dps{};  ///< each gyro less its own drift
  bool usable = true;                     ///< false: its only source is contradicted
};

struct Drift {
  std::array<double, 2> bias_dps{};  ///< NaN where the method has none
  double slope_dps_s = 0.0;  ///< of the drift subtracted from the virtual rate; NaN where unknown
  double bias_sigma_dps = 0.0;     ///< 1σ of that drift; NaN where unknown
  double slope_sigma_dps_s = 0.0;  ///< 1σ of the slope; NaN where unknown
};

struct WindowCounts {
  std::uint64_t completed = 0;
  std::uint64_t skipped = 0;  ///< too few pairs: the drift was held
};

/// State of the vehicle according to its wheel-speed signal.
enum class Wheels : std::uint8_t { kUnknown, kStanding, kRolling };

/// The hypotheses, each with its probability.
enum class Hypothesis : std::uint8_t {
  kStanding,      ///< in a steady stretch: the platform stands
  kTurning,       ///< in a steady stretch: it turns at a constant rate
  kGyro1Stepped,  ///< its bias may have jumped; not settled yet
  kGyro2Stepped,
  kGyro1Blind,  ///< it feels no rotation
  kGyro2Blind,
  kWarmingUp,   ///< the biases have slopes that fade
  kOwnSlopes,   ///< the biases have slopes that come and go, independent of each other
  kAlikeSlopes  ///< the biases have slopes that come and go, alike in both gyros
};
inline constexpr std::size_t kHypotheses = 9;

/// What the platform's other axes show.
struct Elsewhere {
  bool moves = false;        ///< the platform moves about one of them, so it does not stand
  double log_turning = 0.0;  ///< log odds of a steady turn against a stop, from these axes

  friend bool operator==(const Elsewhere&, const Elsewhere&) = default;
};

/// Present state of the method, for reports and for VG_Bias.
struct Condition {
  bool stopped = false;         ///< standing still: the common drift is being learned
  bool moves = false;           ///< the platform moves about this axis, by this axis's own gyros
  bool steady = false;          ///< in a steady stretch: stop or turn by `probability`
  bool ambiguous = false;       ///< two hypotheses are likely, and far apart
  std::array<bool, 2> blind{};  ///< this gyro probably feels no rotation
  std::array<double, kHypotheses> probability{};
  bool disagree = false;            ///< the gyros contradict each other; which one is wrong is open
  std::array<bool, 2> noisy{};      ///< the noise of this gyro is far above its usual one
  std::uint64_t stops = 0;          ///< stops learned from
  std::uint64_t stops_refused = 0;  ///< steady, but a turn was likelier
  std::uint64_t stops_open = 0;     ///< steady stretches that ended with both hypotheses likely
  std::uint64_t restarts = 0;       ///< restarts of an estimate that was not finite
  std::uint64_t disagreements = 0;  ///< times that `disagree` began
  /// Squared deviation of the last measurements from their prediction, in units of the variance
  /// that was expected of it: 1 where noise and drifts are as modelled. NaN before the first.
  double normalized_innovation = std::numeric_limits<double>::quiet_NaN();
};

class Corrector {
 public:
  virtual ~Corrector() = default;

  [[nodiscard]] virtual bool needs_calibration() const = 0;
  /// The pairs of the initial calibration, with their true rate, before start().
  virtual void calibrate(const RatePair& /*pair*/, double /*true_rate_dps*/) {}
  /// The platform moved: discards the pairs given to calibrate() so far.
  virtual void restart_calibration() {}
  /// Must be called once before update() if needs_calibration().
  virtual void start(const Calibration& calibration) = 0;
  /// Instead of a calibration: continues from a memory that is `age_s` seconds old at `t_s`. False
  /// when this method keeps no memory, or the memory is not plausible; then nothing has changed.
  virtual bool resume(const DriftMemory& /*memory*/, double /*age_s*/, double /*t_s*/) {
    return false;
  }

  /// The next pair; t_s grows from call to call, also across update_alone().
  virtual VirtualRate update(const RatePair& pair) = 0;
  /// One gyro alone: the other gyro's rate is not used.
  virtual VirtualRate update_alone(std::size_t gyro, const RatePair& pair) = 0;
  /// The state of the wheels from now on.
  virtual void set_wheels(Wheels /*wheels*/) {}
  /// The gyros' temperatures from now on, degC; NaN where they are not known.
  virtual void set_temperature(const std::array<double, 2>& /*temperature_c*/) {}
  /// The smallest step that this gyro's values have shown, deg/s.
  virtual void set_resolution(std::size_t /*gyro*/, double /*step_dps*/) {}
  /// Variance of the specific force's magnitude from now on, g²; NaN where it is not known.
  virtual void set_vibration(double /*variance_g2*/) {}

  /// What the platform's other axes show from now on.
  virtual void set_elsewhere(const Elsewhere& /*elsewhere*/) {}
  /// Variance of the gyros' difference that comes from rotation about other axes, because the gyros
  /// are not quite parallel; from now on, (deg/s)².
  virtual void set_cross_variance(double /*variance_dps2*/) {}
  /// The true rate at a stop from now on. No effect if OptimalSettings::stop_rate_dps was absent.
  virtual void set_stop_rate(double /*rate_dps*/) {}

  /// Weight of each gyro in the rate; the sum is 1.
  [[nodiscard]] virtual std::array<double, 2> shares() const { return {0.5, 0.5}; }
  [[nodiscard]] virtual Drift drift(double t_s) const = 0;
  [[nodiscard]] virtual WindowCounts windows() const = 0;
  [[nodiscard]] virtual Condition condition() const { return {}; }
  /// Changes whenever condition() may have changed, some times a second.
  [[nodiscard]] virtual std::uint64_t condition_edition() const { return 0; }
  /// To be kept across a restart; empty before anything is learned.
  [[nodiscard]] virtual std::optional<DriftMemory> memory(double /*t_s*/) const {
    return std::nullopt;
  }
};

/// ½(y₁ + y₂), uncorrected: the baseline that every method must beat.
std::unique_ptr<Corrector> make_mean_corrector();

/// The paper's mutual calibration. order 0…kOrderMax, window_s > 0.
std::unique_ptr<Corrector> make_mutual_corrector(int order, double window_s);

struct OptimalSettings {
  double window_s = 10.0;
  /// The true rate at a stop; if absent, stops are not used.
  std::optional<double> stop_rate_dps = 0.0;
  std::array<GyroParameters, 2> gyros;
};

/// Weights from the gyros' noise, drift divided between the gyros by a Kalman filter over windows,
/// biases from stops: docs/optimal.md.
std::unique_ptr<Corrector> make_optimal_corrector(const OptimalSettings& settings);

}  // namespace vgyro::fusion
