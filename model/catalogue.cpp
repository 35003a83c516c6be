#include "model/catalogue.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

#include <fmt/core.h>

#include "model/temperature_past.h"

namespace vgyro::model {

namespace {

using Form = Parameter::Form;
using P = Parameters;
using S = Surroundings;

constexpr double kRateMax_dps = 1e5;
constexpr double kTimeMax_s = 1e9;
// A memory shorter than the interval of the fastest gyro is white noise.
constexpr double kTauMin_s = 1e-3;
// A slower low-pass or line is drift.
constexpr double kCutoffMin_hz = 1e-2;
constexpr double kLineMin_hz = 1e-6;
// A gyro that reads no more than this does not work.
constexpr double kLimitMin_dps = 1e-6;
// Finer than any signal: the Earth turns a million times faster.
constexpr double kStepMin_dps = 1e-9;
// The best gyros have some 1e-7, the worst some 1; squares of these limits are far from the limits
// of double precision.
constexpr double kNoiseLeast = 1e-12;
constexpr double kNoiseMax = 1e2;
// No gyro is so wrong that it responds in reverse or ten times too strongly.
constexpr double kScaleMin = -0.9;
constexpr double kScaleMax = 9.0;
constexpr double kLagMax_s = 0.25;
constexpr double kFrequencyMax_hz = 1e5;

constexpr Parameter kReference{
    .name = "reference_c", .unit = "degC", .minimum = -273.15, .maximum = 1000.0, .preset = 25.0};

// The usual supply of vehicle sensors; the model file states others, such as 3.3 or 12 V.
constexpr Parameter kReferenceSupply{
    .name = "reference_v", .unit = "V", .minimum = 0.0, .maximum = 1000.0, .preset = 5.0};

constexpr Parameter number(std::string_view name, std::string_view unit, double limit) {
  return {.name = name, .unit = unit, .minimum = -limit, .maximum = limit};
}
constexpr Parameter not_negative(std::string_view name, std::string_view unit, double limit) {
  return {.name = name, .unit = unit, .minimum = 0.0, .maximum = limit};
}
constexpr Parameter noise(std::string_view name, std::string_view unit, double limit) {
  return {.name = name, .unit = unit, .minimum = 0.0, .maximum = limit, .least = kNoiseLeast};
}
/// A parameter that something is divided by.
constexpr Parameter divisor(std::string_view name, std::string_view unit, double least,
                            double limit) {
  return {.name = name, .unit = unit, .minimum = least, .maximum = limit};
}

constexpr std::array kBias{number("value_dps", "deg/s", kRateMax_dps)};
constexpr std::array kBiasRamp{number("slope_dps_s", "(deg/s)/s", 1e3)};
constexpr std::array kBiasStep{number("size_dps", "deg/s", kRateMax_dps),
                               number("at_s", "s", kTimeMax_s)};
constexpr std::array kWarmUp{number("amplitude_dps", "deg/s", kRateMax_dps),
                             divisor("tau_s", "s", kTauMin_s, kTimeMax_s)};
constexpr std::array kTemperatureBias{number("coefficient_dps_k", "(deg/s)/K", 1e3), kReference};
constexpr std::array kTemperatureBiasQuadratic{number("coefficient_dps_k2", "(deg/s)/K^2", 1e3),
                                               kReference};
constexpr std::array kTemperatureRateBias{number("coefficient_dps_s_k", "(deg/s)/(K/s)", 1e5)};
constexpr std::array kScaleFactor{
    Parameter{.name = "error", .unit = "", .minimum = kScaleMin, .maximum = kScaleMax}};
constexpr std::array kScaleFactorAsymmetry{number("error", "", 0.9)};
constexpr std::array kScaleFactorQuadratic{number("coefficient_per_dps", "1/(deg/s)", 1.0)};
constexpr std::array kScaleFactorCubic{number("coefficient_per_dps2", "1/(deg/s)^2", 1.0)};
constexpr std::array kScaleFactorTemperature{number("coefficient_per_k", "1/K", 1.0), kReference};
constexpr std::array kGSensitivity{
    Parameter{.name = "axis", .unit = "", .minimum = 0.0, .maximum = 2.0, .form = Form::kAxis},
    number("coefficient_dps_g", "(deg/s)/g", 1e3)};
constexpr std::array kVibrationRectification{number("coefficient_dps_g2", "(deg/s)/g^2", 1e3)};
constexpr std::array kDelay{number("seconds", "s", kLagMax_s)};
constexpr std::array kBandwidth{divisor("cutoff_hz", "Hz", kCutoffMin_hz, kFrequencyMax_hz)};
// A smaller damping rings for a hundred periods; a larger one is a low-pass of the first order.
constexpr std::array kBandwidthSecondOrder{
    divisor("cutoff_hz", "Hz", kCutoffMin_hz, kFrequencyMax_hz),
    divisor("damping", "", 0.01, 10.0)};
constexpr std::array kAngleHarmonic{
    Parameter{
        .name = "harmonic", .unit = "", .minimum = 1.0, .maximum = 100.0, .form = Form::kWhole},
    number("amplitude_dps", "deg/s", kRateMax_dps), number("phase_rad", "rad", 1e3)};
constexpr std::array kLine{divisor("frequency_hz", "Hz", kLineMin_hz, kFrequencyMax_hz),
                           number("amplitude_dps", "deg/s", kRateMax_dps),
                           number("phase_rad", "rad", 1e3)};
constexpr std::array kSaturation{divisor("limit_dps", "deg/s", kLimitMin_dps, kRateMax_dps)};
constexpr std::array kDeadBand{not_negative("width_dps", "deg/s", kRateMax_dps)};
constexpr std::array kQuantization{divisor("step_dps", "deg/s", kStepMin_dps, kRateMax_dps)};
constexpr std::array kWhiteNoise{noise("density_dps_rthz", "deg/s/sqrt(Hz)", kNoiseMax)};
constexpr std::array kRateRandomWalk{noise("density_dps_rts", "deg/s/sqrt(s)", kNoiseMax)};
constexpr std::array kGaussMarkov{noise("sigma_dps", "deg/s", kNoiseMax),
                                  divisor("tau_s", "s", kTauMin_s, kTimeMax_s)};
constexpr std::array kRateNoise{noise("ratio_rthz", "1/sqrt(Hz)", 1.0)};
constexpr std::array kSpikes{not_negative("rate_hz", "1/s", kFrequencyMax_hz),
                             number("size_dps", "deg/s", kRateMax_dps)};
constexpr std::array kStuck{number("from_s", "s", kTimeMax_s), number("to_s", "s", kTimeMax_s)};
constexpr std::array kDroppedFrames{not_negative("fraction", "", 1.0)};
constexpr std::array kClockSkew{number("ppm", "1e-6", 1e5)};
constexpr std::array kTimestampJitter{not_negative("sigma_s", "s", 10.0)};
constexpr std::array kSupplyVoltageBias{number("coefficient_dps_v", "(deg/s)/V", 1e3),
                                        kReferenceSupply};
constexpr std::array kRunIn{number("coefficient_dps", "deg/s", kRateMax_dps),
                            divisor("tau_s", "s", kTauMin_s, kTimeMax_s)};

constexpr std::array kTemperatureHysteresis{number("coefficient_dps_k", "(deg/s)/K", 1e3),
                                            not_negative("play_k", "K", 1e3)};
constexpr std::array kBiasInstability{noise("coefficient_dps", "deg/s", kNoiseMax)};
constexpr std::array kCrossAxis{
    Parameter{.name = "from", .unit = "", .minimum = 0.0, .maximum = 2.0, .form = Form::kAxis},
    number("coefficient", "", 1.0)};

constexpr KindInfo kCatalogue[] = {
    {Kind::kBias, Nature::kOffset, kNeedsNothing, "bias", "value", kBias,
     [](const P& p, double, const S&) { return p[0]; }},
    {Kind::kBiasRamp, Nature::kOffset, kNeedsNothing, "bias_ramp", "slope * t", kBiasRamp,
     [](const P& p, double, const S& s) { return p[0] * s.t_s; }},
    {Kind::kBiasStep, Nature::kOffset, kNeedsNothing, "bias_step", "size, once t >= at", kBiasStep,
     [](const P& p, double, const S& s) { return s.t_s >= p[1] ? p[0] : 0.0; }},
    {Kind::kWarmUp, Nature::kOffset, kNeedsNothing, "warm_up", "amplitude * exp(-t / tau)", kWarmUp,
     [](const P& p, double, const S& s) { return p[0] * std::exp(-s.t_s / p[1]); }},
    {Kind::kTemperatureBias, Nature::kOffset, kNeedsTemperature, "temperature_bias",
     "c * (T - ref)", kTemperatureBias,
     [](const P& p, double, const S& s) { return p[0] * (s.temperature_c - p[1]); }},
    {Kind::kTemperatureBiasQuadratic, Nature::kOffset, kNeedsTemperature,
     "temperature_bias_quadratic", "c * (T - ref)^2", kTemperatureBiasQuadratic,
     [](const P& p, double, const S& s) {
       const double excess_c = s.temperature_c - p[1];
       return p[0] * excess_c * excess_c;
     }},
    {Kind::kTemperatureRateBias, Nature::kOffset, kNeedsTemperature, "temperature_rate_bias",
     "c * dT/dt", kTemperatureRateBias,
     [](const P& p, double, const S& s) { return p[0] * s.temperature_slope_c_s; }},
    {Kind::kScaleFactor, Nature::kResponse, kNeedsNothing, "scale_factor", "e * rate", kScaleFactor,
     [](const P& p, double rate, const S&) { return p[0] * rate; },
     [](const P& p, double, const S&) { return p[0]; }},
    {Kind::kScaleFactorAsymmetry, Nature::kResponse, kNeedsNothing, "scale_factor_asymmetry",
     "e * |rate|", kScaleFactorAsymmetry,
     [](const P& p, double rate, const S&) { return p[0] * std::abs(rate); },
     [](const P& p, double rate, const S&) { return rate < 0.0 ? -p[0] : p[0]; }},
    {Kind::kScaleFactorQuadratic, Nature::kResponse, kNeedsNothing, "scale_factor_quadratic",
     "c * rate^2", kScaleFactorQuadratic,
     [](const P& p, double rate, const S&) { return p[0] * rate * rate; },
     [](const P& p, double rate, const S&) { return 2.0 * p[0] * rate; }},
    {Kind::kScaleFactorCubic, Nature::kResponse, kNeedsNothing, "scale_factor_cubic", "c * rate^3",
     kScaleFactorCubic, [](const P& p, double rate, const S&) { return p[0] * rate * rate * rate; },
     [](const P& p, double rate, const S&) { return 3.0 * p[0] * rate * rate; }},
    {Kind::kScaleFactorTemperature, Nature::kResponse, kNeedsTemperature,
     "scale_factor_temperature", "c * (T - ref) * rate", kScaleFactorTemperature,
     [](const P& p, double rate, const S& s) { return p[0] * (s.temperature_c - p[1]) * rate; },
     [](const P& p, double, const S& s) { return p[0] * (s.temperature_c - p[1]); }},
    {Kind::kGSensitivity, Nature::kOffset, kNeedsAcceleration, "g_sensitivity",
     "c * acceleration along the axis", kGSensitivity,
     [](const P& p, double, const S& s) {
       return p[1] * s.acceleration_g[static_cast<std::size_t>(p[0])];
     }},
    {Kind::kVibrationRectification, Nature::kOffset, kNeedsAcceleration, "vibration_rectification",
     "c * variance of |a| over 1 s", kVibrationRectification,
     [](const P& p, double, const S& s) { return p[0] * s.vibration_g2; }},
    {Kind::kDelay, Nature::kLag, kNeedsNothing, "delay", "rate(t - seconds) instead of rate(t)",
     kDelay},
    {Kind::kBandwidth, Nature::kLag, kNeedsNothing, "bandwidth", "first-order low-pass of the rate",
     kBandwidth},
    {Kind::kAngleHarmonic, Nature::kOffset, kNeedsNothing, "angle_harmonic",
     "A * cos(n * angle + phase)", kAngleHarmonic,
     [](const P& p, double, const S& s) { return p[1] * std::cos(p[0] * s.angle_rad + p[2]); }},
    {Kind::kLine, Nature::kOffset, kNeedsNothing, "line", "A * sin(2 pi f t + phase)", kLine,
     [](const P& p, double, const S& s) {
       // Remove whole periods first, so that the phase keeps its digits after a year.
       const double periods = p[0] * s.t_s;
       return p[1] * std::sin(2.0 * std::numbers::pi * (periods - std::floor(periods)) + p[2]);
     }},
    {Kind::kSaturation, Nature::kClip, kNeedsNothing, "saturation", "clipped at +-limit",
     kSaturation},
    {Kind::kDeadBand, Nature::kClip, kNeedsNothing, "dead_band", "0 while below the width",
     kDeadBand},
    {Kind::kQuantization, Nature::kClip, kNeedsNothing, "quantization", "rounded to the step",
     kQuantization},
    {Kind::kWhiteNoise, Nature::kNoise, kNeedsNothing, "white_noise", "angle random walk N",
     kWhiteNoise},
    {Kind::kRateRandomWalk, Nature::kNoise, kNeedsNothing, "rate_random_walk",
     "random-walk drift K", kRateRandomWalk},
    {Kind::kGaussMarkov, Nature::kNoise, kNeedsNothing, "gauss_markov",
     "exponentially correlated drift", kGaussMarkov},
    {Kind::kRateNoise, Nature::kNoise, kNeedsNothing, "rate_noise",
     "white noise of density ratio * |rate|", kRateNoise},
    {Kind::kSpikes, Nature::kDisturbance, kNeedsNothing, "spikes", "outliers", kSpikes},
    {Kind::kStuck, Nature::kDisturbance, kNeedsNothing, "stuck", "value frozen", kStuck},
    {Kind::kDroppedFrames, Nature::kDisturbance, kNeedsNothing, "dropped_frames", "frames missing",
     kDroppedFrames},
    {Kind::kClockSkew, Nature::kDisturbance, kNeedsNothing, "clock_skew",
     "stamps run fast (positive)", kClockSkew},
    {Kind::kTimestampJitter, Nature::kDisturbance, kNeedsNothing, "timestamp_jitter",
     "stamps randomly late", kTimestampJitter},
    {Kind::kSupplyVoltageBias, Nature::kOffset, kNeedsSupply, "supply_voltage_bias",
     "c * (V - ref)", kSupplyVoltageBias,
     [](const P& p, double, const S& s) { return p[0] * (s.supply_v - p[1]); }},
    {Kind::kRunIn, Nature::kOffset, kNeedsNothing, "run_in", "c * ln(1 + t / tau)", kRunIn,
     [](const P& p, double, const S& s) {
       // A reading dated back to before the first frame has t < 0.
       return p[0] * std::log1p(std::max(0.0, s.t_s) / p[1]);
     }},
    {Kind::kTemperatureHysteresis, Nature::kOffset, kNeedsTemperature, "temperature_hysteresis",
     "c * (T with play - T)", kTemperatureHysteresis,
     [](const P& p, double, const S& s) {
       if (s.temperature_past == nullptr || std::isnan(s.temperature_c)) return 0.0;
       return p[0] * (s.temperature_past->followed_c(p[1], s.temperature_c) - s.temperature_c);
     }},
    {Kind::kBiasInstability, Nature::kNoise, kNeedsNothing, "bias_instability",
     "flicker noise B, Allan floor 0.664 * B", kBiasInstability},
    {Kind::kCrossAxis, Nature::kOffset, kNeedsOtherAxes, "cross_axis",
     "c * rate about another axis of the unit", kCrossAxis,
     [](const P& p, double, const S& s) {
       return p[1] * s.other_rate_dps[static_cast<std::size_t>(p[0])];
     }},
    {Kind::kBandwidthSecondOrder, Nature::kLag, kNeedsNothing, "bandwidth_second_order",
     "second-order low-pass of the rate", kBandwidthSecondOrder},
};
static_assert(std::size(kCatalogue) == kKindCount);

constexpr bool in_order_of_kind() {
  for (std::size_t i = 0; i < kKindCount; ++i) {
    if (static_cast<std::size_t>(kCatalogue[i].kind) != i) return false;
  }
  return true;
}
static_assert(in_order_of_kind());

constexpr bool needs_are_counted() {
  for (const KindInfo& row : kCatalogue) {
    if (row.needs >> kNeedCount != 0) return false;
  }
  return true;
}
static_assert(needs_are_counted());

// Products, quotients and squares of a few parameters, and of times, stay finite and do not
// underflow.
constexpr bool is_sane(const Parameter& parameter) {
  constexpr double kMagnitudeMax = 1e9;
  constexpr double kDivisorMin = 1e-9;
  const bool ordered = parameter.minimum < parameter.maximum;
  const bool bounded = parameter.minimum >= -kMagnitudeMax && parameter.maximum <= kMagnitudeMax;
  const bool divides = parameter.minimum <= 0.0 || parameter.minimum >= kDivisorMin;
  const bool presets = !parameter.preset || (*parameter.preset >= parameter.minimum &&
                                             *parameter.preset <= parameter.maximum);
  return ordered && bounded && divides && presets;
}

constexpr bool all_are_sane() {
  for (const KindInfo& row : kCatalogue) {
    for (const Parameter& parameter : row.parameters) {
      if (!is_sane(parameter)) return false;
      if (row.nature == Nature::kNoise && parameter.minimum == 0.0 && parameter.least <= 0.0) {
        return false;  // the density is not 0 but its square is
      }
    }
  }
  return true;
}
static_assert(all_are_sane());

}  // namespace

bool Parameter::allows(double value) const {
  if (form == Form::kWhole && value != std::floor(value)) return false;
  return value >= minimum && value <= maximum && (value == 0.0 || std::abs(value) >= least);
}

std::string Parameter::limits() const {
  if (form == Form::kAxis) return "\"x\", \"y\" or \"z\"";
  const std::string space = unit.empty() ? "" : " ";
  if (least > 0.0) return fmt::format("0, or {:g} to {:g}{}{}", least, maximum, space, unit);
  return fmt::format("{}{:g} to {:g}{}{}", form == Form::kWhole ? "a whole number, " : "", minimum,
                     maximum, space, unit);
}

std::span<const KindInfo> catalogue() {
  return kCatalogue;
}

const KindInfo& info(Kind kind) {
  return kCatalogue[static_cast<std::size_t>(kind)];
}

const KindInfo* find_kind(std::string_view name) {
  const auto* const found = std::find_if(std::begin(kCatalogue), std::end(kCatalogue),
                                         [&](const KindInfo& row) { return row.name == name; });
  return found == std::end(kCatalogue) ? nullptr : found;
}

std::vector<std::string> kind_names() {
  std::vector<std::string> names;
  for (const KindInfo& row : kCatalogue)
    names.emplace_back(row.name);
  return names;
}

const Parameter* size_parameter(Kind kind) {
  for (const Parameter& parameter : info(kind).parameters) {
    // A line's frequency precedes its amplitude, but is not its size.
    const bool says_when = kind == Kind::kLine && parameter.unit == "Hz";
    if (parameter.form == Form::kNumber && !parameter.preset && !says_when) return &parameter;
  }
  return nullptr;
}

double within_limits(const Parameter& parameter, double value) {
  return std::clamp(value, parameter.minimum, parameter.maximum);
}

double added_dps(const Effect& effect, double rate_dps, const Surroundings& surroundings) {
  const KindInfo& row = info(effect.kind);
  assert(row.added != nullptr);
  const double added = row.added(effect.parameters, rate_dps, surroundings);
  return std::isnan(added) ? 0.0 : added;
}

double slope(const Effect& effect, double rate_dps, const Surroundings& surroundings) {
  const KindInfo& row = info(effect.kind);
  assert(row.slope != nullptr);
  const double slope = row.slope(effect.parameters, rate_dps, surroundings);
  return std::isnan(slope) ? 0.0 : slope;
}

double clipped_dps(const Effect& effect, double reading_dps) {
  const double limit_dps = effect.parameters[0];
  switch (effect.kind) {
    case Kind::kSaturation:
      return std::clamp(reading_dps, -limit_dps, limit_dps);
    case Kind::kDeadBand:
      return std::abs(reading_dps) < limit_dps ? 0.0 : reading_dps;
    case Kind::kQuantization:
      return std::round(reading_dps / limit_dps) * limit_dps;
    default:
      assert(info(effect.kind).nature != Nature::kClip);
      return reading_dps;
  }
}

double lag_s(const Effect& effect) {
  if (effect.kind == Kind::kDelay) return effect.parameters[0];
  const double first_order_s = 1.0 / (2.0 * std::numbers::pi * effect.parameters[0]);
  if (effect.kind == Kind::kBandwidth) return first_order_s;
  assert(effect.kind == Kind::kBandwidthSecondOrder);
  return 2.0 * effect.parameters[1] * first_order_s;
}

double lag_sigma_s(const Effect& effect) {
  if (effect.kind == Kind::kDelay) return effect.sigma[0];
  return lag_s(effect) * effect.sigma[0] / effect.parameters[0];
}

bool acts_on_unit(Kind kind) {
  return info(kind).nature == Nature::kLag || kind == Kind::kDroppedFrames ||
         kind == Kind::kClockSkew || kind == Kind::kTimestampJitter;
}

std::string parameters_text(const Effect& effect) {
  std::string text;
  if (effect.of_axis) text = fmt::format("of {}: ", "xyz"[*effect.of_axis]);
  const std::span<const Parameter> parameters = info(effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (i > 0) text += ", ";
    text += fmt::format("{} ", parameters[i].name);
    if (parameters[i].form == Form::kAxis) {
      text += "xyz"[static_cast<std::size_t>(effect.parameters[i])];
    } else {
      text += fmt::format("{:g}", effect.parameters[i]);
    }
    if (effect.sigma[i] > 0.0) text += fmt::format(" ± {:g}", effect.sigma[i]);
  }
  if (effect.ambiguous) text += ", ambiguous";
  return text;
}

}  // namespace vgyro::model
