#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "fusion/calibration_blocks.h"
#include "fusion/cells.h"
#include "fusion/coherence.h"
#include "fusion/corrector.h"
#include "fusion/difference_window.h"
#include "fusion/noise_tracker.h"
#include "fusion/quadratic.h"
#include "fusion/readings.h"
#include "fusion/stop_detector.h"

// Samples → cells (0.1 s) → blocks (0.5 s) → windows → hypotheses (Readings), each a bank of drift
// filters. A window holds either the difference of the gyros, regressed on rate and its derivative,
// or, while both are steady, both gyros against the known rate. Between windows a sample costs two
// subtractions, two weights and its share in a cell. docs/optimal.md derives weights and σ.

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

constexpr double kSmooth_s = 0.05;

// Instants closer together than this are equal.
constexpr double kRounding_s = 1e-6;

// Length of windows in a steady run. White noise accumulates in the heading until the window is
// learned, so windows are short; the first one decides between stop and turn and is not too short.
// Later ones grow to kStopWindow_s, or to kStopWindowOfMany_s where a window updates many filters.
constexpr double kFirstStopWindow_s = 1.0;
constexpr double kStopWindow_s = 2.0;
constexpr double kStopWindowOfMany_s = 4.0;

// Blocks of a steady run until it is long enough, and one more.
constexpr std::size_t kHeldMax = 8;

// Windows are short against every Gauss–Markov term.
constexpr double kShareOfTau = 0.1;

// Least divisor for an interval that is unknown or 0.
constexpr double kIntervalMin_s = 1e-6;

// Blocks in a row that may be left out because of values that are no measurements.
constexpr int kSpikedBlocks = 2;

// Limits of the gyros' difference: smoothed over some samples, at every sample;
constexpr double kFastGain = 0.125;
constexpr double kFastNoise = kFastGain / (2.0 - kFastGain);
constexpr double kFastSigma = 5.0;
// unsmoothed, at every sample, against all of its noise;
constexpr double kSuddenSigma = 6.0;
// of a block's mean: beyond this the difference has jumped.
constexpr double kJumpSigma = 6.0;
// A jump that stays constant within this share is a step; one that changes for so many blocks is a
// drift.
constexpr double kStepTolerance = 0.05;
constexpr int kDriftBlocks = 6;
// A contradiction is over after this time without another one.
constexpr double kCalm_s = 120.0;
// In a turn the gyros may differ by this share of the rate.
constexpr double kTurnTolerance = 0.02;
constexpr double kTurnTolerance_s = 0.02;  ///< in a turn, times the rate's derivative, at most
// Allowance for the skew beyond its estimate and σ.
constexpr double kSkewTolerance_s = 0.001;
constexpr double kTurning_dps = 1.0;
// The difference does not show which gyro jumped: least share of either.
constexpr double kShareMin = 1.0 / 3.0;

// Of the mean normalised innovation: its scatter is then 1/4, and a change shows within minutes.
constexpr double kInnovationRows = 32.0;
// No measurement counts for more: one jump must not be seen for an hour.
constexpr double kInnovationMost = 100.0;
// χ² per row from which a window's noise is enlarged.
constexpr double kContradiction = 9.0;
// Deviation of the bias difference, in standard deviations, from which a gyro may have stepped.
constexpr double kStepSigma = 5.0;

// A rate below this many standard deviations of the remainder from other axes may consist of that
// remainder alone.
constexpr double kTilted = 5.0;

// A gyro counts as blind from probability kBlind on; below kBlindMin it does not affect the rate.
constexpr double kBlind = 0.5;
constexpr double kBlindMin = 1e-3;

// A steady stretch counts as a stop from this probability on, and below it as a turn.
constexpr double kDecided = 0.5;

// The temperature moves the biases at once when it has changed by this much.
constexpr double kTemperatureStep_k = 0.05;

// Logarithm of the specific force's variance, relative to that at other stops: 0 ± 0.7 at a stop,
// 2.5 ± 1.6 on the road (twelve times more, within a factor of five). The log odds from it are
// bounded: a ferry and a smooth road are as still as a stop.
constexpr double kStillSpread = 0.7;
constexpr double kMovingLog = 2.5;
constexpr double kMovingSpread = 1.6;
constexpr double kVibrationMost = 4.0;
constexpr double kVibrationLeast = -1.0;
constexpr double kVibrationGain = 0.05;
constexpr double kVibrationFloor_g2 = 1e-8;

// An estimate that is not finite is restarted from the last good biases, with this many times their
// variance.
constexpr double kRestartDoubt = 100.0;

Symmetric biases_of(const DriftFilter::Covariance& covariance) {
  return {covariance(kBias1, kBias1), covariance(kBias1, kBias2), covariance(kBias2, kBias2)};
}

/// Both gyros against the known rate, over `length_s` seconds; `shared` is the variance of an error
/// that both have in common.
DriftMeasurement excess_of_both(const std::array<double, 2>& excess_dps, const Symmetric& density,
                                double length_s, double shared) {
  DriftMeasurement measurement(2);
  measurement.rows(0, kBias1) = 1.0;
  measurement.rows(1, kBias2) = 1.0;
  measurement.values << excess_dps[0], excess_dps[1];
  measurement.noise << density[0], density[1], density[1], density[2];
  measurement.noise /= length_s;
  measurement.noise.array() += shared;
  return measurement;
}

bool is_finite(double value) {
  return std::isfinite(value);
}

bool is_covariance(const Symmetric& matrix) {
  return std::all_of(matrix.begin(), matrix.end(), is_finite) && matrix[0] > 0.0 &&
         matrix[2] > 0.0 && matrix[0] * matrix[2] > matrix[1] * matrix[1];
}

bool is_variance(double value) {
  return std::isfinite(value) && value > 0.0;
}

template <class Values>
bool are_weights(const Values& values) {
  return std::all_of(values.begin(), values.end(),
                     [](double value) { return std::isfinite(value) && value >= 0.0; });
}

template <class Values>
bool are_finite(const Values& values) {
  return std::all_of(values.begin(), values.end(), is_finite);
}

/// Checks a memory before use: its storage may have corrupted it.
bool is_sound(const DriftMemory& memory) {
  return is_covariance(memory.bias_covariance) && is_covariance(memory.white_density) &&
         is_variance(memory.sample_variance[0]) && is_variance(memory.sample_variance[1]) &&
         are_finite(memory.bias_dps) && is_finite(memory.scale_difference) &&
         is_variance(memory.scale_difference_sigma) && is_finite(memory.skew_s) &&
         is_variance(memory.skew_sigma_s) && are_weights(memory.walk_weight) &&
         are_weights(memory.kind_weight) && are_finite(memory.slope_dps_s) &&
         are_weights(memory.slope_sigma_dps_s) && are_finite(memory.coefficient_dps_k) &&
         are_weights(memory.coefficient_sigma_dps_k) && are_finite(memory.temperature_c);
}

std::size_t index_of(Hypothesis hypothesis) {
  return static_cast<std::size_t>(hypothesis);
}

class OptimalCorrector final : public Corrector {
 public:
  explicit OptimalCorrector(const OptimalSettings& settings)
      : settings_(settings),
        window_s_(settings.window_s),
        readings_(settings.gyros),
        noise_(settings.gyros),
        before_(settings.gyros) {
    for (const GyroParameters& gyro : settings.gyros) {
      for (std::size_t i = 0; i < gyro.gauss_markov_count; ++i)
        window_s_ = std::min(window_s_, kShareOfTau * gyro.gauss_markov[i].tau_s);
    }
  }

