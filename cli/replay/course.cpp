#include "cli/replay/course.h"

#include <algorithm>
#include <cmath>

namespace vgyro::cli {

namespace {

// A hole is at least as long as a gap of the summary, and longer than a slow gyro's usual interval.
constexpr double kHole_s = 0.5;
constexpr double kHoleIntervals = 5.0;

// In the order of Shade; shade_name() makes the names of faults.
constexpr std::array<const char*, Course::kShades> kShadeNames{
    "calibrating", "stop learned", "stop refused: turning", "ambiguous", "one gyro alone", "", "",
    "contradicted"};

}  // namespace

void Course::Stretches::follow(TimePoint t, bool is_so) {
  if (open_ && t - stretches_.back().to > kHole) open_ = false;
  if (is_so && !open_) stretches_.push_back({t, t});
  if (open_ || is_so) stretches_.back().to = t;
  open_ = is_so;
  if (!is_so && stretches_.size() > kMax) join_nearest();
}

void Course::Stretches::join_nearest() {
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

// A stretch taken for a turn has a likely kTurning without `stopped`.
void Course::add_condition(TimePoint t, const fusion::Condition& condition) {
  const auto likely = [&](fusion::Hypothesis which) {
    return condition.probability[static_cast<std::size_t>(which)] > 0.5;
  };
  const bool refused = !condition.stopped && likely(fusion::Hypothesis::kTurning);
  follow(Shade::kStop, t, condition.stopped);
  follow(Shade::kRefused, t, refused);
  follow(Shade::kAmbiguous, t, condition.ambiguous);
}

void Course::add_status(TimePoint t, const gateway::Status& status) {
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

void Course::add_bias_sigma(TimePoint t, const std::array<double, 2>& sigma_dps) {
  Bucket& bucket = bucket_at(t);
  for (std::size_t i = 0; i < 2; ++i)
    bucket.bias_sigma[i].add(sigma_dps[i]);
}

void Course::Heading::add(TimePoint t, double rate_dps) {
  if (!std::isfinite(rate_dps)) return;
  if (begun) deg += 0.5 * (last_dps + rate_dps) * to_seconds(t - last);
  begun = true;
  last = t;
  last_dps = rate_dps;
}

// All headings start at 0 at the first valid rate: before it there is nothing to compare.
void Course::add_heading(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) {
  const bool valid = std::isfinite(virtual_dps);
  if (valid && !valid_begun_) {
    valid_begun_ = true;
    valid_begin_ = t;
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
    bucket.heading_sigma.add(heading_sigma_deg());
  }
}

void Course::Mean::add(double value) {
  if (!std::isfinite(value)) return;
  sum += value;
  ++count;
}

void Course::Mean::merge(const Mean& other) {
  sum += other.sum;
  count += other.count;
}

void Course::Envelope::add(double value) {
  if (!std::isfinite(value)) return;
  Mean::add(value);
  least = std::min(least, value);
  greatest = std::max(greatest, value);
}

void Course::Envelope::merge(const Envelope& other) {
  Mean::merge(other);
  least = std::min(least, other.least);
  greatest = std::max(greatest, other.greatest);
}

void Course::Bucket::merge(const Bucket& other) {
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

void Course::halve() {
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    if (i % 2 == 1) {
      buckets_[i / 2].merge(buckets_[i]);
    } else {
      buckets_[i / 2] = buckets_[i];
    }
  }
  buckets_.resize((buckets_.size() + 1) / 2);
  width_ *= 2;
}

Course Course::coarser(std::size_t buckets_max) const {
  Course coarse = *this;
  coarse.buckets_max_ = buckets_max;
  while (coarse.buckets_.size() > buckets_max)
    coarse.halve();
  return coarse;
}

Course::Bucket& Course::bucket_at(TimePoint t) {
  if (!begun_) {
    begun_ = true;
    begin_ = t;
  }
  auto index = static_cast<std::size_t>(std::max<Duration::rep>((t - begin_) / width_, 0));
  while (index >= buckets_max_) {
    halve();
    index /= 2;
  }
  if (index >= buckets_.size()) buckets_.resize(index + 1);
  return buckets_[index];
}

void Course::add_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) {
  rate_seen_ = true;
  Bucket& bucket = bucket_at(t);
  for (std::size_t i = 0; i < 2; ++i) {
    bucket.raw[i].add(raw_dps[i]);
    bucket.excess[i].add(raw_dps[i] - virtual_dps);
  }
  bucket.average.add(0.5 * (raw_dps[0] + raw_dps[1]));
  bucket.rate.add(virtual_dps);
  add_heading(t, raw_dps, virtual_dps);
}

// A curve's points are often sparser than the buckets, and the line connects them. Across a hole it
// must not, so the curve gets a break there.
std::vector<bool> Course::breaks(Column column) const {
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

bool Course::has(Column column) const {
  return std::any_of(buckets_.begin(), buckets_.end(),
                     [&](const Bucket& bucket) { return column(bucket).count > 0; });
}

double Course::span_s() const {
  return to_seconds(width_) * static_cast<double>(buckets_.size());
}

// Range of the curve, its band and all measured points but outliers, with a margin.
std::array<double, 2> Course::drift_range_dps(std::size_t gyro) const {
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
  // Without noise, as in a simulation, the curve has no height.
  constexpr double kLeast = 1e-4;
  if (!(high - low > kLeast * std::abs(high))) return {0.0, 0.0};
  const double margin = kMargin * (high - low);
  return {low - margin, high + margin};
}

double Course::largest_bias_dps() const {
  double largest_dps = 0.0;
  for (const Bucket& bucket : buckets_) {
    for (const Mean& bias : bucket.bias) {
      if (bias.count > 0) largest_dps = std::max(largest_dps, std::abs(bias.value()));
    }
  }
  return largest_dps;
}

double Course::heading_sigma_deg() const {
  return std::sqrt(heading_bias_deg_ * heading_bias_deg_ + heading_white_deg2_);
}

std::string Course::shade_name(std::size_t shade,
                               const std::array<std::string, 2>& gyro_names) const {
  const std::size_t first = static_cast<std::size_t>(Shade::kFault1);
  if (shade < first || shade > first + 1) return kShadeNames[shade];
  std::string name = gyro_names[shade - first];
  const char* separator = ": ";
  for (const gateway::Fault fault : faults_[shade - first]) {
    name += separator + std::string(to_string(fault));
    separator = ", ";
  }
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

}  // namespace vgyro::cli
