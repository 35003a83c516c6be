#include "cli/replay/plot.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cli/output/gnuplot.h"

namespace vgyro::cli {

namespace {

constexpr double kSecondsPerHour = 3600.0;
// Of the table: gnuplot draws past a value that is missing, and interrupts the line at one that is
// no number.
constexpr const char* kMissing = "-";
// A hole is as long as the one the summary tells, and longer than a slow gyro's usual pace.
constexpr double kHole_s = 0.5;
constexpr double kHoleIntervals = 5.0;
constexpr std::array<const char*, 2> kColours{"#e0a030", "#70a0d0"};

struct ShadeStyle {
  const char* colour;
  const char* legend;
};
constexpr std::array<ShadeStyle, 3> kShadeStyles{
    {{"#d8efd8", "learned as a stop"}, {"#f3d9b8", "refused: turning"}, {"#d9c8ee", "ambiguous"}}};

}  // namespace

void ReplayPlot::Stretches::follow(TimePoint t, bool is_so) {
  if (open_ && t - stretches_.back().to > kHole) open_ = false;
  if (is_so && !open_) stretches_.push_back({t, t});
  if (open_ || is_so) stretches_.back().to = t;
  open_ = is_so;
  if (!is_so && stretches_.size() > kMax) join_nearest();
}

void ReplayPlot::Stretches::join_nearest() {
  std::size_t nearest = 1;
  for (std::size_t i = 1; i < stretches_.size(); ++i) {
    const auto between = [&](std::size_t at) {
      return stretches_[at].from - stretches_[at - 1].to;
    };
    if (between(i) < between(nearest)) nearest = i;
  }
  stretches_[nearest - 1].to = stretches_[nearest].to;
  stretches_.erase(stretches_.begin() + static_cast<std::ptrdiff_t>(nearest));
}

// A stretch that is held for a turn has `turning` without `stopped`.
void ReplayPlot::add_condition(TimePoint t, const fusion::Condition& condition) {
  const auto likely = [&](fusion::Hypothesis which) {
    return condition.probability[static_cast<std::size_t>(which)] > 0.5;
  };
  const bool refused = !condition.stopped && likely(fusion::Hypothesis::kTurning);
  stretches_[static_cast<std::size_t>(Shade::kStop)].follow(t, condition.stopped);
  stretches_[static_cast<std::size_t>(Shade::kRefused)].follow(t, refused);
  stretches_[static_cast<std::size_t>(Shade::kAmbiguous)].follow(t, condition.ambiguous);
}

void ReplayPlot::Mean::add(double value) {
  if (!std::isfinite(value)) return;
  sum += value;
  ++count;
}

void ReplayPlot::Mean::merge(const Mean& other) {
  sum += other.sum;
  count += other.count;
}

std::string ReplayPlot::Mean::text(double scale) const {
  return count == 0 ? kMissing : fmt::format("{:.9g}", scale * sum / static_cast<double>(count));
}

void ReplayPlot::Bucket::merge(const Bucket& other) {
  for (std::size_t i = 0; i < 2; ++i) {
    raw[i].merge(other.raw[i]);
    excess[i].merge(other.excess[i]);
    bias[i].merge(other.bias[i]);
  }
  average.merge(other.average);
  rate.merge(other.rate);
}

ReplayPlot::Bucket& ReplayPlot::bucket_at(TimePoint t) {
  if (!begun_) {
    begun_ = true;
    begin_ = t;
  }
  auto index = static_cast<std::size_t>(std::max<Duration::rep>((t - begin_) / width_, 0));
  while (index >= kBucketsMax) {
    for (std::size_t i = 0; i < buckets_.size(); ++i) {
      if (i % 2 == 1) {
        buckets_[i / 2].merge(buckets_[i]);
      } else {
        buckets_[i / 2] = buckets_[i];
      }
    }
    buckets_.resize((buckets_.size() + 1) / 2);
    width_ *= 2;
    index /= 2;
  }
  if (index >= buckets_.size()) buckets_.resize(index + 1);
  return buckets_[index];
}

void ReplayPlot::add_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) {
  Bucket& bucket = bucket_at(t);
  for (std::size_t i = 0; i < 2; ++i) {
    bucket.raw[i].add(raw_dps[i]);
    bucket.excess[i].add(raw_dps[i] - virtual_dps);
  }
  bucket.average.add(0.5 * (raw_dps[0] + raw_dps[1]));
  bucket.rate.add(virtual_dps);
}

