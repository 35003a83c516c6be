#pragma once

// Every kind of effect: its name and parameters in the model file, what it does to a gyro, and, for
// deterministic kinds, its equation. A new offset or response is a new row; HACKING.md lists what
// else a new kind touches.
//
// model/equation.h defines how the effects of one gyro act together: every response acts on the
// rate after delay and low-passes, and offsets depend on no rate.

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "model/effect.h"

namespace vgyro::model {

/// Where in that chain a kind acts, which decides how it can be corrected.
enum class Nature : std::uint8_t {
  kOffset,       ///< adds to the reading, whatever the rate
  kResponse,     ///< adds a function of the rate
  kLag,          ///< the reading belongs to an earlier rate
  kClip,         ///< changes the finished reading; information is lost
  kNoise,        ///< random, with a known density or variance
  kDisturbance,  ///< frames or stamps go wrong
};

/// The inputs that an equation needs; a bit mask.
enum Need : std::uint8_t {
  kNeedsNothing = 0,
  kNeedsTemperature = 1U << 0U,
  kNeedsAcceleration = 1U << 1U,
  kNeedsSupply = 1U << 2U,
  kNeedsOtherAxes = 1U << 3U
};
inline constexpr std::size_t kNeedCount = 4;

/// For a table with one row for each need, in the order of the bits. Assert it beside the table, so
/// that a new need does not compile until every table has it.
template <typename Rows>
constexpr bool answers_each_need(const Rows& rows) {
  if (std::size(rows) != kNeedCount) return false;
  for (std::size_t bit = 0; bit < kNeedCount; ++bit) {
    if (rows[bit].need != 1U << bit) return false;
  }
  return true;
}

struct Parameter {
  enum class Form : std::uint8_t { kNumber, kWhole, kAxis };

  std::string_view name;
  std::string_view unit;
  double minimum = 0.0;
  double maximum = 0.0;
  double least = 0.0;  ///< magnitude that a non-zero value must have
  std::optional<double> preset = {};
  Form form = Form::kNumber;

  /// "0.001 to 1e+09 s"
  [[nodiscard]] std::string limits() const;
  [[nodiscard]] bool allows(double value) const;
};

struct KindInfo {
  using Equation = double (*)(const Parameters& p, double rate_dps, const Surroundings& s);

  Kind kind;
  Nature nature;
  std::uint8_t needs = kNeedsNothing;
  std::string_view name;
  std::string_view meaning;  ///< for people: what the gyro reads in addition
  std::span<const Parameter> parameters;
  Equation added = nullptr;  ///< deg/s; for offsets and responses
  Equation slope = nullptr;  ///< d added / d rate; for responses
};

/// All kinds, in the order of Kind.
std::span<const KindInfo> catalogue();
const KindInfo& info(Kind kind);
/// Null for any other word.
const KindInfo* find_kind(std::string_view name);
std::vector<std::string> kind_names();

/// The parameter that determines the size of the effect; a plain `sigma` in the model file refers
/// to it. Null if the kind has none.
const Parameter* size_parameter(Kind kind);

/// Clamps a sum of value and σ to `parameter.minimum` and `parameter.maximum`.
double within_limits(const Parameter& parameter, double value);

/// What an offset or a response adds to the reading, deg/s; `rate_dps` is the late rate. 0 if the
/// effect depends on an unknown input.
double added_dps(const Effect& effect, double rate_dps, const Surroundings& surroundings);

/// For responses: d added_dps / d rate_dps.
double slope(const Effect& effect, double rate_dps, const Surroundings& surroundings);

/// The reading after an effect of Nature::kClip.
double clipped_dps(const Effect& effect, double reading_dps);

/// True for lags and for effects on frames and stamps: they apply to all axes of a unit.
bool acts_on_unit(Kind kind);

/// For Nature::kLag: 1σ of lag_s(), from the effect's σ.
double lag_sigma_s(const Effect& effect);

/// For Nature::kLag: how much later than the rate the reading is, for rates that change slowly.
double lag_s(const Effect& effect);

/// "error 0.00042 ± 3e-06", as printed by check and the summaries.
std::string parameters_text(const Effect& effect);

}  // namespace vgyro::model
