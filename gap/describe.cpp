#include "gap/describe.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <numbers>

#include <fmt/core.h>

#include "gap/evidence.h"
#include "gap/kinds.h"
#include "gap/views.h"
#include "model/catalogue.h"
#include "model/temperature_past.h"

namespace vgyro::gap {

namespace {

using model::Effect;

constexpr std::size_t kTimeBins = 60;
constexpr int kLineReach = 20;     ///< periods of the recording to both sides
constexpr int kLinePerPeriod = 4;  ///< points
// Below any sample's time.
constexpr double kMemoryMin_s = 1e-6;

// All that a description of one effect is made from.
struct Subject {
  const Study& study;
  const Observations& data;
  const NamedEffect& named;

  PairNoise noise;
  Eigen::VectorXd without;  ///< residual when all others are in the model
  Eigen::VectorXd with;     ///< and this one, too

  [[nodiscard]] std::size_t gyro() const { return named.effect.gyro; }
  [[nodiscard]] const std::string& name() const { return study.recording().gyros[gyro()].name; }
  [[nodiscard]] const model::Parameters& p() const { return named.effect.parameters; }
};

// What the error of such a kind is a function of.
struct Against {
  std::string what;
  std::string x_label;
  std::vector<double> x;     ///< at each sample
  std::vector<double> unit;  ///< a bin's value is times of this; empty: 1
  std::string y_label = "deg/s";
  double scale = 1.0;  ///< of the value, for its label
};

/// One sample, as an axis sees it.
struct Seen {
  double t_s = 0.0;
  const SampledCurve::Point& rate;
  const model::Surroundings& around;
  const model::Parameters& p;
};

double turn_deg(const Seen& s) {
  const double turns = s.around.angle_rad / (2.0 * std::numbers::pi);
  return 360.0 * (turns - std::floor(turns));
}

/// {axis} and {reference} stand for the effect's own.
struct AxisRow {
  Axis axis;
  std::string_view what;
  std::string_view x_label;
  double (*x)(const Seen& s);
};
constexpr AxisRow kAxes[] = {
    {Axis::kRate, "the rate", "rate / (deg/s)", [](const Seen& s) { return s.rate.value; }},
    {Axis::kTemperature, "the temperature", "temperature / °C",
     [](const Seen& s) { return s.around.temperature_c; }},
    {Axis::kTemperatureSlope, "the change of temperature", "change of temperature / (K/s)",
     [](const Seen& s) { return s.around.temperature_slope_c_s; }},
    {Axis::kTemperatureLag, "how far the temperature with play stays behind",
     "temperature with play less temperature / K",
     [](const Seen& s) {
       const model::TemperaturePast* const past = s.around.temperature_past;
       return past == nullptr
                  ? model::Surroundings::kUnknown
                  : past->followed_c(s.p[1], s.around.temperature_c) - s.around.temperature_c;
     }},
    {Axis::kRateTimesTemperature, "the rate times the temperature",
     "(temperature - {reference:.4g} °C) · rate / (K deg/s)",
     [](const Seen& s) { return (s.around.temperature_c - s.p[1]) * s.rate.value; }},
    {Axis::kAcceleration, "the acceleration along {axis}", "acceleration along {axis} / g",
     [](const Seen& s) { return s.around.acceleration_g[static_cast<std::size_t>(s.p[0])]; }},
    {Axis::kVibration, "the vibration", "variance of the acceleration / g²",
     [](const Seen& s) { return s.around.vibration_g2; }},
    {Axis::kSupply, "the supply voltage", "supply voltage / V",
     [](const Seen& s) { return s.around.supply_v; }},
    {Axis::kOtherRate, "the rate about {axis}", "rate about {axis} / (deg/s)",
     [](const Seen& s) { return s.around.other_rate_dps[static_cast<std::size_t>(s.p[0])]; }},
    {Axis::kRateSlope, "the slope of the rate", "slope of the rate / (deg/s²)",
     [](const Seen& s) { return s.rate.slope; }},
    {Axis::kGrowingLag, "time, as a lag that grows", "time / s",
     [](const Seen& s) { return s.t_s; }},
    {Axis::kAngle, "the angle", "angle within a turn / deg", turn_deg},
};
// Of every instant but for these three, which have figures of their own.
constexpr bool is_of_instants(Axis axis) {
  return axis != Axis::kTime && axis != Axis::kFrequency && axis != Axis::kAveraging;
}
constexpr bool axes_in_order() {
  for (std::size_t i = 0; i < std::size(kAxes); ++i) {
    if (static_cast<std::size_t>(kAxes[i].axis) != i) return false;
  }
  return is_of_instants(kAxes[std::size(kAxes) - 1].axis) &&
         !is_of_instants(static_cast<Axis>(std::size(kAxes)));
}
static_assert(axes_in_order());
constexpr double kMsPerS = 1e3;

Against against_of(const Subject& s) {
  const KindRow& kind = row(s.named.effect.kind);
  assert(is_of_instants(kind.axis));
  const AxisRow& axis = kAxes[static_cast<std::size_t>(*kind.axis)];
  const auto text = [&](std::string_view form) {
    const char letter = kind.by_axis ? "xyz"[static_cast<std::size_t>(s.p()[0])] : '?';
    return fmt::format(fmt::runtime(form), fmt::arg("axis", letter),
                       fmt::arg("reference", s.p()[1]));
  };
  Against against{text(axis.what), text(axis.x_label), {}, {}};
  const std::size_t gyro = s.gyro();
  for (std::size_t i = 0; i < s.data.t_s.size(); ++i) {
    against.x.push_back(
        axis.x({s.data.t_s[i], s.data.rate[gyro][i], s.data.surroundings[gyro][i], s.p()}));
  }
  if (kind.axis != Axis::kGrowingLag) return against;
  for (const SampledCurve::Point& rate : s.data.rate[gyro])
    against.unit.push_back(-rate.slope);
  against.y_label = "lag / ms";
  against.scale = kMsPerS;
  return against;
}

void scale_by(std::vector<double>& values, double factor) {
  for (double& value : values)
    value *= factor;
}

Figure regressor_figure(const Subject& s) {
  const Against against = against_of(s);
  const Eigen::VectorXd shape = s.without - s.with;
  Bins bins =
      binned(s.data, s.gyro(), s.noise, {&s.without, &s.with, &shape}, against.x, against.unit);
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
  for (const Block& block : s.data.layout.blocks) {
    const double share = share_of(block.channel, s.gyro());
    if (share == 0.0) continue;
    const auto bin =
        std::min(kTimeBins - 1, static_cast<std::size_t>(std::max(0.0, block.t_s) / step_s));
    count[bin] += block.count;
    time[bin] += block.count * block.t_s;
    variance[bin] += block.count * block.count * mean_variance(block, s.noise, s.data.layout);
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
    EvenSeries series = even_series(s.data, s.gyro(), Sight::kBoth, residual);
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
  const Sight sight = main_sight(s.data, s.gyro());
  const EvenSeries series = even_series(s.data, s.gyro(), sight, s.with);
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
      double variance = s.data.layout.reference_variance * series.interval_s / tau_s;
      for (std::size_t k = 0; k < 2; ++k) {
        if (!s.data.holds[k] || (sight == Sight::kOwn && k != s.gyro())) continue;
        const double deviation = allan_deviation(noise[k], s.data.layout.interval_s[k],
                                                 mean_rate_square(s.data, k), tau_s);
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

Figure figure_of(const Subject& s, const PairNoise& noise_without) {
  switch (row(s.named.effect.kind).axis) {
    case Axis::kTime:
      return time_figure(s);
    case Axis::kFrequency:
      return line_figure(s);
    case Axis::kAveraging:
      return noise_figure(s, noise_without);
    default:
      return regressor_figure(s);
  }
}

// Where one noise makes the residual likelier than the other; of what moves within blocks.
Where where_of_noise(const Subject& s, const PairNoise& without) {
  const double seconds = s.study.recording().seconds;
  const double nyquist_hz = 0.5 / s.data.layout.interval_s[s.gyro()];
  Where where{0.0, seconds, 0.0, nyquist_hz};
  const Random part = row(s.named.effect.kind).random;
  if (part == Random::kWalk || part == Random::kFlicker)
    where.high_hz = std::min(nyquist_hz, 0.5 / kBlock_s);
  if (part == Random::kMarkov)
    where.high_hz = std::min(nyquist_hz, 1.0 / std::max(s.p()[1], kMemoryMin_s));
  if (part != Random::kRatio) return where;
  std::vector<double> gains(s.data.layout.blocks.size(), 0.0);
  for (std::size_t b = 0; b < gains.size(); ++b) {
    const Block& block = s.data.layout.blocks[b];
    const auto values = s.with.segment(block.first, block.count);
    const double squares = (values.array() - values.mean()).square().sum();
    const double now = within_variance(block, s.noise, s.data.layout);
    const double then = within_variance(block, without, s.data.layout);
    const double freedom = static_cast<double>(block.count - 1);
    gains[b] = 0.5 * (freedom * std::log(then / now) + squares / then - squares / now);
  }
  const Where place = where_of(s.data, s.gyro(), s.noise, seconds, gains, s.with);
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
    const Observations& data = study.observations_of(named.effect.gyro);
    Subject subject{study, data, named, {}, {}, {}};
    subject.with = data.residual(all);
    subject.without = data.residual(others);
    subject.noise = usable_noise(data, all, subject.with);
    const PairNoise noise_without = noise_of(others);
    if (row(named.effect.kind).axis == Axis::kAveraging) {
      named.where = where_of_noise(subject, noise_without);
    } else {
      const std::vector<double> gains =
          block_gains(data.layout, subject.noise, subject.without, subject.with);
      named.where = where_of(data, named.effect.gyro, subject.noise, study.recording().seconds,
                             gains, subject.without - subject.with);
      // A step begins at the step.
      if (row(named.effect.kind).finder == Finder::kStep) {
        named.where.from_s = named.effect.parameters[1];
        named.where.to_s = std::max(named.where.to_s, named.where.from_s);
      }
    }
    named.figure = figure_of(subject, noise_without);
    named.evidence =
        evidence_text(named.effect, named.sigma, subject.name(), study.recording().seconds);
  }
}

}  // namespace vgyro::gap
