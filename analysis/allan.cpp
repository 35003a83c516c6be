#include "analysis/allan.h"

#include <algorithm>
#include <cmath>

#include <unsupported/Eigen/SpecialFunctions>

namespace vgyro::analysis {

namespace {

// Angle at the ends of every sample, less that of the mean rate: Allan's differences cancel the
// mean, which would only cost digits.
std::vector<double> angles(const std::vector<double>& rate_dps, double interval_s) {
  double mean = 0.0;
  for (const double rate : rate_dps)
    mean += rate;
  mean /= static_cast<double>(rate_dps.size());
  std::vector<double> angle(rate_dps.size() + 1, 0.0);
  for (std::size_t i = 0; i < rate_dps.size(); ++i)
    angle[i + 1] = angle[i] + (rate_dps[i] - mean) * interval_s;
  return angle;
}

double sum_of_squares(const std::vector<double>& angle, std::size_t m) {
  double sum = 0.0;
  for (std::size_t i = 0; i + 2 * m < angle.size(); ++i) {
    const double second = angle[i + 2 * m] - 2.0 * angle[i + m] + angle[i];
    sum += second * second;
  }
  return sum;
}

}  // namespace

double degrees_of_freedom(NoiseKind kind, std::size_t samples, std::size_t averaged) {
  const double n = static_cast<double>(samples) + 1.0;  // points of the angle
  const auto m = static_cast<double>(averaged);
  double freedom = 0.0;
  switch (kind) {
    case NoiseKind::kQuantisation:
      freedom = (n + 1.0) * (n - 2.0 * m) / (2.0 * (n - m));
      break;
    case NoiseKind::kWhite:
      freedom =
          (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0);
      break;
    case NoiseKind::kFlicker:
      freedom = averaged == 1 ? 2.0 * (n - 2.0) * (n - 2.0) / (2.3 * n - 4.9)
                              : 5.0 * n * n / (4.0 * m * (n + 3.0 * m));
      break;
    case NoiseKind::kWalk:
      freedom = (n - 2.0) / m * ((n - 1.0) * (n - 1.0) - 3.0 * m * (n - 1.0) + 4.0 * m * m) /
                ((n - 3.0) * (n - 3.0));
      break;
  }
  return std::max(freedom, 1.0);
}

double chi_square_quantile(double probability, double freedom) {
  const auto below = [&](double x) { return Eigen::numext::igamma(0.5 * freedom, 0.5 * x); };
  double low = 0.0;
  double high = freedom + 10.0 * std::sqrt(2.0 * freedom) + 20.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (below(middle) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

std::vector<AllanPoint> allan_deviation(const Series& series,
                                        const std::function<NoiseKind(double)>& kind_at) {
  std::vector<std::vector<double>> parts;
  std::size_t longest = 0;
  for (const Part& part : series.parts) {
    if (part.rate_dps.size() < 3) continue;
    parts.push_back(angles(part.rate_dps, series.interval_s));
    longest = std::max(longest, part.rate_dps.size());
  }
  std::vector<AllanPoint> points;
  for (std::size_t m = 1; 3 * m <= longest; m *= 2) {
    AllanPoint point;
    point.tau_s = static_cast<double>(m) * series.interval_s;
    const NoiseKind kind = kind_at(point.tau_s);
    double sum = 0.0;
    double terms = 0.0;
    for (const std::vector<double>& angle : parts) {
      const std::size_t n = angle.size() - 1;
      if (n < 3 * m) continue;
      sum += sum_of_squares(angle, m);
      terms += static_cast<double>(n + 1 - 2 * m);
      point.freedom += degrees_of_freedom(kind, n, m);
    }
    const double variance = sum / (2.0 * point.tau_s * point.tau_s * terms);
    const auto bound = [&](double probability) {
      return std::sqrt(variance * point.freedom / chi_square_quantile(probability, point.freedom));
    };
    point.deviation_dps = std::sqrt(variance);
    point.low_dps = bound(0.5 + 0.5 * kConfidence);
    point.high_dps = bound(0.5 - 0.5 * kConfidence);
    points.push_back(point);
  }
  return points;
}

}  // namespace vgyro::analysis
