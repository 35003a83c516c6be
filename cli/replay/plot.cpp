#include "cli/replay/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cli/output/gnuplot.h"

namespace vgyro::cli {

namespace {

constexpr double kSecondsPerHour = 3600.0;
constexpr double kSecondsPerMinute = 60.0;
// A drift beyond this, in deg/s, has more digits than one reads in deg/h.
constexpr double kReadableInDegPerHour_dps = 0.3;
// Of the table: gnuplot draws past a value that is missing, and interrupts the line at one that is
// no number.
constexpr const char* kMissing = "-";
// A hole is as long as the one the summary tells, and longer than a slow gyro's usual pace.
constexpr double kHole_s = 0.5;
constexpr double kHoleIntervals = 5.0;
// Okabe and Ito's colours, which the colour-blind tell apart: none stands for two things.
constexpr std::array<const char*, 2> kColours{"#e69f00", "#cc79a7"};
constexpr const char* kMeanColour = "#808080";
constexpr const char* kVirtualColour = "#0072b2";
constexpr const char* kVirtualBand = "#b3d5ea";
constexpr const char* kDriftColour = "#000000";
constexpr const char* kDriftBand = "#c8c8c8";

struct ShadeStyle {
  unsigned colour;
  const char* lane;
};
// In the order of Shade; of a fault the lane has the gyro's name.
constexpr std::array<ShadeStyle, 8> kShadeStyles{{{0xf0e442, "calibrating"},
                                                  {0x009e73, "stop learned"},
                                                  {0xd55e00, "stop refused: turning"},
                                                  {0x882255, "ambiguous"},
                                                  {0x56b4e9, "one gyro alone"},
                                                  {0x000000, ""},
                                                  {0x000000, ""},
                                                  {0x332288, "contradicted"}}};
constexpr double kTint = 0.2;         // of a shade's colour, the rest is paper
constexpr double kBlackTint = 0.09;   // black weighs more
constexpr double kShortest = 0.0015;  // of the picture: what is shorter could not be seen

// Sizes in pixels.
constexpr int kWidth = 1200;
constexpr int kTitle = 46;
constexpr int kLegend = 78;    // above each panel: what it shows, and below that the legend
constexpr int kNoLegend = 36;  // where there is no legend
constexpr int kHeading = 56;   // of these, from the panel to what it shows
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

// A legend of long names would take three rows, and its panel has room for two. Both ends of a
// name stay: names of one platform often begin alike.
std::string legend_name(const std::string& name) {
  constexpr std::size_t kMost = 20;
  constexpr std::size_t kEnd = 10;
  if (name.size() <= kMost) return "gyro " + name;
  const auto inside = [&](std::size_t at) {  // a character of several bytes
    return (static_cast<unsigned char>(name[at]) & 0xC0U) == 0x80U;
  };
  std::size_t head = kEnd - 1;
  while (head > 0 && inside(head))
    --head;
  std::size_t tail = name.size() - kEnd;
  while (tail < name.size() && inside(tail))
    ++tail;
  return "gyro " + name.substr(0, head) + "…" + name.substr(std::min(tail, name.size()));
}

// Two significant digits of the smaller one.
std::string degrees(double value_deg) {
  const double size = std::abs(value_deg);
  const int digits = size >= 100.0 ? 0 : size >= 10.0 ? 1 : size >= 1.0 ? 2 : 3;
  return fmt::format("{:+.{}f}°", value_deg, digits);
}

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
  follow(Shade::kStop, t, condition.stopped);
  follow(Shade::kRefused, t, refused);
  follow(Shade::kAmbiguous, t, condition.ambiguous);
}

void ReplayPlot::add_status(TimePoint t, const gateway::Status& status) {
  using gateway::State;
  Bucket& bucket = bucket_at(t);
  sigma_known_ = std::isfinite(status.sigma_dps) && std::isfinite(status.bias_sigma_dps);
  sigma_dps_ = sigma_known_ ? status.sigma_dps : 0.0;
  bias_sigma_dps_ = sigma_known_ ? status.bias_sigma_dps : 0.0;
  for (std::size_t i = 0; i < 2; ++i) {
    const gateway::GyroStatus& gyro = status.gyros[i];
    bucket.bias[i].add(gyro.bias_dps);
    bucket.temperature[i].add(gyro.temperature_c);
    const bool silent = !gyro.heard && gyro.frames > 0 && status.pairs > 0;
    follow(i == 0 ? Shade::kFault1 : Shade::kFault2, t, silent || gyro.fault.has_value());
    if (silent) faults_[i].insert(gateway::Fault::kSilent);
    if (gyro.fault) faults_[i].insert(*gyro.fault);
  }
  follow(
      Shade::kCalibrating, t,
      status.pairs > 0 && (status.state == State::kCalibrating || status.state == State::kWaiting));
  follow(Shade::kOneGyro, t, status.state == State::kDegraded);
  follow(Shade::kContradicted, t, status.state == State::kContradicted);
}

void ReplayPlot::add_bias_sigma(TimePoint t, const std::array<double, 2>& sigma_dps) {
  Bucket& bucket = bucket_at(t);
  for (std::size_t i = 0; i < 2; ++i)
    bucket.bias_sigma[i].add(sigma_dps[i]);
}

void ReplayPlot::Heading::add(TimePoint t, double rate_dps) {
  if (!std::isfinite(rate_dps)) return;
  if (begun) deg += 0.5 * (last_dps + rate_dps) * to_seconds(t - last);
  begun = true;
  last = t;
  last_dps = rate_dps;
}

// From the first valid rate on all of them count anew: before it there is nothing to compare.
void ReplayPlot::add_heading(TimePoint t, const std::array<double, 2>& raw_dps,
                             double virtual_dps) {
  const bool valid = std::isfinite(virtual_dps);
  if (valid && !valid_begun_) {
    valid_begun_ = true;
    headings_ = {};
    for (Bucket& bucket : buckets_)
      bucket.heading = {};
  }
  if (valid && headings_[3].begun && sigma_known_) {
    const double interval_s = to_seconds(t - headings_[3].last);
    const double white_dps2 =
        std::max(sigma_dps_ * sigma_dps_ - bias_sigma_dps_ * bias_sigma_dps_, 0.0);
    heading_bias_deg_ += bias_sigma_dps_ * interval_s;
    heading_white_deg2_ += white_dps2 * interval_s * interval_s;
  }
  const std::array<double, 4> rates{raw_dps[0], raw_dps[1], 0.5 * (raw_dps[0] + raw_dps[1]),
                                    virtual_dps};
  Bucket& bucket = bucket_at(t);
  for (std::size_t i = 0; i < rates.size(); ++i) {
    headings_[i].add(t, rates[i]);
    if (std::isfinite(rates[i])) bucket.heading[i].add(headings_[i].deg);
  }
  if (valid && sigma_known_) {
    bucket.heading_sigma.add(
        std::sqrt(heading_bias_deg_ * heading_bias_deg_ + heading_white_deg2_));
  }
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
    bias_sigma[i].merge(other.bias_sigma[i]);
    temperature[i].merge(other.temperature[i]);
  }
  for (std::size_t i = 0; i < heading.size(); ++i)
    heading[i].merge(other.heading[i]);
  heading_sigma.merge(other.heading_sigma);
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
  add_heading(t, raw_dps, virtual_dps);
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
    broken[k] = breaks(columns[k].mean);
  put(to, "$rates << EOD\n");
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    std::string row;
    bool empty = true;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const Mean& mean = columns[k].mean(buckets_[i]);
      row += broken[k][i] ? std::string(" NaN") : " " + mean.text(columns[k].scale);
      empty = empty && mean.count == 0 && !broken[k][i];
    }
    if (empty) continue;
    put(to, "{:.9g}{}\n", to_seconds(width_) * (static_cast<double>(i) + 0.5) / time_unit().in_base,
        row);
  }
  put(to, "EOD\n");
}

