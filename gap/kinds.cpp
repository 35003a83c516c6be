#include "gap/kinds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Kind;
using model::Parameters;
using S = model::Surroundings;

// An error that a smaller change of its input would show is below any gyro's noise.
constexpr double kRateMin_dps = 1.0;
constexpr double kTemperatureMin_c = 0.5;
constexpr double kTemperatureSlopeMin_c_s = 0.01;
constexpr double kAccelerationMin_g = 0.02;
constexpr double kVibrationMin_g2 = 1e-5;
constexpr double kSupplyMin_v = 0.05;

constexpr InputRow kInputs[] = {
    {Input::kRate, [](double rate_dps, const S&) { return rate_dps; }, kRateMin_dps},
    {Input::kTemperature, [](double, const S& s) { return s.temperature_c; }, kTemperatureMin_c},
    {Input::kTemperatureSlope, [](double, const S& s) { return s.temperature_slope_c_s; },
     kTemperatureSlopeMin_c_s},
    {Input::kAccelerationX, [](double, const S& s) { return s.acceleration_g[0]; },
     kAccelerationMin_g},
    {Input::kAccelerationY, [](double, const S& s) { return s.acceleration_g[1]; },
     kAccelerationMin_g},
    {Input::kAccelerationZ, [](double, const S& s) { return s.acceleration_g[2]; },
     kAccelerationMin_g},
    {Input::kVibration, [](double, const S& s) { return s.vibration_g2; }, kVibrationMin_g2},
    {Input::kSupply, [](double, const S& s) { return s.supply_v; }, kSupplyMin_v},
    {Input::kRateX, [](double, const S& s) { return s.other_rate_dps[0]; }, kRateMin_dps},
    {Input::kRateY, [](double, const S& s) { return s.other_rate_dps[1]; }, kRateMin_dps},
    {Input::kRateZ, [](double, const S& s) { return s.other_rate_dps[2]; }, kRateMin_dps},
};
static_assert(std::size(kInputs) == kInputCount);

constexpr bool inputs_in_order() {
  for (std::size_t i = 0; i < kInputCount; ++i) {
    if (static_cast<std::size_t>(kInputs[i].input) != i) return false;
  }
  return true;
}
static_assert(inputs_in_order());

constexpr Inputs kNothing = 0;
constexpr Inputs kRate = bit(Input::kRate);
constexpr Inputs kTemperature = bit(Input::kTemperature);

// A reference temperature or voltage is no free parameter: another one is another bias or scale
// factor.
constexpr double kReference_c = 25.0;
constexpr double kReference_v = 5.0;

constexpr std::array<Free, 0> kNoFree{};
constexpr std::array kFirst{Free{0}};
constexpr std::array kSecond{Free{1}};
// A tenth of a millisecond, and a millionth: below what any recording resolves.
constexpr std::array kDelayFree{Free{0, false, 1e-4}};
constexpr std::array kSkewFree{Free{0, false, 1.0}};
constexpr std::array kCutoffFree{Free{0, false, 1e-3, true}};
constexpr std::array kSecondOrderFree{Free{0, false, 1e-3, true}, Free{1, false, 1e-3, true}};
constexpr std::array kWarmUpFree{Free{0}, Free{1, false, 1e-3, true}};
// So small that hardly a sample gets from one side of the play to the other.
constexpr std::array kPlayFree{Free{0}, Free{1, false, 1e-6, true}};
// The sine and the cosine of a phase that is hardly moved.
constexpr std::array kHarmonicFree{Free{1, false, 1.0}, Free{2, false, 1e-4}};
constexpr std::array kLineFree{Free{0, false, 1e-6}, Free{1, false, 1.0}, Free{2, false, 1e-4}};

