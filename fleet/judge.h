#pragma once

// Judges a pool: what all units of a type have in common, how far they differ, and which unit is
// not as its type. docs/fleet.md derives the computation and explains what a name means.

#include <cstddef>
#include <string>
#include <vector>

#include "fleet/pool.h"

namespace vgyro::fleet {

struct Settings {
  /// Greatest share of all names that is false on average (Benjamini–Yekutieli). If there is
  /// nothing to name, the greatest probability of any name.
  double false_names = 0.005;
};

/// The effect of one shape, of a type or a unit; sizes in the parameter's own unit.
struct PooledEffect {
  Identity whose;  ///< `unit` is empty if the effect is a type's
  std::size_t shape = 0;
  double size = 0.0;
  double sigma = 0.0;
  double half_width95 = 0.0;
  double between_units = 0.0;  ///< 1σ; 0 if there is one unit
  double between_sigma = 0.0;
  double statistic = 0.0;  ///< standard errors from 0; of a unit, from its type
  double p_value = 1.0;
  double per_year = 0.0;  ///< trend of the size
  double per_year_sigma = 0.0;
  std::size_t drives = 0;
  std::size_t units = 0;
  bool varies = false;  ///< units have it beyond chance, their mean has not
  std::vector<std::pair<std::string, std::size_t>> ambiguous_with;  ///< type, shape
};

/// How the bias or a size of a type changes over the months.
struct TypeTrend {
  std::size_t shape = model::kShapeCount;  ///< kShapeCount: the bias, in deg/s
  double per_year = 0.0;
  double sigma = 0.0;
  double between_units = 0.0;  ///< 1σ
  std::size_t units = 0;       ///< with enough drives
  bool varies = false;         ///< each unit changes its own way; the mean has no meaning
};

struct TypeJudgement {
  std::string type;
  std::size_t units = 0;
  std::size_t drives = 0;       ///< of its gyros: a drive with two of this type counts twice
  double white_dps_rthz = 0.0;  ///< the median unit's; 0: unknown
  double walk_dps_rts = 0.0;
  std::vector<PooledEffect> effects;
  std::vector<TypeTrend> trends;
};

enum class Status : std::uint8_t {
  kAsItsType,
  kFewDrives,
  kNoisy,
  kWandering,
  kTrend,
  kLossy,
  kApart
};
std::string_view status_name(Status status);

struct UnitJudgement {
  Identity identity;
  std::size_t drives = 0;
  Status status = Status::kAsItsType;
  std::vector<std::string> why;  ///< sentences for people; empty: nothing
  double white_dps_rthz = 0.0;
  double walk_dps_rts = 0.0;
  double bias_dps = 0.0;
  double bias_scatter_dps = 0.0;      ///< from drive to drive, without its trend
  std::vector<PooledEffect> effects;  ///< its own sizes of shapes in which it stands apart
};

struct Judgement {
  std::vector<TypeJudgement> types;
  std::vector<UnitJudgement> units;
  double tests = 0.0;
  double false_names = 0.0;
};

/// Adds `why`; sets the status unless another one was set before.
void set_status(UnitJudgement& unit, Status status, std::string why);

Judgement judge(const Pool& pool, const Settings& settings);

}  // namespace vgyro::fleet
