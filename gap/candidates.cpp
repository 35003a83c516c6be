#include "gap/candidates.h"

#include <array>
#include <cmath>

#include <fmt/core.h>

#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

constexpr double kRateMin_dps = 1.0;
constexpr double kTemperatureMin_c = 0.5;
constexpr double kTemperatureSlopeMin_c_s = 0.01;
constexpr double kAccelerationMin_g = 0.02;
constexpr double kVibrationMin_g2 = 1e-5;
constexpr int kHarmonicMax = 12;
constexpr std::array kWarmUp_s{3.0, 7.0, 15.0, 30.0, 60.0, 120.0, 240.0, 480.0};
constexpr std::array kCutoff_hz{1.0, 2.5, 6.0, 15.0, 40.0};
constexpr double kReference_c = 25.0;

Candidate plain(std::size_t gyro, Kind kind, model::Parameters parameters, double penalty = 0.0) {
  return {Term{Effect{gyro, kind, parameters, 0}, free_parameters(kind)}, penalty};
}

double derivative_step(const Effect& effect, std::size_t parameter) {
  switch (effect.kind) {
    case Kind::kDelay:
      return 1e-4;
    case Kind::kBandwidth:
      return 1e-3 * effect.parameters[0];
    case Kind::kClockSkew:
      return 1.0;
    case Kind::kWarmUp:
      return parameter == 0 ? 1.0 : 1e-3 * effect.parameters[1];
    case Kind::kLine:
      return parameter == 0 ? 1e-6 : parameter == 1 ? 1.0 : 1e-4;
    case Kind::kAngleHarmonic:
      return parameter == 1 ? 1.0 : 1e-4;
    default:
      return 1.0;
  }
}

}  // namespace

std::vector<std::size_t> free_parameters(Kind kind) {
  switch (kind) {
    case Kind::kGSensitivity:
      return {1};
    case Kind::kWarmUp:
      return {0, 1};
    case Kind::kAngleHarmonic:
      return {1, 2};
    case Kind::kLine:
      return {0, 1, 2};
    default:
      return {0};
  }
}

bool is_linear(Kind kind, std::size_t parameter) {
  switch (kind) {
    case Kind::kDelay:
    case Kind::kBandwidth:
    case Kind::kClockSkew:
    case Kind::kLine:
    case Kind::kAngleHarmonic:
      return false;
    case Kind::kWarmUp:
      return parameter == 0;
    default:
      return true;
  }
}

Eigen::VectorXd derivative(const Study& study, const Problem& problem, const Effect& effect,
                           std::size_t parameter) {
  Effect above = effect;
  if (is_linear(effect.kind, parameter)) {
    above.parameters[parameter] = 1.0;
    return study.contribution(problem, effect.gyro, {above});
  }
  const double step = derivative_step(effect, parameter);
  Effect below = effect;
  above.parameters[parameter] += step;
  below.parameters[parameter] -= step;
  return (study.contribution(problem, effect.gyro, {above}) -
          study.contribution(problem, effect.gyro, {below})) /
         (2.0 * step);
}

std::vector<Candidate> shaped_candidates(const Study& study, std::size_t gyro) {
  const Excitation& x = study.excitation(gyro);
  std::vector<Candidate> list;
  list.push_back(plain(gyro, Kind::kBias, {1.0}));
  list.push_back(plain(gyro, Kind::kBiasRamp, {1.0}));
  for (const double tau_s : kWarmUp_s) {
    if (tau_s < study.recording().seconds)
      list.push_back(plain(gyro, Kind::kWarmUp, {1.0, tau_s}, 5.0));
  }
  if (x.temperature_range_c >= kTemperatureMin_c) {
    list.push_back(plain(gyro, Kind::kTemperatureBias, {1.0, kReference_c}));
    list.push_back(plain(gyro, Kind::kTemperatureBiasQuadratic, {1.0, kReference_c}));
  }
  if (x.temperature_slope_range_c_s >= kTemperatureSlopeMin_c_s)
    list.push_back(plain(gyro, Kind::kTemperatureRateBias, {1.0}));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (x.acceleration_range_g[axis] >= kAccelerationMin_g)
      list.push_back(plain(gyro, Kind::kGSensitivity, {static_cast<double>(axis), 1.0}, 1.0));
  }
  if (x.vibration_range_g2 >= kVibrationMin_g2)
    list.push_back(plain(gyro, Kind::kVibrationRectification, {1.0}));
  if (x.rate_max_dps < kRateMin_dps) return list;
  list.push_back(plain(gyro, Kind::kScaleFactor, {1.0}));
  list.push_back(plain(gyro, Kind::kScaleFactorAsymmetry, {1.0}));
  list.push_back(plain(gyro, Kind::kScaleFactorQuadratic, {1.0}));
  list.push_back(plain(gyro, Kind::kScaleFactorCubic, {1.0}));
  if (x.temperature_range_c >= kTemperatureMin_c)
    list.push_back(plain(gyro, Kind::kScaleFactorTemperature, {1.0, kReference_c}));
  list.push_back(plain(gyro, Kind::kDelay, {0.0}));
  list.push_back(plain(gyro, Kind::kClockSkew, {0.0}));
  for (const double cutoff_hz : kCutoff_hz)
    list.push_back(plain(gyro, Kind::kBandwidth, {cutoff_hz}, 2.0));
  for (int harmonic = 1; harmonic <= kHarmonicMax; ++harmonic) {
    list.push_back(
        plain(gyro, Kind::kAngleHarmonic, {static_cast<double>(harmonic), 1.0, 0.0}, 7.0));
  }
  return list;
}