  [[nodiscard]] bool needs_calibration() const override { return true; }

  void calibrate(const RatePair& pair, double true_rate_dps) override {
    const std::array<double, 2> excess{pair.rate_dps[0] - true_rate_dps,
                                       pair.rate_dps[1] - true_rate_dps};
    follow_still_vibration();
    if (cells_.add(pair.t_s, excess, pair.noise_gain, Present::kBoth)) take_calibration();
  }

  void restart_calibration() override {
    ++edition_;
    cells_.clear();
    calibration_.clear();
    noise_.clear();
    held_count_ = 0;
    still_vibration_g2_ = kNone;
  }

  void start(const Calibration& calibration) override;
  bool resume(const DriftMemory& memory, double age_s, double t_s) override;
  /// Inlined as a whole, like AxisPipeline::receive_gyro().
  [[gnu::flatten]] VirtualRate update(const RatePair& pair) override;
  VirtualRate update_alone(std::size_t gyro, const RatePair& pair) override;
  void set_wheels(Wheels wheels) override { wheels_ = wheels; }
  void set_temperature(const std::array<double, 2>& temperature_c) override {
    temperature_c_ = temperature_c;
  }
  void set_resolution(std::size_t gyro, double step_dps) override {
    noise_.set_resolution(gyro, step_dps);
  }
  void set_vibration(double variance_g2) override { vibration_g2_ = variance_g2; }
  void set_elsewhere(const Elsewhere& elsewhere) override { elsewhere_ = elsewhere; }
  void set_cross_variance(double variance_dps2) override {
    cross_variance_ = variance_dps2;
    cross_sum_ += variance_dps2;
    ++cross_count_;
  }
  void set_stop_rate(double rate_dps) override {
    if (settings_.stop_rate_dps) settings_.stop_rate_dps = rate_dps;
  }

  [[nodiscard]] std::array<double, 2> shares() const override { return weight_; }
  [[nodiscard]] Drift drift(double t_s) const override {
    if (readings_.empty()) return {{kNone, kNone}, kNone, kNone, kNone};
    return {{bias(0, t_s), bias(1, t_s)},
            weight_[0] * slope_[0] + weight_[1] * slope_[1],
            std::sqrt(drift_variance(t_s)),
            std::sqrt(std::max(slope_variance_, 0.0))};
  }
  [[nodiscard]] WindowCounts windows() const override { return windows_; }
  [[nodiscard]] Condition condition() const override;
  [[nodiscard]] std::uint64_t condition_edition() const override { return edition_; }
  [[nodiscard]] std::optional<DriftMemory> memory(double t_s) const override;

 private:
  enum class Kind : std::uint8_t { kNothing, kDifference, kSteady };
  enum class Run : std::uint8_t { kMoving, kStop, kTurn };

  /// Sums since the filters were last updated.
  struct Window {
    Kind kind = Kind::kNothing;
    Present present = Present::kBoth;
    double from_s = 0.0;
    double to_s = 0.0;
    double covered_s = 0.0;  ///< by the blocks of a steady window
    double sway_s = 0.0;     ///< Σ variance of the sway · seconds
    double cross_s = 0.0;    ///< Σ variance of the remainder from other axes · seconds
    double cross_covered_s = 0.0;
    std::array<double, 2> excess_s{};
    std::array<double, 2> temperature_c_s{};
    double temperature_s = 0.0;
  };

  // Calibration.
  void take_calibration();
  void begin_in_motion(const std::array<double, 2>& white, const Symmetric& density);
  void run(double t_s);

  // Blocks.
  [[gnu::noinline]] void close_block(const CellBlock& complete);
  bool is_spiked(const CellBlock& block);
  void judge_coherence(const CellBlock& block);
  [[nodiscard]] double take_cross_variance();
  [[nodiscard]] double window_cross_variance() const;
  [[nodiscard]] Present trusted(Present present) const;
  void learn_from(const CellBlock& block, bool steady);
  bool has_jumped(const CellBlock& block);
  bool is_step(double away_dps, double variance);
  void keep_before();
  void forget_blind_time();
  void end_steady();
  void note_run(Run run);

  // Windows.
  void open_window(const CellBlock& block, Kind kind, Present present);
  void add_difference(const CellBlock& block, Present present);
  void add_steady(const CellBlock& block, Present present);
  void close_window();
  void learn_difference(double length_s);
  void learn_steady();
  [[nodiscard]] DriftMeasurement standing_measurement() const;
  [[nodiscard]] DriftMeasurement turning_measurement() const;
  [[nodiscard]] SteadyWindow steady_window();
  /// Deviation of a window from its prediction.
  struct Contradiction {
    double per_row = 0.0;   ///< χ² per row
    double bias_dps = 0.0;  ///< deviation of the bias difference, from the first row
    double bias_variance = 0.0;
  };
  [[nodiscard]] Contradiction contradiction(const DriftMeasurement& measurement,
                                            double length_s) const;
  void note_innovation(const Contradiction& found, const DriftMeasurement& measurement);

  // For each sample.
  void refresh();
  void begin_anew();
  [[gnu::noinline]] void set_weights(Present present);
  [[nodiscard]] BlockLevel level_of(const CellBlock& block) const;
  [[nodiscard]] double cell_rate(const Cell& cell, double t_s, Present present) const;
  [[nodiscard]] double bias(std::size_t gyro, double t_s) const {
    return bias_[gyro] + slope_[gyro] * std::max(t_s - learned_until_s_, 0.0);
  }
  [[nodiscard]] double rate_density(std::size_t gyro, double rate_dps) const {
    return squared(settings_.gyros[gyro].rate_noise_rthz * rate_dps);
  }
  /// For the gyros' difference.
  [[nodiscard]] double rate_density(double rate_dps) const {
    return rate_density(0, rate_dps) + rate_density(1, rate_dps);
  }
  [[nodiscard]] double interval_s() const { return std::max(cells_.interval_s(), kIntervalMin_s); }
  [[nodiscard]] double drift_variance(double t_s) const {
    const double late_s = std::max(t_s - learned_until_s_, 0.0);
    return doubt_ + (doubt_growth_ + 2.0 * doubt_with_slope_ + slope_variance_ * late_s) * late_s;
  }
  /// Probability that gyro 1 is the wrong one when the gyros contradict each other, by the drifts
  /// alone.
  [[nodiscard]] double suspicion_of_first() const {
    return std::clamp(estimate_.drift_share[0], kShareMin, 1.0 - kShareMin);
  }
  [[nodiscard]] [[gnu::cold, gnu::noinline]] VirtualRate with_blindness(
      const VirtualRate& rate, const std::array<double, 2>& noise) const;
  [[gnu::noinline]] double acceleration_square(double rate_dps, double t_s);
  void apply_temperature();
  void follow_still_vibration();
  [[nodiscard]] double log_turning_by_vibration() const;

