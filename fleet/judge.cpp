#include "fleet/judge.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "fleet/figures.h"
#include "fleet/leave_one_out.h"
#include "fleet/selection.h"
#include "fleet/size_trends.h"
#include "fleet/statistics.h"
#include "fleet/system.h"
#include "fleet/unit_measures.h"

namespace vgyro::fleet {

namespace {

using model::kShapeCount;

// A spread between units is named if there are at least this many units and at least this share of
// them is off by more than two standard errors; by chance that is 4.6 %.
constexpr std::size_t kSpreadUnitsMin = 6;
constexpr double kSpreadShare = 0.25;
constexpr double kOff = 2.0;
constexpr double kOffByChance = 0.0455;
constexpr int kSpreadsMax = 6;
// With fewer units their spread is not known well enough.
constexpr std::size_t kApartUnitsMin = 5;
// One for the bias, and one for the size of each shape.
constexpr std::size_t kTrends = kShapeCount + 1;
// A unit with fewer drives is not called good.
constexpr std::size_t kFewDrives = 3;

double unit_of(std::size_t column) {
  return model::shapes()[column % kShapeCount].unit;
}

class Judge {
 public:
  Judge(const Pool& pool, const Settings& settings) : pool_(pool), settings_(settings) {
    for (const auto& [identity, sums] : pool.units)
      types_.push_back(identity.type);
    types_.erase(std::unique(types_.begin(), types_.end()), types_.end());
    // Identities are sorted by type, so the units of a type are contiguous.
    begin_of_.push_back(0);
    for (const std::string& type : types_)
      begin_of_.push_back(begin_of_.back() + units_of(type));
    of_types_ = System(types_.size() * kShapeCount);
    sizes_ = Eigen::VectorXd::Zero(of_types_.score.size());
    // Every shape of every type and unit, their trends, and the other questions about each unit.
    tests_ = static_cast<double>(types_.size() * (kShapeCount + kTrends) +
                                 pool.units.size() * (kShapeCount + kTrends + kUnitQuestions));
  }

  Judgement run() {
    gather_types();
    choice_ = choose(of_types_, {}, tests_, settings_.false_names);
    fitted_ = choice_.columns;
    fit();
    add_spreads();
    Judgement judgement;
    judgement.tests = tests_;
    judgement.false_names = settings_.false_names;
    for (std::size_t type = 0; type < types_.size(); ++type)
      judge_type(type, judgement);
    return judgement;
  }

 private:
  struct Unit {
    Identity identity;
    System system;  ///< what the type's sizes leave over
  };

  [[nodiscard]] std::size_t units_of(const std::string& type) const {
    return static_cast<std::size_t>(
        std::count_if(pool_.units.begin(), pool_.units.end(),
                      [&](const auto& unit) { return unit.first.type == type; }));
  }

  /// A type's units are units_[begin_of_[type]] up to, but without, units_[end_of(type)].
  [[nodiscard]] std::size_t end_of(std::size_t type) const { return begin_of_[type + 1]; }

  [[nodiscard]] std::size_t type_of(const Identity& identity) const {
    return static_cast<std::size_t>(std::lower_bound(types_.begin(), types_.end(), identity.type) -
                                    types_.begin());
  }

  // Two gyros of one type in a group share their type's columns.
  void gather_types() {
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(of_types_.score.size());
    Eigen::VectorXd freedom = squares;
    for (const auto& [who, sums] : pool_.groups) {
      const auto column = [&, &who_ref = who](std::size_t c) {
        return static_cast<Eigen::Index>(type_of(who_ref[c / kShapeCount]) * kShapeCount +
                                         c % kShapeCount);
      };
      for (std::size_t i = 0; i < sums.columns(); ++i) {
        const Eigen::Index at = column(i);
        of_types_.score[at] += value_of(sums.score[i]);
        of_types_.drives[at] += static_cast<double>(sums.count[i]);
        for (std::size_t k = 0; k <= i; ++k) {
          const double information = value_of(sums.information[triangle(i, k)]);
          of_types_.information(at, column(k)) += information;
          if (i != k) of_types_.information(column(k), at) += information;
        }
        const double own = value_of(sums.information[triangle(i, i)]);
        if (sums.count[i] < 2 || own <= 0.0) continue;
        const double score = value_of(sums.score[i]);
        squares[at] += value_of(sums.heterogeneity[i]) - score * score / own;
        freedom[at] += static_cast<double>(sums.count[i]) - 1.0;
      }
    }
    for (Eigen::Index i = 0; i < squares.size(); ++i)
      if (freedom[i] > 0.0) of_types_.dispersion[i] = std::max(1.0, squares[i] / freedom[i]);
  }

