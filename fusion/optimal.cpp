#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "fusion/cells.h"
#include "fusion/corrector.h"
#include "fusion/drift_bank.h"
#include "fusion/noise_tracker.h"
#include "fusion/quadratic.h"
#include "fusion/stop_detector.h"

// Samples → cells (0.1 s) → blocks (0.5 s) → windows → the bank of drift filters. A window holds
// either the difference of the gyros, regressed on rate and its derivative, or, at a stop, both
// gyros against the known rate. Between windows a sample costs two subtractions, two weights and
// its share in a cell. docs/optimal.md derives weights and σ.

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

constexpr double kSmooth_s = 0.05;

// Instants closer together than this are the same.
constexpr double kRounding_s = 1e-6;

// Calibration keeps at most so many means; when they are full, neighbours are merged.
constexpr std::size_t kCalibrationBlocks = 64;

// Windows at a stop: white noise read there is heading until it is learned. Longer where every
// window costs many filters.
constexpr double kStopWindow_s = 2.0;
constexpr double kStopWindowOfMany_s = 4.0;

// Blocks of a stop until it is sure, and one more.
constexpr std::size_t kHeldMax = 8;

// Windows are short against every Gauss–Markov term.
constexpr double kShareOfTau = 0.1;

// A cell's rate or its derivative counts as a regressor when it is this far above its own noise:
// the noise of a regressor would be taken for knowledge.
constexpr double kExcited = 5.0;

// The difference of the gyros, averaged over some samples, is watched on every sample …
constexpr double kFastGain = 0.125;
constexpr double kFastNoise = kFastGain / (2.0 - kFastGain);
constexpr double kFastSigma = 5.0;
// … and block by block: beyond this it has jumped.
constexpr double kJumpSigma = 6.0;
// While turning, this much of the rate may be the gyros' own disagreement about it.
constexpr double kTurnTolerance = 0.02;
constexpr double kTurnTolerance_s = 0.02;  ///< the same of its derivative
constexpr double kTurning_dps = 1.0;
// Within a cell the two gyros need not have met an acceleration at quite the same time.
constexpr double kTimingDoubt_s = 0.0005;
// Who jumped cannot be seen; neither gyro is above suspicion.
constexpr double kShareMin = 0.1;

// A window that contradicts the filter by this much, per row, is believed less.
constexpr double kContradiction = 9.0;

Symmetric biases_of(const DriftFilter::Covariance& covariance) {
  return {covariance(kBias1, kBias1), covariance(kBias1, kBias2), covariance(kBias2, kBias2)};
}

/// Both gyros against the known rate, over `length_s` seconds.
DriftMeasurement excess_of_both(const std::array<double, 2>& excess_dps, const Symmetric& density,
                                double length_s) {
  DriftMeasurement measurement(2);
  measurement.rows(0, kBias1) = 1.0;
  measurement.rows(1, kBias2) = 1.0;
  measurement.values << excess_dps[0], excess_dps[1];
  measurement.noise << density[0], density[1], density[1], density[2];
  measurement.noise /= length_s;
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

/// Whatever kept it may have spoilt it.
bool is_sound(const DriftMemory& memory) {
  const auto& weights = memory.walk_weight;
  return is_covariance(memory.bias_covariance) && is_covariance(memory.white_density) &&
         is_variance(memory.sample_variance[0]) && is_variance(memory.sample_variance[1]) &&
         is_finite(memory.bias_dps[0]) && is_finite(memory.bias_dps[1]) &&
         is_finite(memory.scale_difference) && is_variance(memory.scale_difference_sigma) &&
         is_finite(memory.skew_s) && is_variance(memory.skew_sigma_s) &&
         std::all_of(weights.begin(), weights.end(),
                     [](double weight) { return std::isfinite(weight) && weight >= 0.0; });
}

/// Means of the calibration, each over some seconds.
class CalibrationBlocks {
 public:
  struct Mean {
    double from_s = 0.0;
    double to_s = 0.0;
    double length_s = 0.0;  ///< covered by samples
    std::array<double, 2> excess_dps{};
  };

  void clear() {
    count_ = 0;
    merge_ = 1;
    gathered_ = 0;
  }
  void add(const Block& block) {
    const Mean mean{
        block.from_s, block.to_s, block.length_s(), {block.mean_dps(0), block.mean_dps(1)}};
    if (gathered_ == 0) {
      if (count_ == kCalibrationBlocks) halve();
      means_[count_++] = mean;
    } else {
      means_[count_ - 1] = merged(means_[count_ - 1], mean);
    }
    gathered_ = (gathered_ + 1) % merge_;
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] const Mean& operator[](std::size_t i) const { return means_[i]; }

 private:
  static Mean merged(const Mean& a, const Mean& b) {
    Mean both{a.from_s, b.to_s, a.length_s + b.length_s, {}};
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      both.excess_dps[gyro] =
          (a.excess_dps[gyro] * a.length_s + b.excess_dps[gyro] * b.length_s) / both.length_s;
    }
    return both;
  }
  void halve() {
    for (std::size_t i = 0; i < kCalibrationBlocks / 2; ++i)
      means_[i] = merged(means_[2 * i], means_[2 * i + 1]);
    count_ = kCalibrationBlocks / 2;
    merge_ *= 2;
  }

  std::array<Mean, kCalibrationBlocks> means_;
  std::size_t count_ = 0;
  std::size_t merge_ = 1;     ///< blocks in each mean
  std::size_t gathered_ = 0;  ///< in the last one
};