  OptimalSettings settings_;
  double window_s_;
  CellBuilder cells_;
  CalibrationBlocks calibration_;
  Readings readings_;
  NoiseTracker noise_;
  StopDetector detector_;
  Coherence coherence_;
  DifferenceWindow difference_;
  Wheels wheels_ = Wheels::kUnknown;
  std::array<double, 2> temperature_c_{kNone, kNone};
  std::array<double, 2> applied_temperature_c_{kNone, kNone};
  double vibration_g2_ = kNone;
  Elsewhere elsewhere_;
  double log_turning_elsewhere_ = 0.0;  ///< the part already counted in this steady run
  double cross_variance_ = 0.0;         ///< at present
  double cross_sum_ = 0.0;              ///< since the last block
  std::uint64_t cross_count_ = 0;
  double still_vibration_g2_ = kNone;  ///< at stops

  Window window_;
  double learned_until_s_ = 0.0;               ///< time of the filters' state
  double stop_length_s_ = kFirstStopWindow_s;  ///< of the next window in this steady run
  /// Blocks that are not learned yet: the last one, and, while a steady run is not long enough, all
  /// of its blocks.
  std::array<CellBlock, kHeldMax> held_;
  std::size_t held_count_ = 0;
  double recent_until_s_ = 0.0;
  bool held_steady_ = false;
  bool held_begins_ = false;  ///< the first held block begins a run of steady blocks
  /// The likeliest bank from before the gyros began to contradict each other.
  DriftBank before_;
  bool has_before_ = false;
  double before_s_ = 0.0;
  double contradicted_s_ = 0.0;  ///< time of the last contradiction
  int spiked_blocks_ = 0;        ///< spiked blocks in a row
  int jump_blocks_ = 0;          ///< blocks in a row that deviate from the prediction
  double suspected_jump_dps_ = 0.0;
  Run run_ = Run::kMoving;
  bool run_open_ = false;  ///< stop and turn are both likely

  // Values for each sample, computed by refresh().
  DriftEstimate estimate_;
  std::array<double, 2> bias_{};
  std::array<double, 2> slope_{};
  std::array<double, 2> gain_{1.0, 1.0};  ///< 1/(1 + scale)
  Present weights_for_ = Present::kBoth;
  std::array<double, 2> weight_{0.5, 0.5};
  double doubt_ = 0.0;             ///< variance of the weighted drift
  double doubt_growth_ = 0.0;      ///< per second
  double doubt_with_slope_ = 0.0;  ///< its covariance with the weighted slope
  double slope_variance_ = 0.0;
  double scale_doubt_ = 0.0;    ///< variance per (deg/s)² of rate
  double timing_doubt_ = 0.0;   ///< variance per (deg/s²)² of acceleration
  double smooth_rate_ = 0.0;    ///< virtual rate, smoothed over kSmooth_s
  double smoother_rate_ = 0.0;  ///< smooth_rate_, smoothed once more
  double smooth_until_s_ = 0.0;
  double fast_noise_ = 0.0;  ///< variance of the smoothed difference
  double fast_difference_ = 0.0;
  double blame_ = 0.0;  ///< variance of the virtual rate per squared excess difference
  std::array<double, 2> blind_{};
  bool blind_before_ = false;  ///< one gyro counted as blind at the last block

  WindowCounts windows_;
  double innovation_sum_ = 0.0;   ///< of squared innovations, the older the less
  double innovation_rows_ = 0.0;  ///< how many they are
  Condition condition_;
  std::uint64_t edition_ = 1;  ///< of condition()
};

// --- calibration ---------------------------------------------------------------------------------

// Holds back the last second: motion that ends the calibration early has begun in it.
void OptimalCorrector::take_calibration() {
  constexpr double kKept_s = 1.0;
  const auto use_first = [this] {
    calibration_.add(held_[0]);
    noise_.measure(held_[0], false);
    std::move(held_.begin() + 1, held_.begin() + held_count_, held_.begin());
    --held_count_;
  };
  held_[held_count_++] = cells_.last();
  while (held_count_ == kHeldMax ||
         (held_count_ > 0 && held_[held_count_ - 1].to_s - held_[0].to_s >= kKept_s))
    use_first();
}

void OptimalCorrector::start(const Calibration& calibration) {
  for (std::size_t i = 0; i < held_count_; ++i) {
    if (held_[i].to_s > calibration.used_until_s + kRounding_s) break;
    calibration_.add(held_[i]);
    noise_.measure(held_[i], calibration.in_motion);
  }
  held_count_ = 0;
  if (calibration_.count() == 0) {
    // The rest was shorter than one block: only the calibration's own means are known.
    readings_.begin(
        {1.0, 1.0},
        {calibration.bias_dps(0, calibration.end_s), calibration.bias_dps(1, calibration.end_s)},
        {1.0, 0.0, 1.0});
    run(calibration.end_s);
    return;
  }
  noise_.settle(cells_.interval_s());
  const Symmetric& density = noise_.usual_density();
  const std::array<double, 2> white{std::sqrt(density[0]), std::sqrt(density[2])};
  if (calibration.in_motion) {
    begin_in_motion(white, density);
    return;
  }
  const double sway = calibration_.sway_variance(density);
  for (std::size_t i = 0; i < calibration_.count(); ++i) {
    const CalibrationBlocks::Mean& mean = calibration_[i];
    const DriftMeasurement measured = excess_of_both(mean.excess_dps, density, mean.length_s, sway);
    if (i == 0) {
      readings_.begin(white, mean.excess_dps,
                      {measured.noise(0, 0), measured.noise(0, 1), measured.noise(1, 1)});
      learned_until_s_ = mean.to_s;
      continue;
    }
    if (mean.from_s > learned_until_s_) readings_.predict(mean.from_s - learned_until_s_);
    readings_.learn(mean.to_s - std::max(mean.from_s, learned_until_s_), measured);
    learned_until_s_ = mean.to_s;
  }
  run(learned_until_s_);
}

// The motion was accepted as rest: only its mean is known. How far the mean is from rest is not
// known, so the swing of the motion is its uncertainty.
void OptimalCorrector::begin_in_motion(const std::array<double, 2>& white,
                                       const Symmetric& density) {
  std::array<double, 2> mean{};
  double square = 0.0;
  double length = 0.0;
  for (std::size_t i = 0; i < calibration_.count(); ++i) {
    const CalibrationBlocks::Mean& one = calibration_[i];
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      mean[gyro] += one.length_s * one.excess_dps[gyro];
    square += one.length_s * squared(0.5 * (one.excess_dps[0] + one.excess_dps[1]));
    length += one.length_s;
    learned_until_s_ = one.to_s;
  }
  mean[0] /= length;
  mean[1] /= length;
  const double swing = std::max(square / length - squared(0.5 * (mean[0] + mean[1])), 0.0);
  readings_.begin(
      white, mean,
      {density[0] / length + swing, density[1] / length + swing, density[2] / length + swing});
  run(learned_until_s_);
}

bool OptimalCorrector::resume(const DriftMemory& memory, double age_s, double t_s) {
  if (!is_sound(memory) || !(age_s >= 0.0) || !std::isfinite(age_s)) return false;
  noise_.resume(memory.white_density, memory.sample_variance);
  readings_.resume(memory, age_s);
  run(t_s);
  return true;
}

