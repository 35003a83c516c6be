#include "fleet/unit_measures.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "fleet/figures.h"
#include "fleet/statistics.h"
#include "fleet/trends.h"

namespace vgyro::fleet {

namespace {

// With fewer units of a type it is not known what is usual.
constexpr std::size_t kUnitsMin = 5;
// Median distance from the median → σ of a normal distribution.
constexpr double kMadToSigma = 1.4826;
// A unit within this factor (or share of lost frames) of its type has no fault, however
// significant.
constexpr double kNoiseFactor = 1.5;
constexpr double kWanderFactor = 2.0;
constexpr double kLostMore = 0.01;
// Units are never taken for more alike than this: in a logarithm, and in a share of frames.
constexpr double kAlikeLog = 0.03;
constexpr double kAlikeShare = 1e-3;
// Fewer drives give no scatter of the bias.
constexpr double kScatterDrivesMin = 4.0;

const Moments& measure(const UnitSums& sums, Measure which) {
  return sums.measures[static_cast<std::size_t>(which)];
}

/// One quantity to compare, with its estimate for each unit that has one.
struct Question {
  std::vector<std::size_t> unit;
  std::vector<Estimate> estimate;
};

// Means of a measure, with the median unit's scatter between drives.
Question means_of(const Pool& pool, Measure which, const std::vector<UnitJudgement>& units) {
  Question question;
  std::vector<double> variances;
  for (std::size_t i = 0; i < units.size(); ++i) {
    const Moments& moments = measure(pool.units.at(units[i].identity), which);
    if (moments.count == 0) continue;
    question.unit.push_back(i);
    question.estimate.push_back({moments.mean(), 1.0 / std::sqrt(moments.n())});
    if (moments.count > 1) variances.push_back(moments.variance());
  }
  const double scatter = std::sqrt(median(variances));
  for (Estimate& one : question.estimate)
    one.sigma *= scatter;
  return question;
}

// Scatter of the bias; about the line if the unit or its type has a trend, because a trend is no
// scatter.
Question scatters_of(const Pool& pool, const std::vector<UnitJudgement>& units,
                     const TypeJudgement& type) {
  Question question;
  for (std::size_t i = 0; i < units.size(); ++i) {
    const Moments& moments = measure(pool.units.at(units[i].identity), Measure::kBias);
    const bool moves = !type.trends.empty() || units[i].status == Status::kTrend;
    const double variance = moves ? moments.variance_about_line() : moments.variance();
    const double freedom = moves ? moments.freedom_about_line() : moments.n() - 1.0;
    if (moments.n() < kScatterDrivesMin || variance <= 0.0) continue;
    question.unit.push_back(i);
    question.estimate.push_back({0.5 * std::log(variance), 1.0 / std::sqrt(2.0 * freedom)});
  }
  return question;
}

// Calls `tell` for each unit that is above its type by more than `least` and beyond chance.
template <class Tell>
void ask(const Question& question, double alike, double least, double threshold, const Tell& tell) {
  if (question.unit.size() < kUnitsMin) return;
  std::vector<double> values;
  std::vector<double> variances;
  for (const Estimate& one : question.estimate) {
    values.push_back(one.value);
    variances.push_back(one.sigma * one.sigma);
  }
  const double middle = median(values);
  for (double& value : values)
    value = std::abs(value - middle);
  const double spread = std::pow(kMadToSigma * median(values), 2) - median(variances);
  const double between = std::max(spread, alike * alike);
  for (std::size_t i = 0; i < question.unit.size(); ++i) {
    const Estimate& one = question.estimate[i];
    const double off = one.value - middle;
    const double t = off / std::sqrt(between + one.sigma * one.sigma);
    const double p = 0.5 * student_tail(t, static_cast<double>(question.unit.size()) - 1.0);
    if (off > least && p < threshold) tell(question.unit[i], off);
  }
}

void judge_bias_trends(const Pool& pool, double threshold, std::vector<UnitJudgement>& units,
                       TypeJudgement& type) {
  std::vector<UnitSlope> slopes;
  for (std::size_t i = 0; i < units.size(); ++i) {
    const Moments& bias = measure(pool.units.at(units[i].identity), Measure::kBias);
    if (bias.n() < kTrendDrivesMin || bias.slope_sigma() <= 0.0) continue;
    slopes.push_back({i, {bias.slope(), bias.slope_sigma()}, bias.n() - 2.0});
  }
  const SlopesJudgement judged = judge_slopes(slopes, threshold);
  for (const auto& [slope, type_per_year] : judged.apart) {
    set_status(
        units[slope.unit], Status::kTrend,
        fmt::format(
            "its bias moves by {} deg/s a year, its type's by {}",
            figure(slope.per_year.value * kBiasUnit_dps, slope.per_year.sigma * kBiasUnit_dps),
            rounded_figure(type_per_year * kBiasUnit_dps, slope.per_year.sigma * kBiasUnit_dps)));
  }
  if (judged.is_named || judged.varies) {
    type.trends.push_back({model::kShapeCount, judged.type.mean * kBiasUnit_dps,
                           judged.type.sigma * kBiasUnit_dps, judged.type.between * kBiasUnit_dps,
                           slopes.size(), !judged.is_named});
  }
}

double middle_of(const std::vector<UnitJudgement>& units, double UnitJudgement::*value) {
  std::vector<double> values;
  for (const UnitJudgement& unit : units)
    if (unit.*value > 0.0) values.push_back(unit.*value);
  return median(values);
}

}  // namespace

UnitJudgement unit_judgement(const Identity& identity, const UnitSums& sums) {
  UnitJudgement unit;
  unit.identity = identity;
  unit.drives = static_cast<std::size_t>(sums.drives);
  const auto middle = [&](Measure which) {
    const Moments& moments = measure(sums, which);
    return moments.count > 0 ? std::exp(moments.mean()) : 0.0;
  };
  unit.white_dps_rthz = middle(Measure::kLogWhite);
  unit.walk_dps_rts = middle(Measure::kLogWalk);
  const Moments& bias = measure(sums, Measure::kBias);
  if (bias.count > 0) unit.bias_dps = bias.mean() * kBiasUnit_dps;
  unit.bias_scatter_dps = std::sqrt(bias.variance_about_line()) * kBiasUnit_dps;
  return unit;
}

void judge_measures(const Pool& pool, double threshold, std::vector<UnitJudgement>& units,
                    TypeJudgement& type) {
  type.white_dps_rthz = middle_of(units, &UnitJudgement::white_dps_rthz);
  type.walk_dps_rts = middle_of(units, &UnitJudgement::walk_dps_rts);
  judge_bias_trends(pool, threshold, units, type);
  ask(means_of(pool, Measure::kLogWhite, units), kAlikeLog, std::log(kNoiseFactor), threshold,
      [&](std::size_t i, double off) {
        set_status(units[i], Status::kNoisy,
                   fmt::format("its white noise is {:.2g} times its type's", std::exp(off)));
      });
  ask(means_of(pool, Measure::kLogWalk, units), kAlikeLog, std::log(kWanderFactor), threshold,
      [&](std::size_t i, double off) {
        set_status(units[i], Status::kWandering,
                   fmt::format("within a drive its bias wanders {:.2g} times as far as its type's",
                               std::exp(off)));
      });
  ask(scatters_of(pool, units, type), kAlikeLog, std::log(kWanderFactor), threshold,
      [&](std::size_t i, double off) {
        set_status(units[i], Status::kWandering,
                   fmt::format("from drive to drive its bias scatters {:.2g} times as far as its "
                               "type's",
                               std::exp(off)));
      });
  ask(means_of(pool, Measure::kLost, units), kAlikeShare, kLostMore, threshold,
      [&](std::size_t i, double off) {
        set_status(
            units[i], Status::kLossy,
            fmt::format("{:.2g} % more of its frames are lost than of its type's", 100.0 * off));
      });
}

}  // namespace vgyro::fleet
