#include "cli/replay/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cli/output/gnuplot.h"
#include "cli/replay/course.h"

namespace vgyro::cli {

namespace {

constexpr double kSecondsPerHour = 3600.0;
constexpr double kSecondsPerMinute = 60.0;
// A drift beyond this is shown in deg/s, because in deg/h it would have too many digits to read.
constexpr double kReadableInDegPerHour_dps = 0.3;
// In gnuplot's table: the line goes on past a missing value, and is interrupted at one that is no
// number.
constexpr const char* kMissing = "-";
// Okabe and Ito's colours, which the colour-blind can distinguish. None has two meanings.
constexpr std::array<const char*, 2> kColours{"#e69f00", "#cc79a7"};
constexpr const char* kMeanColour = "#808080";
constexpr const char* kVirtualColour = "#0072b2";
constexpr const char* kVirtualBand = "#b3d5ea";
constexpr const char* kDriftColour = "#000000";
constexpr const char* kDriftBand = "#c8c8c8";

// In the order of Course::Shade.
constexpr std::array<unsigned, Course::kShades> kShadeColours{
    0xf0e442, 0x009e73, 0xd55e00, 0x882255, 0x56b4e9, 0x000000, 0x000000, 0x332288};
constexpr double kTint = 0.2;         // share of a shade's colour; the rest is paper
constexpr double kBlackTint = 0.09;   // less, because black looks heavier
constexpr double kShortest = 0.0015;  // share of the picture; shorter stretches could not be seen

// Sizes in pixels.
constexpr int kWidth = 1200;
constexpr int kTitle = 46;
constexpr int kLegend = 78;    // above each panel: its caption and, below that, the legend
constexpr int kNoLegend = 36;  // without a legend
constexpr int kHeading = 56;   // of these, from the panel to its caption
constexpr int kFoot = 62;      // the axis of time
constexpr int kLane = 22;
constexpr int kLeft = 190;
constexpr int kRight = 30;

std::string tint(unsigned colour) {
  constexpr double kPaper = 255.0;
  const double weight = colour == 0 ? kBlackTint : kTint;
  unsigned mixed = 0;
  for (const unsigned shift : {16U, 8U, 0U}) {
    const double part = (1.0 - weight) * kPaper + weight * ((colour >> shift) & 0xffU);
    mixed |= static_cast<unsigned>(std::lround(part)) << shift;
  }
  return fmt::format("#{:06x}", mixed);
}

bool is_inside_character(const std::string& text, std::size_t at) {
  return (static_cast<unsigned char>(text[at]) & 0xC0U) == 0x80U;
}

// Keeps both ends of a long name, because names on one platform often begin alike.
std::string shortened(const std::string& name, std::size_t most) {
  if (name.size() <= most) return name;
  std::size_t head = most / 2 - 1;
  while (head > 0 && is_inside_character(name, head))
    --head;
  std::size_t tail = name.size() - most / 2;
  while (tail < name.size() && is_inside_character(name, tail))
    ++tail;
  return name.substr(0, head) + "…" + name.substr(std::min(tail, name.size()));
}

// A legend of long names would take three rows, and its panel has room for two.
std::string legend_name(const std::string& name) {
  constexpr std::size_t kMost = 20;
  return "gyro " + shortened(name, kMost);
}

// Cuts a name to the room left of a lane. The summary has all faults of a gyro.
std::string lane_name(const std::string& shade_name) {
  constexpr std::size_t kMost = 26;
  if (shade_name.size() <= kMost) return shade_name;
  std::size_t end = kMost - 1;
  while (end > 0 && is_inside_character(shade_name, end))
    --end;
  return shade_name.substr(0, end) + "…";
}

// Fewer decimals for larger values.
std::string degrees(double value_deg) {
  const double size = std::abs(value_deg);
  const int digits = size >= 100.0 ? 0 : size >= 10.0 ? 1 : size >= 1.0 ? 2 : 3;
  return fmt::format("{:+.{}f}°", value_deg, digits);
}

std::string text_of(const Course::Mean& mean, double scale) {
  return mean.count == 0 ? kMissing : fmt::format("{:.9g}", scale * mean.value());
}

class Plot {
 public:
  Plot(const Course& course, const PlotTexts& texts) : course_(course), texts_(texts) {}
  /// Script for gnuplot: the data, then the commands that draw them.
  [[nodiscard]] std::string whole_script(const std::string& path) const;