std::vector<NotIdentifiable> not_identifiable(const Study& study) {
  std::vector<NotIdentifiable> list;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Excitation& x = study.excitation(gyro);
    if (!x.knows_temperature) {
      list.push_back({Kind::kTemperatureBias, gyro, "the configuration names no temperature signal",
                      "name `temperature` in [[gyro]], if the sensor sends one"});
    } else if (x.temperature_range_c < kTemperatureMin_c) {
      const std::string why = fmt::format(
          "the temperature is constant in this recording, within {:.2g} K", x.temperature_range_c);
      const std::string how = "let the temperature change by 10 K, up and down";
      list.push_back({Kind::kTemperatureBias, gyro, why, how});
      list.push_back({Kind::kTemperatureBiasQuadratic, gyro, why, how});
      list.push_back({Kind::kTemperatureRateBias, gyro, why, how});
      list.push_back({Kind::kScaleFactorTemperature, gyro, why, how});
    }
    if (x.rate_max_dps < kRateMin_dps) {
      const std::string why =
          fmt::format("the platform never turned faster than {:.2g} deg/s", x.rate_max_dps);
      const std::string how = "turn both ways at several rates, some of them fast";
      list.push_back({Kind::kScaleFactor, gyro, why, how});
      list.push_back({Kind::kDelay, gyro, why, "turn to and fro a few times a second"});
    } else if (!study.recording().has_reference) {
      list.push_back(
          {Kind::kScaleFactor, gyro,
           "what both gyros share does not show in their difference, and there is no reference",
           "record a rate table or a dual-antenna heading as [reference]"});
    }
    if (!x.knows_acceleration) {
      list.push_back({Kind::kGSensitivity, gyro, "the configuration names no accelerometer",
                      "name an [accelerometer]"});
      continue;
    }
    const char* const axes = "xyz";
    bool any = false;
    for (std::size_t axis = 0; axis < 3; ++axis)
      any = any || x.acceleration_range_g[axis] >= kAccelerationMin_g;
    if (!any) {
      list.push_back({Kind::kGSensitivity, gyro, "the acceleration is constant in this recording",
                      "tilt the platform about both horizontal axes"});
    } else {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (x.acceleration_range_g[axis] >= kAccelerationMin_g) continue;
        list.push_back(
            {Kind::kGSensitivity, gyro,
             fmt::format("the acceleration along {} is constant in this recording", axes[axis]),
             fmt::format("tilt the platform so that {} feels gravity", axes[axis])});
      }
    }
    if (x.vibration_range_g2 < kVibrationMin_g2) {
      list.push_back({Kind::kVibrationRectification, gyro,
                      "there is no vibration in this recording", "shake the platform in bursts"});
    }
  }
  return list;
}

std::string experiment_for(const Reading& first, const Reading& second, bool with_reference) {
  if (first.kind == second.kind && first.gyro != second.gyro && !with_reference)
    return "record a [reference]: a difference alone does not say which of two gyros is wrong";
  const auto either = [&](Kind kind) { return first.kind == kind || second.kind == kind; };
  if (either(Kind::kDelay) || either(Kind::kBandwidth) || either(Kind::kClockSkew))
    return "turn to and fro faster, up to a tenth of the sampling rate, and for longer";
  if (either(Kind::kScaleFactor) || either(Kind::kScaleFactorAsymmetry) ||
      either(Kind::kScaleFactorQuadratic) || either(Kind::kScaleFactorCubic)) {
    return "turn both ways at many different rates, slow ones and the fastest";
  }
  if (either(Kind::kTemperatureBias) || either(Kind::kTemperatureBiasQuadratic) ||
      either(Kind::kTemperatureRateBias) || either(Kind::kScaleFactorTemperature)) {
    return "let the temperature rise and fall twice, at different speeds";
  }
  if (either(Kind::kGSensitivity) || either(Kind::kVibrationRectification))
    return "tilt about both horizontal axes, and shake in bursts";
  return "record for longer, with the motion at other times";
}

}  // namespace vgyro::gap
