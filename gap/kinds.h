#pragma once

// What the gap workflow knows of each kind of effect, one row a kind: how it is looked for, what of
// it the data estimate, what it depends on, and how people are told. Nothing else in this layer
// asks which kind an effect is. A field that a row forgets does not compile, nor does a kind
// without a row.

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "model/effect.h"

namespace vgyro::gap {

/// What a recording holds that an error may depend on. Three axes follow each other.
enum class Input : std::uint8_t {
  kRate,
  kTemperature,
  kTemperatureSlope,
  kAccelerationX,
  kAccelerationY,
  kAccelerationZ,
  kVibration,
  kSupply,
  kRateX,
  kRateY,
  kRateZ,
};
inline constexpr std::size_t kInputCount = 11;
/// A set of inputs, by bits.
using Inputs = std::uint16_t;

/// One input: where it is read, how far it must move to show anything, and what to say where it
/// does not.
struct InputRow {
  Input input;
  /// Of one instant; NaN where it is not known.
  double (*value)(double rate_dps, const model::Surroundings& s);
  double least;  ///< of its range, in its own unit; of the rate, of its magnitude
};
std::span<const InputRow> inputs();
const InputRow& input_row(Input input);

/// Who looks for a kind.
enum class Finder : std::uint8_t {
  kShape,   ///< the scan: its shape is known but for its size
  kStep,    ///< the scan, at many instants
  kLine,    ///< the scan, at many frequencies
  kNoise,   ///< the noise search
  kFrames,  ///< the transport checks, on raw frames
};

/// How what the scan solved for becomes parameters.
enum class Form : std::uint8_t {
  kSize,     ///< the reading is linear in the first free parameter
  kShift,    ///< it moves the first free parameter, by its derivative there
  kLowPass,  ///< a shape that is there or not: how much of it says how far the cut-off is away
  kWave,     ///< two shapes, a quarter of a turn apart: parameters 1 and 2 are amplitude and phase
  kNone,     ///< not by the scan
};

/// A parameter that the data estimate.
struct Free {
  std::size_t parameter = 0;
  bool linear = true;     ///< the reading is linear in it
  double step = 1.0;      ///< of a difference quotient, in its unit
  bool relative = false;  ///< the step is this share of the parameter
};

/// Limits of a fit beyond the catalogue's.
struct Bound {
  std::size_t parameter = 0;
  double least = 0.0;
  double most = 0.0;
};

/// What a recording can show of a parameter: beyond this share of its length, or of an input's
/// range, the shape is another kind's.
struct Limit {
  std::size_t parameter = 0;
  std::optional<Input> of = {};  ///< none: the length
  double share = 1.0;
  bool in_fits = true;  ///< or only of what is tried
};

/// Which part of the random model a kind is.
enum class Random : std::uint8_t { kNone, kWhite, kRatio, kWalk, kMarkov, kFlicker, kRounding };
/// It wanders, slower than samples.
constexpr bool is_drift(Random part) {
  return part == Random::kWalk || part == Random::kMarkov || part == Random::kFlicker;
}

/// What a figure of it is drawn against.
enum class Axis : std::uint8_t {
  kRate,
  kTemperature,
  kTemperatureSlope,
  kTemperatureLag,
  kRateTimesTemperature,
  kAcceleration,
  kVibration,
  kSupply,
  kOtherRate,
  kRateSlope,
  kGrowingLag,
  kAngle,
  kTime,       ///< means over time
  kFrequency,  ///< sines around its own
  kAveraging,  ///< the Allan deviation
};

/// What would tell it from its rivals; where two differ the first of the two counts.
enum class Experiment : std::uint8_t {
  kFasterMotion,
  kManyRates,
  kTemperatureCycles,
  kTilt,
  kSupplySteps,
  kOtherTurns,
  kLonger,
};
std::string_view experiment_text(Experiment experiment);

/// A field that every row must give.
template <class T>
class Given {
 public:
  template <std::convertible_to<T> U>
  // NOLINTNEXTLINE(google-explicit-constructor): a row reads as its values
  constexpr Given(U value) : value_(value) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  constexpr operator T() const { return value_; }
  constexpr T operator*() const { return value_; }

 private:
  T value_;
};

struct KindRow {
  Given<model::Kind> kind;
  Given<Finder> finder;
  Given<Inputs> needs;   ///< inputs that must move, by bits
  Given<bool> by_axis;   ///< parameter 0 is the axis of the input that it needs
  Given<bool> by_turns;  ///< by how the temperature changes, which coarse steps do not tell
  Given<std::span<const Free>> free;
  Given<Form> form;
  Given<std::span<const model::Parameters>> starts;  ///< of the scan, of size 1
  Given<double> penalty;  ///< of its statistic: places that were tried for it
  Given<std::span<const Bound>> bounds;
  Given<std::span<const Limit>> limits;
  Given<bool> forms_differ;  ///< another parameter 0 is another shape, not another start
  Given<bool> is_fast;       ///< what a late rate leaves may look like it
  Given<bool> keeps_size;    ///< may be judged by its size in parts of the recording
  Given<std::size_t> most;   ///< more of it on one gyro is something else in pieces; 0: any
  Given<Random> random;
  Given<Axis> axis;
  Given<Experiment> experiment;
  Given<bool> speaks_for_input;       ///< named as not identifiable where its input stands still
  Given<std::string_view> against;    ///< one word for `vgyro compare`
  Given<std::string_view> signature;  ///< one word when the name is withdrawn
  /// One sentence for people, of the fields that evidence_text() fills in.
  Given<std::string_view> evidence;
  /// The parameter whose standard errors the sentence ends with; kNoErrors: none.
  Given<std::size_t> errors_of;
};
inline constexpr std::size_t kNoErrors = model::kParametersMax;

// One more input than the bits of a mask have places for would be lost without a word.
static_assert(kInputCount <= 16);
constexpr Inputs bit(Input input) {
  return static_cast<Inputs>(1U << static_cast<unsigned>(input));
}

/// In the order of model::Kind.
std::span<const KindRow> kinds();
const KindRow& row(model::Kind kind);

/// Into the limits of catalogue and row.
void clamp(model::Effect& effect);
/// Amplitude above 0 and phase within a turn, where it has them.
void tidy_phase(model::Effect& effect);
/// Inputs that the effect needs, by bits.
Inputs needs_of(const model::Effect& effect);
/// Both are the same shape, but for where a search starts.
bool same_form(const model::Effect& a, const model::Effect& b);

/// No larger than a gyro's can be: what is, is something else that looks like it.
bool is_plausible(const model::Effect& effect);

}  // namespace vgyro::gap
