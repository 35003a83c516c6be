#include "cli/allan/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "cli/output/gnuplot.h"

namespace vgyro::cli {

namespace {

using analysis::NoiseFit;
using analysis::NoiseKind;
using analysis::SeriesNoise;

constexpr double kSecondsPerHour = 3600.0;
constexpr int kModelPoints = 121;
constexpr std::array<const char*, 3> kColours{"#c8781e", "#2f78b4", "#4a4a4a"};
constexpr std::array<const char*, 3> kBarColours{"#e6bd8e", "#9cc3e0", "#b0b0b0"};

struct PartOfModel {
  NoiseKind kind;
  const char* colour;
};
constexpr std::array<PartOfModel, 4> kParts{{{NoiseKind::kWhite, "#3f9b5a"},
                                             {NoiseKind::kFlicker, "#8e5bb0"},
                                             {NoiseKind::kWalk, "#c0392b"},
                                             {NoiseKind::kQuantisation, "#8a8a3a"}}};

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  void add(double value) {
    if (!(value > 0.0)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] bool empty() const { return high <= 0.0; }
};

std::array<const SeriesNoise*, 3> series_of(const AllanReport& report) {
  return {&report.noise.gyros[0], &report.noise.gyros[1], &report.noise.difference};
}

class Picture {
 public:
  explicit Picture(const AllanReport& report) : report_(report), series_(series_of(report)) {
    names_ = {"gyro " + report.gyro_names[0], "gyro " + report.gyro_names[1], "difference"};
    for (const SeriesNoise* noise : series_) {
      for (const analysis::AllanPoint& point : noise->allan) {
        tau_s_.add(point.tau_s);
        deviation_.add(kSecondsPerHour * point.deviation_dps);
      }
    }
    tau_s_.low *= 0.7;
    tau_s_.high *= 1.6;
    deviation_.low *= 0.35;
    deviation_.high *= 2.5;
  }

  [[nodiscard]] bool empty() const { return deviation_.empty(); }

  void write(std::string& to, const std::string& path) const {
    for (std::size_t i = 0; i < 3; ++i)
      write_data(to, i);
    put(to,
        "{}set multiplot layout 2,2 title {} noenhanced font ',16'\n"
        "set logscale xy\nset grid xtics ytics mxtics mytics lc rgb '#cccccc' lw 0.6, lc rgb "
        "'#eeeeee' lw 0.4\nset border lc rgb '#888888'\nset tics tc rgb '#333333'\n"
        "set format '10^{{%T}}'\nset xrange [{:.6g}:{:.6g}]\nset yrange [{:.6g}:{:.6g}]\n"
        "set lmargin 10\nset rmargin 2\nset bars 0.4\n"
        "set xlabel 'averaging time, s'\nset ylabel 'Allan deviation, deg/h'\n",
        picture_script(path, 1300, 1050),
        gnuplot_text("Allan deviation" + (report_.axis.empty() ? "" : " about " + report_.axis) +
                     ": " + std::filesystem::path(report_.log).filename().string()),
        tau_s_.low, tau_s_.high, deviation_.low, deviation_.high);
    overview(to);
    for (std::size_t i = 0; i < 3; ++i)
      panel(to, i);
    put(to, "unset multiplot\n");
  }

 private:
  void write_data(std::string& to, std::size_t i) const {
    put(to, "$curve{} << EOD\n", i);
    for (const analysis::AllanPoint& point : series_[i]->allan) {
      if (!(point.deviation_dps > 0.0)) continue;
      put(to, "{:.7g} {:.7g} {:.7g} {:.7g}\n", point.tau_s, kSecondsPerHour * point.deviation_dps,
          kSecondsPerHour * point.low_dps, kSecondsPerHour * point.high_dps);
    }
    put(to, "EOD\n");
    if (!series_[i]->fit) return;
    put(to, "$model{} << EOD\n", i);
    for (int k = 0; k < kModelPoints; ++k) {
      const double share = static_cast<double>(k) / (kModelPoints - 1);
      // The fit is not drawn beyond its own frequency range.
      const double low_s =
          std::max(tau_s_.low,
                   series_[i]->fit->limited ? 0.5 / series_[i]->fit->frequency_max_hz : tau_s_.low);
      const double tau_s = low_s * std::pow(tau_s_.high / low_s, share);
      put(to, "{:.7g} {:.7g}", tau_s, kSecondsPerHour * std::sqrt(whole(i, tau_s)));
      for (const PartOfModel& part : kParts) {
        put(to, " {:.7g}",
            kSecondsPerHour * std::sqrt(series_[i]->fit->variance(part.kind, tau_s)));
      }
      put(to, " {:.7g}\n", kSecondsPerHour * std::sqrt(ramp_variance(i, tau_s)));
    }
    put(to, "EOD\n");
  }

