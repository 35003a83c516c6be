#include "model/shape.h"

#include <algorithm>
#include <iterator>

#include "model/catalogue.h"

namespace vgyro::model {

namespace {

// Other reference values differ from these by a bias or a scale factor.
constexpr double kReference_c = 25.0;
constexpr double kReference_v = 5.0;

// Times, cut-offs and plays are a factor of four apart, so that a shape between two of them is
// represented to a tenth. Units are a hundredth of a consumer gyro's data sheet, or less.
constexpr Shape kShapes[] = {
    {"bias_ramp", Kind::kBiasRamp, {}, 0, false, 1e-6},
    {"warm_up:15", Kind::kWarmUp, {0.0, 15.0}, 0, false, 1e-2},
    {"warm_up:60", Kind::kWarmUp, {0.0, 60.0}, 0, false, 1e-2},
    {"warm_up:240", Kind::kWarmUp, {0.0, 240.0}, 0, false, 1e-2},
    {"temperature_bias", Kind::kTemperatureBias, {0.0, kReference_c}, 0, false, 1e-3},
    {"temperature_bias_quadratic",
     Kind::kTemperatureBiasQuadratic,
     {0.0, kReference_c},
     0,
     false,
     1e-4},
    {"temperature_rate_bias", Kind::kTemperatureRateBias, {}, 0, false, 1e-2},
    {"scale_factor", Kind::kScaleFactor, {}, 0, false, 1e-3},
    {"scale_factor_asymmetry", Kind::kScaleFactorAsymmetry, {}, 0, false, 1e-3},
    {"scale_factor_quadratic", Kind::kScaleFactorQuadratic, {}, 0, false, 1e-5},
    {"scale_factor_cubic", Kind::kScaleFactorCubic, {}, 0, false, 1e-7},
    {"scale_factor_temperature",
     Kind::kScaleFactorTemperature,
     {0.0, kReference_c},
     0,
     false,
     1e-4},
    {"g_sensitivity:x", Kind::kGSensitivity, {0.0}, 1, false, 1e-3},
    {"g_sensitivity:y", Kind::kGSensitivity, {1.0}, 1, false, 1e-3},
    {"g_sensitivity:z", Kind::kGSensitivity, {2.0}, 1, false, 1e-3},
    {"vibration_rectification", Kind::kVibrationRectification, {}, 0, false, 1e-1},
    {"delay", Kind::kDelay, {}, 0, false, 1e-3},
    {"bandwidth:2.5", Kind::kBandwidth, {2.5}, 0, true, 1e-1},
    {"bandwidth:6", Kind::kBandwidth, {6.0}, 0, true, 1e-1},
    {"bandwidth:15", Kind::kBandwidth, {15.0}, 0, true, 1e-1},
    {"bandwidth:40", Kind::kBandwidth, {40.0}, 0, true, 1e-1},
    {"clock_skew", Kind::kClockSkew, {}, 0, false, 10.0},
    {"supply_voltage_bias", Kind::kSupplyVoltageBias, {0.0, kReference_v}, 0, false, 1e-2},
    {"run_in:8", Kind::kRunIn, {0.0, 8.0}, 0, false, 1e-3},
    {"temperature_hysteresis:0.6", Kind::kTemperatureHysteresis, {0.0, 0.6}, 0, false, 1e-3},
    {"temperature_hysteresis:2.4", Kind::kTemperatureHysteresis, {0.0, 2.4}, 0, false, 1e-3},
    {"cross_axis:x", Kind::kCrossAxis, {0.0}, 1, false, 1e-3},
    {"cross_axis:y", Kind::kCrossAxis, {1.0}, 1, false, 1e-3},
    {"cross_axis:z", Kind::kCrossAxis, {2.0}, 1, false, 1e-3},
};
static_assert(std::size(kShapes) == kShapeCount);

}  // namespace

std::span<const Shape> shapes() {
  return kShapes;
}

std::size_t shape_index(std::string_view name) {
  const auto* const found = std::find_if(std::begin(kShapes), std::end(kShapes),
                                         [&](const Shape& shape) { return shape.name == name; });
  return static_cast<std::size_t>(found - std::begin(kShapes));
}

Effect effect_of(const Shape& shape, double size) {
  Effect effect{0, shape.kind, shape.fixed, 0};
  if (shape.is_low_pass) {
    effect.parameters[0] = shape.fixed[0] / size;
  } else {
    effect.parameters[shape.size] = size;
  }
  return effect;
}

Parameters sigma_of(const Shape& shape, double size, double size_sigma) {
  Parameters sigma{};
  // The cut-off is fixed/size.
  sigma[shape.size] = shape.is_low_pass ? shape.fixed[0] * size_sigma / (size * size) : size_sigma;
  return sigma;
}

const Shape* shape_of(const Effect& effect) {
  const auto same = [&](const Shape& shape) {
    if (shape.kind != effect.kind || shape.is_low_pass) return false;
    Parameters parameters = effect.parameters;
    parameters[shape.size] = 0.0;
    return parameters == shape.fixed;
  };
  const auto* const found = std::find_if(std::begin(kShapes), std::end(kShapes), same);
  return found == std::end(kShapes) ? nullptr : found;
}

}  // namespace vgyro::model
