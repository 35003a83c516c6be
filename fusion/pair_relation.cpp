#include "fusion/pair_relation.h"

#include <cmath>
#include <limits>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kAny = std::numeric_limits<double>::infinity();

// A gyro has moved in a block when its cells scatter by this many standard deviations of the part
// that is not smooth from cell to cell: noise, steps of its values, vibration.
constexpr double kMoved = 4.0;
// At least one gyro must have moved this much, deg/s rms: no bias wanders so far within a second.
constexpr double kMovedMin_dps = 0.2;
// Motion that the other gyro has to follow, deg/s rms.
constexpr double kMovedMuch_dps = 1.0;
// A gyro must have turned over this range, deg, within the memory: vibration beyond half the
// sampling rate looks like slow motion, which the two gyros may even see with opposite signs, but
// it does not turn the platform.
constexpr double kSwung_deg = 3.0;
// Motion smaller than a drift of this slope, deg/s within a second, is judged without its trend.
constexpr double kDrift_dps_s = 0.1;

// Slopes beyond this contradict a pair. Slopes between this and PairRelation::kSlopeMost are no
// evidence for anything: no wrong unit is so near to the right one (rpm for deg/s is 6).
constexpr double kContrarySlope = 5.0;

// Share of a healthy pair's motion that neither slope nor lag explains: bandwidths, and motion
// between two cells.
constexpr double kTolerance = 0.03;
// A contradiction counts only if its own slope leaves no more than this share …
constexpr double kExplained = 0.2;
// … or, for a unit, this share plus noise: a signal that is clipped at a small part of the motion
// leaves 0.19.
constexpr double kScaleExplained = 0.1;
// Blocks support the same contradiction only if their slopes agree within this, in the logarithm.
constexpr double kSameSlope = 0.4;
// Half the number of independent values in a block of smooth motion; and the bound of a block's
// evidence, so that one odd second is not enough.
constexpr double kHalfValues = 2.0;
constexpr double kBlockTells = 6.0;
// A configuration is wrong once in some thousand: prior log odds. Three blocks are needed for a
// finding, four to take it back.
constexpr double kPrior = -8.0;
constexpr double kFound = 6.0;
constexpr double kEvidenceMost = 24.0;
constexpr double kEvidenceLeast = -12.0;

// Largest lag that is searched.
constexpr double kLagSought_s = 3.0;
// Number of long blocks over which their evidence fades.
constexpr double kRemembered = 32.0;
// A lag needs this many long blocks, must leave no more than this share, and this many times less
// than any healthy lag.
constexpr double kLagBlocks = 6.0;
constexpr double kLagLeaves = 0.2;
constexpr double kLagBetter = 5.0;
// It must also be better by this factor in this share of the blocks: in periodic motion one odd
// block could decide otherwise.
constexpr double kLagShare = 0.6;
constexpr double kLagBlockBetter = 3.0;
// A lag that was found stands while it is better by this factor.
constexpr double kLagStillBetter = 2.0;
constexpr double kNamingBlocks = 3.0;
// Sign or unit are named only if one slope leaves less than this share on average.
constexpr double kOneSlopeLeaves = 0.3;
// For streams with nothing in common: the most that a healthy slope leaves of a pair at its lag on
// average; the scatter of that share between blocks; the significance needed; and the least number
// of blocks in which both moved, one of them much.
constexpr double kPairLeaves = 0.4;
constexpr double kLeftSpread = 0.3;
constexpr double kUnrelatedSigmas = 2.5;
constexpr double kStrongBlocks = 8.0;
constexpr double kBothMoved_dps = 0.3;
// Correlation from which a gyro follows the other one, and below which it does not; it does not
// follow either if it moves less than this share of the other one's motion.
constexpr double kFollows = 0.8;
constexpr double kFollowsNot = 0.3;
constexpr double kSmallShare = 0.2;
// Log odds from a long block that a gyro moves by itself: five blocks for each gyro are needed.
constexpr double kAloneTells = 3.5;