bool ReplayPlot::has(const Mean& (*column)(const Bucket&)) const {
  return std::any_of(buckets_.begin(), buckets_.end(),
                     [&](const Bucket& bucket) { return column(bucket).count > 0; });
}

double ReplayPlot::span_s() const {
  return to_seconds(width_) * static_cast<double>(buckets_.size());
}

ReplayPlot::Unit ReplayPlot::time_unit() const {
  constexpr double kMinutesFrom_s = 600.0;
  constexpr double kHoursFrom_s = 3.0 * kSecondsPerHour;
  if (span_s() >= kHoursFrom_s) return {"h", kSecondsPerHour};
  if (span_s() >= kMinutesFrom_s) return {"min", kSecondsPerMinute};
  return {"s", 1.0};
}

ReplayPlot::Unit ReplayPlot::drift_unit() const {
  double largest_dps = 0.0;
  for (const Bucket& bucket : buckets_) {
    for (const Mean& bias : bucket.bias) {
      if (bias.count > 0) largest_dps = std::max(largest_dps, std::abs(bias.value()));
    }
  }
  if (largest_dps > kReadableInDegPerHour_dps) return {"deg/s", 1.0};
  return {"deg/h", 1.0 / kSecondsPerHour};
}

ReplayPlot::Panel ReplayPlot::heading_panel(const PlotTexts& texts) const {
  std::string text = "plot ";
  if (has([](const Bucket& b) -> const Mean& { return b.heading_sigma; })) {
    put(text, "$rates u 1:($13-$14):($13+$14) w filledcurves lc rgb '{}' t 'virtual gyro ±σ', ",
        kVirtualBand);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    put(text, "$rates u 1:{} w l lw 1.5 lc rgb '{}' t {}, ", 10 + i, kColours[i],
        gnuplot_text(legend_name(texts.gyro_names[i])));
  }
  put(text, "$rates u 1:12 w l lw 1.5 dt 2 lc rgb '{}' t 'mean'", kMeanColour);
  if (valid_begun_)
    put(text, ", $rates u 1:13 w l lw 2.5 lc rgb '{}' t 'virtual gyro'", kVirtualColour);
  return {310, "Heading, deg", text + '\n'};
}

