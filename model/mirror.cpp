#include "model/mirror.h"

#include <cmath>
#include <numbers>

namespace vgyro::model {

namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;

}  // namespace

Effect mirrored(const Effect& effect) {
  Effect image = effect;
  Parameters& p = image.parameters;
  switch (effect.kind) {
    case Kind::kBias:
    case Kind::kBiasRamp:
    case Kind::kBiasStep:
    case Kind::kWarmUp:
    case Kind::kRunIn:
    case Kind::kTemperatureBias:
    case Kind::kTemperatureBiasQuadratic:
    case Kind::kTemperatureRateBias:
    case Kind::kTemperatureHysteresis:
    case Kind::kSupplyVoltageBias:
    case Kind::kVibrationRectification:
    case Kind::kScaleFactorAsymmetry:
    case Kind::kScaleFactorQuadratic:
      p[0] = -p[0];
      break;
    // The parameter after the axis of the input, which keeps its own sign.
    case Kind::kGSensitivity:
    case Kind::kCrossAxis:
      p[1] = -p[1];
      break;
    case Kind::kLine:
      p[2] = std::remainder(p[2] + 0.5 * kTurn_rad, kTurn_rad);
      break;
    // -A cos(n·(-θ) + φ) = A cos(n·θ + π − φ)
    case Kind::kAngleHarmonic:
      p[2] = std::remainder(0.5 * kTurn_rad - p[2], kTurn_rad);
      break;
    case Kind::kScaleFactor:
    case Kind::kScaleFactorCubic:
    case Kind::kScaleFactorTemperature:
    case Kind::kDelay:
    case Kind::kBandwidth:
    case Kind::kBandwidthSecondOrder:
    case Kind::kSaturation:
    case Kind::kDeadBand:
    case Kind::kQuantization:
    case Kind::kWhiteNoise:
    case Kind::kRateRandomWalk:
    case Kind::kGaussMarkov:
    case Kind::kRateNoise:
    case Kind::kBiasInstability:
    case Kind::kSpikes:  // of either sign already
    case Kind::kStuck:
    case Kind::kDroppedFrames:
    case Kind::kClockSkew:
    case Kind::kTimestampJitter:
      break;
  }
  return image;
}

}  // namespace vgyro::model
