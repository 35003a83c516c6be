#pragma once

// A pool → what all units of a type have in common, how far they differ, and which unit is not as
// its type. docs/fleet.md derives what is computed here and says what a name means.

#include <cstddef>
#include <string>
#include <vector>

#include "fleet/pool.h"

namespace vgyro::fleet {

struct Settings {
  /// Of all names, those that are false on average, at most (Benjamini–Yekutieli). Where there is
  /// nothing to name it is the chance of any name.
  double false_names = 0.005;
};

/// One shape, of a type or of a unit; sizes in the parameter's own unit.
struct PooledEffect {
  Identity whose;  ///< of a type the unit is empty
  std::size_t shape = 0;
  double size = 0.0;
  double sigma = 0.0;
  double half_width95 = 0.0;
  double between_units = 0.0;  ///< 1σ; 0 of one unit
  double between_sigma = 0.0;
  double statistic = 0.0;  ///< standard errors from 0, or of a unit from its type
  double p_value = 1.0;
  double per_year = 0.0;  ///< trend of the size
  double per_year_sigma = 0.0;
  std::size_t drives = 0;
  std::size_t units = 0;
  bool varies = false;  ///< what the units have is there, and its mean is not
  std::vector<std::pair<std::string, std::size_t>> ambiguous_with;  ///< type, shape
};

/// How something of a type changes over the months.
struct TypeTrend {
  std::size_t shape = model::kShapeCount;  ///< whose size; kShapeCount: the bias, in deg/s
  double per_year = 0.0;
  double sigma = 0.0;
  double between_units = 0.0;  ///< 1σ
  std::size_t units = 0;       ///< with drives enough
  bool varies = false;         ///< units change, each its own way, and the mean says nothing
};

struct TypeJudgement {
  std::string type;
  std::size_t units = 0;
  std::size_t drives = 0;       ///< of its gyros: two of one type in a drive are two
  double white_dps_rthz = 0.0;  ///< the middle unit's; 0: not known
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
  double bias_scatter_dps = 0.0;      ///< from drive to drive, beside its trend
  std::vector<PooledEffect> effects;  ///< where it stands apart: its own sizes
};

struct Judgement {
  std::vector<TypeJudgement> types;
  std::vector<UnitJudgement> units;
  double tests = 0.0;
  double false_names = 0.0;
};

/// Adds a sentence, and a status to a unit that had none.
void set_status(UnitJudgement& unit, Status status, std::string why);

Judgement judge(const Pool& pool, const Settings& settings);

}  // namespace vgyro::fleet
