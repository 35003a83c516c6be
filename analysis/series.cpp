#include "analysis/series.h"

#include <algorithm>
#include <cmath>

namespace vgyro::analysis {

namespace {

// Share of a sample's deviation by which the grid follows it: jitter averages out over some fifty
// samples, and a clock error of 1e-3 is followed within a twentieth of an interval.
constexpr double kFollow = 0.02;
// Measured neighbours on each side of a hole whose mean fills it.
constexpr std::size_t kNeighbours = 4;
constexpr std::size_t kSamplesMin = 3;

}  // namespace

std::size_t Series::size() const {
  std::size_t sum = 0;
  for (const Part& part : parts)
    sum += part.rate_dps.size();
  return sum;
}

Series slice(const Series& series, double from_s, double to_s) {
  Series result{series.interval_s, {}, series.filled_share};
  for (const Part& part : series.parts) {
    const auto places = static_cast<double>(part.rate_dps.size());
    const auto place_of = [&](double t_s) {
      return std::clamp(std::ceil((t_s - part.begin_s) / series.interval_s), 0.0, places);
    };
    const double first = place_of(from_s);
    const double end = place_of(to_s);
    if (first >= end) continue;
    const auto begin = part.rate_dps.begin();
    result.parts.push_back(
        {part.begin_s + first * series.interval_s,
         {begin + static_cast<std::ptrdiff_t>(first), begin + static_cast<std::ptrdiff_t>(end)}});
  }
  return result;
}

void SeriesBuilder::add(double t_s, const std::array<double, 2>& values) {
  if (interval_s_ > 0.0) {
    place({t_s, values});
    return;
  }
  if (!first_.empty() && t_s <= first_.back().t_s) return;
  first_.push_back({t_s, values});
  if (first_.size() == kSamplesToJudge) find_interval();
}

// The mean of the intervals near the median, without lost samples and pauses.
void SeriesBuilder::find_interval() {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < first_.size(); ++i)
    intervals.push_back(first_[i].t_s - first_[i - 1].t_s);
  std::vector<double> sorted = intervals;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double median = *middle;
  double sum = 0.0;
  double count = 0.0;
  for (const double interval : intervals) {
    if (std::abs(interval - median) > 0.5 * median) continue;
    sum += interval;
    count += 1.0;
  }
  interval_s_ = sum / count;
  for (const StampedValues& sample : first_)
    place(sample);
  first_.clear();
}

void SeriesBuilder::place(const StampedValues& sample) {
  if (series_[0].parts.empty()) {
    begin_part(sample);
    return;
  }
  const double steps = std::round((sample.t_s - newest_s_) / interval_s_);
  if (steps < 0.0) return;
  if (steps > static_cast<double>(kBridgedMax + 1)) {
    close_part();
    begin_part(sample);
    return;
  }
  newest_s_ += steps * interval_s_;
  newest_s_ += kFollow * (sample.t_s - newest_s_);
  if (steps == 0.0) {
    ++merged_;
    for (std::size_t i = 0; i < 2; ++i) {
      double& newest = series_[i].parts.back().rate_dps.back();
      newest += (sample.values[i] - newest) / merged_;
    }
    return;
  }
  merged_ = 1;
  if (steps > 1.0) {
    bridge();
    hole_at_ = series_[0].parts.back().rate_dps.size();
    holes_ = static_cast<std::size_t>(steps) - 1;
    for (std::size_t i = 0; i < holes_; ++i)
      append({0.0, 0.0});
  }
  append(sample.values);
  const std::size_t size = series_[0].parts.back().rate_dps.size();
  if (holes_ > 0 && size >= hole_at_ + holes_ + kNeighbours) bridge();
}

void SeriesBuilder::begin_part(const StampedValues& sample) {
  for (Series& series : series_)
    series.parts.push_back({sample.t_s, {}});
  append(sample.values);
  newest_s_ = sample.t_s;
  part_begin_s_ = sample.t_s;
  merged_ = 1;
}

void SeriesBuilder::append(const std::array<double, 2>& values) {
  for (std::size_t i = 0; i < 2; ++i)
    series_[i].parts.back().rate_dps.push_back(values[i]);
}

void SeriesBuilder::close_part() {
  bridge();
  grid_s_ += newest_s_ - part_begin_s_;
  grid_places_ += static_cast<double>(series_[0].parts.back().rate_dps.size() - 1);
}

// The mean of the neighbours keeps slow drift and adds hardly any noise.
void SeriesBuilder::bridge() {
  if (holes_ == 0) return;
  for (Series& series : series_) {
    std::vector<double>& rate_dps = series.parts.back().rate_dps;
    const std::size_t begin = hole_at_ - std::min(hole_at_, kNeighbours);
    const std::size_t end = std::min(rate_dps.size(), hole_at_ + holes_ + kNeighbours);
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      if (i >= hole_at_ && i < hole_at_ + holes_) continue;
      sum += rate_dps[i];
      count += 1.0;
    }
    std::fill_n(rate_dps.begin() + static_cast<std::ptrdiff_t>(hole_at_), holes_, sum / count);
  }
  filled_ += holes_;
  holes_ = 0;
}

std::array<Series, 2> SeriesBuilder::finish() {
  if (interval_s_ == 0.0) {
    if (first_.size() < kSamplesMin) return {};
    find_interval();
  }
  close_part();
  const double share = static_cast<double>(filled_) / static_cast<double>(series_[0].size());
  for (Series& series : series_) {
    series.interval_s = grid_places_ > 0.0 ? grid_s_ / grid_places_ : interval_s_;
    series.filled_share = share;
  }
  return std::move(series_);
}

}  // namespace vgyro::analysis