void ReplayPlot::add_bias(TimePoint t, const std::array<double, 2>& bias_dps) {
  Bucket& bucket = bucket_at(t);
  for (std::size_t i = 0; i < 2; ++i)
    bucket.bias[i].add(bias_dps[i]);
}

// A curve's points are often sparser than the buckets: the line goes on to the next one. Where it
// must not, across a hole, the curve gets a point that is none.
std::vector<bool> ReplayPlot::breaks(const Mean& (*column)(const Bucket&)) const {
  std::vector<std::size_t> filled;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    if (column(buckets_[i]).count > 0) filled.push_back(i);
  }
  std::vector<bool> broken(buckets_.size(), false);
  if (filled.size() < 2) return broken;
  std::vector<std::size_t> steps;
  for (std::size_t i = 1; i < filled.size(); ++i)
    steps.push_back(filled[i] - filled[i - 1]);
  std::vector<std::size_t> sorted = steps;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double usual_s = to_seconds(width_) * static_cast<double>(*middle);
  const double hole_s = std::max(kHoleIntervals * usual_s, kHole_s);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (to_seconds(width_) * static_cast<double>(steps[i]) > hole_s) broken[filled[i] + 1] = true;
  }
  return broken;
}

void ReplayPlot::write_data(std::string& to) const {
  struct Column {
    const Mean& (*mean)(const Bucket&);
    double scale;
  };
  constexpr std::array<Column, 8> kColumns{{
      {[](const Bucket& b) -> const Mean& { return b.raw[0]; }, 1.0},
      {[](const Bucket& b) -> const Mean& { return b.raw[1]; }, 1.0},
      {[](const Bucket& b) -> const Mean& { return b.average; }, 1.0},
      {[](const Bucket& b) -> const Mean& { return b.rate; }, 1.0},
      {[](const Bucket& b) -> const Mean& { return b.excess[0]; }, kSecondsPerHour},
      {[](const Bucket& b) -> const Mean& { return b.excess[1]; }, kSecondsPerHour},
      {[](const Bucket& b) -> const Mean& { return b.bias[0]; }, kSecondsPerHour},
      {[](const Bucket& b) -> const Mean& { return b.bias[1]; }, kSecondsPerHour},
  }};
  std::array<std::vector<bool>, kColumns.size()> broken;
  for (std::size_t k = 0; k < kColumns.size(); ++k)
    broken[k] = breaks(kColumns[k].mean);
  put(to, "$rates << EOD\n");
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    std::string row;
    bool empty = true;
    for (std::size_t k = 0; k < kColumns.size(); ++k) {
      const Mean& mean = kColumns[k].mean(buckets_[i]);
      row += broken[k][i] ? std::string(" NaN") : " " + mean.text(kColumns[k].scale);
      empty = empty && mean.count == 0 && !broken[k][i];
    }
    if (empty) continue;
    put(to, "{:.9g}{}\n", to_seconds(width_) * (static_cast<double>(i) + 0.5), row);
  }
  put(to, "EOD\n");
}

bool ReplayPlot::has_rates() const {
  return std::any_of(buckets_.begin(), buckets_.end(),
                     [](const Bucket& bucket) { return bucket.rate.count > 0; });
}

bool ReplayPlot::has_biases() const {
  return std::any_of(buckets_.begin(), buckets_.end(),
                     [](const Bucket& bucket) { return bucket.bias[0].count > 0; });
}

