#include "gap/describe.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <fmt/core.h>

#include "gap/views.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

constexpr std::size_t kTimeBins = 60;
constexpr int kLineReach = 20;     ///< periods of the recording to both sides
constexpr int kLinePerPeriod = 4;  ///< points

// All that a description of one effect is made from.
struct Subject {
  const Study& study;
  const Problem& problem;
  const NamedEffect& named;

  PairNoise noise;
  Eigen::VectorXd without;  ///< residual when all others are in the model
  Eigen::VectorXd with;     ///< and this one, too

  [[nodiscard]] std::size_t gyro() const { return named.effect.gyro; }
  [[nodiscard]] const std::string& name() const { return study.recording().gyros[gyro()].name; }
  [[nodiscard]] const model::Parameters& p() const { return named.effect.parameters; }
};

bool is_noise(Kind kind) {
  return model::info(kind).nature == model::Nature::kNoise || kind == Kind::kQuantization;
}

// What the error of such a kind is a function of.
struct Against {
  std::string what;
  std::string x_label;
  std::vector<double> x;     ///< at each sample
  std::vector<double> unit;  ///< a bin's value is times of this; empty: 1
  std::string y_label = "deg/s";
  double scale = 1.0;  ///< of the value, for its label
};

template <class Value>
std::vector<double> each(const Problem& problem, const Value& value) {
  std::vector<double> list(problem.t_s.size());
  for (std::size_t i = 0; i < list.size(); ++i)
    list[i] = value(i);
  return list;
}

Against against_of(const Subject& s) {
  const std::size_t gyro = s.gyro();
  const auto& rate = s.problem.rate[gyro];
  const auto& around = s.problem.surroundings[gyro];
  const auto of = [&](const auto& value) { return each(s.problem, value); };
  switch (s.named.effect.kind) {
    case Kind::kTemperatureBias:
    case Kind::kTemperatureBiasQuadratic:
      return {"the temperature",
              "temperature / °C",
              of([&](std::size_t i) { return around[i].temperature_c; }),
              {}};
    case Kind::kTemperatureRateBias:
      return {"the change of temperature",
              "change of temperature / (K/s)",
              of([&](std::size_t i) { return around[i].temperature_slope_c_s; }),
              {}};
    case Kind::kScaleFactorTemperature:
      return {
          "the rate times the temperature",
          fmt::format("(temperature - {:.4g} °C) · rate / (K deg/s)", s.p()[1]),
          of([&](std::size_t i) { return (around[i].temperature_c - s.p()[1]) * rate[i].value; }),
          {}};
    case Kind::kGSensitivity: {
      const auto axis = static_cast<std::size_t>(s.p()[0]);
      return {fmt::format("the acceleration along {}", "xyz"[axis]),
              fmt::format("acceleration along {} / g", "xyz"[axis]),
              of([&](std::size_t i) { return around[i].acceleration_g[axis]; }),
              {}};
    }
    case Kind::kVibrationRectification:
      return {"the vibration",
              "variance of the acceleration / g²",
              of([&](std::size_t i) { return around[i].vibration_g2; }),
              {}};
    case Kind::kDelay:
    case Kind::kBandwidth:
      return {"the slope of the rate",
              "slope of the rate / (deg/s²)",
              of([&](std::size_t i) { return rate[i].slope; }),
              {}};
    case Kind::kClockSkew:
      return {"time, as a lag that grows",
              "time / s",
              of([&](std::size_t i) { return s.problem.t_s[i]; }),
              of([&](std::size_t i) { return -rate[i].slope; }),
              "lag / ms",
              1e3};
    case Kind::kAngleHarmonic:
      return {"the angle",
              "angle within a turn / deg",
              of([&](std::size_t i) {
                const double turns = around[i].angle_rad / (2.0 * std::numbers::pi);
                return 360.0 * (turns - std::floor(turns));
              }),
              {}};
    default:
      return {"the rate", "rate / (deg/s)", of([&](std::size_t i) { return rate[i].value; }), {}};
  }
}

void scale_by(std::vector<double>& values, double factor) {
  for (double& value : values)
    value *= factor;
}

Figure regressor_figure(const Subject& s) {
  const Against against = against_of(s);
  const Eigen::VectorXd shape = s.without - s.with;
  Bins bins =
      binned(s.problem, s.gyro(), s.noise, {&s.without, &s.with, &shape}, against.x, against.unit);
  scale_by(bins.sigma, against.scale);
  for (std::vector<double>& value : bins.value)
    scale_by(value, against.scale);
  return {fmt::format("Residual of {} against {}, all other effects in the model", s.name(),
                      against.what),
          against.x_label,
          against.y_label,
          false,
          false,
          {{"before: without it", bins.at, bins.value[0], bins.sigma, true},
           {"after: with it", bins.at, bins.value[1], bins.sigma, true},
           {"fitted " + std::string(model::info(s.named.effect.kind).name),
            bins.at,
            bins.value[2],
            {},
            false}}};
}