std::optional<DriftMemory> OptimalCorrector::memory(double t_s) const {
  if (readings_.empty()) return std::nullopt;
  DriftMemory memory;
  readings_.save(memory);
  const double late_s = std::max(t_s - learned_until_s_, 0.0);
  const Eigen::Matrix2d with = estimate_.slope_with_bias * late_s;
  const Eigen::Matrix2d covariance = estimate_.covariance.topLeftCorner<2, 2>() + with +
                                     with.transpose() +
                                     estimate_.slope_covariance * (late_s * late_s);
  memory.bias_dps = {bias(0, t_s), bias(1, t_s)};
  memory.bias_covariance = {covariance(0, 0) + estimate_.growth[0] * late_s, covariance(0, 1),
                            covariance(1, 1) + estimate_.growth[1] * late_s};
  memory.scale_difference = estimate_.mean(kScale);
  memory.scale_difference_sigma = std::sqrt(estimate_.covariance(kScale, kScale));
  memory.skew_s = estimate_.mean(kSkew);
  memory.skew_sigma_s = std::sqrt(estimate_.covariance(kSkew, kSkew));
  memory.white_density = noise_.usual_density();
  memory.sample_variance = {noise_.usual_sample_variance()[0], noise_.usual_sample_variance()[2]};
  return memory;
}

void OptimalCorrector::run(double t_s) {
  ++edition_;
  learned_until_s_ = t_s;
  cells_.clear();
  held_count_ = 0;
  stop_length_s_ = kFirstStopWindow_s;
  window_.kind = Kind::kNothing;
  run_ = Run::kMoving;
  run_open_ = false;
  has_before_ = false;
  detector_.reset();
  coherence_.clear();
  difference_.break_off();
  readings_.set_temperature(temperature_c_);
  applied_temperature_c_ = temperature_c_;
  refresh();
}

// --- samples -------------------------------------------------------------------------------------

VirtualRate OptimalCorrector::update(const RatePair& pair) {
  if (cells_.add(pair.t_s, pair.rate_dps, pair.noise_gain, Present::kBoth))
    close_block(cells_.last());
  const Present trusted_now = trusted(Present::kBoth);
  if (weights_for_ != trusted_now) set_weights(trusted_now);

  const double first = (pair.rate_dps[0] - bias(0, pair.t_s)) * gain_[0];
  const double second = (pair.rate_dps[1] - bias(1, pair.t_s)) * gain_[1];
  const double rate = weight_[0] * first + weight_[1] * second;

  const Symmetric& sample = noise_.sample_variance();
  const double interval = interval_s();
  const double noise_1 = (sample[0] + rate_density(0, rate) / interval) * pair.noise_gain[0];
  const double noise_2 = (sample[2] + rate_density(1, rate) / interval) * pair.noise_gain[1];
  const double noise_12 = sample[1] * std::sqrt(pair.noise_gain[0] * pair.noise_gain[1]);
  double variance = weighted(weight_, {noise_1, noise_12, noise_2}) + drift_variance(pair.t_s) +
                    scale_doubt_ * rate * rate;
  if (timing_doubt_ > 0.0) variance += timing_doubt_ * acceleration_square(rate, pair.t_s);

  // While the gyros contradict each other, either may be wrong: σ covers both.
  fast_difference_ += kFastGain * (first - second - fast_difference_);
  const double contradiction = fast_difference_ * fast_difference_;
  const double allowed =
      squared(kFastSigma) *
      (fast_noise_ + kFastNoise * rate_density(rate) / interval + cross_variance_);
  // A single value that is no measurement.
  const double sudden =
      squared(first - second) -
      squared(kSuddenSigma) * (noise_1 - 2.0 * noise_12 + noise_2 + fast_noise_ + cross_variance_);
  variance += blame_ * std::max({contradiction - allowed, sudden, 0.0});
  const VirtualRate out{rate, std::sqrt(variance), {first, second}};
  if (blind_[0] + blind_[1] < kBlindMin) return out;
  return with_blindness(out, {noise_1, noise_2});
}

// Three cases: both feel the rotation, only gyro 2 does, only gyro 1 does.
VirtualRate OptimalCorrector::with_blindness(const VirtualRate& rate,
                                             const std::array<double, 2>& noise) const {
  const double both = std::max(1.0 - blind_[0] - blind_[1], 0.0);
  const double sum = both + blind_[0] + blind_[1];
  const std::array<double, 3> share{both / sum, blind_[0] / sum, blind_[1] / sum};
  const std::array<double, 3> value{rate.rate_dps, rate.corrected_dps[1], rate.corrected_dps[0]};
  const std::array<double, 3> variance{squared(rate.sigma_dps),
                                       noise[1] + estimate_.covariance(kBias2, kBias2),
                                       noise[0] + estimate_.covariance(kBias1, kBias1)};
  VirtualRate mixed = rate;
  mixed.rate_dps = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    mixed.rate_dps += share[i] * value[i];
  double square = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    square += share[i] * (variance[i] + squared(value[i] - mixed.rate_dps));
  mixed.sigma_dps = std::sqrt(square);
  return mixed;
}

// Squared dΩ/dt, less the noise that the smoothed rate has.
double OptimalCorrector::acceleration_square(double rate_dps, double t_s) {
  const double tau_s = std::max(kSmooth_s, 2.0 * cells_.interval_s());
  const double share = std::clamp((t_s - smooth_until_s_) / tau_s, 0.0, 1.0);
  smooth_until_s_ = t_s;
  smooth_rate_ += share * (rate_dps - smooth_rate_);
  // smoother_rate_ lags behind smooth_rate_ by tau_s · dΩ/dt.
  const double slope = (smooth_rate_ - smoother_rate_) / tau_s;
  smoother_rate_ += share * (smooth_rate_ - smoother_rate_);
  const double noise = weighted(weight_, noise_.density()) / (4.0 * tau_s) / squared(tau_s);
  return std::max(squared(slope) - noise, 0.0);
}

VirtualRate OptimalCorrector::update_alone(std::size_t gyro, const RatePair& pair) {
  const Present present = gyro == 0 ? Present::kGyro1 : Present::kGyro2;
  // The missing gyro gets a value so that its sums stay finite; nothing reads them.
  RatePair alone = pair;
  alone.rate_dps[1 - gyro] = 0.0;
  if (cells_.add(alone.t_s, alone.rate_dps, alone.noise_gain, present)) close_block(cells_.last());
  if (weights_for_ != present) {
    ++edition_;
    readings_.suspect(1 - gyro);
    // A rise of noise is found by comparison: the gyro that fell out may have made the other one
    // look noisy.
    noise_.forget_rise();
    set_weights(present);
  }
  fast_difference_ = 0.0;

  VirtualRate out{
      (pair.rate_dps[gyro] - bias(gyro, pair.t_s)) * gain_[gyro], kNone, {kNone, kNone}};
  out.corrected_dps[gyro] = out.rate_dps;
  const double interval = interval_s();
  const double noise =
      noise_.sample_variance()[2 * gyro] + rate_density(gyro, out.rate_dps) / interval;
  out.sigma_dps = std::sqrt(noise * pair.noise_gain[gyro] + drift_variance(pair.t_s) +
                            scale_doubt_ * squared(out.rate_dps));
  out.usable = blind_[gyro] < kBlind;
  return out;
}

// --- blocks --------------------------------------------------------------------------------------

double OptimalCorrector::cell_rate(const Cell& cell, double t_s, Present present) const {
  const double first = (cell.mean_dps[0] - bias(0, t_s)) * gain_[0];
  const double second = (cell.mean_dps[1] - bias(1, t_s)) * gain_[1];
  if (present == Present::kGyro1) return first;
  if (present == Present::kGyro2) return second;
  return weight_[0] * first + weight_[1] * second;
}