class OptimalCorrector final : public Corrector {
 public:
  explicit OptimalCorrector(const OptimalSettings& settings)
      : settings_(settings),
        window_s_(settings.window_s),
        bank_(settings.gyros),
        noise_(settings.gyros) {
    for (const GyroParameters& gyro : settings.gyros) {
      for (std::size_t i = 0; i < gyro.gauss_markov_count; ++i)
        window_s_ = std::min(window_s_, kShareOfTau * gyro.gauss_markov[i].tau_s);
    }
  }

  [[nodiscard]] bool needs_calibration() const override { return true; }

  void calibrate(const RatePair& pair, double true_rate_dps) override {
    const std::array<double, 2> excess{pair.rate_dps[0] - true_rate_dps,
                                       pair.rate_dps[1] - true_rate_dps};
    if (cells_.add(pair.t_s, excess, pair.noise_gain, Present::kBoth)) take_calibration();
  }

  void restart_calibration() override {
    cells_.clear();
    calibration_.clear();
    noise_.clear();
    held_count_ = 0;
  }

  void start(const Calibration& calibration) override;
  bool resume(const DriftMemory& memory, double age_s, double t_s) override;
  VirtualRate update(const RatePair& pair) override;
  VirtualRate update_alone(std::size_t gyro, const RatePair& pair) override;
  void set_wheels(Wheels wheels) override { wheels_ = wheels; }

  [[nodiscard]] Drift drift(double t_s) const override {
    if (bank_.empty()) return {{kNone, kNone}, kNone, kNone, kNone};
    return {bias_, kNone, std::sqrt(drift_variance(t_s)), kNone};
  }
  [[nodiscard]] WindowCounts windows() const override { return windows_; }
  [[nodiscard]] Condition condition() const override {
    Condition now = condition_;
    now.noisy = {noise_.noisy(0), noise_.noisy(1)};
    return now;
  }
  [[nodiscard]] std::optional<DriftMemory> memory(double t_s) const override;

 private:
  enum class Kind : std::uint8_t { kNothing, kDifference, kStop };
  using Matrix3 = Eigen::Matrix3d;
  using Vector3 = Eigen::Vector3d;

  /// What has been gathered since the filters were last updated.
  struct Window {
    Kind kind = Kind::kNothing;
    Present present = Present::kBoth;
    double from_s = 0.0;
    double to_s = 0.0;
    Matrix3 normal = Matrix3::Zero();  ///< of the difference on (1, Ω, dΩ/dt), over its noise
    Vector3 right = Vector3::Zero();
    double covered_s = 0.0;  ///< of a stop
    double sway_s = 0.0;     ///< Σ of its variance · seconds
    std::array<double, 2> excess_s{};
  };