constexpr std::array<Parameters, 0> kNoStart{};
constexpr std::array<Parameters, 1> kUnit{Parameters{1.0}};
constexpr std::array<Parameters, 1> kZero{Parameters{0.0}};
constexpr std::array<Parameters, 1> kUnitAtReference{Parameters{1.0, kReference_c}};
constexpr std::array<Parameters, 1> kUnitAtSupply{Parameters{1.0, kReference_v}};
constexpr std::array kAxes{Parameters{0.0, 1.0}, Parameters{1.0, 1.0}, Parameters{2.0, 1.0}};
// Twice as long each time: between two of them the shape is met to a few per cent.
constexpr std::array kWarmUps{Parameters{1.0, 3.0},   Parameters{1.0, 7.0},  Parameters{1.0, 15.0},
                              Parameters{1.0, 30.0},  Parameters{1.0, 60.0}, Parameters{1.0, 120.0},
                              Parameters{1.0, 240.0}, Parameters{1.0, 480.0}};
// Four times as long each time: a logarithm hardly bends.
constexpr std::array kRunIns{Parameters{1.0, 2.0}, Parameters{1.0, 8.0}, Parameters{1.0, 32.0},
                             Parameters{1.0, 128.0}};
// Twice as far each time.
constexpr std::array kPlays{Parameters{1.0, 0.3}, Parameters{1.0, 0.6}, Parameters{1.0, 1.2},
                            Parameters{1.0, 2.4}, Parameters{1.0, 4.8}};
constexpr std::array kCutoffs{Parameters{1.0}, Parameters{2.5}, Parameters{6.0}, Parameters{15.0},
                              Parameters{40.0}};
constexpr std::array kSecondOrders{Parameters{2.0, 0.7}, Parameters{5.0, 0.7},
                                   Parameters{12.0, 0.7}, Parameters{30.0, 0.7}};
// What a turntable, a gear or a magnet repeats in a turn.
constexpr std::array kHarmonics{
    Parameters{1.0, 1.0, 0.0},  Parameters{2.0, 1.0, 0.0},  Parameters{3.0, 1.0, 0.0},
    Parameters{4.0, 1.0, 0.0},  Parameters{5.0, 1.0, 0.0},  Parameters{6.0, 1.0, 0.0},
    Parameters{7.0, 1.0, 0.0},  Parameters{8.0, 1.0, 0.0},  Parameters{9.0, 1.0, 0.0},
    Parameters{10.0, 1.0, 0.0}, Parameters{11.0, 1.0, 0.0}, Parameters{12.0, 1.0, 0.0}};

constexpr std::array<Bound, 0> kNoBound{};
// A slower low-pass is no gyro's, a faster one is none.
constexpr std::array kCutoffBound{Bound{0, 0.05, 1e4}};
// Filters of gyros neither ring nor creep.
constexpr std::array kSecondOrderBound{Bound{0, 0.05, 1e4}, Bound{1, 0.2, 2.0}};
// Below what sensors of a gyro's temperature resolve.
constexpr std::array kPlayBound{Bound{1, 0.05, 100.0}};
// Faster than two samples, or slower than hours, it is a spike or a bias.
constexpr std::array kWarmUpBound{Bound{1, 0.5, 1e4}};

constexpr std::array<Limit, 0> kNoLimit{};
// What dies away later than the recording ends is a bias.
constexpr std::array kWarmUpLimit{Limit{1, {}, 1.0, false}};
// With more play than that the temperature drags it along too little to show a loop: what it stays
// behind by is the temperature itself.
constexpr std::array kPlayLimit{Limit{1, Input::kTemperature, 0.35}};
// A logarithm that hardly bends is a ramp.
constexpr std::array kRunInLimit{Limit{1, {}, 0.1}};