BlockLevel OptimalCorrector::level_of(const CellBlock& block) const {
  BlockLevel level;
  level.length_s = block.length_s();
  level.cells = static_cast<double>(block.count);
  level.bias_dps = {bias(0, block.to_s), bias(1, block.to_s)};
  level.weight = weight_;
  level.doubt_variance = drift_variance(block.to_s);
  const Symmetric& density = noise_.density();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    level.excess_dps[gyro] = block.mean_dps(gyro) - *settings_.stop_rate_dps;
    level.excess_variance[gyro] =
        density[2 * gyro] / level.length_s + noise_.rounding_variance(gyro);
  }
  double sum = 0.0;
  double cell_s = 0.0;
  for (std::size_t i = 0; i < block.count; ++i) {
    sum += cell_rate(block.cells[i], block.to_s, weights_for_);
    cell_s += block.cells[i].length_s;
  }
  const double mean = sum / level.cells;
  double squares = 0.0;
  for (std::size_t i = 0; i < block.count; ++i)
    squares += squared(cell_rate(block.cells[i], block.to_s, weights_for_) - mean);
  level.cell_variance = squares / std::max(level.cells - 1.0, 1.0);
  level.noise_variance = weighted(weight_, density) * level.cells / cell_s;
  return level;
}

/// The gyros that may be used: a blind gyro is ignored.
Present OptimalCorrector::trusted(Present present) const {
  if (present != Present::kBoth) return present;
  if (blind_[0] >= kBlind) return Present::kGyro2;
  return blind_[1] >= kBlind ? Present::kGyro1 : Present::kBoth;
}

void OptimalCorrector::judge_coherence(const CellBlock& block) {
  if (block.present != Present::kBoth) {
    coherence_.break_off();
    return;
  }
  // Raw means: an update of the biases must not look like motion.
  const std::array<double, 2> mean{block.mean_dps(0) * gain_[0], block.mean_dps(1) * gain_[1]};
  // Gyros that are not parallel may feel a rotation about other axes differently.
  const double fastest = std::max(std::abs(mean[0]), std::abs(mean[1]));
  if (squared(kTilted) * block.cross_variance > squared(fastest)) {
    coherence_.break_off();
    return;
  }
  // A time skew sets the gyros apart by at most the skew times the steepest slope in the block.
  double bend = 0.0;
  for (std::size_t i = 1; i < block.count; ++i) {
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const double step = block.cells[i].mean_dps[gyro] - block.cells[i - 1].mean_dps[gyro];
      bend = std::max(bend, std::abs(step) / CellBuilder::kCell_s);
    }
  }
  coherence_.judge(mean, block.from_s, block.to_s, noise_.density(),
                   std::max(kTurnTolerance_s, 3.0 * std::abs(estimate_.mean(kSkew))) * bend);
  blind_ = {coherence_.blind(0), coherence_.blind(1)};
}

// A block with values that are no measurements is left out: it teaches nothing, and neither begins
// nor ends a stop. After kSpikedBlocks in a row the gyro has become noisy, which is learned.
bool OptimalCorrector::is_spiked(const CellBlock& block) {
  const double rate = cell_rate(block.cells[0], block.to_s, weights_for_);
  if (!noise_.spiked(block, rate_density(rate) / interval_s())) {
    spiked_blocks_ = 0;
    return false;
  }
  return ++spiked_blocks_ <= kSpikedBlocks;
}

double OptimalCorrector::take_cross_variance() {
  const double mean =
      cross_count_ > 0 ? cross_sum_ / static_cast<double>(cross_count_) : cross_variance_;
  cross_sum_ = 0.0;
  cross_count_ = 0;
  return mean;
}

// A block is used after the next one has been judged: motion begins before it is detected.
void OptimalCorrector::close_block(const CellBlock& complete) {
  ++edition_;
  const double cross_variance = take_cross_variance();
  if (is_spiked(complete)) return;
  CellBlock block = complete;
  block.cross_variance = cross_variance;
  judge_coherence(block);
  const Present present = trusted(block.present);
  if (block.present == Present::kBoth && present != Present::kBoth && !blind_before_)
    forget_blind_time();
  blind_before_ = block.present == Present::kBoth && present != Present::kBoth;
  if (present != weights_for_) set_weights(present);
  if (present == Present::kBoth) {
    noise_.watch(block);
  } else {
    noise_.forget_rise();
  }
  apply_temperature();
  auto steadiness = StopDetector::Steadiness::kMoving;
  if (settings_.stop_rate_dps)
    steadiness = detector_.judge(level_of(block), wheels_, elsewhere_.moves);
  const bool steady = steadiness == StopDetector::Steadiness::kSteady;
  // All held blocks but the last belong to a run that has just become long enough, or to none.
  const bool waits = steadiness == StopDetector::Steadiness::kUnsure && held_count_ < kHeldMax;
  if (!waits || detector_.run_begins()) {
    for (std::size_t i = 0; i < held_count_; ++i) {
      const bool still = steady && held_steady_ && held_[i].present == block.present;
      learn_from(held_[i], still && !(i == 0 && held_begins_));
    }
    held_count_ = 0;
    // The first steady block may hold the end of the motion.
    held_begins_ = detector_.run_begins();
  }
  if (!steady && run_ != Run::kMoving) end_steady();
  held_[held_count_++] = block;
  held_steady_ = steadiness != StopDetector::Steadiness::kMoving;
}

void OptimalCorrector::learn_from(const CellBlock& block, bool steady) {
  const Present present = trusted(block.present);
  if (present == Present::kBoth && (coherence_.suspects() || has_jumped(block))) return;
  if (steady) {
    if (readings_.standing() > kDecided && detector_.sway_variance() == 0.0 &&
        noise_.usual(block)) {
      noise_.measure(block, false);
      noise_.settle(cells_.interval_s());
    }
    add_steady(block, present);
    return;
  }
  add_difference(block, present);
}

// Counts the present stretch as a stop or a turn: once, by the latest verdict.
void OptimalCorrector::note_run(Run run) {
  if (run_ == run) return;
  if (run_ == Run::kStop) --condition_.stops;
  if (run_ == Run::kTurn) --condition_.stops_refused;
  if (run == Run::kStop) ++condition_.stops;
  if (run == Run::kTurn) ++condition_.stops_refused;
  run_ = run;
}

void OptimalCorrector::end_steady() {
  if (window_.kind == Kind::kSteady) close_window();
  if (run_open_) ++condition_.stops_open;
  run_ = Run::kMoving;
  run_open_ = false;
  readings_.end_steady();
  detector_.stay();
  stop_length_s_ = kFirstStopWindow_s;
  refresh();
}