  void take_calibration();
  void begin_in_motion(const std::array<double, 2>& white, const Symmetric& density);
  void run(double t_s);
  void close_block(const Block& block);
  void learn_from(const Block& block, bool stop);
  void open_window(const Block& block, Kind kind);
  void add_difference(const Block& block);
  void regress();
  void add_stop(const Block& block);
  bool has_jumped(const Block& block);
  void close_window();
  [[nodiscard]] DriftMeasurement measure_difference() const;
  [[nodiscard]] DriftMeasurement measure_stop() const;
  void doubt_contradiction(DriftMeasurement& measurement, double length_s) const;
  void refresh();
  [[nodiscard]] BlockLevel level_of(const Block& block) const;
  [[nodiscard]] double cell_rate(const Cell& cell, Present present) const;
  [[nodiscard]] double rate_density(std::size_t gyro, double rate_dps) const {
    return squared(settings_.gyros[gyro].rate_noise_rthz * rate_dps);
  }
  [[nodiscard]] double drift_variance(double t_s) const {
    return doubt_ + doubt_growth_ * std::max(t_s - learned_until_s_, 0.0);
  }
  /// How likely it is gyro 1 where the two contradict each other and nothing tells which is wrong.
  [[nodiscard]] double suspicion_of_first() const {
    return std::clamp(estimate_.drift_share[0], kShareMin, 1.0 - kShareMin);
  }
  void set_weights(Present present);
  double acceleration_square(double rate_dps, double t_s);

  OptimalSettings settings_;
  double window_s_;
  CellBuilder cells_;
  CalibrationBlocks calibration_;
  DriftBank bank_;
  NoiseTracker noise_;
  StopDetector detector_;
  Wheels wheels_ = Wheels::kUnknown;

  Window window_;
  double learned_until_s_ = 0.0;  ///< the filters stand here
  double stop_length_s_ = 0.0;    ///< of the next window at this stop: short at first
  /// Blocks that wait for the verdict: the last one, and while a stop is not sure all of its
  /// blocks so far.
  std::array<Block, kHeldMax> held_;
  std::size_t held_count_ = 0;
  struct RecentCell {
    double rate_dps = 0.0;
    double difference_dps = 0.0;
    double length_s = 0.0;
  };
  std::array<RecentCell, 5> recent_;  ///< of the difference, without a gap
  std::size_t recent_count_ = 0;
  double recent_until_s_ = 0.0;
  bool held_steady_ = false;
  bool held_begins_ = false;  ///< the first of them begins a run of steady ones
  bool refused_ = false;
  bool jump_suspected_ = false;
  double suspected_jump_dps_ = 0.0;

  // What a sample needs, made by refresh().
  DriftEstimate estimate_;
  std::array<double, 2> bias_{};
  std::array<double, 2> gain_{1.0, 1.0};  ///< 1/(1 + scale)
  Present weights_for_ = Present::kBoth;
  std::array<double, 2> weight_{0.5, 0.5};
  double doubt_ = 0.0;          ///< variance of the weighted drift
  double doubt_growth_ = 0.0;   ///< per second
  double scale_doubt_ = 0.0;    ///< variance per (deg/s)² of rate
  double timing_doubt_ = 0.0;   ///< variance per (deg/s²)² of acceleration
  double smooth_rate_ = 0.0;    ///< of the virtual rate, over kSmooth_s
  double smoother_rate_ = 0.0;  ///< the same once more
  double smooth_until_s_ = 0.0;
  double fast_noise_ = 0.0;  ///< of the smoothed difference
  double fast_difference_ = 0.0;
  double blame_ = 0.0;  ///< variance of the virtual rate per squared excess difference

  WindowCounts windows_;
  Condition condition_;
};

// --- calibration ---------------------------------------------------------------------------------

// The last second is kept back: the calibration may end early because motion has begun in it.
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
    // Too short for a single block: the calibration's own means are all there is.
    bank_.begin(
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
  for (std::size_t i = 0; i < calibration_.count(); ++i) {
    const CalibrationBlocks::Mean& mean = calibration_[i];
    if (i == 0) {
      bank_.begin(
          white, mean.excess_dps,
          {density[0] / mean.length_s, density[1] / mean.length_s, density[2] / mean.length_s});
      learned_until_s_ = mean.to_s;
      continue;
    }
    if (mean.from_s > learned_until_s_) bank_.predict(mean.from_s - learned_until_s_);
    bank_.learn(mean.to_s - std::max(mean.from_s, learned_until_s_),
                excess_of_both(mean.excess_dps, density, mean.length_s));
    learned_until_s_ = mean.to_s;
  }
  run(learned_until_s_);
}