// Limits that no gyro reaches: scatter from sample to sample, deg/s rms, also as a multiple of the
// other gyro's, …
constexpr double kErratic_dps = 30.0;
constexpr double kErraticRatio = 10.0;
// … least scatter in all cells of a block but one, bias against the other gyro from the start on,
// and the number of such blocks for a finding.
constexpr double kErraticCell_dps = 10.0;
constexpr double kBiasMost_dps = 100.0;
constexpr double kErraticBlocks = 8.0;
// After this many blocks with less scatter than this, the values were a gyro's.
constexpr std::size_t kCalmBlocks = 5;
constexpr double kCalm_dps = 3.0;
// No gyro leaps so far from one sample to the next and stays there, while the other one moves:
// least leap, as a multiple of the other's largest leap, and of the range of the other around that
// time. Leaps both ways are needed; they are remembered over a hundred blocks of motion.
constexpr double kLeap_dps = 30.0;
constexpr double kLeapRatio = 5.0;
constexpr double kLeapRange = 2.0;
constexpr double kLeapStays = 0.6;
constexpr std::size_t kLeapCells = 3;  // cells compared before the leap and after it
constexpr double kLeaps = 1.5;
constexpr double kLeapsStill = 0.5;
constexpr double kLeapKept = 0.99;

double log_odds_to_probability(double log_odds) {
  return 1.0 / (1.0 + std::exp(-log_odds));
}

}  // namespace

void PairRelation::Slopes::add(const Fit& fit) {
  own += fit.own;
  both += fit.both;
  own_square += squared(fit.own);
  both_square += squared(fit.both);
  product += fit.own * fit.both;
}

// From the scatter of the blocks, which differ by more than noise.
double PairRelation::Slopes::sigma() const {
  const double s = slope();
  const double square = both_square - 2.0 * s * product + s * s * own_square;
  return std::sqrt(std::max(square, 0.0)) / own;
}

// --- cells ---------------------------------------------------------------------------------------

void PairRelation::close_cell(double t_s, double step_s) {
  const auto n = static_cast<double>(samples_);
  RelationCell closed;
  closed.samples = n;
  closed.length_s = t_s - from_s_;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double away_dps = sum_[gyro] / n;
    closed.mean_dps[gyro] = origin_[gyro] + away_dps;
    closed.leap[gyro] = step_most_[gyro];
    if (samples_ > 1) {
      closed.rough[gyro] = 0.5 * step_square_[gyro] / (n - 1.0);
      closed.scatter[gyro] = std::max(square_[gyro] - n * away_dps * away_dps, 0.0) / (n - 1.0);
    }
  }
  samples_ = 0;
  sum_ = square_ = step_square_ = step_most_ = {};
  constexpr double kGapCells = 4.0;
  const bool gap = step_s > kGap_s && step_s > kGapCells * length_s_;
  if (gap) {
    // A stream of long intervals begins like one with a gap.
    length_s_ = count_ == 0 ? closed.length_s : 0.0;
    break_off();
    return;
  }
  if (count_ == kCells) {
    head_ = (head_ + 1) % kCells;
    --count_;
  }
  constexpr double kLengthGain = 0.05;
  length_s_ =
      length_s_ > 0.0 ? length_s_ + kLengthGain * (closed.length_s - length_s_) : closed.length_s;
  cells_[(head_ + count_++) % kCells] = closed;
  ++since_block_;
  ++since_long_block_;
  judge_block();
  judge_long_block();
}

PairRelation::Stretch PairRelation::stretch(std::size_t gyro, std::size_t from,
                                            std::size_t length) const {
  Stretch out;
  double within = 0.0;
  for (std::size_t i = 0; i < length; ++i) {
    const RelationCell& one = cell(from + i);
    out.mean_dps += one.mean_dps[gyro];
    out.rough += one.rough[gyro];
    within += one.scatter[gyro] / one.samples;
  }
  const auto n = static_cast<double>(length);
  out.mean_dps /= n;
  out.rough /= n;
  // Second differences of white noise have six times its variance; smooth motion has none.
  double bends = 0.0;
  for (std::size_t i = 0; i < length; ++i) {
    const double value = cell(from + i).mean_dps[gyro];
    out.squares += squared(value - out.mean_dps);
    if (i < 2) continue;
    bends += squared(value - 2.0 * cell(from + i - 1).mean_dps[gyro] +
                     cell(from + i - 2).mean_dps[gyro]);
  }
  out.bends = bends / (6.0 * (n - 2.0));
  out.noise = std::max(within / n, out.bends);
  return out;
}