  void fit() {
    sizes_.setZero();
    if (!fitted_.empty()) sizes_(fitted_) = of_types_.solve(fitted_);
    gather_units();
  }

  // Collects the system of each unit, on the assumption that its partners have their types' sizes.
  void gather_units() {
    units_.clear();
    for (const auto& [identity, sums] : pool_.units)
      units_.push_back({identity, System(kShapeCount)});
    for (const auto& [who, sums] : pool_.groups) {
      for (std::size_t slot = 0; slot < who.size(); ++slot)
        add_to_unit(who, sums, slot);
    }
  }

  void add_to_unit(const std::vector<Identity>& who, const GroupSums& sums, std::size_t slot) {
    const auto at = std::lower_bound(
        units_.begin(), units_.end(), who[slot],
        [](const Unit& unit, const Identity& identity) { return unit.identity < identity; });
    System& system = at->system;
    const std::size_t type = type_of(who[slot]);
    for (std::size_t i = 0; i < kShapeCount; ++i) {
      const std::size_t own = slot * kShapeCount + i;
      const auto row = static_cast<Eigen::Index>(i);
      double score = value_of(sums.score[own]);
      for (std::size_t k = 0; k < sums.columns(); ++k) {
        const double information =
            value_of(sums.information[triangle(std::max(own, k), std::min(own, k))]);
        const std::size_t partner = type_of(who[k / kShapeCount]);
        score -= information *
                 sizes_[static_cast<Eigen::Index>(partner * kShapeCount + k % kShapeCount)];
        if (k / kShapeCount == slot)
          system.information(row, static_cast<Eigen::Index>(k % kShapeCount)) += information;
      }
      system.score[row] += score;
      system.drives[row] += static_cast<double>(sums.count[own]);
      system.dispersion[row] =
          of_types_.dispersion[static_cast<Eigen::Index>(type * kShapeCount + i)];
    }
  }

  // Finds shapes that many units have with different sizes, which a mean near 0 must not hide.
  void add_spreads() {
    for (int round = 0; round < kSpreadsMax; ++round) {
      std::size_t best = 0;
      double best_p = threshold_of(1, tests_, settings_.false_names);
      for (std::size_t type = 0; type < types_.size(); ++type) {
        const std::array<double, kShapeCount> p = spread_p_of(type);
        for (std::size_t shape = 0; shape < kShapeCount; ++shape) {
          const std::size_t column = type * kShapeCount + shape;
          if (std::find(fitted_.begin(), fitted_.end(), column) != fitted_.end()) continue;
          if (p[shape] < best_p) std::tie(best, best_p) = std::pair(column, p[shape]);
        }
      }
      if (best_p == threshold_of(1, tests_, settings_.false_names)) return;
      fitted_.push_back(best);
      spreads_.push_back(best);
      spread_p_.push_back(best_p);
      fit();
    }
  }

  // For each shape the probability that so many of the type's units are off by chance; 1 if they
  // are too few.
  [[nodiscard]] std::array<double, kShapeCount> spread_p_of(std::size_t type) const {
    std::array<std::size_t, kShapeCount> off{};
    std::array<std::size_t, kShapeCount> all{};
    const std::vector<std::size_t> own = own_fitted(type);
    for (std::size_t u = begin_of_[type]; u < end_of(type); ++u) {
      const std::vector<Left> left = units_[u].system.beside(own);
      for (std::size_t shape = 0; shape < kShapeCount; ++shape) {
        if (left[shape].information <= 0.0) continue;
        ++all[shape];
        if (left[shape].gain() > kOff * kOff * units_[u].system.doubt(shape)) ++off[shape];
      }
    }
    std::array<double, kShapeCount> p{};
    for (std::size_t shape = 0; shape < kShapeCount; ++shape) {
      const bool is_seen =
          all[shape] >= kSpreadUnitsMin &&
          static_cast<double>(off[shape]) >= kSpreadShare * static_cast<double>(all[shape]);
      p[shape] = is_seen ? binomial_tail(off[shape], all[shape], kOffByChance) : 1.0;
    }
    return p;
  }

