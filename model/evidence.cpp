#include "model/evidence.h"

#include <iterator>

#include "model/catalogue.h"

namespace vgyro::model {

namespace {

constexpr Evidence kEvidence[] = {
    {Kind::kBias, "rest, or a reference", "warm_up, bias_step"},
    {Kind::kBiasRamp, "a long recording at steady temperature", "warm_up, rate_random_walk"},
    {Kind::kBiasStep, "a minute before the step and a minute after it",
     "rate_random_walk, warm_up"},
    {Kind::kWarmUp, "a cold start, three times as long as tau", "temperature_bias, bias_ramp"},
    {Kind::kTemperatureBias, "temperature that rises and falls by some kelvin",
     "warm_up, rate_random_walk"},
    {Kind::kTemperatureBiasQuadratic, "temperature on both sides of the reference",
     "temperature_bias"},
    {Kind::kTemperatureRateBias, "temperature that changes fast and slowly", "temperature_bias"},
    {Kind::kScaleFactor, "turns, and a reference", "scale_factor_cubic, scale_factor_temperature"},
    {Kind::kScaleFactorAsymmetry, "turns both ways", "scale_factor_quadratic, scale_factor"},
    {Kind::kScaleFactorQuadratic, "turns both ways at several rates", "scale_factor_asymmetry"},
    {Kind::kScaleFactorCubic, "turns at several rates, some near the limit", "scale_factor"},
    {Kind::kScaleFactorTemperature, "turns at several temperatures", "scale_factor"},
    {Kind::kGSensitivity, "tilt about both horizontal axes; an accelerometer",
     "rate_random_walk, bias_step"},
    {Kind::kVibrationRectification, "vibration that comes and goes; an accelerometer",
     "bias_step, rate_random_walk"},
    {Kind::kDelay, "turning to and fro several times a second", "bandwidth, clock_skew"},
    {Kind::kBandwidth, "turning to and fro near the cut-off", "delay"},
    {Kind::kAngleHarmonic, "several whole turns at different rates", "line"},
    {Kind::kLine, "a recording of many periods", "angle_harmonic"},
    {Kind::kSaturation, "turns beyond the limit", "stuck"},
    {Kind::kDeadBand, "rates about zero that change slowly", "stuck, quantization"},
    {Kind::kQuantization, "any readings: they lie on a lattice", "dead_band"},
    {Kind::kWhiteNoise, "rest: scatter from sample to sample", "rate_noise"},
    {Kind::kRateRandomWalk, "rest of minutes to hours", "gauss_markov, bias_ramp"},
    {Kind::kGaussMarkov, "rest of ten times tau", "rate_random_walk"},
    {Kind::kRateNoise, "scatter that grows with the rate", "white_noise"},
    {Kind::kSpikes, "single samples far from their neighbours", ""},
    {Kind::kStuck, "values that repeat while the other gyro moves", "saturation, dead_band"},
    {Kind::kDroppedFrames, "an alive counter, or gaps in the stamps", ""},
    {Kind::kClockSkew, "a long recording with turns, stamps of the same clock", "delay"},
    {Kind::kTimestampJitter, "stamps that scatter about an even clock", "dropped_frames"},
    {Kind::kSupplyVoltageBias, "a supply voltage that rises and falls by some tenths of a volt",
     "bias_step, rate_random_walk"},
    {Kind::kRunIn, "a long recording from the start on, ten times as long as tau",
     "warm_up, bias_ramp, rate_random_walk"},
    {Kind::kTemperatureHysteresis,
     "temperature that turns round several times, by far more than the play",
     "temperature_rate_bias, rate_random_walk"},
    {Kind::kBiasInstability,
     "rest of a thousand times as long as white noise takes to sink below it",
     "gauss_markov, rate_random_walk"},
    {Kind::kCrossAxis, "turns about the other axes; their rates on the bus", "g_sensitivity, line"},
    {Kind::kBandwidthSecondOrder, "turning to and fro below the cut-off and beyond it",
     "bandwidth, delay"},
};

static_assert(std::size(kEvidence) == kKindCount);

constexpr bool in_order_of_kind() {
  for (std::size_t i = 0; i < kKindCount; ++i) {
    if (static_cast<std::size_t>(kEvidence[i].kind) != i) return false;
  }
  return true;
}
static_assert(in_order_of_kind());

}  // namespace

const Evidence& evidence(Kind kind) {
  return kEvidence[static_cast<std::size_t>(kind)];
}

}  // namespace vgyro::model