// Means over time, with what white noise alone leaves of them as error: drift shows as itself.
Figure time_figure(const Subject& s) {
  const double seconds = s.study.recording().seconds;
  std::array<double, kTimeBins> count{}, time{}, variance{}, without{}, with{};
  const double step_s = seconds / static_cast<double>(kTimeBins);
  for (const Block& block : s.problem.layout.blocks) {
    const double share = share_of(block.channel, s.gyro());
    if (share == 0.0) continue;
    const auto bin =
        std::min(kTimeBins - 1, static_cast<std::size_t>(std::max(0.0, block.t_s) / step_s));
    count[bin] += block.count;
    time[bin] += block.count * block.t_s;
    variance[bin] += block.count * block.count * mean_variance(block, s.noise, s.problem.layout);
    without[bin] += share * s.without.segment(block.first, block.count).sum();
    with[bin] += share * s.with.segment(block.first, block.count).sum();
  }
  Curve before{"before: without it", {}, {}, {}, true};
  Curve after{"after: with it", {}, {}, {}, true};
  Curve shape{"fitted " + std::string(model::info(s.named.effect.kind).name), {}, {}, {}, false};
  for (std::size_t bin = 0; bin < kTimeBins; ++bin) {
    if (count[bin] == 0.0) continue;
    const double t_s = time[bin] / count[bin];
    before.x.push_back(t_s);
    before.y.push_back(without[bin] / count[bin]);
    before.y_sigma.push_back(std::sqrt(variance[bin]) / count[bin]);
    after.x.push_back(t_s);
    after.y.push_back(with[bin] / count[bin]);
    shape.x.push_back(t_s);
    shape.y.push_back((without[bin] - with[bin]) / count[bin]);
  }
  after.y_sigma = before.y_sigma;
  return {fmt::format("Residual of {} over time, all other effects in the model", s.name()),
          "time / s",
          "deg/s",
          false,
          false,
          {before, after, shape}};
}

// Amplitude of the best sine at frequencies around the line.
Curve amplitude_curve(const EvenSeries& series, double centre_hz, double seconds,
                      std::string label) {
  Curve curve;
  curve.label = std::move(label);
  const double step_hz = 1.0 / (kLinePerPeriod * seconds);
  for (int k = -kLineReach * kLinePerPeriod; k <= kLineReach * kLinePerPeriod; ++k) {
    const double frequency_hz = centre_hz + k * step_hz;
    if (frequency_hz < 0.5 / seconds) continue;
    const std::complex<double> turn =
        std::polar(1.0, 2.0 * std::numbers::pi * frequency_hz * series.interval_s);
    std::complex<double> phase = 1.0;
    std::complex<double> sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < series.value.size(); ++i) {
      sum += series.value[i] * phase;
      count += series.present[i];
      phase *= turn;
    }
    curve.x.push_back(frequency_hz);
    curve.y.push_back(2.0 * std::abs(sum) / std::max(count, 1.0));
  }
  return curve;
}

Figure line_figure(const Subject& s) {
  Figure figure{fmt::format("Sines in the residual of {} around {:.6g} Hz", s.name(), s.p()[0]),
                "frequency / Hz",
                "amplitude / (deg/s)",
                false,
                false,
                {}};
  const double seconds = s.study.recording().seconds;
  const auto add = [&](const Eigen::VectorXd& residual, std::string label) {
    EvenSeries series = even_series(s.problem, s.gyro(), Sight::kBoth, residual);
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < series.value.size(); ++i) {
      sum += series.value[i];
      count += series.present[i];
    }
    for (std::size_t i = 0; i < series.value.size(); ++i) {
      if (series.present[i] != 0) series.value[i] -= sum / count;
    }
    figure.curves.push_back(amplitude_curve(series, s.p()[0], seconds, std::move(label)));
  };
  add(s.without, "before: without it");
  add(s.with, "after: with it");
  return figure;
}