  [[nodiscard]] std::vector<std::size_t> own_fitted(std::size_t type) const {
    std::vector<std::size_t> own;
    for (const std::size_t column : fitted_)
      if (column / kShapeCount == type) own.push_back(column % kShapeCount);
    return own;
  }

  /// A unit's size of one of its type's shapes.
  struct UnitSize {
    std::size_t unit;
    Estimate estimate;
  };
  [[nodiscard]] std::vector<UnitSize> unit_sizes(std::size_t column) const {
    const std::size_t type = column / kShapeCount;
    const std::size_t shape = column % kShapeCount;
    std::vector<std::size_t> others = own_fitted(type);
    others.erase(std::find(others.begin(), others.end(), shape));
    std::vector<UnitSize> sizes;
    for (std::size_t u = begin_of_[type]; u < end_of(type); ++u) {
      const Left left = units_[u].system.beside(others)[shape];
      if (left.information <= 0.0) continue;
      const double sigma = std::sqrt(units_[u].system.doubt(shape) / left.information);
      sizes.push_back({u, {left.size() + sizes_[static_cast<Eigen::Index>(column)], sigma}});
    }
    return sizes;
  }

  // Units without those that stand apart: these would pull the type's mean, and have names and
  // model files of their own. All units if the rest would be too few.
  [[nodiscard]] std::vector<UnitSize> alike_of(std::size_t column,
                                               const std::vector<UnitSize>& sizes,
                                               const std::vector<UnitJudgement>& units) const {
    std::vector<UnitSize> alike;
    for (const UnitSize& one : sizes)
      if (!stands_apart(units[one.unit - begin_of_[column / kShapeCount]], column % kShapeCount))
        alike.push_back(one);
    return alike.size() < kApartUnitsMin ? sizes : alike;
  }

  [[nodiscard]] static bool stands_apart(const UnitJudgement& unit, std::size_t shape) {
    return std::any_of(unit.effects.begin(), unit.effects.end(),
                       [&](const PooledEffect& effect) { return effect.shape == shape; });
  }

  [[nodiscard]] PooledEffect pooled(std::size_t column, const std::vector<UnitSize>& sizes,
                                    bool are_some) const {
    std::vector<Estimate> estimates;
    for (const UnitSize& one : sizes)
      estimates.push_back(one.estimate);
    const RandomEffects random = random_effects(estimates);
    const auto place = std::find(fitted_.begin(), fitted_.end(), column) - fitted_.begin();
    const double variance = of_types_.covariance(fitted_)(place, place) * of_types_.doubt(column);
    const double unit = unit_of(column);
    PooledEffect effect;
    effect.whose.type = types_[column / kShapeCount];
    effect.shape = column % kShapeCount;
    const bool mixed = sizes.size() > 1 && (random.between > 0.0 || are_some);
    effect.size = unit * (mixed ? random.mean : sizes_[static_cast<Eigen::Index>(column)]);
    effect.sigma = unit * std::max(std::sqrt(variance), sizes.size() > 1 ? random.sigma : 0.0);
    RandomEffects width = random;
    width.sigma = effect.sigma;
    effect.half_width95 = width.half_width95();
    effect.between_units = unit * random.between;
    effect.between_sigma = unit * random.between_sigma;
    effect.units = sizes.size();
    effect.drives = static_cast<std::size_t>(of_types_.drives[static_cast<Eigen::Index>(column)]);
    return effect;
  }