// Of places tried: starts and a second free parameter count as in docs/gap.md.
constexpr double kNoPenalty = 0.0;
constexpr double kWarmUpPenalty = 5.0;
// Four starts and a free time; and where a ramp explains as much, it is a ramp: the difference is
// more than what a name must lead by.
constexpr double kRunInPenalty = 8.0;
// Five starts and a free play.
constexpr double kPlayPenalty = 5.0;
constexpr double kAxisPenalty = 1.0;
constexpr double kCutoffPenalty = 2.0;
// Four starts and a free damping. It has a lag and a low-pass for free, and passes for either: it
// must be far better than they are.
constexpr double kSecondOrderPenalty = 40.0;
constexpr double kHarmonicPenalty = 7.0;
// Two parameters more than a walk, one of which means nothing where the other is 0.
constexpr double kMarkovPenalty = 6.0;
// A walk that is as good is a walk: more than what a name must lead by.
constexpr double kFlickerPenalty = 8.0;
constexpr std::size_t kAnyNumber = 0;
constexpr std::size_t kFew = 3;

// Fields that the rows of one family share.
constexpr KindRow added(Kind kind, Inputs needs, std::span<const Parameters> starts, Axis axis,
                        Experiment experiment, std::string_view against, std::string_view signature,
                        std::string_view evidence) {
  return {.kind = kind,
          .finder = Finder::kShape,
          .needs = needs,
          .by_axis = false,
          .by_turns = false,
          .free = std::span<const Free>(kFirst),
          .form = Form::kSize,
          .starts = starts,
          .penalty = kNoPenalty,
          .bounds = std::span<const Bound>(kNoBound),
          .limits = std::span<const Limit>(kNoLimit),
          .forms_differ = false,
          .is_fast = false,
          .keeps_size = true,
          .most = kAnyNumber,
          .random = Random::kNone,
          .axis = axis,
          .experiment = experiment,
          .speaks_for_input = false,
          .against = against,
          .signature = signature,
          .evidence = evidence,
          .errors_of = std::size_t{0}};
}

constexpr KindRow timing(Kind kind, std::span<const Free> free, Form form,
                         std::span<const Parameters> starts, double penalty,
                         std::span<const Bound> bounds, Axis axis, bool speaks,
                         std::string_view against, std::string_view evidence,
                         std::size_t errors_of) {
  return {.kind = kind,
          .finder = Finder::kShape,
          .needs = kRate,
          .by_axis = false,
          .by_turns = false,
          .free = free,
          .form = form,
          .starts = starts,
          .penalty = penalty,
          .bounds = bounds,
          .limits = std::span<const Limit>(kNoLimit),
          .forms_differ = false,
          .is_fast = true,
          .keeps_size = true,
          .most = kAnyNumber,
          .random = Random::kNone,
          .axis = axis,
          .experiment = Experiment::kFasterMotion,
          .speaks_for_input = speaks,
          .against = against,
          .signature = "rate",
          .evidence = evidence,
          .errors_of = errors_of};
}

constexpr KindRow random(Kind kind, Random part, double penalty, bool fast,
                         std::string_view evidence) {
  return {.kind = kind,
          .finder = Finder::kNoise,
          .needs = kNothing,
          .by_axis = false,
          .by_turns = false,
          .free = std::span<const Free>(kNoFree),
          .form = Form::kNone,
          .starts = std::span<const Parameters>(kNoStart),
          .penalty = penalty,
          .bounds = std::span<const Bound>(kNoBound),
          .limits = std::span<const Limit>(kNoLimit),
          .forms_differ = false,
          .is_fast = fast,
          .keeps_size = false,
          .most = kAnyNumber,
          .random = part,
          .axis = Axis::kAveraging,
          .experiment = Experiment::kLonger,
          .speaks_for_input = false,
          .against = "noise",
          .signature = "noise",
          .evidence = evidence,
          .errors_of = kNoErrors};
}

// The transport checks bring a sentence and a figure of their own.
constexpr KindRow frames(Kind kind, std::string_view against, Random part = Random::kNone) {
  return {.kind = kind,
          .finder = Finder::kFrames,
          .needs = kNothing,
          .by_axis = false,
          .by_turns = false,
          .free = std::span<const Free>(kNoFree),
          .form = Form::kNone,
          .starts = std::span<const Parameters>(kNoStart),
          .penalty = kNoPenalty,
          .bounds = std::span<const Bound>(kNoBound),
          .limits = std::span<const Limit>(kNoLimit),
          .forms_differ = false,
          .is_fast = false,
          .keeps_size = false,
          .most = kAnyNumber,
          .random = part,
          .axis = Axis::kTime,
          .experiment = Experiment::kLonger,
          .speaks_for_input = false,
          .against = against,
          .signature = against,
          .evidence = "{name} shows {kind}",
          .errors_of = kNoErrors};
}

