#pragma once

// One effect of the model file: a cause why a gyro reads other than the true rate.
// model/catalogue.h describes kinds, parameters and equations; an Effect holds only their values.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

namespace vgyro::model {

enum class Kind : std::uint8_t {
  kBias,
  kBiasRamp,
  kBiasStep,
  kWarmUp,
  kTemperatureBias,
  kTemperatureBiasQuadratic,
  kTemperatureRateBias,
  kScaleFactor,
  kScaleFactorAsymmetry,
  kScaleFactorQuadratic,
  kScaleFactorCubic,
  kScaleFactorTemperature,
  kGSensitivity,
  kVibrationRectification,
  kDelay,
  kBandwidth,
  kAngleHarmonic,
  kLine,
  kSaturation,
  kDeadBand,
  kQuantization,
  kWhiteNoise,
  kRateRandomWalk,
  kGaussMarkov,
  kRateNoise,
  kSpikes,
  kStuck,
  kDroppedFrames,
  kClockSkew,
  kTimestampJitter,
  kSupplyVoltageBias,
  kRunIn,
  kTemperatureHysteresis,
  kBiasInstability,
  kCrossAxis,
  kBandwidthSecondOrder
};
inline constexpr std::size_t kKindCount = 36;

/// Effects of kind gauss_markov for one gyro. Three, a decade apart, represent flicker noise over
/// the times for which a gyro is used (docs/allan.md); each is a state of every filter of the
/// gateway.
inline constexpr std::size_t kGaussMarkovMax = 3;

inline constexpr std::size_t kParametersMax = 3;
/// In the order of the catalogue; an axis is 0, 1 or 2.
using Parameters = std::array<double, kParametersMax>;

struct Effect {
  std::size_t gyro = 0;  ///< 0 or 1
  Kind kind = Kind::kBias;
  Parameters parameters{};
  unsigned line = 0;       ///< of its table in the model file; 0 without one
  Parameters sigma{};      ///< 1σ of each parameter; 0: not stated
  bool ambiguous = false;  ///< another explanation is as good: the whole effect may not be this
                           ///< gyro's
  /// For a unit of several axes: the sensor axis (0 … 2) that has the effect; nothing: each of
  /// them.
  std::optional<std::size_t> of_axis = {};

  friend bool operator==(const Effect&, const Effect&) = default;
};

/// The effect states a σ, or is ambiguous.
inline bool is_doubted(const Effect& effect) {
  return effect.ambiguous || effect.sigma != Parameters{};
}

class TemperaturePast;

/// What a gyro's error depends on besides the true rate, at one instant. NaN: unknown.
struct Surroundings {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  double t_s = 0.0;  ///< since the first frame of the recording
  double temperature_c = kUnknown;
  double temperature_slope_c_s = kUnknown;
  const TemperaturePast* temperature_past = nullptr;  ///< up to now; null: unknown
  std::array<double, 3> acceleration_g{kUnknown, kUnknown, kUnknown};
  double vibration_g2 = kUnknown;  ///< variance of |a| over the last second
  double supply_v = kUnknown;      ///< at the gyro
  /// About x, y and z of the same unit, as it sends them: with the same lag as its own reading.
  std::array<double, 3> other_rate_dps{kUnknown, kUnknown, kUnknown};
  double angle_rad = 0.0;  ///< ∫Ω dt, up to whole turns
};

}  // namespace vgyro::model