bool PairRelation::moves(const Stretch& stretch, std::size_t length) {
  return stretch.squares > squared(kMoved) * static_cast<double>(length) * stretch.noise;
}

double PairRelation::swing_deg(std::size_t gyro) const {
  double mean_dps = 0.0;
  for (std::size_t i = 0; i < count_; ++i)
    mean_dps += cell(i).mean_dps[gyro];
  mean_dps /= static_cast<double>(count_);
  double angle_deg = 0.0;
  double least_deg = 0.0;
  double most_deg = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    angle_deg += (cell(i).mean_dps[gyro] - mean_dps) * cell(i).length_s;
    least_deg = std::min(least_deg, angle_deg);
    most_deg = std::max(most_deg, angle_deg);
  }
  return most_deg - least_deg;
}

PairRelation::Products PairRelation::products(std::size_t from, std::size_t lagged_from,
                                              std::size_t length, bool trends_off,
                                              bool halfway) const {
  const double first_origin = cell(from).mean_dps[0];
  const double second_origin = cell(lagged_from).mean_dps[1];
  const auto n = static_cast<double>(length);
  const double middle = 0.5 * (n - 1.0);
  std::array<double, 2> sum{};
  std::array<double, 2> trend{};
  Products out;
  for (std::size_t i = 0; i < length; ++i) {
    const double first = cell(from + i).mean_dps[0] - first_origin;
    const double after = cell(lagged_from + i + (halfway ? 1 : 0)).mean_dps[1];
    const double second = 0.5 * (cell(lagged_from + i).mean_dps[1] + after) - second_origin;
    const double place = static_cast<double>(i) - middle;
    sum[0] += first;
    sum[1] += second;
    trend[0] += place * first;
    trend[1] += place * second;
    out.first += first * first;
    out.second += second * second;
    out.both += first * second;
  }
  const double places = trends_off ? n * (n * n - 1.0) / 12.0 : kAny;
  out.first -= sum[0] * sum[0] / n + trend[0] * trend[0] / places;
  out.second -= sum[1] * sum[1] / n + trend[1] * trend[1] / places;
  out.both -= sum[0] * sum[1] / n + trend[0] * trend[1] / places;
  return out;
}

PairRelation::Fit PairRelation::fit(const Products& sums, double slope_least, double slope_most) {
  Fit out{.own = sums.first, .both = sums.both};
  if (!(sums.first > 0.0) || !(sums.second > 0.0)) return out;
  out.slope = std::clamp(sums.both / sums.first, slope_least, slope_most);
  const double left = sums.second + out.slope * (out.slope * sums.first - 2.0 * sums.both);
  out.left = std::max(left, 0.0) / sums.second;
  return out;
}

// In fast motion a lag of half a cell would make a healthy pair look unlike.
PairRelation::Fit PairRelation::halfway_fit(std::size_t from, std::size_t lagged_from,
                                            std::size_t length, bool trends_off) const {
  return fit(products(from, lagged_from, length, trends_off, true), 1.0 / kSlopeMost, kSlopeMost);
}

// --- block by block: sign and unit ---------------------------------------------------------------

std::size_t PairRelation::near_lags(std::size_t most) const {
  return static_cast<std::size_t>(
      std::clamp(std::round(kLagMost_s / length_s_), 1.0, static_cast<double>(most)));
}

void PairRelation::judge_block() {
  const std::size_t lags = near_lags(kLags);
  if (since_block_ < kBlock || count_ < kBlock + 2 * lags) return;
  since_block_ = 0;
  const std::size_t from = count_ - lags - kBlock;
  const std::array<Stretch, 2> both{stretch(0, from, kBlock), stretch(1, from, kBlock)};
  judge_values(from, both);
  const double most = std::max(both[0].squares, both[1].squares);
  const bool enough = most > squared(kMovedMin_dps) * static_cast<double>(kBlock) &&
                      std::max(swing_deg(0), swing_deg(1)) > kSwung_deg;
  if (enough && moves(both[0], kBlock) && moves(both[1], kBlock)) {
    Fit contrary;
    const double tells = block_tells(from, lags, both, contrary);
    hear(tells, contrary);
  }
  decide();
}