// The ends stand in the legend: they are what one takes away.
ReplayPlot::Panel ReplayPlot::off_panel(const PlotTexts& texts) const {
  const std::array<std::string, 3> names{legend_name(texts.gyro_names[0]),
                                         legend_name(texts.gyro_names[1]), "mean"};
  std::string text = "plot ";
  const bool sigma = has([](const Bucket& b) -> const Mean& { return b.heading_sigma; });
  if (sigma) {
    put(text, "$rates u 1:(-$14):14 w filledcurves lc rgb '{}' t 'virtual gyro ±{:.2g}°', ",
        kVirtualBand, std::sqrt(heading_bias_deg_ * heading_bias_deg_ + heading_white_deg2_));
  }
  put(text, "$rates u 1:($13-$13) w l lw 2.5 lc rgb '{}' notitle", kVirtualColour);
  for (std::size_t i = 0; i < names.size(); ++i) {
    put(text, ", $rates u 1:(${}-$13) w l lw 1.5 {} lc rgb '{}' t {}", 10 + i, i == 2 ? "dt 2" : "",
        i == 2 ? kMeanColour : kColours[i],
        gnuplot_text(fmt::format("{} {}", names[i], degrees(headings_[i].deg - headings_[3].deg))));
  }
  return {220, "Heading off the virtual gyro, deg (in the legend: at the end)", text + '\n'};
}

ReplayPlot::Panel ReplayPlot::rate_panel(const PlotTexts& texts) const {
  std::string text = "plot ";
  for (std::size_t i = 0; i < 2; ++i) {
    put(text, "$rates u 1:{} w l lc rgb '{}' t {}, ", 2 + i, kColours[i],
        gnuplot_text(legend_name(texts.gyro_names[i])));
  }
  put(text, "$rates u 1:4 w l lc rgb '{}' t 'mean'", kMeanColour);
  if (valid_begun_)
    put(text, ", $rates u 1:5 w l lw 1.5 lc rgb '{}' t 'virtual gyro'", kVirtualColour);
  return {200, "Rate, deg/s", text + '\n'};
}