 private:
  using Bucket = Course::Bucket;
  using Mean = Course::Mean;
  struct Unit {
    const char* name;
    double in_base;  ///< this unit in the base unit, s or deg/s
  };
  /// One plot of the picture, from top to bottom, with its height and the script that draws it.
  struct Panel {
    int height_px;
    std::string caption;
    std::string script;
    bool legend = true;
  };

  void write_data(std::string& to) const;
  void write_known(std::string& to) const;
  [[nodiscard]] double middle_of(std::size_t bucket) const;
  [[nodiscard]] Unit time_unit() const;
  [[nodiscard]] Unit drift_unit() const;
  [[nodiscard]] std::string script(const std::string& path) const;
  [[nodiscard]] std::vector<Panel> panels() const;
  [[nodiscard]] Panel heading_panel() const;
  [[nodiscard]] Panel off_panel() const;
  [[nodiscard]] Panel rate_panel() const;
  [[nodiscard]] Panel drift_panel(std::size_t gyro) const;
  [[nodiscard]] std::string temperature_range() const;
  [[nodiscard]] Panel temperature_panel() const;
  [[nodiscard]] std::string drift_range(std::size_t gyro) const;
  [[nodiscard]] Panel events_panel() const;
  [[nodiscard]] std::array<double, 2> ends(const Course::Stretch& stretch) const;
  [[nodiscard]] std::string shades_script() const;