  void judge_type(std::size_t type, Judgement& judgement) {
    TypeJudgement own;
    own.type = types_[type];
    std::vector<UnitJudgement> units;
    for (std::size_t u = begin_of_[type]; u < end_of(type); ++u) {
      const UnitSums& sums = pool_.units.at(units_[u].identity);
      units.push_back(unit_judgement(units_[u].identity, sums));
      own.drives += units.back().drives;
    }
    own.units = units.size();
    judge_measures(pool_, threshold_of(1, tests_, settings_.false_names), units, own);
    for (const std::size_t column : fitted_)
      if (column / kShapeCount == type) judge_effect(column, units, own);
    for (std::size_t i = 0; i < units.size(); ++i)
      judge_own(type, units_[begin_of_[type] + i], units[i]);
    judge_size_trends(pool_, known_sizes(type), threshold_of(1, tests_, settings_.false_names),
                      units, own);
    for (UnitJudgement& unit : units) {
      if (unit.status == Status::kAsItsType && unit.drives < kFewDrives)
        unit.status = Status::kFewDrives;
      judgement.units.push_back(std::move(unit));
    }
    judgement.types.push_back(std::move(own));
  }

  void judge_effect(std::size_t column, std::vector<UnitJudgement>& units,
                    TypeJudgement& own) const {
    const std::vector<UnitSize> sizes = unit_sizes(column);
    judge_apart(column, sizes, units);
    PooledEffect effect =
        pooled(column, alike_of(column, sizes, units), count_apart(column, units) > 0);
    const bool is_spread = std::find(spreads_.begin(), spreads_.end(), column) != spreads_.end();
    effect.varies = is_spread || (sizes.size() > 1 && std::abs(effect.size) < effect.half_width95);
    const auto chosen = std::find(choice_.columns.begin(), choice_.columns.end(), column);
    if (chosen != choice_.columns.end()) {
      const auto at = static_cast<std::size_t>(chosen - choice_.columns.begin());
      effect.statistic = choice_.z[at];
      effect.p_value = normal_tail(effect.statistic);
      for (const std::size_t other : choice_.ambiguous_with[at])
        effect.ambiguous_with.emplace_back(types_[other / kShapeCount], other % kShapeCount);
    } else {
      const auto at = std::find(spreads_.begin(), spreads_.end(), column) - spreads_.begin();
      effect.p_value = spread_p_[static_cast<std::size_t>(at)];
    }
    // An effect that is nothing but a unit standing apart is reported for that unit only.
    const bool is_one_units = effect.varies && !is_spread && effect.between_units <= 0.0;
    if (!is_one_units && !(effect.varies && !is_spread && count_apart(column, units) > 0))
      own.effects.push_back(std::move(effect));
  }

  [[nodiscard]] static std::size_t count_apart(std::size_t column,
                                               const std::vector<UnitJudgement>& units) {
    return static_cast<std::size_t>(std::count_if(
        units.begin(), units.end(),
        [&](const UnitJudgement& unit) { return stands_apart(unit, column % kShapeCount); }));
  }

  // Compares each unit with the mean and the spread of all other units of its type.
  void judge_apart(std::size_t column, const std::vector<UnitSize>& sizes,
                   std::vector<UnitJudgement>& units) const {
    if (sizes.size() < kApartUnitsMin) return;
    std::vector<Estimate> estimates;
    for (const UnitSize& one : sizes)
      estimates.push_back(one.estimate);
    const std::vector<RandomEffects> others = random_effects_of_others(estimates);
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const Estimate& own = sizes[i].estimate;
      const RandomEffects& type = others[i];
      const double off = own.value - type.mean;
      const double sigma =
          std::sqrt(own.sigma * own.sigma + type.between * type.between + type.sigma * type.sigma);
      const double p =
          type.between > 0.0 ? student_tail(off / sigma, type.freedom) : normal_tail(off / sigma);
      if (p > threshold_of(1, tests_, settings_.false_names)) continue;
      tell_apart(column % kShapeCount, own, off / sigma, p, type.mean,
                 units[sizes[i].unit - begin_of_[column / kShapeCount]]);
    }
  }