// Is there still motion above the noise after the trends are removed?
bool PairRelation::clear_of_noise(const Products& sums, const std::array<Stretch, 2>& both) {
  const double most = squared(kMoved) * static_cast<double>(kBlock);
  return sums.first > most * both[0].noise && sums.second > most * both[1].noise;
}

// Log likelihood ratio of the best contrary slope against the best healthy one, bounded.
double PairRelation::block_tells(std::size_t from, std::size_t lags,
                                 const std::array<Stretch, 2>& both, Fit& contrary) const {
  const auto n = static_cast<double>(kBlock);
  const double least_squares = std::min(both[0].squares, both[1].squares);
  const double drift_dps = kDrift_dps_s * n * length_s_;
  const bool may_be_drift = least_squares < n * squared(drift_dps) / 12.0;
  Fit healthy;
  healthy.left = kAny;
  contrary.left = kAny;
  for (std::size_t lagged = from - lags; lagged <= from + lags; ++lagged) {
    const Products sums = products(from, lagged, kBlock, may_be_drift);
    if (may_be_drift && lagged == from && !clear_of_noise(sums, both)) return 0.0;
    const Fit with = fit(sums, 1.0 / kSlopeMost, kSlopeMost);
    if (with.left < healthy.left) healthy = with;
    if (lagged < from + lags) {
      const Fit between = halfway_fit(from, lagged, kBlock, may_be_drift);
      if (between.left < healthy.left) healthy = between;
    }
    const Fit less = fit(sums, -kAny, 1.0 / kContrarySlope);
    if (less.left < contrary.left) contrary = less;
    const Fit more = fit(sums, kContrarySlope, kAny);
    if (more.left < contrary.left) contrary = more;
  }
  const double slope = std::abs(contrary.left < healthy.left ? contrary.slope : healthy.slope);
  const double noise = n * (both[1].noise + slope * slope * both[0].noise) / both[1].squares;
  const double least = kTolerance + noise;
  const double tells =
      kHalfValues * std::log(std::max(healthy.left, least) / std::max(contrary.left, least));
  const double explained = contrary.slope < 0.0 ? kExplained : kScaleExplained + noise;
  if (tells > 0.0 && contrary.left > explained) return 0.0;
  if (tells < 0.0 && healthy.left > kExplained) return 0.0;
  return std::clamp(tells, -kBlockTells, kBlockTells);
}

void PairRelation::hear(double tells, const Fit& contrary) {
  if (tells > 0.0) {
    // Another slope is another contradiction: evidence for the old one does not count for it.
    const double ratio = slopes_.own > 0.0 ? contrary.slope / slopes_.slope() : 1.0;
    if (!(ratio > 0.0) || std::abs(std::log(ratio)) > kSameSlope) {
      slopes_ = {};
      evidence_ = std::min(evidence_, 0.0);
    }
    slopes_.add(contrary);
  }
  evidence_ = std::clamp(evidence_ + tells, kEvidenceLeast, kEvidenceMost);
  if (evidence_ <= 0.0) slopes_ = {};
}

// True if nearly every value of the block jumps, not just a few outliers.
bool PairRelation::jumps(std::size_t gyro, std::size_t from, const std::array<Stretch, 2>& both,
                         bool moving) const {
  const Stretch& own = both[gyro];
  const Stretch& other = both[1 - gyro];
  const bool several = own.rough > 0.0;  // samples in a cell
  const double scatter = several ? own.rough : own.bends;
  double of_the_other = several ? other.rough : other.bends;
  if (!moving || !several) of_the_other += other.squares / static_cast<double>(kBlock);
  if (scatter < squared(kErratic_dps) || scatter < squared(kErraticRatio) * of_the_other)
    return false;
  std::size_t cells = 0;
  for (std::size_t i = 2; i < kBlock; ++i) {
    const RelationCell& one = cell(from + i);
    const double bend = one.mean_dps[gyro] - 2.0 * cell(from + i - 1).mean_dps[gyro] +
                        cell(from + i - 2).mean_dps[gyro];
    const double square = several ? one.rough[gyro] : squared(bend);
    if (square > squared(kErraticCell_dps)) ++cells;
  }
  return cells + 1 >= kBlock - 2;
}

