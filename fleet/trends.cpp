#include "fleet/trends.h"

#include <algorithm>
#include <cmath>

#include "fleet/leave_one_out.h"

namespace vgyro::fleet {

namespace {

// Whether each unit moves its own way is judged by the number of units with |t| above this.
constexpr double kOff = 2.0;

double t_of(double value, double sigma) {
  return value / sigma;
}

// The normal tail is checked first: Student's is never below it and costs a hundred times as much.
bool is_beyond_chance(double t, double freedom, double threshold) {
  return normal_tail(t) < threshold && student_tail(t, freedom) < threshold;
}

// If units differ, their spread is estimated from the units, so their number limits the degrees of
// freedom.
double freedom_of(const UnitSlope& unit, const RandomEffects& others) {
  return others.between > 0.0 ? std::min(unit.freedom, others.freedom) : unit.freedom;
}

bool mean_is_named(const RandomEffects& type, const std::vector<UnitSlope>& slopes,
                   double threshold) {
  double freedom = 0.0;
  for (const UnitSlope& slope : slopes)
    freedom += slope.freedom;
  return is_beyond_chance(t_of(type.mean, type.sigma), type.between > 0.0 ? type.freedom : freedom,
                          threshold);
}

// About the median unit: one that runs away would pull the mean, and is reported by itself.
bool spread_is_named(const std::vector<UnitSlope>& slopes, double threshold) {
  constexpr double kShare = 0.25;     // of the units, as for a spread of sizes
  constexpr double kByChance = 0.11;  // |t| > 2 with the 5 degrees of freedom of few drives
  std::vector<double> values;
  values.reserve(slopes.size());
  for (const UnitSlope& slope : slopes)
    values.push_back(slope.per_year.value);
  const double middle = median(values);
  const auto off = std::count_if(slopes.begin(), slopes.end(), [&](const UnitSlope& slope) {
    return std::abs(t_of(slope.per_year.value - middle, slope.per_year.sigma)) > kOff;
  });
  const auto successes = static_cast<std::size_t>(off);
  return static_cast<double>(off) >= kShare * static_cast<double>(slopes.size()) &&
         binomial_tail(successes, slopes.size(), kByChance) < threshold;
}

SlopesJudgement judge_alone(const std::vector<UnitSlope>& slopes, double threshold) {
  SlopesJudgement judgement;
  for (const UnitSlope& slope : slopes) {
    if (is_beyond_chance(t_of(slope.per_year.value, slope.per_year.sigma), slope.freedom,
                         threshold))
      judgement.apart.push_back({slope, 0.0});
  }
  return judgement;
}

}  // namespace

SlopesJudgement judge_slopes(const std::vector<UnitSlope>& slopes, double threshold) {
  if (slopes.size() < kTrendUnitsMin) return judge_alone(slopes, threshold);
  std::vector<Estimate> estimates;
  estimates.reserve(slopes.size());
  for (const UnitSlope& slope : slopes)
    estimates.push_back(slope.per_year);
  SlopesJudgement judgement;
  judgement.type = random_effects(estimates);
  judgement.is_named = mean_is_named(judgement.type, slopes, threshold);
  judgement.varies = spread_is_named(slopes, threshold);
  const std::vector<RandomEffects> others = random_effects_of_others(estimates);
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    const Estimate& own = slopes[i].per_year;
    const double sigma = std::hypot(own.sigma, others[i].between, others[i].sigma);
    if (is_beyond_chance(t_of(own.value - others[i].mean, sigma), freedom_of(slopes[i], others[i]),
                         threshold))
      judgement.apart.push_back({slopes[i], others[i].mean});
  }
  return judgement;
}

}  // namespace vgyro::fleet
