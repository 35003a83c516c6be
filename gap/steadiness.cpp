#include "gap/steadiness.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace vgyro::gap {

namespace {

using model::Kind;

constexpr std::size_t kParts = 6;
// Of a χ², and what the noise's own doubt and interpolation add.
constexpr double kChanceSigmas = 4.5;
constexpr double kChanceMore = 10.0;
constexpr double kChangeShare = 0.04;
// Two steps cancel when their sum is this close to 0, in its σ or as a share of one.
constexpr double kCancelSigmas = 3.0;
constexpr double kCancelShare = 0.1;

// Ends of parts that hold about equal information on a shape.
std::array<double, kParts> ends_of_parts(const Observations& data, const Matrix& white_shape) {
  std::vector<std::pair<double, double>> information;
  double total = 0.0;
  for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
    const Block& block = data.layout.blocks[b];
    information.emplace_back(
        block.t_s, white_shape.middleRows(block.first, block.count).squaredNorm() +
                       white_shape.row(data.size() + static_cast<Eigen::Index>(b)).squaredNorm());
  }
  std::sort(information.begin(), information.end());
  for (const auto& [t_s, sum] : information)
    total += sum;
  std::array<double, kParts> ends_s;
  ends_s.fill(std::numeric_limits<double>::max());
  double so_far = 0.0;
  std::size_t part = 0;
  for (const auto& [t_s, sum] : information) {
    so_far += sum;
    if (part + 1 < kParts && so_far >= total * static_cast<double>(part + 1) / kParts)
      ends_s[part++] = t_s;
  }
  return ends_s;
}

std::vector<std::size_t> of_kind(const std::vector<Found>& found, std::size_t gyro, Kind kind) {
  std::vector<std::size_t> list;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].effect.gyro == gyro && found[i].effect.kind == kind) list.push_back(i);
  }
  return list;
}

bool cancel(const Found& a, const Found& b) {
  const double sum = a.effect.parameters[0] + b.effect.parameters[0];
  const double sigma = std::hypot(a.sigma[0], b.sigma[0]);
  const double size = std::abs(a.effect.parameters[0]);
  return std::abs(sum) < std::max(kCancelSigmas * sigma, kCancelShare * size);
}

bool any_cancel(const std::vector<Found>& found, const std::vector<std::size_t>& steps) {
  for (const std::size_t i : steps) {
    for (const std::size_t j : steps) {
      if (i != j && cancel(found[i], found[j])) return true;
    }
  }
  return false;
}

}  // namespace

bool Change::is_beyond_chance(double statistic_of_term) const {
  const double chance = freedom + kChanceSigmas * std::sqrt(2.0 * freedom) + kChanceMore;
  return statistic > chance && statistic > kChangeShare * statistic_of_term;
}

Change change_over_time(const Regression& regression, const Effects& terms, std::size_t index,
                        const PairNoise& noise) {
  const Observations& data = regression.data();
  const Matrix shape = regression.derivatives(terms, index);
  const auto ends_s = ends_of_parts(data, regression.whitened(shape, noise));
  const Eigen::Index width = shape.cols();
  Matrix columns = regression.columns(terms, static_cast<Eigen::Index>(kParts) * width, index);
  const Eigen::Index at = columns.cols() - static_cast<Eigen::Index>(kParts) * width;
  for (Eigen::Index i = 0; i < data.size(); ++i) {
    const double t_s = data.t_s[static_cast<std::size_t>(i)];
    const auto part = std::lower_bound(ends_s.begin(), ends_s.end(), t_s) - ends_s.begin();
    columns.row(i).segment(at + static_cast<Eigen::Index>(part) * width, width) = shape.row(i);
  }
  const Matrix white = regression.whitened(columns, noise);
  return {explain_first(white.transpose() * white).gain,
          static_cast<double>((kParts - 1) * static_cast<std::size_t>(width))};
}

std::vector<bool> pieces_of_something_else(const std::vector<Found>& found) {
  std::vector<bool> pieces(found.size(), false);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    for (const KindRow& its : kinds()) {
      if (its.most == 0) continue;
      const std::vector<std::size_t> alike = of_kind(found, gyro, its.kind);
      const bool too_many = alike.size() >= its.most;
      if (!too_many && !(its.finder == Finder::kStep && any_cancel(found, alike))) continue;
      for (const std::size_t i : alike)
        pieces[i] = true;
    }
  }
  return pieces;
}

}  // namespace vgyro::gap