constexpr KindRow speaking(KindRow row) {
  row.speaks_for_input = true;
  return row;
}

constexpr KindRow warm_up() {
  KindRow row =
      added(Kind::kWarmUp, kNothing, kWarmUps, Axis::kTime, Experiment::kLonger, "time", "slow",
            "the residual of {name} starts {p0:+.3g} deg/s off and dies away within "
            "{p1:.4g} s");
  row.free = std::span<const Free>(kWarmUpFree);
  row.penalty = kWarmUpPenalty;
  row.bounds = std::span<const Bound>(kWarmUpBound);
  row.limits = std::span<const Limit>(kWarmUpLimit);
  row.keeps_size = false;
  return row;
}

constexpr KindRow run_in() {
  KindRow row =
      added(Kind::kRunIn, kNothing, kRunIns, Axis::kTime, Experiment::kLonger, "time", "slow",
            "the residual of {name} moves on ever more slowly, by {p0:+.3g} deg/s times "
            "ln(1 + t / {p1:.4g} s)");
  row.free = std::span<const Free>(kWarmUpFree);
  row.penalty = kRunInPenalty;
  row.bounds = std::span<const Bound>(kWarmUpBound);
  row.limits = std::span<const Limit>(kRunInLimit);
  row.keeps_size = false;
  return row;
}

constexpr KindRow temperature_rate_bias() {
  KindRow row =
      added(Kind::kTemperatureRateBias, bit(Input::kTemperatureSlope), kUnit,
            Axis::kTemperatureSlope, Experiment::kTemperatureCycles, "temperature", "temperature",
            "the residual of {name} follows the change of its temperature: {p0:+.3g} "
            "deg/s per K/s");
  row.by_turns = true;
  return speaking(row);
}

constexpr KindRow temperature_hysteresis() {
  KindRow row = added(Kind::kTemperatureHysteresis, kTemperature, kPlays, Axis::kTemperatureLag,
                      Experiment::kTemperatureCycles, "temperature", "temperature",
                      "the residual of {name} goes another way when its temperature turns round: "
                      "{p0:+.3g} deg/s per K that a play of {p1:.3g} K to both sides leaves");
  row.by_turns = true;
  row.free = std::span<const Free>(kPlayFree);
  row.penalty = kPlayPenalty;
  row.bounds = std::span<const Bound>(kPlayBound);
  row.limits = std::span<const Limit>(kPlayLimit);
  return row;
}

constexpr KindRow bias_step() {
  KindRow row = added(Kind::kBiasStep, kNothing, kNoStart, Axis::kTime, Experiment::kLonger, "time",
                      "steps", "the residual of {name} jumps by {p0:+.3g} deg/s at {p1:.1f} s");
  row.finder = Finder::kStep;
  row.keeps_size = false;
  row.most = kFew;
  return row;
}

constexpr KindRow g_sensitivity() {
  KindRow row =
      added(Kind::kGSensitivity, bit(Input::kAccelerationX), kAxes, Axis::kAcceleration,
            Experiment::kTilt, "acceleration", "acceleration",
            "the residual of {name} follows the acceleration along {axis}: {p1:+.3g} deg/s per g");
  row.by_axis = true;
  row.free = std::span<const Free>(kSecond);
  row.penalty = kAxisPenalty;
  row.forms_differ = true;
  row.errors_of = std::size_t{1};
  return speaking(row);
}

