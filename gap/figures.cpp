#include "gap/figures.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "gap/views.h"

namespace vgyro::gap {

namespace {

using model::Effect;

constexpr double kTimePoints = 700.0;

// One residual as it is drawn.
struct Shown {
  std::string label;
  Eigen::VectorXd values;
};

Curve time_curve(const Observations& data, std::size_t gyro, Sight sight, const Shown& shown,
                 double step_s, std::string label) {
  Curve curve;
  curve.label = std::move(label);
  std::vector<double> sum;
  std::vector<double> time;
  std::vector<double> count;
  for (std::size_t i = 0; i < data.t_s.size(); ++i) {
    const double weight = weight_of(data.channel[i], gyro, sight);
    if (weight == 0.0) continue;
    const auto cell = static_cast<std::size_t>(std::max(0.0, data.t_s[i]) / step_s);
    if (cell >= sum.size()) {
      sum.resize(cell + 1, 0.0);
      time.resize(cell + 1, 0.0);
      count.resize(cell + 1, 0.0);
    }
    sum[cell] += weight * shown.values[static_cast<Eigen::Index>(i)];
    time[cell] += data.t_s[i];
    count[cell] += 1.0;
  }
  for (std::size_t cell = 0; cell < sum.size(); ++cell) {
    if (count[cell] == 0.0) continue;
    curve.x.push_back(time[cell] / count[cell]);
    curve.y.push_back(sum[cell] / count[cell]);
  }
  return curve;
}

// Two standard deviations of such a mean, when the model is right: its drift and its white noise.
std::array<Curve, 2> time_band(const Observations& data, std::size_t gyro, Sight sight,
                               const PairNoise& noise, double step_s) {
  std::array<Curve, 2> band;
  band[0].label = "+2σ of simulations";
  band[1].label = "-2σ of simulations";
  double t_s = 0.0;
  double white = 0.0;
  double count = 0.0;
  double cell = -1.0;
  const auto add = [&] {
    if (count == 0.0) return;
    t_s /= count;
    double variance = white / (count * count);
    for (std::size_t k = 0; k < 2; ++k) {
      if (!data.holds[k] || (sight == Sight::kOwn && k != gyro)) continue;
      variance += noise[k].walk_dps_rts * noise[k].walk_dps_rts * t_s;
      noise[k].each_correlated(
          [&](const MarkovTerm& term) { variance += term.sigma_dps * term.sigma_dps; });
    }
    band[0].x.push_back(t_s);
    band[0].y.push_back(2.0 * std::sqrt(variance));
    band[1].x.push_back(t_s);
    band[1].y.push_back(-2.0 * std::sqrt(variance));
    t_s = white = count = 0.0;
  };
  for (const Block& block : data.layout.blocks) {
    if (weight_of(block.channel, gyro, sight) == 0.0) continue;
    const double its_cell = std::floor(std::max(0.0, block.t_s) / step_s);
    if (its_cell != cell) add();
    cell = its_cell;
    t_s += block.count * block.t_s;
    white += block.count * block.count * mean_variance(block, noise, data.layout);
    count += block.count;
  }
  add();
  return band;
}

Figure time_figure(const Observations& data, std::size_t gyro, const std::vector<Shown>& shown,
                   const PairNoise& noise, double seconds) {
  const double step_s = std::max(1.0, seconds / kTimePoints);
  Figure figure;
  figure.title = fmt::format("Measured less predicted, means of {:.2g} s", step_s);
  figure.x_label = "time / s";
  figure.y_label = "deg/s";
  const Sight main = main_sight(data, gyro);
  for (const Sight sight : {Sight::kOwn, Sight::kDifference}) {
    for (const Shown& one : shown) {
      const std::string label = sight == Sight::kDifference
                                    ? one.label + ", difference of the two gyros"
                                : data.holds[1 - gyro] ? one.label + ", at rest"
                                                       : one.label;
      Curve curve = time_curve(data, gyro, sight, one, step_s, label);
      // A line would bridge what belongs to the other sight.
      curve.points = data.holds[1 - gyro];
      if (!curve.x.empty()) figure.curves.push_back(std::move(curve));
    }
  }
  for (Curve& curve : time_band(data, gyro, main, noise, step_s))
    figure.curves.push_back(std::move(curve));
  return figure;
}

}  // namespace

std::array<GyroFigures, 2> gyro_figures(const Study& study, const std::vector<Effect>& before,
                                        const std::vector<Effect>& after, std::uint64_t seed) {
  std::array<GyroFigures, 2> figures;
  const bool same = before.size() == after.size();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Observations& data = study.observations_of(gyro);
    std::vector<Shown> shown;
    shown.push_back({same ? "measured less predicted" : "before", data.residual(before)});
    if (!same) shown.push_back({"after", data.residual(after)});
    const PairNoise noise = noise_of(after);
    const Shown simulated{"simulated", simulate_residual(data, noise, seed + gyro)};
    GyroFigures& mine = figures[gyro];
    mine.time = time_figure(data, gyro, shown, noise, study.recording().seconds);
    shown.push_back(simulated);
    const Sight sight = main_sight(data, gyro);
    const std::string of = sight == Sight::kDifference ? " of the difference of the two gyros"
                           : data.holds[1 - gyro]      ? " at rest"
                                                       : "";
    mine.spectrum = {fmt::format("Residual{} over frequency; white noise lies at its density", of),
                     "frequency / Hz",
                     "deg/s/√Hz",
                     true,
                     true,
                     {}};
    mine.allan = {fmt::format("Allan deviation of the residual{}", of),
                  "averaging time / s",
                  "deg/s",
                  true,
                  true,
                  {}};
    for (const Shown& one : shown) {
      const EvenSeries series = even_series(data, gyro, sight, one.values);
      mine.spectrum.curves.push_back(spectrum_curve(series, one.label));
      mine.allan.curves.push_back(allan_curve(series, one.label));
    }
  }
  return figures;
}

}  // namespace vgyro::gap