// The motion was accepted as rest: its mean is all there is, and how far that is from rest is
// anyone's guess: as far as it swung.
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
  bank_.begin(
      white, mean,
      {density[0] / length + swing, density[1] / length + swing, density[2] / length + swing});
  run(learned_until_s_);
}

bool OptimalCorrector::resume(const DriftMemory& memory, double age_s, double t_s) {
  if (!is_sound(memory) || !(age_s >= 0.0) || !std::isfinite(age_s)) return false;
  noise_.resume(memory.white_density, memory.sample_variance);
  bank_.resume(memory, age_s);
  run(t_s);
  return true;
}

std::optional<DriftMemory> OptimalCorrector::memory(double t_s) const {
  if (bank_.empty()) return std::nullopt;
  DriftMemory memory;
  bank_.save(memory);
  const double late_s = std::max(t_s - learned_until_s_, 0.0);
  memory.bias_covariance[0] += estimate_.growth[0] * late_s;
  memory.bias_covariance[2] += estimate_.growth[1] * late_s;
  memory.white_density = noise_.usual_density();
  memory.sample_variance = {noise_.usual_sample_variance()[0], noise_.usual_sample_variance()[2]};
  return memory;
}

void OptimalCorrector::run(double t_s) {
  learned_until_s_ = t_s;
  cells_.clear();
  held_count_ = 0;
  stop_length_s_ = 0.0;
  detector_.reset();
  refresh();
}

// --- samples -------------------------------------------------------------------------------------

VirtualRate OptimalCorrector::update(const RatePair& pair) {
  if (cells_.add(pair.t_s, pair.rate_dps, pair.noise_gain, Present::kBoth))
    close_block(cells_.last());
  if (weights_for_ != Present::kBoth) set_weights(Present::kBoth);

  const double first = (pair.rate_dps[0] - bias_[0]) * gain_[0];
  const double second = (pair.rate_dps[1] - bias_[1]) * gain_[1];
  const double rate = weight_[0] * first + weight_[1] * second;

  const Symmetric& sample = noise_.sample_variance();
  const double interval = std::max(cells_.interval_s(), 1e-6);
  const double noise_1 = (sample[0] + rate_density(0, rate) / interval) * pair.noise_gain[0];
  const double noise_2 = (sample[2] + rate_density(1, rate) / interval) * pair.noise_gain[1];
  const double noise_12 = sample[1] * std::sqrt(pair.noise_gain[0] * pair.noise_gain[1]);
  double variance = weighted(weight_, {noise_1, noise_12, noise_2}) + drift_variance(pair.t_s) +
                    scale_doubt_ * rate * rate;
  if (timing_doubt_ > 0.0) variance += timing_doubt_ * acceleration_square(rate, pair.t_s);

  // The gyros contradict each other: until it is known who is wrong, each may be.
  fast_difference_ += kFastGain * (first - second - fast_difference_);
  const double contradiction = fast_difference_ * fast_difference_;
  const double allowed =
      squared(kFastSigma) *
      (fast_noise_ + kFastNoise * (rate_density(0, rate) + rate_density(1, rate)) / interval);
  if (contradiction > allowed) variance += blame_ * (contradiction - allowed);
  return {rate, std::sqrt(variance), {first, second}};
}

// Squared dΩ/dt as far as it rises above the noise of the smoothed rate.
double OptimalCorrector::acceleration_square(double rate_dps, double t_s) {
  const double tau_s = std::max(kSmooth_s, 2.0 * cells_.interval_s());
  const double share = std::clamp((t_s - smooth_until_s_) / tau_s, 0.0, 1.0);
  smooth_until_s_ = t_s;
  smooth_rate_ += share * (rate_dps - smooth_rate_);
  // Smoothed once more it lags by tau_s · dΩ/dt.
  const double slope = (smooth_rate_ - smoother_rate_) / tau_s;
  smoother_rate_ += share * (smooth_rate_ - smoother_rate_);
  const double noise = weighted(weight_, noise_.density()) / (4.0 * tau_s) / squared(tau_s);
  return std::max(squared(slope) - noise, 0.0);
}

