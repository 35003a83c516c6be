#include "fusion/misalignment.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "base/angle.h"
#include "fusion/quadratic.h"

namespace vgyro::fusion {

namespace {

constexpr double kPrior_rad = Misalignment::kPrior_deg * kRadPerDeg;
// From data sheets of cheap gyros, and buses that deliver one unit later than the other.
constexpr double kScalePrior = 0.02;
constexpr double kSkewPrior_s = 0.01;
// Changes in an hour: of the housing, of scale factors, of clocks.
constexpr double kWarp_rad = 0.005 * kRadPerDeg;
constexpr double kScaleDrift = 1e-4;
constexpr double kSkewDrift_s = 1e-4;
constexpr double kHour_s = 3600.0;

// A longer hole than this many cells ends a segment.
constexpr double kHole_s = 3.0 * Misalignment::kCell_s;
// Derivatives need a neighbour on each side.
constexpr std::size_t kEdge = 1;
constexpr std::size_t kCellsMin = 20;
// A segment counts if its rates are this far above their own noise, which would otherwise bias the
// fit, and above this rate.
constexpr double kExcited = 5.0;
constexpr double kTurning_dps = 0.05;
// Least noise: coarse readings repeat, and seem to have none.
constexpr double kNoiseLeast_dps = 1e-4;
// Parameters of the fit whose remainder is a segment's noise: a level, three rates, a derivative.
constexpr int kFitted = 5;
// χ² per state from which a segment counts less.
constexpr double kContradiction = 4.0;
// χ² per state from which a segment is taken for a fault and left out, unless more than so many
// follow each other.
constexpr double kUnlikely = 50.0;
constexpr int kUnlikelyMost = 3;
// Limit of the correlation of neighbours.
constexpr double kAlikeMost = 0.9;

std::size_t next(std::size_t axis) {
  return (axis + 1) % kPlatformAxes;
}
std::size_t after_next(std::size_t axis) {
  return (axis + 2) % kPlatformAxes;
}

}  // namespace

Misalignment::Misalignment() {
  for (int i = 0; i < 3; ++i) {
    covariance_(i, i) = squared(kPrior_rad);
    covariance_(3 + i, 3 + i) = squared(kScalePrior);
  }
  covariance_(6, 6) = squared(kSkewPrior_s);
}

// --- cells ---------------------------------------------------------------------------------------

void Misalignment::add(double t_s, const AxisRates& first_dps, const AxisRates& second_dps,
                       const Both& both) {
  if (both != both_) {
    // The samples just before an axis was set aside may be faulty.
    cells_count_ = 0;
    break_off();
  }
  both_ = both;
  if (begun_ && (t_s - newest_s_ > kHole_s || t_s < newest_s_)) break_off();
  if (!begun_) {
    begun_ = true;
    cell_from_s_ = t_s;
    count_ = 0.0;
    if (t_s < learned_until_s_ || learned_until_s_ == 0.0) learned_until_s_ = t_s;
  }
  if (count_ > 0.0 && t_s - cell_from_s_ >= kCell_s) {
    close_cell();
    cell_from_s_ = t_s;
  }
  newest_s_ = t_s;
  count_ += 1.0;
  for (std::size_t axis = 0; axis < kPlatformAxes; ++axis) {
    first_sum_[axis] += first_dps[axis];
    second_sum_[axis] += second_dps[axis];
  }
}

void Misalignment::close_cell() {
  Cell& cell = cells_[cells_count_++];
  for (std::size_t axis = 0; axis < kPlatformAxes; ++axis) {
    cell.rate_dps[axis] = 0.5 * (first_sum_[axis] + second_sum_[axis]) / count_;
    cell.difference_dps[axis] = (second_sum_[axis] - first_sum_[axis]) / count_;
  }
  first_sum_ = {};
  second_sum_ = {};
  count_ = 0.0;
  if (cells_count_ == kSegmentCells) close_segment();
}

void Misalignment::break_off() {
  close_segment();
  first_sum_ = {};
  second_sum_ = {};
  count_ = 0.0;
  begun_ = false;
}

// --- segments ------------------------------------------------------------------------------------

Misalignment::State Misalignment::regressor(std::size_t axis, std::size_t cell) const {
  const AxisRates& rate = cells_[cell].rate_dps;
  State row = State::Zero();
  // (Ω × θ) about this axis.
  row(static_cast<int>(after_next(axis))) = rate[next(axis)];
  row(static_cast<int>(next(axis))) = -rate[after_next(axis)];
  row(3 + static_cast<int>(axis)) = rate[axis];
  row(6) = (cells_[cell + 1].rate_dps[axis] - cells_[cell - 1].rate_dps[axis]) / (2.0 * kCell_s);
  return row;
}

// Variance of the remainder that no rate and no derivative explains; it is larger where neighbours
// are correlated.
double Misalignment::noise_variance(std::size_t axis) const {
  using Fit = Eigen::Matrix<double, kFitted, 1>;
  Eigen::Matrix<double, kFitted, kFitted> normal = Eigen::Matrix<double, kFitted, kFitted>::Zero();
  Fit right = Fit::Zero();
  const auto row_of = [&](std::size_t cell) {
    Fit row;
    const State all = regressor(axis, cell);
    row << 1.0, cells_[cell].rate_dps[0], cells_[cell].rate_dps[1], cells_[cell].rate_dps[2],
        all(6);
    return row;
  };
  for (std::size_t i = kEdge; i + kEdge < cells_count_; ++i) {
    const Fit row = row_of(i);
    normal += row * row.transpose();
    right += row * cells_[i].difference_dps[axis];
  }
  // The column of an axis that does not turn is zero.
  constexpr double kRidge = 1e-9;
  normal.diagonal().array() += kRidge * (1.0 + normal.trace());
  const Fit fit = normal.ldlt().solve(right);
  double squares = 0.0;
  double products = 0.0;
  double before = 0.0;
  for (std::size_t i = kEdge; i + kEdge < cells_count_; ++i) {
    const double left = cells_[i].difference_dps[axis] - row_of(i).dot(fit);
    squares += left * left;
    if (i > kEdge) products += left * before;
    before = left;
  }
  const auto count = static_cast<double>(cells_count_ - 2 * kEdge);
  const double alike = squares > 0.0 ? std::clamp(products / squares, 0.0, kAlikeMost) : 0.0;
  const double variance = squares / (count - kFitted) * (1.0 + alike) / (1.0 - alike);
  return std::max(variance, squared(kNoiseLeast_dps));
}

bool Misalignment::add_axis(std::size_t axis, Square& information, State& right) const {
  const auto count = static_cast<double>(cells_count_ - 2 * kEdge);
  State mean_row = State::Zero();
  double mean_difference = 0.0;
  for (std::size_t i = kEdge; i + kEdge < cells_count_; ++i) {
    mean_row += regressor(axis, i) / count;
    mean_difference += cells_[i].difference_dps[axis] / count;
  }
  Square squares = Square::Zero();
  State products = State::Zero();
  for (std::size_t i = kEdge; i + kEdge < cells_count_; ++i) {
    const State row = regressor(axis, i) - mean_row;
    squares += row * row.transpose();
    products += row * (cells_[i].difference_dps[axis] - mean_difference);
  }
  const double noise = noise_variance(axis);
  // The rate is the mean of both units: a quarter of the variance of their difference.
  const double turning = (squares.diagonal().head<6>().sum()) / count;
  if (turning < std::max(squared(kExcited) * 0.25 * noise, squared(kTurning_dps))) return false;
  information += squares / noise;
  right += products / noise;
  return true;
}

void Misalignment::close_segment() {
  const std::size_t count = cells_count_;
  if (count >= kCellsMin) {
    grow(newest_s_ - learned_until_s_);
    learned_until_s_ = newest_s_;
    Square information = Square::Zero();
    State right = State::Zero();
    bool any = false;
    for (std::size_t axis = 0; axis < kPlatformAxes; ++axis) {
      if (both_[axis]) any = add_axis(axis, information, right) || any;
    }
    if (any) learn(information, right);
  }
  cells_count_ = 0;
}

void Misalignment::grow(double length_s) {
  const double share = std::max(length_s, 0.0) / kHour_s;
  for (int i = 0; i < 3; ++i) {
    covariance_(i, i) =
        std::min(covariance_(i, i) + share * squared(kWarp_rad), squared(kPrior_rad));
    covariance_(3 + i, 3 + i) += share * squared(kScaleDrift);
  }
  covariance_(6, 6) += share * squared(kSkewDrift_s);
}

// Kalman update in information form; a segment that contradicts the present state weighs less.
void Misalignment::learn(Square information, State right) {
  const Square before = covariance_;
  const State away = right - information * mean_;
  Square expected = information * before * information + information;
  // States that the segment does not excite have a zero row.
  expected.diagonal().array() += 1e-12 * (1.0 + expected.trace());
  const double excess = away.dot(expected.ldlt().solve(away)) / kStates;
  unlikely_ = excess > kUnlikely ? unlikely_ + 1 : 0;
  if (unlikely_ > 0 && unlikely_ <= kUnlikelyMost) return;
  if (excess > kContradiction) information *= kContradiction / excess;
  const double weight = excess > kContradiction ? kContradiction / excess : 1.0;
  const Square unit = Square::Identity();
  // (P⁻¹ + A)⁻¹ = P (1 + A P)⁻¹
  const Square after = before * (unit + information * before).partialPivLu().inverse();
  if (!after.allFinite() || !away.allFinite()) return;
  covariance_ = 0.5 * (after + after.transpose());
  mean_ += covariance_ * (weight * away);
  ++segments_used_;
}

// --- the excess of unit 2 ------------------------------------------------------------------------

double Misalignment::cross_dps(std::size_t axis, const AxisRates& rate_dps) const {
  return rate_dps[next(axis)] * mean_(static_cast<int>(after_next(axis))) -
         rate_dps[after_next(axis)] * mean_(static_cast<int>(next(axis)));
}

double Misalignment::cross_variance(std::size_t axis, const AxisRates& rate_dps) const {
  const auto b = static_cast<int>(next(axis));
  const auto c = static_cast<int>(after_next(axis));
  const double of_c = rate_dps[next(axis)];
  const double of_b = -rate_dps[after_next(axis)];
  return std::max(of_c * of_c * covariance_(c, c) + of_b * of_b * covariance_(b, b) +
                      2.0 * of_b * of_c * covariance_(b, c),
                  0.0);
}

std::array<double, 3> Misalignment::angle_rad() const {
  return {mean_(0), mean_(1), mean_(2)};
}

std::array<double, 3> Misalignment::sigma_rad() const {
  return {std::sqrt(covariance_(0, 0)), std::sqrt(covariance_(1, 1)), std::sqrt(covariance_(2, 2))};
}

MisalignmentMemory Misalignment::memory() const {
  return {.angle_rad = angle_rad(),
          .covariance = {covariance_(0, 0), covariance_(0, 1), covariance_(0, 2), covariance_(1, 1),
                         covariance_(1, 2), covariance_(2, 2)}};
}

bool Misalignment::resume(const MisalignmentMemory& memory, double age_s) {
  const auto& m = memory.covariance;
  Eigen::Matrix3d covariance;
  covariance << m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5];
  const Eigen::Vector3d angle(memory.angle_rad[0], memory.angle_rad[1], memory.angle_rad[2]);
  if (!covariance.allFinite() || !angle.allFinite() || !(age_s >= 0.0)) return false;
  if (covariance.llt().info() != Eigen::Success) return false;
  mean_.head<3>() = angle;
  covariance_.topLeftCorner<3, 3>() = covariance;
  grow(age_s);
  return true;
}

}  // namespace vgyro::fusion
