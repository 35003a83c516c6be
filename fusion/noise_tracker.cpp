#include "fusion/noise_tracker.h"

#include <algorithm>
#include <cmath>

namespace vgyro::fusion {

namespace {

// When so many cells are summed, all sums are halved: noise changes with age and heat.
constexpr double kCellsMax = 12000.0;

// A correlation below this many of its own standard deviations counts as 0.
constexpr double kRealCorrelation = 4.0;

// A greater correlation than this is motion.
constexpr double kSwayCorrelation = 0.8;

// Gain per block with which a rise is followed; significance that it needs; share of
// NoiseTracker::kNoisyFactor below which it is over; bound of a single block.
constexpr double kRiseGain = 0.3;
constexpr double kSureSigma = 3.0;
constexpr double kNoLongerNoisy = 0.5;
constexpr double kOneBlockMax = 22.0;

// A sensor of unknown resolution still has some noise, (deg/s)²/Hz.
constexpr double kDensityMin = 1e-14;

// A block is usual within so many standard deviations of its sum of squares.
constexpr double kUsualSigmas = 4.0;
constexpr double kGainMin = 1e-3;

// Scatter of a cell's difference, in standard deviations of its noise, that no Gaussian noise
// reaches. A value that is off by less than one or two dozen of them does little harm.
constexpr double kSpikeSigma = 4.0;
// Least number of values in such a cell: among fewer, an outlier looks like motion.
constexpr double kSpikeSamples = 4.0;
// Share of the common motion that skew and scale factors may leave in the difference.
constexpr double kMotionShare = 0.01;

// Least share of the difference's noise that each gyro has: common motion never explains all of one
// gyro's noise, because scale factors differ.
constexpr double kOwnShareMin = 0.05;

}  // namespace

void NoiseTracker::clear() {
  const std::array<double, 2> step_dps = step_dps_;
  *this = NoiseTracker(gyros_);
  step_dps_ = step_dps;
}

double NoiseTracker::step_dps(std::size_t gyro) const {
  return std::max(gyros_[gyro].resolution_dps, step_dps_[gyro]);
}

// The mean of a rounded value is off by (step/π)·sin(…)·exp(−2π²σ²/step²) to first order. This is
// its mean square over all places between two steps; noise of half a step makes it vanish.
double NoiseTracker::rounding_variance(std::size_t gyro) const {
  const double step = step_dps(gyro);
  if (!(step > 0.0)) return 0.0;
  const double square = step * step;
  const double noise = std::max(sample_[2 * gyro] - square / 12.0, 0.0);
  constexpr double kFourPiSquare = 39.47841760435743;
  return square / 12.0 * std::exp(-kFourPiSquare * noise / square);
}

void NoiseTracker::measure(const CellBlock& block, bool moving) {
  shared_is_motion_ = shared_is_motion_ || moving;
  for (std::size_t i = 0; i < block.count; ++i) {
    const Cell& cell = block.cells[i];
    for (std::size_t k = 0; k < 3; ++k)
      sample_squares_[k] += cell.scatter[k];
    const double freedom = cell.count - 1.0;
    samples_ += freedom;
    gain_[0] += freedom * cell.noise_gain[0];
    gain_[1] += freedom * cell.noise_gain[1];
    if (i == 0) continue;
    const Cell& before = block.cells[i - 1];
    const double first = cell.mean_dps[0] - before.mean_dps[0];
    const double second = cell.mean_dps[1] - before.mean_dps[1];
    const double length = 0.25 * (cell.length_s + before.length_s);
    cell_squares_[0] += first * first * length;
    cell_squares_[1] += first * second * length;
    cell_squares_[2] += second * second * length;
    cells_ += 1.0;
  }
  if (cells_ < kCellsMax) return;
  for (std::size_t k = 0; k < 3; ++k) {
    cell_squares_[k] *= 0.5;
    sample_squares_[k] *= 0.5;
  }
  cells_ *= 0.5;
  samples_ *= 0.5;
  gain_[0] *= 0.5;
  gain_[1] *= 0.5;
}

bool NoiseTracker::usual(const CellBlock& block) const {
  Symmetric squares{};
  double freedom = 0.0;
  for (std::size_t i = 0; i < block.count; ++i) {
    const Cell& cell = block.cells[i];
    freedom += cell.count - 1.0;
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      squares[2 * gyro] += cell.scatter[2 * gyro] / std::max(cell.noise_gain[gyro], kGainMin);
  }
  const double most = freedom + kUsualSigmas * std::sqrt(2.0 * freedom);
  return squares[0] <= most * present_sample_[0] && squares[2] <= most * present_sample_[2];
}

bool NoiseTracker::spiked(const CellBlock& block, double more) const {
  if (block.present != Present::kBoth) return false;
  const double besides = more + squared(step_dps(0)) + squared(step_dps(1));
  const auto difference = [&](std::size_t i) {
    return block.cells[i].mean_dps[0] - block.cells[i].mean_dps[1];
  };
  for (std::size_t i = 0; i < block.count; ++i) {
    const Cell& cell = block.cells[i];
    if (cell.count < kSpikeSamples) continue;
    const double noise =
        present_sample_[0] * cell.noise_gain[0] + present_sample_[2] * cell.noise_gain[1] + besides;
    const double motion = std::max(cell.scatter[1], 0.0);
    const double scatter = of_difference(cell.scatter) - kMotionShare * motion;
    if (scatter <= squared(kSpikeSigma) * cell.count * noise) continue;
    // Rotation that only one gyro feels continues from cell to cell.
    double moved = 0.0;
    for (std::size_t other = 0; other < block.count; ++other)
      moved = std::max(moved, std::abs(difference(other) - difference(i)));
    if (squared(moved) * cell.count < scatter) return true;
  }
  return false;
}

void NoiseTracker::settle(double interval_s) {
  if (cells_ == 0.0) return;
  const auto own_part = [](const Symmetric& squares, std::size_t k, double shared_part) {
    if (shared_part == 0.0) return squares[k];
    return std::max(squares[k] - shared_part, kOwnShareMin * of_difference(squares));
  };
  const auto shared = [&](const Symmetric& squares, double count) {
    const double significant =
        kRealCorrelation * std::sqrt(squares[0] * squares[2] / std::max(count, 1.0));
    return std::abs(squares[1]) > significant ? squares[1] : 0.0;
  };
  const double cell_shared = shared(cell_squares_, cells_);
  const double sample_shared = shared(sample_squares_, samples_);
  // The noise of two sensors is never that alike: the platform sways.
  const bool sways =
      shared_is_motion_ ||
      squared(cell_shared) > squared(kSwayCorrelation) * cell_squares_[0] * cell_squares_[2];
  const bool shakes = sways || squared(sample_shared) > squared(kSwayCorrelation) *
                                                            sample_squares_[0] * sample_squares_[2];
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::size_t k = 2 * gyro;
    const GyroParameters& given = gyros_[gyro];
    const double rounding = squared(step_dps(gyro)) / 12.0;
    const double measured = own_part(cell_squares_, k, sways ? cell_shared : 0.0) / cells_;
    density_[k] = given.white_dps_rthz ? *given.white_dps_rthz * *given.white_dps_rthz : measured;
    density_[k] = std::max({density_[k], rounding * interval_s, kDensityMin});
    // Gyros slower than a cell have one sample in each.
    sample_[k] = samples_ > cells_
                     ? own_part(sample_squares_, k, shakes ? sample_shared : 0.0) / gain_[gyro]
                     : density_[k] / interval_s;
    sample_[k] = std::max({sample_[k], rounding, kDensityMin});
  }
  const bool given = gyros_[0].white_dps_rthz || gyros_[1].white_dps_rthz;
  density_[1] = sways || given ? 0.0 : cell_shared / cells_;
  sample_[1] = shakes || samples_ <= cells_ ? 0.0 : sample_shared / std::sqrt(gain_[0] * gain_[1]);
  apply_rise();
}

