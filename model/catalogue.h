#pragma once

// Every kind of effect: its name and parameters in the model file, what it does to a gyro, and, of
// the deterministic ones, its equation. A new offset or response is a new row; HACKING.md says what
// else another kind touches.
//
// How the effects of one gyro act together is said in model/equation.h: every response is to the
// rate behind delay and low-passes, and offsets depend on no rate.

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

/// Where in that chain a kind acts, which decides what can be done about it.
enum class Nature : std::uint8_t {
  kOffset,       ///< adds to the reading, whatever the rate
  kResponse,     ///< adds a function of the rate
  kLag,          ///< the reading is of an earlier rate
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

/// For a table with one row for each need, in the order of the bits. To be
/// asserted beside the table, so that a new need does not compile until every table has it.
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
  double least = 0.0;  ///< what is not 0 is at least this large
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
  Equation added = nullptr;  ///< deg/s; of offsets and responses
  Equation slope = nullptr;  ///< d added / d rate; of responses
};

/// All kinds, in the order of Kind.
std::span<const KindInfo> catalogue();
const KindInfo& info(Kind kind);
/// Null for any other word.
const KindInfo* find_kind(std::string_view name);
std::vector<std::string> kind_names();

/// The parameter that says how large the effect is: what a plain `sigma` in the model file is of.
/// Null where it has none.
const Parameter* size_parameter(Kind kind);

/// Within `parameter.minimum` and `parameter.maximum`, for a sum of value and σ.
double within_limits(const Parameter& parameter, double value);

/// What an offset or a response adds to the reading, deg/s; `rate_dps` is the late rate. 0 where it
/// depends on something that is not known.
double added_dps(const Effect& effect, double rate_dps, const Surroundings& surroundings);

/// Of responses: d added_dps / d rate_dps.
double slope(const Effect& effect, double rate_dps, const Surroundings& surroundings);

/// What the kinds of Nature::kClip make of a reading.
double clipped_dps(const Effect& effect, double reading_dps);

/// Lags, and what happens to frames and stamps: of a unit of several axes it is of all of them.
bool acts_on_unit(Kind kind);

/// Of Nature::kLag: 1σ of lag_s(), from the effect's σ.
double lag_sigma_s(const Effect& effect);

/// Of Nature::kLag: how much later than the rate the reading comes, for rates that change slowly.
double lag_s(const Effect& effect);

/// "error 0.00042 ± 3e-06", as check and the summaries print it.
std::string parameters_text(const Effect& effect);

}  // namespace vgyro::model