constexpr KindRow cross_axis() {
  KindRow row = added(Kind::kCrossAxis, bit(Input::kRateX), kAxes, Axis::kOtherRate,
                      Experiment::kOtherTurns, "other_rate", "rate",
                      "the residual of {name} follows the rate about {axis}: {p1:+.3g} of it");
  row.by_axis = true;
  row.free = std::span<const Free>(kSecond);
  row.penalty = kAxisPenalty;
  row.forms_differ = true;
  row.is_fast = true;
  row.errors_of = std::size_t{1};
  return speaking(row);
}

constexpr KindRow angle_harmonic() {
  KindRow row =
      added(Kind::kAngleHarmonic, kRate, kHarmonics, Axis::kAngle, Experiment::kLonger, "angle",
            "rate", "the residual of {name} repeats {p0:.0f} times a turn, by {size:.3g} deg/s");
  row.free = std::span<const Free>(kHarmonicFree);
  row.form = Form::kWave;
  row.penalty = kHarmonicPenalty;
  row.forms_differ = true;
  row.errors_of = std::size_t{1};
  return row;
}

constexpr KindRow line() {
  KindRow row =
      added(Kind::kLine, kNothing, kNoStart, Axis::kFrequency, Experiment::kLonger, "frequency",
            "line", "the residual of {name} holds a sine of {p0:.6g} Hz and {size:.3g} deg/s");
  row.finder = Finder::kLine;
  row.free = std::span<const Free>(kLineFree);
  row.form = Form::kWave;
  row.is_fast = true;
  row.most = kFew;
  row.errors_of = std::size_t{1};
  return row;
}