VirtualRate OptimalCorrector::update_alone(std::size_t gyro, const RatePair& pair) {
  const Present present = gyro == 0 ? Present::kGyro1 : Present::kGyro2;
  // The missing gyro's place is filled so that its sums stay finite; nothing reads them.
  RatePair alone = pair;
  alone.rate_dps[1 - gyro] = 0.0;
  if (cells_.add(alone.t_s, alone.rate_dps, alone.noise_gain, present)) close_block(cells_.last());
  if (weights_for_ != present) {
    // A rise was told by comparison: a gyro that falls out may have made the other one look noisy.
    noise_.forget_rise();
    set_weights(present);
  }
  fast_difference_ = 0.0;

  VirtualRate out{(pair.rate_dps[gyro] - bias_[gyro]) * gain_[gyro], kNone, {kNone, kNone}};
  out.corrected_dps[gyro] = out.rate_dps;
  const double interval = std::max(cells_.interval_s(), 1e-6);
  const double noise =
      noise_.sample_variance()[2 * gyro] + rate_density(gyro, out.rate_dps) / interval;
  out.sigma_dps = std::sqrt(noise * pair.noise_gain[gyro] + drift_variance(pair.t_s) +
                            scale_doubt_ * squared(out.rate_dps));
  return out;
}

// --- blocks --------------------------------------------------------------------------------------

double OptimalCorrector::cell_rate(const Cell& cell, Present present) const {
  const double first = (cell.mean_dps[0] - bias_[0]) * gain_[0];
  const double second = (cell.mean_dps[1] - bias_[1]) * gain_[1];
  if (present == Present::kGyro1) return first;
  if (present == Present::kGyro2) return second;
  return weight_[0] * first + weight_[1] * second;
}

BlockLevel OptimalCorrector::level_of(const Block& block) const {
  BlockLevel level;
  level.length_s = block.length_s();
  level.cells = static_cast<double>(block.count);
  level.bias_dps = bias_;
  level.weight = weight_;
  level.doubt_variance = drift_variance(block.to_s);
  const Symmetric& density = noise_.density();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    level.excess_dps[gyro] = block.mean_dps(gyro) - *settings_.stop_rate_dps;
    level.excess_variance[gyro] = density[2 * gyro] / level.length_s;
  }
  double sum = 0.0;
  double cell_s = 0.0;
  for (std::size_t i = 0; i < block.count; ++i) {
    sum += cell_rate(block.cells[i], block.present);
    cell_s += block.cells[i].length_s;
  }
  const double mean = sum / level.cells;
  double squares = 0.0;
  for (std::size_t i = 0; i < block.count; ++i)
    squares += squared(cell_rate(block.cells[i], block.present) - mean);
  level.cell_variance = squares / std::max(level.cells - 1.0, 1.0);
  level.noise_variance = weighted(weight_, density) * level.cells / cell_s;
  return level;
}

// A block is used when the next one has been judged: motion begins before it is seen.
void OptimalCorrector::close_block(const Block& block) {
  if (block.present != weights_for_) set_weights(block.present);
  noise_.watch(block);
  auto verdict = StopDetector::Verdict::kMoving;
  if (settings_.stop_rate_dps) verdict = detector_.judge(level_of(block), wheels_);
  const bool stop =
      verdict == StopDetector::Verdict::kStop || verdict == StopDetector::Verdict::kRelearn;
  // All held blocks but the last belong to a stop that has just become sure, or to none.
  const bool waits = verdict == StopDetector::Verdict::kSteady && held_count_ < kHeldMax;
  if (!waits || detector_.run_begins()) {
    for (std::size_t i = 0; i < held_count_; ++i) {
      const bool still = stop && held_steady_ && held_[i].present == block.present;
      learn_from(held_[i], still && !(i == 0 && held_begins_));
    }
    held_count_ = 0;
    // The first steady block may hold the end of the motion.
    held_begins_ = detector_.run_begins();
  }
  if (verdict == StopDetector::Verdict::kRelearn) {
    close_window();
    const double variance = squared(detector_.run_level_dps());
    bank_.widen(variance, variance, variance);
    refresh();
  }
  if (stop && !condition_.stopped) ++condition_.stops;
  if (verdict == StopDetector::Verdict::kRefused && !refused_) ++condition_.stops_refused;
  refused_ = verdict == StopDetector::Verdict::kRefused;
  condition_.stopped = stop;
  held_[held_count_++] = block;
  held_steady_ = stop || verdict == StopDetector::Verdict::kSteady;
}

