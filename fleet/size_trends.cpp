#include "fleet/size_trends.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "fleet/figures.h"
#include "fleet/trends.h"

namespace vgyro::fleet {

namespace {

using model::kShapeCount;

// Least mean square distance of a unit's drives from their middle, in years²: a tenth of a year,
// squared.
constexpr double kSpanSquareMin = 0.01;

/// Sums for one shape of a unit over its drives.
struct Course {
  double drives = 0.0;
  double score = 0.0;
  double information = 0.0;
  double score_time = 0.0;
  double information_time = 0.0;
  double time_square = 0.0;
  double foreign = 0.0;  ///< Σ size²·I over all other shapes
};
using Courses = std::array<Course, kShapeCount>;

class UnitCourses {
 public:
  UnitCourses(const Pool& pool, const KnownSizes& known, const std::vector<UnitJudgement>& units)
      : known_(known), units_(units), courses_(units.size()) {
    for (const auto& [who, sums] : pool.groups) {
      for (std::size_t slot = 0; slot < who.size(); ++slot) {
        if (const UnitJudgement* unit = find(who[slot]))
          add(who, sums, slot, courses_[static_cast<std::size_t>(unit - units_.data())]);
      }
    }
  }

  /// Slopes of the units whose drives cover enough time.
  [[nodiscard]] std::vector<UnitSlope> slopes(std::size_t shape) const {
    std::vector<UnitSlope> slopes;
    // σ follows from the information and from the scatter of all drives of the type, not of the
    // unit's few, so the degrees of freedom are those of all.
    double freedom = 0.0;
    for (const Courses& unit : courses_)
      freedom += std::max(0.0, unit[shape].drives - 1.0);
    for (std::size_t u = 0; u < courses_.size(); ++u) {
      const Course& one = courses_[u][shape];
      if (one.drives < kTrendDrivesMin || one.information <= 0.0) continue;
      const double middle = one.information_time / one.information;
      const double about_middle = one.time_square - middle * one.information_time;
      if (about_middle <= kSpanSquareMin * one.information) continue;
      // The likeness of the other shapes to this one varies from drive to drive; this is its
      // greatest effect.
      const double doubt = std::max(known_.dispersion[u][shape], 1.0 + one.foreign / one.drives);
      slopes.push_back(
          {u,
           {(one.score_time - middle * one.score) / about_middle, std::sqrt(doubt / about_middle)},
           freedom});
    }
    return slopes;
  }

 private:
  [[nodiscard]] const UnitJudgement* find(const Identity& identity) const {
    const auto at = std::lower_bound(
        units_.begin(), units_.end(), identity,
        [](const UnitJudgement& unit, const Identity& other) { return unit.identity < other; });
    return at == units_.end() || at->identity != identity ? nullptr : &*at;
  }

  // The unit's type's sizes, or its own where it stands apart.
  [[nodiscard]] std::vector<double> sizes_of(const Identity& identity) const {
    std::vector<double> sizes = known_.of_type.at(identity.type);
    if (const UnitJudgement* unit = find(identity)) {
      for (const PooledEffect& effect : unit->effects)
        sizes[effect.shape] = effect.size / model::shapes()[effect.shape].unit;
    }
    return sizes;
  }

  void add(const std::vector<Identity>& who, const GroupSums& sums, std::size_t slot,
           Courses& courses) const {
    std::vector<double> squares;
    double all = 0.0;
    for (const Identity& identity : who) {
      for (const double size : sizes_of(identity)) {
        const std::size_t c = squares.size();
        squares.push_back(size * size * value_of(sums.information[triangle(c, c)]));
        all += squares.back();
      }
    }
    for (std::size_t shape = 0; shape < kShapeCount; ++shape) {
      const std::size_t c = slot * kShapeCount + shape;
      Course& one = courses[shape];
      one.drives += static_cast<double>(sums.count[c]);
      one.score += value_of(sums.score[c]);
      one.information += value_of(sums.information[triangle(c, c)]);
      one.score_time += value_of(sums.score_time[c]);
      one.information_time += value_of(sums.information_time[c]);
      one.time_square += value_of(sums.time_square[c]);
      one.foreign += std::max(0.0, all - squares[c]);
    }
  }

  const KnownSizes& known_;
  const std::vector<UnitJudgement>& units_;
  std::vector<Courses> courses_;
};

// Sets the trend of the type's effect of this shape, if it has one.
void set_trend_of_effect(std::size_t shape, const std::vector<UnitSlope>& slopes,
                         TypeJudgement& type) {
  if (slopes.empty()) return;
  std::vector<Estimate> estimates;
  estimates.reserve(slopes.size());
  for (const UnitSlope& slope : slopes)
    estimates.push_back(slope.per_year);
  for (PooledEffect& effect : type.effects) {
    if (effect.shape != shape) continue;
    const RandomEffects all = random_effects(estimates);
    effect.per_year = model::shapes()[shape].unit * all.mean;
    effect.per_year_sigma = model::shapes()[shape].unit * all.sigma;
  }
}

}  // namespace

void judge_size_trends(const Pool& pool, const KnownSizes& known, double threshold,
                       std::vector<UnitJudgement>& units, TypeJudgement& type) {
  const UnitCourses courses(pool, known, units);
  for (std::size_t shape = 0; shape < kShapeCount; ++shape) {
    const std::vector<UnitSlope> slopes = courses.slopes(shape);
    set_trend_of_effect(shape, slopes, type);
    const model::Shape& its = model::shapes()[shape];
    // A low-pass has no size that could change in proportion.
    if (its.is_low_pass) continue;
    const SlopesJudgement judged = judge_slopes(slopes, threshold);
    for (const auto& [slope, type_per_year] : judged.apart) {
      set_status(
          units[slope.unit], Status::kTrend,
          fmt::format("{}: changes by {} a year, its type's by {}", its.name,
                      figure(its.unit * slope.per_year.value, its.unit * slope.per_year.sigma),
                      rounded_figure(its.unit * type_per_year, its.unit * slope.per_year.sigma)));
    }
    if (judged.is_named || judged.varies) {
      type.trends.push_back({shape, its.unit * judged.type.mean, its.unit * judged.type.sigma,
                             its.unit * judged.type.between, slopes.size(), !judged.is_named});
    }
  }
}

}  // namespace vgyro::fleet