// The curve, its band, and all but the wildest of what was measured, with a margin.
std::string ReplayPlot::drift_range(std::size_t gyro) const {
  constexpr double kWild = 0.02;  // of the points, at each end
  constexpr double kMargin = 0.15;
  std::vector<double> points;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Bucket& bucket : buckets_) {
    if (bucket.excess[gyro].count > 0) points.push_back(bucket.excess[gyro].value());
    if (bucket.bias[gyro].count == 0) continue;
    const double sigma = bucket.bias_sigma[gyro].count > 0 ? bucket.bias_sigma[gyro].value() : 0.0;
    low = std::min(low, bucket.bias[gyro].value() - sigma);
    high = std::max(high, bucket.bias[gyro].value() + sigma);
  }
  if (!points.empty()) {
    std::sort(points.begin(), points.end());
    const auto aside = static_cast<std::size_t>(kWild * static_cast<double>(points.size()));
    low = std::min(low, points[aside]);
    high = std::max(high, points[points.size() - 1 - aside]);
  }
  // A simulation without noise: gnuplot wants some height.
  constexpr double kLeast = 1e-4;
  if (!(high - low > kLeast * std::abs(high))) return "set autoscale y\n";
  const double margin = kMargin * (high - low);
  const double scale = 1.0 / drift_unit().in_base;
  return fmt::format("set yrange [{:.6g}:{:.6g}]\n", scale * (low - margin),
                     scale * (high + margin));
}

ReplayPlot::Panel ReplayPlot::drift_panel(const PlotTexts& texts, std::size_t gyro) const {
  std::string text = drift_range(gyro);
  // The points are small, for there are many; the legend's is large enough to be seen.
  put(text,
      "plot $rates u 1:{} w p pt 7 ps 0.25 lc rgb '{}' notitle, "
      "NaN w p pt 7 ps 0.8 lc rgb '{}' t 'gyro less the virtual gyro', ",
      6 + gyro, kColours[gyro], kColours[gyro]);
  const bool sigma = gyro == 0
                         ? has([](const Bucket& b) -> const Mean& { return b.bias_sigma[0]; })
                         : has([](const Bucket& b) -> const Mean& { return b.bias_sigma[1]; });
  if (sigma) {
    put(text,
        "$known u 1:(${0}-${1}):(${0}+${1}) w filledcurves fs transparent solid 0.7 lc rgb '{2}' "
        "t 'its ±σ', ",
        2 + 2 * gyro, 3 + 2 * gyro, kDriftBand);
  }
  put(text, "$rates u 1:{} w l lw 1.5 lc rgb '{}' t 'drift'\nset autoscale y\n", 8 + gyro,
      kDriftColour);
  return {180, fmt::format("Drift of gyro {}, {}", texts.gyro_names[gyro], drift_unit().name),
          text};
}

ReplayPlot::Panel ReplayPlot::temperature_panel(const PlotTexts& texts) const {
  const std::array<bool, 2> told{
      has([](const Bucket& b) -> const Mean& { return b.temperature[0]; }),
      has([](const Bucket& b) -> const Mean& { return b.temperature[1]; })};
  if (!told[0] && !told[1]) return {0, {}, {}};
  std::string text = "plot ";
  for (std::size_t i = 0; i < 2; ++i) {
    if (!told[i]) continue;
    put(text, "{}$rates u 1:{} w l lw 1.5 lc rgb '{}' t {}", i == 1 && told[0] ? ", " : "", 17 + i,
        kColours[i], gnuplot_text(legend_name(texts.gyro_names[i])));
  }
  return {130, "Temperature, °C", text + '\n'};
}