bool OptimalCorrector::has_jumped(const CellBlock& block) {
  const double length = block.length_s();
  double difference = 0.0;
  double rate = 0.0;
  double rate_square = 0.0;
  double slope = 0.0;
  for (std::size_t i = 0; i < block.count; ++i) {
    const Cell& cell = block.cells[i];
    const double one = cell_rate(cell, block.to_s, Present::kBoth);
    const double share = cell.length_s / length;
    difference += share * (cell.mean_dps[0] - cell.mean_dps[1]);
    rate += share * one;
    rate_square += share * one * one;
    if (i > 0) {
      slope = std::max(slope,
                       std::abs(one - cell_rate(block.cells[i - 1], block.to_s, Present::kBoth)) /
                           cell.length_s);
    }
  }
  const double late_s = std::max(block.to_s - learned_until_s_, 0.0);
  DriftFilter::Observables regressor;
  regressor << 1.0, -1.0, rate, 0.0;
  const double foretold = regressor.dot(estimate_.mean) + (slope_[0] - slope_[1]) * late_s;
  const double away = difference - foretold;
  const Eigen::Vector2d apart(1.0, -1.0);
  double variance = regressor.dot(estimate_.covariance * regressor) +
                    (estimate_.growth[0] + estimate_.growth[1]) * late_s +
                    2.0 * late_s * apart.dot(estimate_.slope_with_bias * apart) +
                    late_s * late_s * apart.dot(estimate_.slope_covariance * apart) +
                    of_difference(noise_.density()) / length + rate_density(rate) / length +
                    noise_.rounding_variance(0) + noise_.rounding_variance(1) +
                    block.cross_variance;
  const double skew_s = std::abs(estimate_.mean(kSkew)) +
                        std::sqrt(estimate_.covariance(kSkew, kSkew)) + kSkewTolerance_s;
  variance += squared(std::min(skew_s, kTurnTolerance_s) * slope);
  if (rate_square > squared(kTurning_dps)) variance += squared(kTurnTolerance) * rate_square;
  if (squared(away) <= squared(kJumpSigma) * variance) {
    jump_blocks_ = 0;
    return false;
  }
  return !is_step(away, variance);
}

// One block alone proves nothing. Two blocks in a row that agree are a step. A deviation that keeps
// changing is a turn that one gyro does not feel, while coherence suspects that, and otherwise a
// drift.
bool OptimalCorrector::is_step(double away_dps, double variance) {
  const double changed = std::abs(away_dps - suspected_jump_dps_);
  const bool constant = jump_blocks_ > 0 && changed <= kJumpSigma * std::sqrt(2.0 * variance) +
                                                           kStepTolerance * std::abs(away_dps);
  suspected_jump_dps_ = away_dps;
  ++jump_blocks_;
  if (coherence_.suspects()) return false;
  if (!constant && jump_blocks_ < kDriftBlocks) return false;
  jump_blocks_ = 0;
  close_window();
  keep_before();
  const double doubt = constant ? variance : squared(kShareMin * away_dps) + variance;
  readings_.split_step(away_dps, doubt, suspicion_of_first());
  fast_difference_ = 0.0;
  refresh();
  return true;
}

// A blind gyro contradicts the other one before it is recognized, and what is learned meanwhile may
// be wrong for both. This keeps the bank from before.
void OptimalCorrector::keep_before() {
  if (!has_before_ || learned_until_s_ - contradicted_s_ > kCalm_s) {
    readings_.copy_likeliest(before_);
    before_s_ = learned_until_s_;
    has_before_ = true;
  }
  contradicted_s_ = learned_until_s_;
}

void OptimalCorrector::forget_blind_time() {
  if (!has_before_ || learned_until_s_ - contradicted_s_ > kCalm_s) return;
  close_window();
  readings_.go_back(before_, std::max(learned_until_s_ - before_s_, 0.0));
  run_ = Run::kMoving;
  run_open_ = false;
  has_before_ = false;
  refresh();
}

// --- windows -------------------------------------------------------------------------------------

void OptimalCorrector::open_window(const CellBlock& block, Kind kind, Present present) {
  const bool goes_on = window_.kind == kind && window_.present == present &&
                       block.from_s <= window_.to_s + kRounding_s;
  if (!goes_on) {
    close_window();
    // A steady run of other gyros is over: its level cannot be compared with this one's.
    if (run_ != Run::kMoving && window_.present != present) end_steady();
    if (block.from_s > learned_until_s_) {
      readings_.predict(block.from_s - learned_until_s_);
      learned_until_s_ = block.from_s;
    }
    window_ = Window{
        .kind = kind, .present = present, .from_s = learned_until_s_, .to_s = learned_until_s_};
    difference_.clear();
  }
  window_.to_s = std::max(block.to_s, window_.to_s);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    window_.temperature_c_s[gyro] += temperature_c_[gyro] * block.length_s();
  window_.temperature_s += block.length_s();
  window_.cross_s += block.cross_variance * block.length_s();
  window_.cross_covered_s += block.length_s();
}

double OptimalCorrector::window_cross_variance() const {
  return window_.cross_covered_s > 0.0 ? window_.cross_s / window_.cross_covered_s : 0.0;
}

void OptimalCorrector::add_difference(const CellBlock& block, Present present) {
  stop_length_s_ = kFirstStopWindow_s;
  if (block.from_s > recent_until_s_ + kRounding_s || present != Present::kBoth)
    difference_.break_off();
  open_window(block, Kind::kDifference, present);
  if (present == Present::kBoth) {
    const RateNoise noise{weighted(weight_, noise_.density()), of_difference(noise_.density()),
                          rate_density(0, 1.0) + rate_density(1, 1.0)};
    for (std::size_t i = 0; i < block.count; ++i) {
      const Cell& cell = block.cells[i];
      difference_.add({cell_rate(cell, block.to_s, present), cell.mean_dps[0] - cell.mean_dps[1],
                       cell.length_s},
                      noise);
    }
  }
  recent_until_s_ = block.to_s;
  // A turn that determines scale factor or skew better than they are known is used at once.
  const bool tells = difference_.scale_information() * estimate_.covariance(kScale, kScale) > 1.0 ||
                     difference_.skew_information() * estimate_.covariance(kSkew, kSkew) > 1.0;
  if (tells || window_.to_s - window_.from_s >= window_s_) close_window();
}

void OptimalCorrector::add_steady(const CellBlock& block, Present present) {
  open_window(block, Kind::kSteady, present);
  const double length = block.length_s();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    window_.excess_s[gyro] += (block.mean_dps(gyro) - *settings_.stop_rate_dps) * length;
  }
  window_.covered_s += length;
  window_.sway_s += detector_.sway_variance() * length;
  // Windows are short at the beginning of a stop, and grow later.
  const double longest_s = readings_.few() ? kStopWindow_s : kStopWindowOfMany_s;
  if (window_.to_s - window_.from_s < std::min({stop_length_s_, window_s_, longest_s})) return;
  stop_length_s_ = 2.0 * stop_length_s_;
  close_window();
}

void OptimalCorrector::close_window() {
  if (window_.kind == Kind::kNothing) return;
  const double length = window_.to_s - window_.from_s;
  std::array<double, 2> mean_c{kNone, kNone};
  for (std::size_t gyro = 0; gyro < 2 && window_.temperature_s > 0.0; ++gyro)
    mean_c[gyro] = window_.temperature_c_s[gyro] / window_.temperature_s;
  const Kind kind = window_.kind;
  window_.kind = Kind::kNothing;
  readings_.observe_at(mean_c);
  if (kind == Kind::kSteady) {
    learn_steady();
  } else {
    learn_difference(length);
  }
  readings_.observe_at(applied_temperature_c_);
  learned_until_s_ = window_.to_s;
  refresh();
}