Figure noise_figure(const Subject& s, const PairNoise& without) {
  const Sight sight = main_sight(s.problem, s.gyro());
  const EvenSeries series = even_series(s.problem, s.gyro(), sight, s.with);
  Figure figure{
      fmt::format("Allan deviation of {}, measured and as the model says",
                  sight == Sight::kDifference ? "the difference of the two gyros" : s.name()),
      "averaging time / s",
      "deg/s",
      true,
      true,
      {}};
  Curve measured = allan_curve(series, "measured");
  measured.points = true;
  const auto model_curve = [&](const PairNoise& noise, std::string label) {
    Curve curve;
    curve.label = std::move(label);
    curve.x = measured.x;
    for (const double tau_s : measured.x) {
      double variance = s.problem.layout.reference_variance * series.interval_s / tau_s;
      for (std::size_t k = 0; k < 2; ++k) {
        if (!s.problem.holds[k] || (sight == Sight::kOwn && k != s.gyro())) continue;
        const double deviation = allan_deviation(noise[k], s.problem.layout.interval_s[k],
                                                 mean_rate_square(s.problem, k), tau_s);
        variance += deviation * deviation;
      }
      curve.y.push_back(std::sqrt(variance));
    }
    // A model without noise has no place on a logarithmic axis.
    if (std::any_of(curve.y.begin(), curve.y.end(), [](double y) { return y <= 0.0; }))
      curve.x.clear(), curve.y.clear();
    return curve;
  };
  figure.curves = {measured, model_curve(without, "before: model without it"),
                   model_curve(s.noise, "after: model with it")};
  return figure;
}

// ", 63 standard errors"
std::string errors_text(const Subject& s, std::size_t parameter) {
  const double sigma = s.named.sigma[parameter];
  if (!(sigma > 0.0)) return "";
  return fmt::format(", {:.0f} standard errors", std::abs(s.p()[parameter]) / sigma);
}

std::string evidence_of(const Subject& s) {
  const std::string& a = s.name();
  const model::Parameters& p = s.p();
  const auto first = [&](const std::string& text) { return text + errors_text(s, 0); };
  switch (s.named.effect.kind) {
    case Kind::kBias:
      return first(fmt::format("{} reads {:+.3g} deg/s beside the truth all the time", a, p[0]));
    case Kind::kBiasRamp:
      return first(
          fmt::format("the residual of {} climbs by {:+.3g} deg/s every second, {:+.3g} "
                      "deg/s over the recording",
                      a, p[0], p[0] * s.study.recording().seconds));
    case Kind::kBiasStep:
      return first(
          fmt::format("the residual of {} jumps by {:+.3g} deg/s at {:.1f} s", a, p[0], p[1]));
    case Kind::kWarmUp:
      return first(
          fmt::format("the residual of {} starts {:+.3g} deg/s off and dies away within {:.4g} s",
                      a, p[0], p[1]));
    case Kind::kTemperatureBias:
      return first(
          fmt::format("the residual of {} follows its temperature: {:+.3g} deg/s per K", a, p[0]));
    case Kind::kTemperatureBiasQuadratic:
      return first(
          fmt::format("the residual of {} follows the square of its temperature less "
                      "{:.4g} °C: {:+.3g} deg/s per K²",
                      a, p[1], p[0]));
    case Kind::kTemperatureRateBias:
      return first(fmt::format(
          "the residual of {} follows the change of its temperature: {:+.3g} deg/s per K/s", a,
          p[0]));
    case Kind::kScaleFactor:
      return first(fmt::format("the residual of {} follows the rate: {:+.3g} of it", a, p[0]));
    case Kind::kScaleFactorAsymmetry:
      return first(fmt::format(
          "the residual of {} follows the rate whatever its sign: {:+.3g} of |rate|", a, p[0]));
    case Kind::kScaleFactorQuadratic:
      return first(fmt::format(
          "the residual of {} follows the square of the rate: {:+.3g} deg/s per (deg/s)²", a,
          p[0]));
    case Kind::kScaleFactorCubic:
      return first(fmt::format(
          "the residual of {} follows the cube of the rate: {:+.3g} deg/s per (deg/s)³", a, p[0]));
    case Kind::kScaleFactorTemperature:
      return first(
          fmt::format("the residual of {} follows the rate the more, the further its "
                      "temperature is from {:.4g} °C: {:+.3g} of the rate per K",
                      a, p[1], p[0]));
    case Kind::kGSensitivity:
      return fmt::format(
          "the residual of {} follows the acceleration along {}: {:+.3g} deg/s per "
          "g{}",
          a, "xyz"[static_cast<std::size_t>(p[0])], p[1], errors_text(s, 1));
    case Kind::kVibrationRectification:
      return first(fmt::format(
          "the residual of {} follows the vibration: {:+.3g} deg/s per g² of variance", a, p[0]));
    case Kind::kDelay:
      return first(
          fmt::format("the residual of {} follows the slope of the rate: it comes {:+.3g} ms late",
                      a, 1e3 * p[0]));
    case Kind::kBandwidth:
      return fmt::format(
          "the residual of {} grows with the frequency of the motion as behind a "
          "low-pass of {:.4g} Hz",
          a, p[0]);
    case Kind::kClockSkew:
      return first(fmt::format("the lag of {} grows by {:+.3g} µs every second", a, p[0]));
    case Kind::kAngleHarmonic:
      return fmt::format("the residual of {} repeats {:.0f} times a turn, by {:.3g} deg/s{}", a,
                         p[0], std::abs(p[1]), errors_text(s, 1));
    case Kind::kLine:
      return fmt::format("the residual of {} holds a sine of {:.6g} Hz and {:.3g} deg/s{}", a, p[0],
                         std::abs(p[1]), errors_text(s, 1));
    case Kind::kWhiteNoise:
      return fmt::format(
          "{} scatters from sample to sample by {:.3g} deg/s/√Hz more than the "
          "model says",
          a, p[0]);
    case Kind::kRateNoise:
      return fmt::format("{} scatters the more, the faster it turns: {:.3g} of the rate, per √Hz",
                         a, p[0]);
    case Kind::kRateRandomWalk:
      return fmt::format(
          "{} wanders as a random walk of {:.3g} deg/s/√s beyond what the model says", a, p[0]);
    case Kind::kGaussMarkov:
      return fmt::format(
          "{} wanders by {:.3g} deg/s and forgets it within {:.4g} s, beyond what the model says",
          a, p[0], p[1]);
    default:
      return fmt::format("{} shows {}", a, model::info(s.named.effect.kind).name);
  }
}