  const Course& course_;
  const PlotTexts& texts_;
};

void Plot::write_data(std::string& to) const {
  struct Column {
    const Mean& (*mean)(const Bucket&);
    double scale;
  };
  const double drift = 1.0 / drift_unit().in_base;
  const std::array<Column, 17> columns{{
      {[](const Bucket& b) -> const Mean& { return b.raw[0]; }, 1.0},           // 2
      {[](const Bucket& b) -> const Mean& { return b.raw[1]; }, 1.0},           // 3
      {[](const Bucket& b) -> const Mean& { return b.average; }, 1.0},          // 4
      {[](const Bucket& b) -> const Mean& { return b.rate; }, 1.0},             // 5
      {[](const Bucket& b) -> const Mean& { return b.excess[0]; }, drift},      // 6
      {[](const Bucket& b) -> const Mean& { return b.excess[1]; }, drift},      // 7
      {[](const Bucket& b) -> const Mean& { return b.bias[0]; }, drift},        // 8
      {[](const Bucket& b) -> const Mean& { return b.bias[1]; }, drift},        // 9
      {[](const Bucket& b) -> const Mean& { return b.heading[0]; }, 1.0},       // 10
      {[](const Bucket& b) -> const Mean& { return b.heading[1]; }, 1.0},       // 11
      {[](const Bucket& b) -> const Mean& { return b.heading[2]; }, 1.0},       // 12
      {[](const Bucket& b) -> const Mean& { return b.heading[3]; }, 1.0},       // 13
      {[](const Bucket& b) -> const Mean& { return b.heading_sigma; }, 1.0},    // 14
      {[](const Bucket& b) -> const Mean& { return b.bias_sigma[0]; }, drift},  // 15
      {[](const Bucket& b) -> const Mean& { return b.bias_sigma[1]; }, drift},  // 16
      {[](const Bucket& b) -> const Mean& { return b.temperature[0]; }, 1.0},   // 17
      {[](const Bucket& b) -> const Mean& { return b.temperature[1]; }, 1.0},   // 18
  }};
  std::array<std::vector<bool>, 17> broken;
  for (std::size_t k = 0; k < columns.size(); ++k)
    broken[k] = course_.breaks(columns[k].mean);
  put(to, "$rates << EOD\n");
  for (std::size_t i = 0; i < course_.buckets().size(); ++i) {
    std::string row;
    bool empty = true;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const Mean& mean = columns[k].mean(course_.buckets()[i]);
      row += broken[k][i] ? std::string(" NaN") : " " + text_of(mean, columns[k].scale);
      empty = empty && mean.count == 0 && !broken[k][i];
    }
    if (empty) continue;
    put(to, "{:.9g}{}\n", middle_of(i), row);
  }
  put(to, "EOD\n");
}

// Time of a bucket's middle, in the unit of the time axis.
double Plot::middle_of(std::size_t bucket) const {
  return to_seconds(course_.width()) * (static_cast<double>(bucket) + 0.5) / time_unit().in_base;
}

Plot::Unit Plot::time_unit() const {
  constexpr double kMinutesFrom_s = 600.0;
  constexpr double kHoursFrom_s = 3.0 * kSecondsPerHour;
  if (course_.span_s() >= kHoursFrom_s) return {"h", kSecondsPerHour};
  if (course_.span_s() >= kMinutesFrom_s) return {"min", kSecondsPerMinute};
  return {"s", 1.0};
}

Plot::Unit Plot::drift_unit() const {
  if (course_.largest_bias_dps() > kReadableInDegPerHour_dps) return {"deg/s", 1.0};
  return {"deg/h", 1.0 / kSecondsPerHour};
}

Plot::Panel Plot::heading_panel() const {
  std::string text = "plot ";
  if (course_.has([](const Bucket& b) -> const Mean& { return b.heading_sigma; })) {
    put(text, "$rates u 1:($13-$14):($13+$14) w filledcurves lc rgb '{}' t 'virtual gyro ±σ', ",
        kVirtualBand);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    put(text, "$rates u 1:{} w l lw 1.5 lc rgb '{}' t {}, ", 10 + i, kColours[i],
        gnuplot_text(legend_name(texts_.gyro_names[i])));
  }
  put(text, "$rates u 1:12 w l lw 1.5 dt 2 lc rgb '{}' t 'mean'", kMeanColour);
  if (course_.is_valid_begun())
    put(text, ", $rates u 1:13 w l lw 2.5 lc rgb '{}' t 'virtual gyro'", kVirtualColour);
  return {310, "Heading, deg", text + '\n'};
}

// The legend shows the values at the end, which are the result.
Plot::Panel Plot::off_panel() const {
  const std::array<std::string, 3> names{legend_name(texts_.gyro_names[0]),
                                         legend_name(texts_.gyro_names[1]), "mean"};
  std::string text = "plot ";
  const bool sigma = course_.has([](const Bucket& b) -> const Mean& { return b.heading_sigma; });
  if (sigma) {
    put(text, "$rates u 1:(-$14):14 w filledcurves lc rgb '{}' t 'virtual gyro ±{:.2g}°', ",
        kVirtualBand, course_.heading_sigma_deg());
  }
  put(text, "$rates u 1:($13-$13) w l lw 2.5 lc rgb '{}' notitle", kVirtualColour);
  for (std::size_t i = 0; i < names.size(); ++i) {
    put(text, ", $rates u 1:(${}-$13) w l lw 1.5 {} lc rgb '{}' t {}", 10 + i, i == 2 ? "dt 2" : "",
        i == 2 ? kMeanColour : kColours[i],
        gnuplot_text(fmt::format("{} {}", names[i],
                                 degrees(course_.heading_deg(i) - course_.heading_deg(3)))));
  }
  return {220, "Heading off the virtual gyro, deg (in the legend: at the end)", text + '\n'};
}

Plot::Panel Plot::rate_panel() const {
  std::string text = "plot ";
  for (std::size_t i = 0; i < 2; ++i) {
    put(text, "$rates u 1:{} w l lc rgb '{}' t {}, ", 2 + i, kColours[i],
        gnuplot_text(legend_name(texts_.gyro_names[i])));
  }
  put(text, "$rates u 1:4 w l lc rgb '{}' t 'mean'", kMeanColour);
  if (course_.is_valid_begun())
    put(text, ", $rates u 1:5 w l lw 1.5 lc rgb '{}' t 'virtual gyro'", kVirtualColour);
  return {200, "Rate, deg/s", text + '\n'};
}

std::string Plot::drift_range(std::size_t gyro) const {
  const auto [low, high] = course_.drift_range_dps(gyro);
  if (!(high > low)) return "set autoscale y\n";
  const double scale = 1.0 / drift_unit().in_base;
  return fmt::format("set yrange [{:.6g}:{:.6g}]\n", scale * low, scale * high);
}

Plot::Panel Plot::drift_panel(std::size_t gyro) const {
  std::string text = drift_range(gyro);
  // The points are small because there are many; the legend's point is large enough to be seen.
  put(text,
      "plot $rates u 1:{} w p pt 7 ps 0.25 lc rgb '{}' notitle, "
      "NaN w p pt 7 ps 0.8 lc rgb '{}' t 'gyro less the virtual gyro', ",
      6 + gyro, kColours[gyro], kColours[gyro]);
  const bool sigma =
      gyro == 0 ? course_.has([](const Bucket& b) -> const Mean& { return b.bias_sigma[0]; })
                : course_.has([](const Bucket& b) -> const Mean& { return b.bias_sigma[1]; });
  if (sigma) {
    put(text,
        "$known u 1:(${0}-${1}):(${0}+${1}) w filledcurves fs transparent solid 0.7 lc rgb '{2}' "
        "t 'its ±σ', ",
        2 + 2 * gyro, 3 + 2 * gyro, kDriftBand);
  }
  put(text, "$rates u 1:{} w l lw 1.5 lc rgb '{}' t 'drift'\nset autoscale y\n", 8 + gyro,
      kDriftColour);
  return {180, fmt::format("Drift of gyro {}, {}", texts_.gyro_names[gyro], drift_unit().name),
          text};
}

// A constant temperature would leave the plot no height, and gnuplot would complain.
std::string Plot::temperature_range() const {
  constexpr double kAround_k = 1.0;
  double low_c = std::numeric_limits<double>::infinity();
  double high_c = -low_c;
  for (const Bucket& bucket : course_.buckets()) {
    for (const Mean& temperature : bucket.temperature) {
      if (temperature.count == 0) continue;
      low_c = std::min(low_c, temperature.value());
      high_c = std::max(high_c, temperature.value());
    }
  }
  if (high_c > low_c) return {};
  return fmt::format("set yrange [{:.9g}:{:.9g}]\n", low_c - kAround_k, high_c + kAround_k);
}

Plot::Panel Plot::temperature_panel() const {
  const std::array<bool, 2> told{
      course_.has([](const Bucket& b) -> const Mean& { return b.temperature[0]; }),
      course_.has([](const Bucket& b) -> const Mean& { return b.temperature[1]; })};
  if (!told[0] && !told[1]) return {0, {}, {}};
  std::string text = "plot ";
  for (std::size_t i = 0; i < 2; ++i) {
    if (!told[i]) continue;
    put(text, "{}$rates u 1:{} w l lw 1.5 lc rgb '{}' t {}", i == 1 && told[0] ? ", " : "", 17 + i,
        kColours[i], gnuplot_text(legend_name(texts_.gyro_names[i])));
  }
  return {130, "Temperature, °C", temperature_range() + text + "\nset autoscale y\n"};
}

// Begin and end in the unit of the time axis, wide enough to be seen.
std::array<double, 2> Plot::ends(const Course::Stretch& stretch) const {
  const double from = std::max(to_seconds(stretch.from - course_.begin()), 0.0);
  const double to =
      std::max(to_seconds(stretch.to - course_.begin()), from + kShortest * course_.span_s());
  return {from / time_unit().in_base, to / time_unit().in_base};
}

// A lane, with its name, for each shade that occurred; the panels are shaded in the same colours.
Plot::Panel Plot::events_panel() const {
  std::string boxes;
  std::string names;
  int lanes = 0;
  constexpr std::size_t kNameMost = 12;
  const std::array<std::string, 2> short_names{shortened(texts_.gyro_names[0], kNameMost),
                                               shortened(texts_.gyro_names[1], kNameMost)};
  for (std::size_t shade = 0; shade < Course::kShades; ++shade) {
    if (course_.stretches(shade).empty()) continue;
    ++lanes;
    put(names, "{}{} {}", lanes == 1 ? "" : ", ",
        gnuplot_text(lane_name(course_.shade_name(shade, short_names))), -lanes);
    for (const Course::Stretch& stretch : course_.stretches(shade)) {
      put(boxes,
          "set object rectangle from first {:.9g},{} to first {:.9g},{} front fs solid 1 border lc "
          "rgb '#{:06x}' fc rgb '#{:06x}'\n",
          ends(stretch)[0], -lanes - 0.35, ends(stretch)[1], -lanes + 0.35, kShadeColours[shade],
          kShadeColours[shade]);
    }
  }
  if (lanes == 0) return {0, {}, {}};
  return {kLane * lanes, "What went on",
          fmt::format("unset object\n{}set yrange [{}:-0.4]\nset ytics ({}) scale 0 "
                      "noenhanced\nplot NaN notitle\nset autoscale y\nunset "
                      "object\nset ytics autofreq scale 1\n{}",
                      boxes, -lanes - 0.6, names, shades_script()),
          false};
}

// Rectangles over the whole height of every panel, behind the curves.
std::string Plot::shades_script() const {
  std::string text;
  for (std::size_t shade = 0; shade < Course::kShades; ++shade) {
    for (const Course::Stretch& stretch : course_.stretches(shade)) {
      put(text,
          "set object rectangle from first {:.9g},graph 0 to first {:.9g},graph 1 behind fs solid "
          "noborder fc rgb '{}'\n",
          ends(stretch)[0], ends(stretch)[1], tint(kShadeColours[shade]));
    }
  }
  return text;
}

std::vector<Plot::Panel> Plot::panels() const {
  std::vector<Panel> panels{heading_panel()};
  if (course_.is_valid_begun()) panels.push_back(off_panel());
  if (Panel events = events_panel(); events.height_px > 0) panels.push_back(events);
  panels.push_back(rate_panel());
  const bool biases = course_.has([](const Bucket& b) -> const Mean& { return b.bias[0]; }) &&
                      course_.has([](const Bucket& b) -> const Mean& { return b.excess[0]; });
  for (std::size_t gyro = 0; biases && gyro < 2; ++gyro)
    panels.push_back(drift_panel(gyro));
  if (Panel temperature = temperature_panel(); temperature.height_px > 0)
    panels.push_back(temperature);
  return panels;
}

std::string Plot::script(const std::string& path) const {
  const std::vector<Panel> drawn = panels();
  int height = kTitle + kFoot;
  for (const Panel& panel : drawn)
    height += (panel.legend ? kLegend : kNoLegend) + panel.height_px;
  std::string text = fmt::format(
      "{}set multiplot\nset label 1 {} at screen 0.5,{:.6f} center noenhanced font ',15'\n"
      "set grid xtics ytics lt 1 lw 1 lc rgb '#d5d5d5'\n"
      "set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\nset xrange [0:{:.9g}]\n"
      "set datafile missing '-'\nset tics nomirror\nset format x ''\n{}",
      picture_script(path, kWidth, height),
      gnuplot_text(texts_.title + (course_.is_valid_begun() ? "" : ": no valid virtual rate")),
      1.0 - 0.5 * kTitle / height, static_cast<double>(kLeft) / kWidth,
      1.0 - static_cast<double>(kRight) / kWidth, course_.span_s() / time_unit().in_base,
      shades_script());
  int above = kTitle;
  const auto from_top = [&](int pixels) { return 1.0 - static_cast<double>(pixels) / height; };
  for (const Panel& panel : drawn) {
    above += panel.legend ? kLegend : kNoLegend;
    if (&panel == &drawn.back())
      put(text, "set format x '%g'\nset xlabel 'time, {}'\n", time_unit().name);
    put(text,
        "set label 2 {} at screen {:.6f},{:.6f} left noenhanced font ',12'\n"
        "set key at screen {:.6f},{:.6f} left bottom horizontal Left reverse noenhanced samplen 3 "
        "maxrows 1\n"
        "set tmargin at screen {:.6f}\nset bmargin at screen {:.6f}\n{}unset label 1\n",
        gnuplot_text(panel.caption), static_cast<double>(kLeft) / kWidth,
        from_top(above - (panel.legend ? kHeading : kHeading - (kLegend - kNoLegend))),
        static_cast<double>(kLeft) / kWidth, from_top(above - 6), from_top(above),
        from_top(above + panel.height_px), panel.script);
    above += panel.height_px;
  }
  return text + "unset multiplot\n";
}

// Table of the known drifts. It is separate because σ comes less often than the drift.
void Plot::write_known(std::string& to) const {
  const double scale = 1.0 / drift_unit().in_base;
  put(to, "$known << EOD\n");
  for (std::size_t i = 0; i < course_.buckets().size(); ++i) {
    const Bucket& b = course_.buckets()[i];
    if (b.bias_sigma[0].count == 0 || b.bias[0].count == 0) continue;
    put(to, "{:.9g} {} {} {} {}\n", middle_of(i), text_of(b.bias[0], scale),
        text_of(b.bias_sigma[0], scale), text_of(b.bias[1], scale),
        text_of(b.bias_sigma[1], scale));
  }
  put(to, "EOD\n");
}

std::string Plot::whole_script(const std::string& path) const {
  std::string whole;
  write_data(whole);
  write_known(whole);
  return whole + script(path);
}

}  // namespace

Expected<void> draw_plot(const Course& course, const std::string& path, const PlotTexts& texts) {
  if (course.empty()) {
    return fail(path, "there is nothing to draw: no pair of samples was formed");
  }
  return run_gnuplot(path, Plot(course, texts).whole_script(path));
}

}  // namespace vgyro::cli