void OptimalCorrector::learn_from(const Block& block, bool stop) {
  if (stop) {
    noise_.measure(block, false);
    noise_.settle(cells_.interval_s());
    jump_suspected_ = false;
    add_stop(block);
    return;
  }
  if (block.present == Present::kBoth && has_jumped(block)) return;
  add_difference(block);
}

void OptimalCorrector::open_window(const Block& block, Kind kind) {
  const bool goes_on = window_.kind == kind && window_.present == block.present &&
                       block.from_s <= window_.to_s + kRounding_s;
  if (!goes_on) {
    close_window();
    if (block.from_s > learned_until_s_) {
      bank_.predict(block.from_s - learned_until_s_);
      learned_until_s_ = block.from_s;
    }
    window_ = Window{.kind = kind,
                     .present = block.present,
                     .from_s = learned_until_s_,
                     .to_s = learned_until_s_};
  }
  window_.to_s = std::max(block.to_s, window_.to_s);
}

void OptimalCorrector::add_difference(const Block& block) {
  stop_length_s_ = 0.0;
  if (block.from_s > recent_until_s_ + kRounding_s || block.present != Present::kBoth)
    recent_count_ = 0;
  open_window(block, Kind::kDifference);
  if (block.present == Present::kBoth) {
    for (std::size_t i = 0; i < block.count; ++i) {
      if (recent_count_ == recent_.size()) {
        std::move(recent_.begin() + 1, recent_.end(), recent_.begin());
        --recent_count_;
      }
      const Cell& cell = block.cells[i];
      recent_[recent_count_++] = {cell_rate(cell, block.present),
                                  cell.mean_dps[0] - cell.mean_dps[1], cell.length_s};
      if (recent_count_ == recent_.size()) regress();
    }
  }
  recent_until_s_ = block.to_s;
  // A turn that tells much about scale factor or skew is used at once.
  const bool tells = window_.normal(1, 1) * estimate_.covariance(kScale, kScale) > 1.0 ||
                     window_.normal(2, 2) * estimate_.covariance(kSkew, kSkew) > 1.0;
  if (tells || window_.to_s - window_.from_s >= window_s_) close_window();
}

// The middle one of the recent cells; its neighbours give the mean of dΩ/dt over it, to fourth
// order: a skew of milliseconds shows in the smallest accelerations, and so would their error.
void OptimalCorrector::regress() {
  const auto& [first, before, cell, after, last] = recent_;
  const Symmetric& density = noise_.density();
  const double span_s = 12.0 * cell.length_s;
  const double slope =
      (8.0 * (after.rate_dps - before.rate_dps) - (last.rate_dps - first.rate_dps)) / span_s;
  const double rate_variance = weighted(weight_, density) / cell.length_s;
  const double slope_variance = 130.0 * rate_variance / squared(span_s);
  const bool turns = squared(cell.rate_dps) > squared(kExcited) * rate_variance;
  const bool accelerates = squared(slope) > squared(kExcited) * slope_variance;
  const Vector3 regressor{1.0, turns ? cell.rate_dps : 0.0, accelerates ? slope : 0.0};
  const double noise =
      (of_difference(density) + rate_density(0, cell.rate_dps) + rate_density(1, cell.rate_dps)) /
          cell.length_s +
      squared(kTimingDoubt_s * slope);
  window_.normal += regressor * regressor.transpose() / noise;
  window_.right += regressor * (cell.difference_dps / noise);
}

void OptimalCorrector::add_stop(const Block& block) {
  open_window(block, Kind::kStop);
  const double length = block.length_s();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    window_.excess_s[gyro] += (block.mean_dps(gyro) - *settings_.stop_rate_dps) * length;
  }
  window_.covered_s += length;
  window_.sway_s += detector_.sway_variance() * length;
  // At the beginning of a stop every second counts; later the windows grow.
  if (window_.to_s - window_.from_s >=
      std::min({stop_length_s_, window_s_, bank_.single() ? kStopWindow_s : kStopWindowOfMany_s})) {
    stop_length_s_ = std::max(1.0, 2.0 * stop_length_s_);
    close_window();
    condition_.disagree = false;
  }
}