Figure figure_of(const Subject& s, const PairNoise& noise_without) {
  switch (s.named.effect.kind) {
    case Kind::kBias:
    case Kind::kBiasRamp:
    case Kind::kBiasStep:
    case Kind::kWarmUp:
      return time_figure(s);
    case Kind::kLine:
      return line_figure(s);
    default:
      return is_noise(s.named.effect.kind) ? noise_figure(s, noise_without) : regressor_figure(s);
  }
}

// Where one noise makes the residual likelier than the other; of what moves within blocks.
Where where_of_noise(const Subject& s, const PairNoise& without) {
  const double seconds = s.study.recording().seconds;
  const double nyquist_hz = 0.5 / s.problem.layout.interval_s[s.gyro()];
  Where where{0.0, seconds, 0.0, nyquist_hz};
  const Kind kind = s.named.effect.kind;
  if (kind == Kind::kRateRandomWalk) where.high_hz = std::min(nyquist_hz, 0.5 / kBlock_s);
  if (kind == Kind::kGaussMarkov)
    where.high_hz = std::min(nyquist_hz, 1.0 / std::max(s.p()[1], 1e-6));
  if (kind != Kind::kRateNoise) return where;
  std::vector<double> gains(s.problem.layout.blocks.size(), 0.0);
  for (std::size_t b = 0; b < gains.size(); ++b) {
    const Block& block = s.problem.layout.blocks[b];
    const auto values = s.with.segment(block.first, block.count);
    const double squares = (values.array() - values.mean()).square().sum();
    const double now = within_variance(block, s.noise, s.problem.layout);
    const double then = within_variance(block, without, s.problem.layout);
    const double freedom = static_cast<double>(block.count - 1);
    gains[b] = 0.5 * (freedom * std::log(then / now) + squares / then - squares / now);
  }
  const Where place = where_of(s.problem, s.gyro(), s.noise, seconds, gains, s.with);
  where.from_s = place.from_s;
  where.to_s = place.to_s;
  return where;
}

}  // namespace

void describe_effects(const Study& study, const std::vector<Effect>& before, Result& result) {
  std::vector<Effect> all = before;
  for (const NamedEffect& named : result.effects)
    all.push_back(named.effect);
  for (std::size_t i = 0; i < result.effects.size(); ++i) {
    NamedEffect& named = result.effects[i];
    if (!named.evidence.empty()) continue;
    std::vector<Effect> others = all;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(before.size() + i));
    const Problem& problem = study.problems()[study.problem_of(named.effect.gyro)];
    Subject subject{study, problem, named, {}, {}, {}};
    subject.with = study.residual(problem, all);
    subject.without = study.residual(problem, others);
    subject.noise = usable_noise(problem, all, subject.with);
    const PairNoise noise_without = noise_of(others);
    if (is_noise(named.effect.kind)) {
      named.where = where_of_noise(subject, noise_without);
    } else {
      const std::vector<double> gains =
          block_gains(problem.layout, subject.noise, subject.without, subject.with);
      named.where = where_of(problem, named.effect.gyro, subject.noise, study.recording().seconds,
                             gains, subject.without - subject.with);
      // A step begins at the step.
      if (named.effect.kind == Kind::kBiasStep) {
        named.where.from_s = named.effect.parameters[1];
        named.where.to_s = std::max(named.where.to_s, named.where.from_s);
      }
    }
    named.figure = figure_of(subject, noise_without);
    named.evidence = evidence_of(subject);
  }
}

}  // namespace vgyro::gap