  static void tell_apart(std::size_t shape, const Estimate& size, double z, double p, double mean,
                         UnitJudgement& unit) {
    const model::Shape& its = model::shapes()[shape];
    PooledEffect effect;
    effect.whose = unit.identity;
    effect.shape = shape;
    effect.size = its.unit * size.value;
    effect.sigma = its.unit * size.sigma;
    effect.half_width95 = RandomEffects{0.0, effect.sigma}.half_width95();
    effect.statistic = z;
    effect.p_value = p;
    effect.drives = unit.drives;
    effect.units = 1;
    set_status(unit, Status::kApart,
               fmt::format("{}: {}; its type has {}, {:.0f} standard errors away", its.name,
                           figure(effect.size, effect.sigma),
                           rounded_figure(its.unit * mean, effect.sigma), std::abs(z)));
    unit.effects.push_back(std::move(effect));
  }

  // Names the shapes that the unit has and its type does not. The type's shapes are fitted to the
  // unit beside them.
  void judge_own(std::size_t type, const Unit& unit, UnitJudgement& told) const {
    // What the only unit of a type has is the type's.
    if (end_of(type) - begin_of_[type] < 2) return;
    const Choice own = choose(unit.system, own_fitted(type), tests_, settings_.false_names);
    const Eigen::VectorXd sizes = unit.system.solve(joined(own_fitted(type), own.columns));
    const Eigen::Index first = sizes.size() - static_cast<Eigen::Index>(own.columns.size());
    for (std::size_t i = 0; i < own.columns.size(); ++i) {
      const double size = sizes[first + static_cast<Eigen::Index>(i)];
      tell_apart(own.columns[i], {size, std::abs(size / own.z[i])}, own.z[i], normal_tail(own.z[i]),
                 0.0, told);
      for (const std::size_t other : own.ambiguous_with[i])
        told.effects.back().ambiguous_with.emplace_back(types_[type], other);
    }
  }

  [[nodiscard]] KnownSizes known_sizes(std::size_t type) const {
    KnownSizes known;
    for (std::size_t t = 0; t < types_.size(); ++t) {
      std::vector<double>& sizes = known.of_type[types_[t]];
      for (std::size_t shape = 0; shape < kShapeCount; ++shape)
        sizes.push_back(sizes_[static_cast<Eigen::Index>(t * kShapeCount + shape)]);
    }
    for (std::size_t u = begin_of_[type]; u < end_of(type); ++u)
      known.dispersion.emplace_back(units_[u].system.dispersion.begin(),
                                    units_[u].system.dispersion.end());
    return known;
  }

  static std::vector<std::size_t> joined(std::vector<std::size_t> first,
                                         const std::vector<std::size_t>& second) {
    first.insert(first.end(), second.begin(), second.end());
    return first;
  }

  const Pool& pool_;
  Settings settings_;
  std::vector<std::string> types_;
  std::vector<std::size_t>
      begin_of_;  ///< index of each type's first unit in `units_`; then the end
  System of_types_;
  Eigen::VectorXd sizes_;  ///< of the types' columns; 0 if not fitted
  Choice choice_;
  std::vector<std::size_t> fitted_;
  std::vector<std::size_t> spreads_;
  std::vector<double> spread_p_;
  std::vector<Unit> units_;
  double tests_ = 0.0;
};

}  // namespace

std::string_view status_name(Status status) {
  switch (status) {
    case Status::kAsItsType:
      return "as_its_type";
    case Status::kFewDrives:
      return "few_drives";
    case Status::kNoisy:
      return "noisy";
    case Status::kWandering:
      return "wandering";
    case Status::kTrend:
      return "trend";
    case Status::kLossy:
      return "lossy";
    case Status::kApart:
      break;
  }
  return "apart";
}

void set_status(UnitJudgement& unit, Status status, std::string why) {
  if (unit.status == Status::kAsItsType) unit.status = status;
  unit.why.push_back(std::move(why));
}

Judgement judge(const Pool& pool, const Settings& settings) {
  return Judge(pool, settings).run();
}

}  // namespace vgyro::fleet