// A leap from one sample to the next that stays, many times as far as the other gyro has moved: a
// sign bit is read as part of a value, or a value wraps. A healthy gyro beside a blind one makes no
// leap, nor does an outlier.
void PairRelation::look_for_leaps(std::size_t gyro, std::size_t from, bool moving) {
  if (!moving) return;
  const std::size_t lags = near_lags(kLags);
  double least = kAny;
  double most = -kAny;
  double other_leap = 0.0;
  for (std::size_t i = from - lags; i < from + kBlock + lags; ++i) {
    least = std::min(least, cell(i).mean_dps[1 - gyro]);
    most = std::max(most, cell(i).mean_dps[1 - gyro]);
    other_leap = std::max(other_leap, std::abs(cell(i).leap[1 - gyro]));
  }
  const double enough = std::max({kLeap_dps, kLeapRatio * other_leap, kLeapRange * (most - least)});
  std::array<double, 2>& leaps = values_[gyro].leaps;
  std::array<bool, 2> any{};
  for (std::size_t i = std::max(from, kLeapCells); i < from + kBlock && i + kLeapCells < count_;
       ++i) {
    const double leap = cell(i).leap[gyro];
    if (std::abs(leap) < enough) continue;
    double before = -kAny;  // farthest in the leap's direction
    double after = kAny;    // nearest
    for (std::size_t away = 1; away <= kLeapCells; ++away) {
      before = std::max(before, cell(i - away).mean_dps[gyro] / leap);
      after = std::min(after, cell(i + away).mean_dps[gyro] / leap);
    }
    if (after - before > kLeapStays) any[leap > 0.0 ? 1 : 0] = true;
  }
  for (std::size_t way = 0; way < 2; ++way)
    leaps[way] = kLeapKept * leaps[way] + (any[way] ? 1.0 : 0.0);
}

// Finds values that are no gyro's, however the platform moves, from the start on. A gyro whose
// values were normal, at rest or in motion, and no longer are is faulty, not configured wrongly.
void PairRelation::judge_values(std::size_t from, const std::array<Stretch, 2>& both) {
  const auto n = static_cast<double>(kBlock);
  const double apart_dps = std::abs(both[0].mean_dps - both[1].mean_dps);
  were_near_ = were_near_ || apart_dps < 0.5 * kBiasMost_dps;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Stretch& own = both[gyro];
    const Stretch& other = both[1 - gyro];
    const bool moving = moves(other, kBlock) && other.squares > n * squared(kMovedMin_dps);
    const std::size_t which = moving ? 1 : 0;
    Values& values = values_[gyro];
    const double scatter = own.rough > 0.0 ? own.rough : own.bends;
    const bool calm = scatter < squared(kCalm_dps);
    if (calm) values.calm[which] = std::min(values.calm[which] + 1, kCalmBlocks);
    const bool far = !were_near_ && apart_dps > kBiasMost_dps &&
                     std::abs(own.mean_dps) > kSlopeMost * std::abs(other.mean_dps) &&
                     !moves(own, kBlock);
    const bool jumping = jumps(gyro, from, both, moving);
    const bool sick = jumping && values.calm[which] == kCalmBlocks;
    const auto count = [&](std::size_t circumstance, double more) {
      double& blocks = values.erratic[circumstance];
      blocks = std::clamp(blocks + more, 0.0, 2.0 * kErraticBlocks);
    };
    if (sick) {
      count(1 - which, -2.0);
    } else if (far || jumping) {
      count(which, 1.0);
    } else if (calm) {
      count(which, -1.0);
    }
    look_for_leaps(gyro, from, moving);
  }
}

// A finding needs less evidence to stand than to begin.
bool PairRelation::erratic(std::size_t gyro) const {
  const Values& values = values_[gyro];
  const bool stands = verdict_.contradiction == Contradiction::kErratic && verdict_.gyro == gyro;
  const double blocks = std::max(values.erratic[0], values.erratic[1]);
  const double leaps = std::min(values.leaps[0], values.leaps[1]);
  return stands ? blocks >= 1.0 || leaps > kLeapsStill : blocks >= kErraticBlocks || leaps > kLeaps;
}

// --- over all lags: late, or nothing in common ---------------------------------------------------