std::string ReplayPlot::lane_name(std::size_t shade, const PlotTexts& texts) const {
  const std::size_t first = static_cast<std::size_t>(Shade::kFault1);
  if (shade < first || shade > first + 1) return kShadeStyles[shade].lane;
  std::string name = texts.gyro_names[shade - first];
  const char* separator = ": ";
  for (const gateway::Fault fault : faults_[shade - first]) {
    name += separator + std::string(to_string(fault));
    separator = ", ";
  }
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

// From and to, in the unit of the time axis, wide enough to be seen.
std::array<double, 2> ReplayPlot::ends(const Stretch& stretch) const {
  const double from = std::max(to_seconds(stretch.from - begin_), 0.0);
  const double to = std::max(to_seconds(stretch.to - begin_), from + kShortest * span_s());
  return {from / time_unit().in_base, to / time_unit().in_base};
}

// A lane, with its name, for each thing that went on at some time; the same colours shade the
// panels.
ReplayPlot::Panel ReplayPlot::events_panel(const PlotTexts& texts) const {
  std::string boxes;
  std::string names;
  int lanes = 0;
  for (std::size_t shade = 0; shade < kShades; ++shade) {
    if (stretches_[shade].all().empty()) continue;
    ++lanes;
    put(names, "{}{} {}", lanes == 1 ? "" : ", ", gnuplot_text(lane_name(shade, texts)), -lanes);
    for (const Stretch& stretch : stretches_[shade].all()) {
      put(boxes,
          "set object rectangle from first {:.9g},{} to first {:.9g},{} front fs solid 1 border lc "
          "rgb '#{:06x}' fc rgb '#{:06x}'\n",
          ends(stretch)[0], -lanes - 0.35, ends(stretch)[1], -lanes + 0.35,
          kShadeStyles[shade].colour, kShadeStyles[shade].colour);
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
std::string ReplayPlot::shades_script() const {
  std::string text;
  for (std::size_t shade = 0; shade < kShades; ++shade) {
    for (const Stretch& stretch : stretches_[shade].all()) {
      put(text,
          "set object rectangle from first {:.9g},graph 0 to first {:.9g},graph 1 behind fs solid "
          "noborder fc rgb '{}'\n",
          ends(stretch)[0], ends(stretch)[1], tint(kShadeStyles[shade].colour));
    }
  }
  return text;
}

std::vector<ReplayPlot::Panel> ReplayPlot::panels(const PlotTexts& texts) const {
  std::vector<Panel> panels{heading_panel(texts)};
  if (valid_begun_) panels.push_back(off_panel(texts));
  if (Panel events = events_panel(texts); events.height_px > 0) panels.push_back(events);
  panels.push_back(rate_panel(texts));
  const bool biases = has([](const Bucket& b) -> const Mean& { return b.bias[0]; }) &&
                      has([](const Bucket& b) -> const Mean& { return b.excess[0]; });
  for (std::size_t gyro = 0; biases && gyro < 2; ++gyro)
    panels.push_back(drift_panel(texts, gyro));
  if (Panel temperature = temperature_panel(texts); temperature.height_px > 0)
    panels.push_back(temperature);
  return panels;
}

std::string ReplayPlot::script(const std::string& path, const PlotTexts& texts) const {
  const std::vector<Panel> drawn = panels(texts);
  int height = kTitle + kFoot;
  for (const Panel& panel : drawn)
    height += (panel.legend ? kLegend : kNoLegend) + panel.height_px;
  std::string text = fmt::format(
      "{}set multiplot\nset label 1 {} at screen 0.5,{:.6f} center noenhanced font ',15'\n"
      "set grid xtics ytics lt 1 lw 1 lc rgb '#d5d5d5'\n"
      "set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\nset xrange [0:{:.9g}]\n"
      "set datafile missing '-'\nset tics nomirror\nset format x ''\n{}",
      picture_script(path, kWidth, height),
      gnuplot_text(texts.title + (valid_begun_ ? "" : ": no valid virtual rate")),
      1.0 - 0.5 * kTitle / height, static_cast<double>(kLeft) / kWidth,
      1.0 - static_cast<double>(kRight) / kWidth, span_s() / time_unit().in_base, shades_script());
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

// What is known of the drifts, row by row: σ comes less often than the drift.
void ReplayPlot::write_known(std::string& to) const {
  const double scale = 1.0 / drift_unit().in_base;
  put(to, "$known << EOD\n");
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    const Bucket& b = buckets_[i];
    if (b.bias_sigma[0].count == 0 || b.bias[0].count == 0) continue;
    put(to, "{:.9g} {} {} {} {}\n",
        to_seconds(width_) * (static_cast<double>(i) + 0.5) / time_unit().in_base,
        b.bias[0].text(scale), b.bias_sigma[0].text(scale), b.bias[1].text(scale),
        b.bias_sigma[1].text(scale));
  }
  put(to, "EOD\n");
}

Expected<void> ReplayPlot::draw(const std::string& path, const PlotTexts& texts) const {
  if (buckets_.empty()) {
    return fail(path, "there is nothing to draw: no pair of samples came together");
  }
  std::string whole;
  write_data(whole);
  write_known(whole);
  whole += script(path, texts);
  return run_gnuplot(path, whole);
}

}  // namespace vgyro::cli