std::string ReplayPlot::drift_script(const PlotTexts& texts) const {
  const std::array<std::string, 2> names{gnuplot_text("gyro " + texts.gyro_names[0]),
                                         gnuplot_text("gyro " + texts.gyro_names[1])};
  std::string text = fmt::format(
      "set ylabel 'off the virtual gyro, deg/h'\n"
      "plot $rates u 1:6 w l lc rgb '{}' t {}, '' u 1:7 w l lc rgb '{}' t {}, "
      "'' u 1:(0.5*($6+$7)) w l lc rgb '#606060' t 'mean', "
      "0 w l lw 1.5 lc rgb '#b00020' t 'virtual gyro'\n",
      kColours[0], names[0], kColours[1], names[1]);
  if (!has_biases()) return text;
  for (std::size_t i = 0; i < 2; ++i) {
    if (i == 1) text += "set xlabel 'time since the first pair, s'\n";
    text += fmt::format(
        "set ylabel 'drift, deg/h'\nplot $rates u 1:{} w p pt 7 ps 0.25 lc rgb '{}' t {}, "
        "'' u 1:{} w l lw 1.5 lc rgb '#202020' t 'drift curve'\n",
        6 + i, kColours[i], gnuplot_text("gyro " + texts.gyro_names[i] + " less the virtual gyro"),
        8 + i);
  }
  return text;
}

// Rectangles over the whole height of every panel, behind the curves.
std::string ReplayPlot::shades_script() const {
  std::string text;
  for (std::size_t shade = 0; shade < kShades; ++shade) {
    for (const Stretch& stretch : stretches_[shade].all()) {
      put(text,
          "set object rectangle from first {:.9g},graph 0 to first {:.9g},graph 1 behind fs solid "
          "noborder fc rgb '{}'\n",
          std::max(to_seconds(stretch.from - begin_), 0.0),
          std::max(to_seconds(stretch.to - begin_), 0.0), kShadeStyles[shade].colour);
    }
  }
  return text;
}

// An object has no place in the legend: a curve of nothing stands there for it.
std::string ReplayPlot::shades_legend() const {
  std::string text;
  for (std::size_t shade = 0; shade < kShades; ++shade) {
    if (stretches_[shade].all().empty()) continue;
    put(text, ", NaN w boxes fs solid noborder fc rgb '{}' t '{}'", kShadeStyles[shade].colour,
        kShadeStyles[shade].legend);
  }
  return text;
}

std::string ReplayPlot::script(const std::string& path, const PlotTexts& texts) const {
  const bool rates = has_rates();
  const int panels = !rates ? 1 : has_biases() ? 4 : 2;
  std::string text = fmt::format(
      "{}set multiplot layout {},1 title {} noenhanced\n"
      "set grid lc rgb '#dddddd'\nset key outside top right horizontal noenhanced\n"
      "set lmargin 12\nset rmargin 3\nset xrange [0:{:.9g}]\nset datafile missing '-'\n"
      "set ylabel 'rate, deg/s'\n{}{}"
      "plot $rates u 1:2 w l lc rgb '{}' t {}, '' u 1:3 w l lc rgb '{}' t {}, "
      "'' u 1:4 w l lc rgb '#909090' t 'mean'",
      picture_script(path, 1200, 1250), panels,
      gnuplot_text(texts.title + (rates ? "" : " (no valid virtual rate)")),
      to_seconds(width_) * static_cast<double>(buckets_.size()), shades_script(),
      rates ? "" : "set xlabel 'time since the first pair, s'\n", kColours[0],
      gnuplot_text("gyro " + texts.gyro_names[0]), kColours[1],
      gnuplot_text("gyro " + texts.gyro_names[1]));
  if (rates) text += ", '' u 1:5 w l lw 1.5 lc rgb '#b00020' t 'virtual gyro'";
  text += shades_legend() + '\n';
  if (rates) text += drift_script(texts);
  return text + "\nunset multiplot\n";
}

Expected<void> ReplayPlot::draw(const std::string& path, const PlotTexts& texts) const {
  if (buckets_.empty()) {
    return fail(path, "there is nothing to draw: no pair of samples came together");
  }
  std::string whole;
  write_data(whole);
  whole += script(path, texts);
  return run_gnuplot(path, whole);
}

}  // namespace vgyro::cli