constexpr KindRow kKinds[] = {
    added(Kind::kBias, kNothing, kUnit, Axis::kTime, Experiment::kLonger, "time", "slow",
          "{name} reads {p0:+.3g} deg/s beside the truth all the time"),
    added(Kind::kBiasRamp, kNothing, kUnit, Axis::kTime, Experiment::kLonger, "time", "slow",
          "the residual of {name} climbs by {p0:+.3g} deg/s every second, {over:+.3g} deg/s over "
          "the recording"),
    bias_step(),
    warm_up(),
    speaking(added(Kind::kTemperatureBias, kTemperature, kUnitAtReference, Axis::kTemperature,
                   Experiment::kTemperatureCycles, "temperature", "temperature",
                   "the residual of {name} follows its temperature: {p0:+.3g} deg/s per K")),
    speaking(added(Kind::kTemperatureBiasQuadratic, kTemperature, kUnitAtReference,
                   Axis::kTemperature, Experiment::kTemperatureCycles, "temperature", "temperature",
                   "the residual of {name} follows the square of its temperature less {p1:.4g} °C: "
                   "{p0:+.3g} deg/s per K²")),
    temperature_rate_bias(),
    speaking(added(Kind::kScaleFactor, kRate, kUnit, Axis::kRate, Experiment::kManyRates, "rate",
                   "rate", "the residual of {name} follows the rate: {p0:+.3g} of it")),
    added(Kind::kScaleFactorAsymmetry, kRate, kUnit, Axis::kRate, Experiment::kManyRates, "rate",
          "rate", "the residual of {name} follows the rate whatever its sign: {p0:+.3g} of |rate|"),
    added(Kind::kScaleFactorQuadratic, kRate, kUnit, Axis::kRate, Experiment::kManyRates, "rate",
          "rate",
          "the residual of {name} follows the square of the rate: {p0:+.3g} deg/s per (deg/s)²"),
    added(Kind::kScaleFactorCubic, kRate, kUnit, Axis::kRate, Experiment::kManyRates, "rate",
          "rate",
          "the residual of {name} follows the cube of the rate: {p0:+.3g} deg/s per (deg/s)³"),
    speaking(added(Kind::kScaleFactorTemperature, kRate | kTemperature, kUnitAtReference,
                   Axis::kRateTimesTemperature, Experiment::kTemperatureCycles, "temperature",
                   "rate",
                   "the residual of {name} follows the rate the more, the further its temperature "
                   "is from {p1:.4g} °C: {p0:+.3g} of the rate per K")),
    g_sensitivity(),
    speaking(added(Kind::kVibrationRectification, bit(Input::kVibration), kUnit, Axis::kVibration,
                   Experiment::kTilt, "acceleration", "acceleration",
                   "the residual of {name} follows the vibration: {p0:+.3g} deg/s per g² of "
                   "variance")),
    timing(Kind::kDelay, kDelayFree, Form::kShift, kZero, kNoPenalty, kNoBound, Axis::kRateSlope,
           true, "rate_slope",
           "the residual of {name} follows the slope of the rate: it comes {ms:+.3g} ms late", 0),
    timing(Kind::kBandwidth, kCutoffFree, Form::kLowPass, kCutoffs, kCutoffPenalty, kCutoffBound,
           Axis::kRateSlope, false, "rate_slope",
           "the residual of {name} grows with the frequency of the motion as behind a low-pass of "
           "{p0:.4g} Hz",
           kNoErrors),
    angle_harmonic(),
    line(),
    frames(Kind::kSaturation, "values"),
    frames(Kind::kDeadBand, "values"),
    frames(Kind::kQuantization, "values", Random::kRounding),
    random(Kind::kWhiteNoise, Random::kWhite, kNoPenalty, true,
           "{name} scatters from sample to sample by {p0:.3g} deg/s/√Hz more than the model says"),
    random(Kind::kRateRandomWalk, Random::kWalk, kNoPenalty, false,
           "{name} wanders as a random walk of {p0:.3g} deg/s/√s beyond what the model says"),
    random(Kind::kGaussMarkov, Random::kMarkov, kMarkovPenalty, false,
           "{name} wanders by {p0:.3g} deg/s and forgets it within {p1:.4g} s, beyond what the "
           "model says"),
    random(Kind::kRateNoise, Random::kRatio, kNoPenalty, true,
           "{name} scatters the more, the faster it turns: {p0:.3g} of the rate, per √Hz"),
    frames(Kind::kSpikes, "values"),
    frames(Kind::kStuck, "values"),
    frames(Kind::kDroppedFrames, "frames"),
    timing(Kind::kClockSkew, kSkewFree, Form::kShift, kZero, kNoPenalty, kNoBound,
           Axis::kGrowingLag, false, "stamps",
           "the lag of {name} grows by {p0:+.3g} µs every second", 0),
    frames(Kind::kTimestampJitter, "stamps"),
    speaking(added(Kind::kSupplyVoltageBias, bit(Input::kSupply), kUnitAtSupply, Axis::kSupply,
                   Experiment::kSupplySteps, "supply", "supply",
                   "the residual of {name} follows its supply voltage: {p0:+.3g} deg/s per V")),
    run_in(),
    temperature_hysteresis(),
    random(
        Kind::kBiasInstability, Random::kFlicker, kFlickerPenalty, false,
        "{name} wanders alike over all times, by {p0:.3g} deg/s of flicker beyond what the model "
        "says"),
    cross_axis(),
    timing(Kind::kBandwidthSecondOrder, kSecondOrderFree, Form::kLowPass, kSecondOrders,
           kSecondOrderPenalty, kSecondOrderBound, Axis::kRateSlope, false, "rate_slope",
           "the residual of {name} grows with the frequency of the motion as behind a low-pass of "
           "second order of {p0:.4g} Hz and a damping of {p1:.2g}",
           kNoErrors),
};
static_assert(std::size(kKinds) == model::kKindCount);

constexpr bool kinds_in_order() {
  for (std::size_t i = 0; i < model::kKindCount; ++i) {
    if (static_cast<std::size_t>(*kKinds[i].kind) != i) return false;
  }
  return true;
}
static_assert(kinds_in_order());

// What the scan looks for has a shape and something to estimate.
constexpr bool scanned_rows_are_whole() {
  for (const KindRow& row : kKinds) {
    const bool shaped = row.finder == Finder::kShape;
    if (shaped == std::span(*row.starts).empty()) return false;
    if ((row.form == Form::kNone) != std::span(*row.free).empty()) return false;
    if ((row.finder == Finder::kNoise) && row.random == Random::kNone) return false;
  }
  return true;
}
static_assert(scanned_rows_are_whole());

}  // namespace

