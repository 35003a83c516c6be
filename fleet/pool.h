#pragma once

// A pool: the evidence of many drives as sums of fixed size for each unit. Pools can be added; the
// result is the same to the bit however drives are grouped and ordered (fleet/sums.h). A pool lists
// its drives, so that none counts twice.

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "fleet/drive.h"
#include "fleet/sums.h"

namespace vgyro::fleet {

/// Sums over the drives of one gyro, or of a pair of which only the difference is known.
struct GroupSums {
  explicit GroupSums(std::size_t slots = 1);

  std::size_t slots;                    ///< 1 or 2
  std::vector<Whole> count;             ///< for each column: drives that could show it
  std::vector<Whole> score;             ///< Σ u
  std::vector<Whole> heterogeneity;     ///< Σ u²/I, each shape alone
  std::vector<Whole> score_time;        ///< Σ u·t
  std::vector<Whole> information_time;  ///< Σ I·t
  std::vector<Whole> time_square;       ///< Σ I·t²
  std::vector<Whole> information;       ///< Σ I: lower triangle, row by row

  [[nodiscard]] std::size_t columns() const { return slots * model::kShapeCount; }
  void add(const DrivePlace& place, double t_years);
  void add(const GroupSums& more);
};

/// What each drive measures of a unit besides the shapes.
enum class Measure : std::uint8_t { kLogWhite, kLogWalk, kBias, kLost, kMasked };
inline constexpr std::size_t kMeasures = 5;
/// Unit in which biases are summed.
inline constexpr double kBiasUnit_dps = 1e-4;

struct UnitSums {
  std::array<Moments, kMeasures> measures;
  Whole drives = 0;
  Whole seconds = 0;
  double began_least_s = 0.0;
  double began_most_s = 0.0;
  bool has_temperature = false;
  std::array<double, 2> temperature_c{};
  std::map<std::string, std::uint64_t> named;  ///< kind → number of drives that alone named it

  void add(const UnitSums& more);
};

struct Pool {
  std::set<std::string> drives;
  std::set<std::string> models;  ///< fingerprints of the model files used to judge them
  std::set<std::pair<std::string, std::string>>
      pairs;  ///< types of gyro 1 and gyro 2 of the vehicles
  std::map<Identity, UnitSums> units;
  std::map<std::vector<Identity>, GroupSums> groups;

  /// False if the drive is in the pool already: nothing changes. Error if the same recording is in
  /// it with other evidence.
  Expected<bool> add(const Drive& drive);
  /// Error if a drive is in both pools: its share of the sums cannot be taken out again.
  Expected<void> add(const Pool& more);
};

/// Index into a lower triangle stored row by row; row ≥ column.
constexpr std::size_t triangle(std::size_t row, std::size_t column) {
  return row * (row + 1) / 2 + column;
}

}  // namespace vgyro::fleet