bool OptimalCorrector::has_jumped(const Block& block) {
  const double length = block.length_s();
  const double difference = block.mean_dps(0) - block.mean_dps(1);
  double rate = 0.0;
  double rate_square = 0.0;
  for (std::size_t i = 0; i < block.count; ++i) {
    const double one = cell_rate(block.cells[i], block.present);
    rate += one / static_cast<double>(block.count);
    rate_square += one * one / static_cast<double>(block.count);
  }
  const double slope = block.count < 2 ? 0.0
                                       : (cell_rate(block.cells[block.count - 1], block.present) -
                                          cell_rate(block.cells[0], block.present)) /
                                             length;
  const DriftFilter::Observables regressor{1.0, -1.0, rate, slope};
  const double away = difference - regressor.dot(estimate_.mean);
  const double late_s = std::max(block.to_s - learned_until_s_, 0.0);
  double variance = regressor.dot(estimate_.covariance * regressor) +
                    (estimate_.growth[0] + estimate_.growth[1]) * late_s +
                    of_difference(noise_.density()) / length +
                    (rate_density(0, rate) + rate_density(1, rate)) / length;
  if (rate_square > squared(kTurning_dps))
    variance += squared(kTurnTolerance) * rate_square + squared(kTurnTolerance_s * slope);
  if (squared(away) <= squared(kJumpSigma) * variance) {
    jump_suspected_ = false;
    return false;
  }
  // One block may hold anything; two that agree are a new state of things.
  const bool again = jump_suspected_ && away * suspected_jump_dps_ > 0.0 &&
                     std::abs(away) < 2.0 * std::abs(suspected_jump_dps_);
  jump_suspected_ = true;
  suspected_jump_dps_ = away;
  if (!again) return true;
  jump_suspected_ = false;
  close_window();
  const double first = suspicion_of_first();
  bank_.widen(first * squared(away), 0.0, (1.0 - first) * squared(away));
  refresh();
  if (!condition_.disagree) ++condition_.disagreements;
  condition_.disagree = true;
  return false;
}

// --- windows -------------------------------------------------------------------------------------

// Normal equations → rows of unit noise, by Cholesky; what was not excited has no row.
DriftMeasurement OptimalCorrector::measure_difference() const {
  constexpr double kNothing = 1e-9;
  Matrix3 lower = Matrix3::Zero();
  Vector3 white = Vector3::Zero();
  std::array<int, 3> used{};
  int rows = 0;
  for (int j = 0; j < 3; ++j) {
    double pivot = window_.normal(j, j);
    double value = window_.right(j);
    for (int r = 0; r < rows; ++r) {
      const int k = used[static_cast<std::size_t>(r)];
      pivot -= lower(j, k) * lower(j, k);
      value -= lower(j, k) * white(k);
    }
    if (pivot <= kNothing * window_.normal(j, j)) continue;
    lower(j, j) = std::sqrt(pivot);
    white(j) = value / lower(j, j);
    for (int i = j + 1; i < 3; ++i) {
      double cross = window_.normal(i, j);
      for (int r = 0; r < rows; ++r) {
        const int k = used[static_cast<std::size_t>(r)];
        cross -= lower(i, k) * lower(j, k);
      }
      lower(i, j) = cross / lower(j, j);
    }
    used[static_cast<std::size_t>(rows++)] = j;
  }
  DriftMeasurement measurement(rows);
  for (int r = 0; r < rows; ++r) {
    const int j = used[static_cast<std::size_t>(r)];
    measurement.rows(r, kBias1) = lower(0, j);
    measurement.rows(r, kBias2) = -lower(0, j);
    measurement.rows(r, kScale) = lower(1, j);
    measurement.rows(r, kSkew) = lower(2, j);
    measurement.values(r) = white(j);
  }
  return measurement;
}

DriftMeasurement OptimalCorrector::measure_stop() const {
  const double length = window_.covered_s;
  const double sway = window_.sway_s / length;
  const std::array<double, 2> excess{window_.excess_s[0] / length, window_.excess_s[1] / length};
  if (window_.present == Present::kBoth) {
    DriftMeasurement measurement = excess_of_both(excess, noise_.density(), length);
    measurement.noise.array() += sway;
    return measurement;
  }
  const std::size_t gyro = window_.present == Present::kGyro1 ? 0 : 1;
  DriftMeasurement measurement(1);
  measurement.rows(0, gyro == 0 ? kBias1 : kBias2) = 1.0;
  measurement.values(0) = excess[gyro];
  measurement.noise(0, 0) = noise_.density()[2 * gyro] / length + sway;
  return measurement;
}