  [[nodiscard]] double ramp_variance(std::size_t i, double tau_s) const {
    const NoiseFit& fit = *series_[i]->fit;
    if (fit.ramp_significance() < analysis::kRampSigmas) return 0.0;
    return 0.5 * fit.ramp_dps_s * fit.ramp_dps_s * tau_s * tau_s;
  }
  [[nodiscard]] double whole(std::size_t i, double tau_s) const {
    return series_[i]->fit->variance(tau_s) + ramp_variance(i, tau_s);
  }

  void overview(std::string& to) const {
    put(to, "set title 'both gyros and their difference'\nset key top center noenhanced\nplot ");
    for (std::size_t i = 0; i < 3; ++i) {
      put(to,
          "{}$curve{} u 1:2:3:4 w yerrorbars pt 7 ps 0.35 lc rgb '{}' notitle, "
          "'' u 1:2 w lp pt 7 ps 0.45 lw 2 lc rgb '{}' t {}",
          i == 0 ? "" : ", ", i, kBarColours[i], kColours[i], gnuplot_text(names_[i]));
    }
    put(to, "\n");
  }

  void panel(std::string& to, std::size_t i) const {
    const SeriesNoise& noise = *series_[i];
    put(to, "set title {} noenhanced tc rgb '{}'\nplot ", gnuplot_text(names_[i]), kColours[i]);
    if (noise.fit) {
      for (std::size_t k = 0; k < kParts.size(); ++k) {
        if (noise.fit->variance(kParts[k].kind, 1.0) <= 0.0) continue;
        put(to, "$model{} u 1:{} w l dt 2 lw 1.5 lc rgb '{}' t {}, ", i, 3 + k, kParts[k].colour,
            gnuplot_text(part_title(*noise.fit, kParts[k])));
      }
      if (ramp_variance(i, 1.0) > 0.0) {
        put(to, "$model{} u 1:7 w l dt 3 lw 1.5 lc rgb '#777777' t {}, ", i,
            gnuplot_text(fmt::format("ramp {:.2g} deg/s²", noise.fit->ramp_dps_s)));
      }
      put(to, "$model{} u 1:2 w l lw 2 lc rgb '{}' t 'fitted model', ", i, kColours[i]);
    }
    put(to, "$curve{} u 1:2:3:4 w yerrorbars pt 7 ps 0.55 lw 1.2 lc rgb '{}' t {}\n", i,
        noise.fit ? "#222222" : kColours[i],
        noise.fit ? "'measured, 95 % bounds'" : "'measured; contains motion'");
  }

  static std::string part_title(const NoiseFit& fit, const PartOfModel& part) {
    switch (part.kind) {
      case NoiseKind::kWhite:
        return fmt::format("N {:.3g} deg/√h", 60.0 * fit.white_dps_rthz.value);
      case NoiseKind::kFlicker:
        return fmt::format("B {:.3g} deg/h", kSecondsPerHour * fit.flicker_dps.value);
      case NoiseKind::kWalk:
        return fmt::format("K {:.3g} deg/s/√s", fit.walk_dps_rts.value);
      case NoiseKind::kQuantisation:
        return fmt::format("Q {:.3g} deg", fit.quantisation_deg.value);
    }
    return {};
  }

  const AllanReport& report_;
  std::array<const SeriesNoise*, 3> series_;
  std::array<std::string, 3> names_;
  Range tau_s_;
  Range deviation_;
};

}  // namespace

Expected<void> draw_allan(const std::string& path, const AllanReport& report) {
  const Picture picture(report);
  if (picture.empty()) return fail(path, "there is nothing to draw: the rates never change");
  std::string script;
  picture.write(script, path);
  return run_gnuplot(path, script);
}

}  // namespace vgyro::cli