void PairRelation::judge_long_block() {
  const auto lags = static_cast<std::size_t>(
      std::clamp(std::round(kLagSought_s / length_s_), 2.0, static_cast<double>(kLags)));
  if (since_long_block_ < kLongBlock || count_ < kLongBlock + 2 * lags) return;
  since_long_block_ = 0;
  if (lags != lag_cells_) {
    lag_cells_ = lags;
    lags_ = {};
    long_blocks_ = 0.0;
    strong_blocks_ = 0.0;
    own_ = 0.0;
  }
  const std::size_t from = count_ - lags - kLongBlock;
  const std::array<Stretch, 2> both{stretch(0, from, kLongBlock), stretch(1, from, kLongBlock)};
  const auto n = static_cast<double>(kLongBlock);
  const bool count = std::max(both[0].squares, both[1].squares) > n * squared(kMovedMin_dps) &&
                     std::max(swing_deg(0), swing_deg(1)) > kSwung_deg &&
                     moves(both[0], kLongBlock) && moves(both[1], kLongBlock);
  constexpr double kKept = 1.0 - 1.0 / kRemembered;
  const bool strong = count &&
                      std::max(both[0].squares, both[1].squares) > n * squared(kMovedMuch_dps) &&
                      std::min(both[0].squares, both[1].squares) > n * squared(kBothMoved_dps);
  if (count) long_blocks_ = kKept * long_blocks_ + 1.0;
  if (strong) strong_blocks_ = kKept * strong_blocks_ + 1.0;
  const std::size_t near = near_lags(lags - 1);
  double most_alike = -1.0;
  double least_left = 1.0;
  for (std::size_t lag = 0; lag <= 2 * lags; ++lag) {
    const std::size_t lagged = from - lags + lag;
    const Products sums = products(from, lagged, kLongBlock, false);
    Fit with = fit(sums, 1.0 / kSlopeMost, kSlopeMost);
    const Fit any = fit(sums, -kAny, kAny);
    if (lag + near >= lags && lag <= lags + near) {
      const Fit between = halfway_fit(from, lagged, kLongBlock, false);
      if (between.left < with.left) with = between;
      const double alike = std::sqrt(std::clamp(1.0 - any.left, 0.0, 1.0));
      most_alike = std::max(most_alike, std::copysign(alike, any.both));
      least_left = std::min(least_left, with.left);
    }
    if (!count) continue;
    AtLag& at = lags_[lag];
    at.now = with.left;
    at.left = kKept * at.left + std::min(with.left, 1.0);
    at.any_left = kKept * at.any_left + any.left;
    if (strong) at.strong_left = kKept * at.strong_left + std::min(with.left, 1.0);
    at.both = kKept * at.both + any.both;
    if (lag == lags) own_ = kKept * own_ + any.own;
  }
  judge_following(both, most_alike, least_left);
  if (count) {
    for (AtLag& at : lags_)
      at.blocks = kKept * at.blocks + (kLagBlockBetter * at.now < least_left ? 1.0 : 0.0);
    weigh_lags();
  }
  decide();
}

// Does each gyro move with the other one? A blind gyro does not follow, but never moves by itself.
void PairRelation::judge_following(const std::array<Stretch, 2>& both, double most_alike,
                                   double left) {
  const auto n = static_cast<double>(kLongBlock);
  bool follows = false;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Stretch& own = both[gyro];
    if (own.squares < n * squared(kMovedMuch_dps) || !moves(own, kLongBlock)) continue;
    if (swing_deg(gyro) < kSwung_deg) continue;
    const bool small = both[1 - gyro].squares < squared(kSmallShare) * own.squares;
    double tells = 0.0;
    if (small || most_alike < kFollowsNot) tells = kAloneTells;
    if (!small && most_alike > kFollows && left < kExplained) tells = -kBlockTells;
    alone_[gyro] = std::clamp(alone_[gyro] + tells, kEvidenceLeast, kEvidenceMost);
    follows = follows || (tells < 0.0 && left < 0.5 * kExplained);
  }
  // Following in large motion outweighs earlier evidence for a wrong sign or unit.
  if (follows) hear(-kBlockTells, {});
  const double least = std::min(alone_[0], alone_[1]);
  unrelated_ = kPrior + least > kFound || (unrelated_ && least > 0.0);
}