void NoiseTracker::resume(const Symmetric& density, const std::array<double, 2>& sample_variance) {
  density_ = density;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!gyros_[gyro].white_dps_rthz) continue;
    density_[2 * gyro] = *gyros_[gyro].white_dps_rthz * *gyros_[gyro].white_dps_rthz;
    density_[1] = 0.0;
  }
  sample_ = {sample_variance[0], 0.0, sample_variance[1]};
  apply_rise();
}

void NoiseTracker::watch(const CellBlock& block) {
  if (block.present != Present::kBoth) return;
  Symmetric squares{};
  double freedom = 0.0;
  std::array<double, 2> gain{};
  for (std::size_t i = 0; i < block.count; ++i) {
    const Cell& cell = block.cells[i];
    for (std::size_t k = 0; k < 3; ++k)
      squares[k] += cell.scatter[k];
    freedom += cell.count - 1.0;
    gain[0] += (cell.count - 1.0) * cell.noise_gain[0];
    gain[1] += (cell.count - 1.0) * cell.noise_gain[1];
  }
  if (freedom < 8.0) return;
  const std::array<double, 2> expected{(sample_[0] - sample_[1]) * gain[0],
                                       (sample_[2] - sample_[1]) * gain[1]};
  if (expected[0] <= 0.0 || expected[1] <= 0.0) return;
  // The common part is motion. It does not cancel exactly in one gyro's sum of squares: its
  // uncertainty grows with the motion, and with the other gyro's noise. A delay shows with opposite
  // signs in the two gyros, and is at most what both have together. Rounding leaves a difference of
  // squares below zero where both step alike.
  const double both = std::max(of_difference(squares), 0.0);
  const std::array<double, 2> own{std::clamp(squares[0] - squares[1], 0.0, both),
                                  std::clamp(squares[2] - squares[1], 0.0, both)};
  const double both_expected = expected[0] + expected[1];
  std::array<double, 2> rise{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double spread = std::sqrt(std::max(squares[2 * gyro], 0.0) * both / freedom);
    rise[gyro] = std::max((own[gyro] - kSureSigma * spread) / expected[gyro], 1.0);
  }
  const double explained = rise[0] * expected[0] + rise[1] * expected[1];
  const double sure = both - kSureSigma * both_expected * std::sqrt(2.0 / freedom);
  const double missing = std::max(sure / explained, 1.0);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    // One outlying block is not noise; several are, however large.
    const double followed = std::min(rise[gyro] * missing, 3.0 * rise_[gyro] + kOneBlockMax);
    rise_[gyro] += kRiseGain * (followed - rise_[gyro]);
    // Report a gyro only if the noise is plainly its own: the rises of both explain the difference,
    // or its own significant rise is enough.
    const bool plain = missing < 2.0 || rise[gyro] > kNoisyFactor;
    if (rise_[gyro] > kNoisyFactor && plain) noisy_[gyro] = true;
    if (rise_[gyro] < kNoLongerNoisy * kNoisyFactor) noisy_[gyro] = false;
  }
  apply_rise();
}

void NoiseTracker::forget_rise() {
  rise_ = {1.0, 1.0};
  noisy_ = {};
  apply_rise();
}

void NoiseTracker::apply_rise() {
  const double both = std::sqrt(rise_[0] * rise_[1]);
  present_density_ = {density_[0] * rise_[0], density_[1] * both, density_[2] * rise_[1]};
  present_sample_ = {sample_[0] * rise_[0], sample_[1] * both, sample_[2] * rise_[1]};
}

}  // namespace vgyro::fusion