void OptimalCorrector::learn_difference(double length_s) {
  DriftMeasurement measurement(0);
  if (window_.present == Present::kBoth) measurement = difference_.measure();
  if (measurement.values.size() == 0) {
    readings_.predict(length_s);
    ++windows_.skipped;
    return;
  }
  // The rows have unit noise. The remainder from other axes is the same in the whole window, and
  // may be proportional to this axis's own rate, so it is added to every row.
  const double information = squared(measurement.rows(0, kBias1));
  measurement.noise.diagonal().array() += information * window_cross_variance();
  const Contradiction found = contradiction(measurement, length_s);
  DriftMeasurement doubted = measurement;
  if (found.per_row > kContradiction) doubted.noise *= found.per_row / kContradiction;
  if (squared(found.bias_dps) > squared(kStepSigma) * found.bias_variance) {
    keep_before();
    readings_.learn_maybe_step(length_s, measurement, doubted, found.bias_dps, found.bias_variance,
                               suspicion_of_first());
  } else {
    readings_.learn(length_s, doubted);
  }
  note_innovation(found, measurement);
  ++windows_.completed;
}

// Before any doubt is added because of it: what the filters expected of the measurement.
void OptimalCorrector::note_innovation(const Contradiction& found,
                                       const DriftMeasurement& measurement) {
  if (!std::isfinite(found.per_row)) return;  // begin_anew() counts that
  const auto rows = static_cast<double>(measurement.values.size());
  const double kept = std::exp(-rows / kInnovationRows);
  innovation_sum_ = kept * innovation_sum_ + rows * std::min(found.per_row, kInnovationMost);
  innovation_rows_ = kept * innovation_rows_ + rows;
  condition_.normalized_innovation = innovation_sum_ / innovation_rows_;
}

DriftMeasurement OptimalCorrector::standing_measurement() const {
  const double length = window_.covered_s;
  const double sway = window_.sway_s / length;
  const std::array<double, 2> excess{window_.excess_s[0] / length, window_.excess_s[1] / length};
  const std::array<double, 2> rounding{noise_.rounding_variance(0), noise_.rounding_variance(1)};
  if (window_.present == Present::kBoth) {
    DriftMeasurement measurement = excess_of_both(excess, noise_.density(), length, sway);
    measurement.noise(0, 0) += rounding[0];
    measurement.noise(1, 1) += rounding[1];
    return measurement;
  }
  const std::size_t gyro = window_.present == Present::kGyro1 ? 0 : 1;
  DriftMeasurement measurement(1);
  measurement.rows(0, gyro == 0 ? kBias1 : kBias2) = 1.0;
  measurement.values(0) = excess[gyro];
  measurement.noise(0, 0) = noise_.density()[2 * gyro] / length + rounding[gyro] + sway;
  return measurement;
}

DriftMeasurement OptimalCorrector::turning_measurement() const {
  if (window_.present != Present::kBoth) return DriftMeasurement(0);
  const double length = window_.covered_s;
  const double rate =
      cell_rate({.mean_dps = {window_.excess_s[0] / length + *settings_.stop_rate_dps,
                              window_.excess_s[1] / length + *settings_.stop_rate_dps}},
                window_.to_s, Present::kBoth);
  DriftMeasurement measurement(1);
  measurement.rows(0, kBias1) = 1.0;
  measurement.rows(0, kBias2) = -1.0;
  measurement.rows(0, kScale) = rate;
  measurement.values(0) = (window_.excess_s[0] - window_.excess_s[1]) / length;
  measurement.noise(0, 0) =
      (of_difference(noise_.density()) + rate_density(0, rate) + rate_density(1, rate)) / length +
      noise_.rounding_variance(0) + noise_.rounding_variance(1) + window_cross_variance();
  return measurement;
}

SteadyWindow OptimalCorrector::steady_window() {
  SteadyWindow steady;
  steady.standing = standing_measurement();
  steady.turning = turning_measurement();
  steady.length_s = window_.to_s - window_.from_s;
  const DriftMeasurement& both = steady.standing;
  if (window_.present == Present::kBoth) {
    // The weights that make the level independent of the difference.
    const double sum = both.noise(0, 0) + both.noise(1, 1) - 2.0 * both.noise(0, 1);
    const double first = sum > 0.0 ? (both.noise(1, 1) - both.noise(0, 1)) / sum : 0.5;
    steady.weight = {first, 1.0 - first};
    steady.level_dps = first * both.values(0) + (1.0 - first) * both.values(1);
    steady.level_variance =
        weighted(steady.weight, {both.noise(0, 0), both.noise(0, 1), both.noise(1, 1)});
  } else {
    steady.weight = {window_.present == Present::kGyro1 ? 1.0 : 0.0,
                     window_.present == Present::kGyro2 ? 1.0 : 0.0};
    steady.level_dps = both.values(0);
    steady.level_variance = both.noise(0, 0);
  }
  steady.elsewhere = detector_.moved_on();
  steady.log_turning = run_ == Run::kMoving
                           ? detector_.log_turning(wheels_) + log_turning_by_vibration()
                           : detector_.log_turning_gain(wheels_, steady.length_s);
  // Each part of the other axes' log odds counts once in this run.
  if (run_ == Run::kMoving) log_turning_elsewhere_ = 0.0;
  steady.log_turning += elsewhere_.log_turning - log_turning_elsewhere_;
  log_turning_elsewhere_ = elsewhere_.log_turning;
  return steady;
}

void OptimalCorrector::learn_steady() {
  const SteadyWindow window = steady_window();
  const Contradiction found = contradiction(window.standing, window.length_s);
  const bool contradicted = has_before_ && learned_until_s_ - contradicted_s_ <= kCalm_s;
  if (run_ == Run::kMoving && contradicted && window_.present == Present::kBoth)
    readings_.add_back(before_, std::max(learned_until_s_ - before_s_, 0.0));
  readings_.learn_steady(window);
  ++windows_.completed;
  const double standing = readings_.standing();
  note_run(standing > kDecided ? Run::kStop : Run::kTurn);
  run_open_ = std::min(standing, 1.0 - standing) > Readings::kWorthTelling;
  if (standing > 1.0 - Readings::kWorthTelling) {
    follow_still_vibration();
    note_innovation(found, window.standing);
    has_before_ = false;
  }
}

// Large for turns that neither scale factor nor skew explains, and for drift faster than its model.
OptimalCorrector::Contradiction OptimalCorrector::contradiction(const DriftMeasurement& measurement,
                                                                double length_s) const {
  DriftFilter::Covariance doubt = estimate_.covariance;
  doubt(kBias1, kBias1) += estimate_.growth[0] * length_s;
  doubt(kBias2, kBias2) += estimate_.growth[1] * length_s;
  doubt.topLeftCorner<2, 2>() += estimate_.slope_covariance * squared(0.5 * length_s);
  DriftFilter::Observables mean = estimate_.mean;
  mean.head<2>() += estimate_.slope * (0.5 * length_s);
  DriftMeasurement::Square expected = measurement.noise;
  expected += measurement.rows * doubt * measurement.rows.transpose();
  const DriftMeasurement::Values away = measurement.values - measurement.rows * mean;
  Contradiction found;
  found.per_row = away.dot(Eigen::LLT<DriftMeasurement::Square>(expected).solve(away)) /
                  static_cast<double>(away.size());
  const double unit = measurement.rows(0, kBias1);
  if (unit > 0.0) {
    found.bias_dps = away(0) / unit;
    found.bias_variance = expected(0, 0) / squared(unit) + difference_.motion_variance();
  }
  return found;
}

// --- surroundings --------------------------------------------------------------------------------

