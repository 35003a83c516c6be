#include "gap/signals.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <gtest/gtest.h>

#include "gap/kinds.h"

namespace vgyro::gap {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kInterval_s = 0.01;

template <class Function>
SampledCurve sampled(const Function& f, double seconds) {
  std::vector<double> t_s;
  std::vector<double> value;
  for (int i = 0; i * kInterval_s < seconds; ++i) {
    t_s.push_back(kInterval_s * i);
    value.push_back(f(t_s.back()));
  }
  return {t_s, value};
}

Signals turning_at(double frequency_hz, double amplitude_dps) {
  Signals signals;
  signals.motion = Motion(sampled(
      [&](double t) { return amplitude_dps * std::sin(2.0 * kPi * frequency_hz * t); }, 20.0));
  return signals;
}

TEST(Prediction, LowPassAnswersASineAsTheEquationSays) {
  for (const double frequency_hz : {0.5, 2.0, 5.0}) {
    const Signals signals = turning_at(frequency_hz, 40.0);
    const double cutoff_hz = 4.0;
    const std::array effects{model::Effect{0, model::Kind::kBandwidth, {cutoff_hz}, 0}};
    const Prediction prediction(effects, signals);
    const double x = frequency_hz / cutoff_hz;
    for (double t = 5.0; t < 15.0; t += 0.0371) {
      const double truth =
          40.0 / std::sqrt(1.0 + x * x) * std::sin(2.0 * kPi * frequency_hz * t - std::atan(x));
      // The rate is taken as straight over a quarter of a sample.
      const double bend = 2.0 * kPi * frequency_hz * kInterval_s / 4.0;
      EXPECT_NEAR(prediction.at(t), truth, 40.0 * (bend * bend / 8.0 + 2e-5));
    }
  }
}

TEST(Prediction, LowPassOfSecondOrderAnswersASineAsTheEquationSays) {
  constexpr double kCutoff_hz = 4.0;
  for (const double damping : {0.4, 0.7, 1.0, 1.5}) {
    for (const double frequency_hz : {0.5, 2.0, 5.0}) {
      const Signals signals = turning_at(frequency_hz, 40.0);
      const std::array effects{
          model::Effect{0, model::Kind::kBandwidthSecondOrder, {kCutoff_hz, damping}, 0}};
      const Prediction prediction(effects, signals);
      const std::complex<double> x(0.0, frequency_hz / kCutoff_hz);
      const std::complex<double> gain = 40.0 / (1.0 + 2.0 * damping * x + x * x);
      const double bend = 2.0 * kPi * frequency_hz * kInterval_s / 4.0;
      for (double t = 5.0; t < 15.0; t += 0.0371) {
        const double truth =
            std::imag(gain * std::exp(std::complex<double>(0.0, 2.0 * kPi * frequency_hz * t)));
        EXPECT_NEAR(prediction.at(t), truth, 40.0 * (bend * bend / 8.0 + 2e-5)) << damping;
      }
    }
  }
}

TEST(Prediction, DelayReadsAnEarlierRate) {
  const Signals signals = turning_at(1.0, 40.0);
  const std::array effects{model::Effect{0, model::Kind::kDelay, {0.0123}, 0}};
  const Prediction prediction(effects, signals);
  for (double t = 1.0; t < 19.0; t += 0.0371)
    EXPECT_NEAR(prediction.at(t), 40.0 * std::sin(2.0 * kPi * (t - 0.0123)), 1e-5);
}

TEST(Prediction, AddsAScaleFactorToTheRate) {
  const Signals signals = turning_at(1.0, 40.0);
  const std::array effects{model::Effect{0, model::Kind::kScaleFactor, {0.01}, 0},
                           model::Effect{0, model::Kind::kBias, {0.5}, 0}};
  const Prediction prediction(effects, signals);
  for (double t = 1.0; t < 19.0; t += 0.0371)
    EXPECT_NEAR(prediction.at(t), 40.4 * std::sin(2.0 * kPi * t) + 0.5, 1e-5);
}

// The sensor's response is to the rate that it reads, which is the late one: at 250 deg/s² the
// order of the two is worth 1e-2 deg/s.
TEST(Prediction, ResponsesSeeTheRateBehindDelayAndLowPass) {
  const Signals signals = turning_at(1.0, 40.0);
  const model::Effect delay{0, model::Kind::kDelay, {0.02}, 0};
  const model::Effect bandwidth{0, model::Kind::kBandwidth, {20.0}, 0};
  const model::Effect scale{0, model::Kind::kScaleFactor, {2e-3}, 0};
  const model::Effect cubic{0, model::Kind::kScaleFactorCubic, {1e-6}, 0};
  const std::array lags{delay, bandwidth};
  const std::array all{scale, delay, cubic, bandwidth};
  const Prediction lagged(lags, signals);
  const Prediction read(all, signals);
  for (double t = 1.0; t < 19.0; t += 0.0371) {
    const double late_dps = lagged.at(t);
    EXPECT_NEAR(read.at(t), late_dps * (1.0 + 2e-3 + 1e-6 * late_dps * late_dps), 1e-12);
  }
}

TEST(Motion, AngleIsTheIntegralOfTheRate) {
  const double frequency_hz = 0.8;
  const Signals signals = turning_at(frequency_hz, 90.0);
  const double omega = 2.0 * kPi * frequency_hz;
  for (double t = 0.1; t < 19.0; t += 0.0371) {
    const double truth_deg = 90.0 / omega * (1.0 - std::cos(omega * t));
    // A started interval is taken by its middle: T³/24 of the rate's second derivative.
    const double bend_deg = std::pow(kInterval_s, 3) / 24.0 * 90.0 * omega * omega;
    EXPECT_NEAR(signals.motion.angle_rad(t), truth_deg * kPi / 180.0,
                1.05 * bend_deg * kPi / 180.0);
  }
}

TEST(Temperature, SlopeIsThatOfTheTruthBehindCoarseSteps) {
  GyroSeries gyro;
  const double step_c = 1.0 / 128.0;
  const auto truth = [](double t) { return 25.0 + 8.0 * std::sin(2.0 * kPi * t / 120.0); };
  for (int i = 0; i < 12000; ++i) {
    gyro.t_s.push_back(kInterval_s * i);
    gyro.temperature_c.push_back(step_c * std::round(truth(gyro.t_s.back()) / step_c));
  }
  Signals signals;
  smooth_temperature(gyro, signals);
  for (double t = 3.0; t < 117.0; t += 0.37) {
    EXPECT_NEAR(signals.temperature_c.linear(t), truth(t), step_c);
    const double slope = 8.0 * 2.0 * kPi / 120.0 * std::cos(2.0 * kPi * t / 120.0);
    EXPECT_NEAR(signals.temperature_slope_c_s.linear(t), slope, 0.02 * 8.0 * 2.0 * kPi / 120.0);
  }
}

TEST(SupplyVoltage, IsWhatWasToldLast) {
  GyroSeries gyro;
  for (int i = 0; i < 100; ++i) {
    gyro.t_s.push_back(kInterval_s * i);
    gyro.supply_v.push_back(i == 30 ? std::nan("") : i < 50 ? 5.0 : 4.5);
  }
  Signals signals;
  set_supply(gyro, signals);
  EXPECT_DOUBLE_EQ(signals.supply_v.linear(0.3), 5.0) << "a gap is bridged";
  EXPECT_NEAR(signals.supply_v.linear(0.495), 4.75, 1e-9);
  EXPECT_DOUBLE_EQ(signals.supply_v.linear(0.9), 4.5);
  Signals without;
  set_supply({}, without);
  EXPECT_TRUE(without.supply_v.empty());
}

// Between two of them the motion is no straight line.
TEST(OtherRates, AreFollowedBetweenSamples) {
  GyroSeries gyro;
  const auto truth = [](double t_s) { return 20.0 * std::sin(2.0 * kPi * 5.0 * t_s); };
  for (int i = 0; i < 300; ++i) {
    gyro.t_s.push_back(kInterval_s * i);
    gyro.other_rate_dps[1].push_back(truth(gyro.t_s.back()));
  }
  Signals signals = turning_at(1.0, 3.0);
  set_other_rates(gyro, signals);
  for (double t_s = 0.5; t_s < 2.5; t_s += 0.0037)
    EXPECT_NEAR(signals.at(t_s).other_rate_dps[1], truth(t_s), 0.02);
  EXPECT_TRUE(std::isnan(signals.at(1.0).other_rate_dps[0]));
}

// The follower of a temperature with play, whatever the play: of the smoothed temperature.
TEST(Temperature, ItsPastSaysWhatStaysBehind) {
  GyroSeries gyro;
  const auto truth = [](double t_s) { return 25.0 + 4.0 * std::sin(2.0 * kPi * t_s / 60.0); };
  for (int i = 0; i < 9000; ++i) {
    gyro.t_s.push_back(kInterval_s * i);
    gyro.temperature_c.push_back(truth(gyro.t_s.back()));
  }
  Signals signals = turning_at(1.0, 90.0);
  smooth_temperature(gyro, signals);
  double followed_c = truth(0.0);
  constexpr double kPlay_k = 1.5;
  for (const double t_s : gyro.t_s) {
    followed_c = std::clamp(followed_c, truth(t_s) - kPlay_k, truth(t_s) + kPlay_k);
    const model::Surroundings s = signals.at(t_s);
    ASSERT_NE(s.temperature_past, nullptr);
    EXPECT_NEAR(s.temperature_past->followed_c(kPlay_k, s.temperature_c), followed_c, 0.01) << t_s;
  }
}

// What a recording holds of an input reaches whoever asks for it. A new input is tried here without
// being named.
TEST(Signals, TellEveryInput) {
  GyroSeries gyro;
  AccelerationSeries acceleration;
  for (int i = 0; i < 1000; ++i) {
    gyro.t_s.push_back(kInterval_s * i);
    gyro.temperature_c.push_back(20.0 + 0.01 * i);
    gyro.supply_v.push_back(5.0);
    for (std::vector<double>& axis : gyro.other_rate_dps)
      axis.push_back(3.0);
    acceleration.t_s.push_back(kInterval_s * i);
    for (std::vector<double>& axis_g : acceleration.g)
      axis_g.push_back(0.5 + 0.1 * (i % 2));
  }
  Signals signals = turning_at(1.0, 40.0);
  const auto all_are_known = [&] {
    const model::Surroundings s = signals.at(5.0);
    return std::all_of(inputs().begin(), inputs().end(), [&](const InputRow& input) {
      return std::isfinite(input.value(signals.motion.rate(5.0).value, s));
    });
  };
  EXPECT_FALSE(all_are_known());
  set_circumstances(gyro, acceleration, signals);
  EXPECT_TRUE(all_are_known());
}

TEST(Acceleration, VibrationIsTheVarianceOfItsSizeOverASecond) {
  AccelerationSeries acceleration;
  for (int i = 0; i < 3000; ++i) {
    acceleration.t_s.push_back(kInterval_s * i);
    acceleration.g[0].push_back(0.0);
    acceleration.g[1].push_back(0.0);
    acceleration.g[2].push_back(1.0 + 0.1 * std::sin(2.0 * kPi * 10.0 * acceleration.t_s.back()));
  }
  Signals signals;
  set_acceleration(acceleration, signals);
  // Ten whole periods: half the amplitude's square, by one sample of a hundred at most.
  EXPECT_NEAR(signals.vibration_g2.linear(20.0), 0.005, 0.005 * 0.02);
  EXPECT_NEAR(signals.acceleration_g[2].linear(20.0), 1.0, 1e-9);
}

}  // namespace
}  // namespace vgyro::gap