std::span<const InputRow> inputs() {
  return kInputs;
}

const InputRow& input_row(Input input) {
  return kInputs[static_cast<std::size_t>(input)];
}

std::span<const KindRow> kinds() {
  return kKinds;
}

const KindRow& row(Kind kind) {
  return kKinds[static_cast<std::size_t>(kind)];
}

std::string_view experiment_text(Experiment experiment) {
  switch (experiment) {
    case Experiment::kFasterMotion:
      return "turn to and fro faster, up to a tenth of the sampling rate, and for longer";
    case Experiment::kManyRates:
      return "turn both ways at many different rates, slow ones and the fastest";
    case Experiment::kTemperatureCycles:
      return "let the temperature rise and fall twice, at different speeds";
    case Experiment::kTilt:
      return "tilt about both horizontal axes, and shake in bursts";
    case Experiment::kSupplySteps:
      return "let the supply voltage rise and fall by half a volt, several times";
    case Experiment::kOtherTurns:
      return "turn about the two other axes, at times when the platform does not turn about its "
             "own";
    case Experiment::kLonger:
      break;
  }
  return "record for longer, with the motion at other times";
}

void clamp(model::Effect& effect) {
  const auto parameters = model::info(effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    effect.parameters[i] =
        std::clamp(effect.parameters[i], parameters[i].minimum, parameters[i].maximum);
    if (std::abs(effect.parameters[i]) < parameters[i].least) effect.parameters[i] = 0.0;
  }
  for (const Bound& bound : *row(effect.kind).bounds) {
    effect.parameters[bound.parameter] =
        std::clamp(effect.parameters[bound.parameter], bound.least, bound.most);
  }
}

void tidy_phase(model::Effect& effect) {
  if (row(effect.kind).form != Form::kWave) return;
  const double turn = 2.0 * std::numbers::pi;
  if (effect.parameters[1] < 0.0) {
    effect.parameters[1] = -effect.parameters[1];
    effect.parameters[2] += std::numbers::pi;
  }
  effect.parameters[2] -= turn * std::floor(effect.parameters[2] / turn);
}

Inputs needs_of(const model::Effect& effect) {
  const KindRow& its = row(effect.kind);
  const auto axis = its.by_axis ? static_cast<unsigned>(effect.parameters[0]) : 0U;
  return static_cast<Inputs>(its.needs << axis);
}

bool same_form(const model::Effect& a, const model::Effect& b) {
  return a.kind == b.kind && a.gyro == b.gyro &&
         (!row(a.kind).forms_differ || a.parameters[0] == b.parameters[0]);
}

namespace {

// Ten times what the worst data sheets say, or what would be seen without any tool.
struct Most {
  Kind kind;
  std::size_t parameter;
  double value;
};
constexpr Most kMost[] = {
    {Kind::kTemperatureBias, 0, 0.5},
    {Kind::kTemperatureBiasQuadratic, 0, 0.05},
    {Kind::kScaleFactor, 0, 0.2},
    {Kind::kScaleFactorAsymmetry, 0, 0.1},
    {Kind::kScaleFactorTemperature, 0, 5e-3},
    {Kind::kGSensitivity, 1, 0.5},
    {Kind::kDelay, 0, 0.3},
    {Kind::kClockSkew, 0, 2e4},
    {Kind::kTemperatureHysteresis, 0, 0.5},
    {Kind::kCrossAxis, 1, 0.5},
};

}  // namespace

bool is_plausible(const model::Effect& effect) {
  return std::none_of(std::begin(kMost), std::end(kMost), [&](const Most& most) {
    return most.kind == effect.kind && std::abs(effect.parameters[most.parameter]) > most.value;
  });
}

}  // namespace vgyro::gap