void OptimalCorrector::apply_temperature() {
  bool changed = false;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!settings_.gyros[gyro].learns_temperature || !std::isfinite(temperature_c_[gyro])) continue;
    changed = changed || !(std::abs(temperature_c_[gyro] - applied_temperature_c_[gyro]) <=
                           kTemperatureStep_k);
  }
  if (!changed) return;
  readings_.set_temperature(temperature_c_);
  applied_temperature_c_ = temperature_c_;
  refresh();
}

void OptimalCorrector::follow_still_vibration() {
  if (!std::isfinite(vibration_g2_)) return;
  const double now = std::max(vibration_g2_, kVibrationFloor_g2);
  still_vibration_g2_ =
      std::isfinite(still_vibration_g2_)
          ? still_vibration_g2_ * std::pow(now / still_vibration_g2_, kVibrationGain)
          : now;
}

double OptimalCorrector::log_turning_by_vibration() const {
  if (!std::isfinite(vibration_g2_) || !std::isfinite(still_vibration_g2_)) return 0.0;
  const double ratio = std::log(std::max(vibration_g2_, kVibrationFloor_g2) / still_vibration_g2_);
  const double still = -0.5 * squared(ratio / kStillSpread) - std::log(kStillSpread);
  const double moving =
      -0.5 * squared((ratio - kMovingLog) / kMovingSpread) - std::log(kMovingSpread);
  return std::clamp(moving - still, kVibrationLeast, kVibrationMost);
}

// --- weights -------------------------------------------------------------------------------------

void OptimalCorrector::refresh() {
  const DriftEstimate now = readings_.estimate();
  if (!now.mean.allFinite() || !now.covariance.allFinite() || !now.slope.allFinite()) {
    begin_anew();
    return;
  }
  estimate_ = now;
  bias_ = {estimate_.mean(kBias1), estimate_.mean(kBias2)};
  slope_ = {estimate_.slope(0), estimate_.slope(1)};
  gain_ = {1.0 / (1.0 + estimate_.scale[0]), 1.0 / (1.0 + estimate_.scale[1])};
  set_weights(weights_for_);
  const bool disagree =
      std::min(readings_.stepped(0), readings_.stepped(1)) > Readings::kWorthTelling ||
      coherence_.suspects();
  if (disagree && !condition_.disagree) ++condition_.disagreements;
  condition_.disagree = disagree;
  condition_.ambiguous = readings_.ambiguous();
}

// Restarts from the last good biases with a larger variance, so that no value stays non-finite.
void OptimalCorrector::begin_anew() {
  ++condition_.restarts;
  const Symmetric& density = noise_.usual_density();
  const double first = std::max(kRestartDoubt * estimate_.covariance(kBias1, kBias1), density[0]);
  const double second = std::max(kRestartDoubt * estimate_.covariance(kBias2, kBias2), density[2]);
  readings_.begin({std::sqrt(density[0]), std::sqrt(density[2])}, bias_, {first, 0.0, second});
  run_ = Run::kMoving;
  run_open_ = false;
  has_before_ = false;
  window_.kind = Kind::kNothing;
  estimate_ = readings_.estimate();
  slope_ = {0.0, 0.0};
  gain_ = {1.0, 1.0};
  set_weights(weights_for_);
}

// Weights that minimize the heading's error over one window: the uncertainty of the drift is
// constant over the window, white noise averages out.
void OptimalCorrector::set_weights(Present present) {
  weights_for_ = present;
  Symmetric doubt = biases_of(estimate_.covariance);
  doubt[0] += noise_.rounding_variance(0);
  doubt[2] += noise_.rounding_variance(1);
  if (present == Present::kBoth) {
    const Symmetric& density = noise_.density();
    const double first = doubt[0] + density[0] / window_s_;
    const double both = doubt[1] + density[1] / window_s_;
    const double second = doubt[2] + density[2] / window_s_;
    const double sum = first + second - 2.0 * both;
    // Where both biases may be wrong together, the optimum is a negative weight: a rate beyond both
    // gyros, with their noise amplified many times. So the weights are limited to 0…1.
    weight_[0] = sum > 0.0 ? std::clamp((second - both) / sum, 0.0, 1.0) : 0.5;
    weight_[1] = 1.0 - weight_[0];
  } else {
    weight_ = {present == Present::kGyro1 ? 1.0 : 0.0, present == Present::kGyro2 ? 1.0 : 0.0};
  }
  const auto weighted_slope = [this](const Eigen::Matrix2d& matrix) {
    const Eigen::Vector2d weight(weight_[0], weight_[1]);
    return weight.dot(matrix * weight);
  };
  doubt_ = std::max(weighted(weight_, doubt), 0.0);
  doubt_growth_ = weighted(weight_, {estimate_.growth[0], 0.0, estimate_.growth[1]});
  doubt_with_slope_ = std::max(weighted_slope(estimate_.slope_with_bias), 0.0);
  slope_variance_ = std::max(weighted_slope(estimate_.slope_covariance), 0.0);
  scale_doubt_ = std::max(weighted(weight_, estimate_.scale_covariance), 0.0);
  fast_noise_ = kFastNoise * of_difference(noise_.sample_variance()) + of_difference(doubt);
  const double first_share = suspicion_of_first();
  blame_ = first_share * squared(weight_[0]) + (1.0 - first_share) * squared(weight_[1]);
  // The skew does not show which gyro is late; the worse one is likelier.
  const double skew_square = squared(estimate_.mean(kSkew)) - estimate_.covariance(kSkew, kSkew);
  timing_doubt_ = present != Present::kBoth || skew_square <= 0.0
                      ? 0.0
                      : skew_square * (estimate_.blame[0] * squared(weight_[0]) +
                                       estimate_.blame[1] * squared(weight_[1]));
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const GyroParameters& known = settings_.gyros[gyro];
    timing_doubt_ += squared(known.lag_sigma_s * weight_[gyro]) + squared(known.lag_common_sigma_s);
  }
}

Condition OptimalCorrector::condition() const {
  Condition now = condition_;
  now.noisy = {noise_.noisy(0), noise_.noisy(1)};
  now.blind = {blind_[0] >= kBlind, blind_[1] >= kBlind};
  now.stopped = run_ == Run::kStop;
  now.steady = run_ != Run::kMoving;
  now.moves = detector_.moves();
  if (readings_.empty()) return now;
  auto& probability = now.probability;
  probability[index_of(Hypothesis::kStanding)] = readings_.standing();
  probability[index_of(Hypothesis::kTurning)] = readings_.turning();
  probability[index_of(Hypothesis::kGyro1Stepped)] = readings_.stepped(0);
  probability[index_of(Hypothesis::kGyro2Stepped)] = readings_.stepped(1);
  probability[index_of(Hypothesis::kGyro1Blind)] = blind_[0];
  probability[index_of(Hypothesis::kGyro2Blind)] = blind_[1];
  probability[index_of(Hypothesis::kWarmingUp)] =
      estimate_.kind_weight[1] + estimate_.kind_weight[2];
  probability[index_of(Hypothesis::kOwnSlopes)] = estimate_.kind_weight[3];
  probability[index_of(Hypothesis::kAlikeSlopes)] = estimate_.kind_weight[4];
  return now;
}

}  // namespace

std::unique_ptr<Corrector> make_optimal_corrector(const OptimalSettings& settings) {
  return std::make_unique<OptimalCorrector>(settings);
}

}  // namespace vgyro::fusion