// Turns that neither scale factor nor skew explains, and drift that is faster than its model.
void OptimalCorrector::doubt_contradiction(DriftMeasurement& measurement, double length_s) const {
  DriftFilter::Covariance doubt = estimate_.covariance;
  doubt(kBias1, kBias1) += estimate_.growth[0] * length_s;
  doubt(kBias2, kBias2) += estimate_.growth[1] * length_s;
  DriftMeasurement::Square expected = measurement.noise;
  expected += measurement.rows * doubt * measurement.rows.transpose();
  const DriftMeasurement::Values away = measurement.values - measurement.rows * estimate_.mean;
  const double contradiction =
      away.dot(Eigen::LLT<DriftMeasurement::Square>(expected).solve(away)) /
      static_cast<double>(away.size());
  if (contradiction > kContradiction) measurement.noise *= contradiction / kContradiction;
}

void OptimalCorrector::close_window() {
  if (window_.kind == Kind::kNothing) return;
  const double length = window_.to_s - window_.from_s;
  DriftMeasurement measurement(0);
  if (window_.kind == Kind::kStop) {
    measurement = measure_stop();
  } else if (window_.present == Present::kBoth) {
    measurement = measure_difference();
  }
  if (measurement.values.size() == 0) {
    bank_.predict(length);
    ++windows_.skipped;
  } else {
    if (window_.kind == Kind::kDifference) doubt_contradiction(measurement, length);
    bank_.learn(length, measurement);
    ++windows_.completed;
  }
  learned_until_s_ = window_.to_s;
  window_.kind = Kind::kNothing;
  refresh();
}

// --- weights -------------------------------------------------------------------------------------

void OptimalCorrector::refresh() {
  estimate_ = bank_.estimate();
  bias_ = {estimate_.mean(kBias1), estimate_.mean(kBias2)};
  gain_ = {1.0 / (1.0 + estimate_.scale[0]), 1.0 / (1.0 + estimate_.scale[1])};
  set_weights(weights_for_);
}

// The weights that make the heading's error over one window least: doubt of the drift stays for
// the window's length, white noise averages out over it.
void OptimalCorrector::set_weights(Present present) {
  weights_for_ = present;
  const Symmetric doubt = biases_of(estimate_.covariance);
  if (present == Present::kBoth) {
    const Symmetric& density = noise_.density();
    const double first = doubt[0] + density[0] / window_s_;
    const double both = doubt[1] + density[1] / window_s_;
    const double second = doubt[2] + density[2] / window_s_;
    const double sum = first + second - 2.0 * both;
    weight_[0] = sum > 0.0 ? (second - both) / sum : 0.5;
    weight_[1] = 1.0 - weight_[0];
  } else {
    weight_ = {present == Present::kGyro1 ? 1.0 : 0.0, present == Present::kGyro2 ? 1.0 : 0.0};
  }
  doubt_ = weighted(weight_, doubt);
  doubt_growth_ = weighted(weight_, {estimate_.growth[0], 0.0, estimate_.growth[1]});
  scale_doubt_ = std::max(weighted(weight_, estimate_.scale_covariance), 0.0);
  fast_noise_ = kFastNoise * of_difference(noise_.sample_variance()) + of_difference(doubt);
  const double first_share = suspicion_of_first();
  blame_ = first_share * squared(weight_[0]) + (1.0 - first_share) * squared(weight_[1]);
  // Which gyro is late, or early, the skew does not tell; the worse one is likelier.
  const double skew_square = squared(estimate_.mean(kSkew)) - estimate_.covariance(kSkew, kSkew);
  timing_doubt_ = present != Present::kBoth || skew_square <= 0.0
                      ? 0.0
                      : skew_square * (estimate_.blame[0] * squared(weight_[0]) +
                                       estimate_.blame[1] * squared(weight_[1]));
}

}  // namespace

std::unique_ptr<Corrector> make_optimal_corrector(const OptimalSettings& settings) {
  return std::make_unique<OptimalCorrector>(settings);
}

}  // namespace vgyro::fusion