// Have the gyros significantly less in common than a pair?
void PairRelation::judge_common(double left) {
  if (strong_blocks_ < kStrongBlocks) return;
  const double mean = left / strong_blocks_;
  const double sigma = kLeftSpread / std::sqrt(strong_blocks_);
  const double sigmas = (mean - kPairLeaves) / sigma;
  pooled_ = sigmas > kUnrelatedSigmas || (pooled_ && sigmas > 0.0);
  pooled_probability_ = 1.0 - 0.5 * std::erfc(sigmas / std::sqrt(2.0));
}

void PairRelation::weigh_lags() {
  const std::size_t near = near_lags(lag_cells_ - 1);
  std::size_t best = 0;
  std::size_t best_near = lag_cells_;
  double any_left = kAny;
  double strong_left = kAny;
  for (std::size_t lag = 0; lag <= 2 * lag_cells_; ++lag) {
    const AtLag& at = lags_[lag];
    if (at.left < lags_[best].left) best = lag;
    if (lag + near < lag_cells_ || lag > lag_cells_ + near) continue;
    if (at.left < lags_[best_near].left) best_near = lag;
    any_left = std::min(any_left, at.any_left);
    strong_left = std::min(strong_left, at.strong_left);
  }
  judge_common(strong_left);
  best_any_left_ = any_left / long_blocks_;
  const double left = std::max(lags_[best].left / long_blocks_, 0.5 * kTolerance);
  const double better = std::min(lags_[best_near].left / long_blocks_, best_any_left_) / left;
  const bool inside = best > 0 && best < 2 * lag_cells_;
  const bool before = late_.contradiction == Contradiction::kLag;
  late_ = {};
  if (long_blocks_ < kLagBlocks || !inside || left > kLagLeaves) return;
  if (better < (before ? kLagStillBetter : kLagBetter)) return;
  if (!before && lags_[best].blocks < kLagShare * long_blocks_) return;
  late_.contradiction = Contradiction::kLag;
  late_.slope = lags_[best].both / own_;
  late_.slope_sigma = kNone;
  late_.lag_s = (static_cast<double>(best) - static_cast<double>(lag_cells_)) * length_s_;
  late_.probability =
      log_odds_to_probability(kPrior + kHalfValues * long_blocks_ * std::log(better));
}

// --- the verdict ---------------------------------------------------------------------------------

void PairRelation::decide() {
  const bool before = contradicts();
  const double log_odds = kPrior + evidence_;
  // A finding stands until the evidence against it equals the evidence for it.
  by_blocks_ = slopes_.own > 0.0 && (log_odds > kFound || (by_blocks_ && evidence_ > 0.0));
  const bool one_slope = long_blocks_ < kNamingBlocks || best_any_left_ < kOneSlopeLeaves;
  PairVerdict now;
  if (late_.contradiction != Contradiction::kNone) {
    now = late_;
  } else if (by_blocks_ && one_slope) {
    now = {.contradiction = slopes_.slope() < 0.0 ? Contradiction::kSign : Contradiction::kScale,
           .probability = log_odds_to_probability(log_odds),
           .slope = slopes_.slope(),
           .slope_sigma = slopes_.sigma()};
  } else if (by_blocks_ || unrelated_ || pooled_) {
    const double most = std::max(log_odds, kPrior + std::min(alone_[0], alone_[1]));
    const double pooled = pooled_ ? pooled_probability_ : 0.0;
    now = {Contradiction::kUnrelated, std::max(log_odds_to_probability(most), pooled), kNone,
           kNone};
  }
  const bool named =
      now.contradiction != Contradiction::kNone && now.contradiction != Contradiction::kUnrelated;
  for (std::size_t gyro = 0; gyro < 2 && !named; ++gyro) {
    if (!erratic(gyro)) continue;
    now = {Contradiction::kErratic, log_odds_to_probability(kFound), kNone, kNone, 0.0, gyro};
  }
  const bool pair = evidence_ <= kEvidenceLeast;
  if (pair || now.contradiction != Contradiction::kNone) earlier_ = {};
  verdict_ = now.contradiction != Contradiction::kNone ? now : earlier_;
  if (contradicts() && !before) ++times_;
}

}  // namespace vgyro::fusion
