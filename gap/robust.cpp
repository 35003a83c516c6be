#include "gap/robust.h"

#include <algorithm>
#include <cmath>

namespace vgyro::gap {

namespace {

// As long as what is not modelled hangs together, and short enough for many of them.
constexpr double kStretch_s = 5.0;

}  // namespace

// Sums of residual times shape over stretches: their squares add up to the variance of the whole
// sum, whatever the noise is; were it the model's, that is the shape's square.
double inflation(const Regression& regression, const Fit& fit, std::size_t index) {
  const Observations& data = regression.data();
  const Matrix white = regression.whitened(regression.columns(fit.terms), fit.noise);
  Eigen::Index first = 1;
  for (std::size_t i = 0; i < index; ++i)
    first += free_count({fit.terms[i]});
  if (free_count({fit.terms[index]}) == 0) return 1.0;
  std::vector<Eigen::Index> others;
  for (Eigen::Index i = 1; i < white.cols(); ++i)
    if (i != first) others.push_back(i);
  Eigen::VectorXd shape = white.col(first);
  if (!others.empty()) {
    const Matrix beside = white(Eigen::all, others);
    const Solution solution =
        solve(beside.transpose() * beside, beside.transpose() * white.col(first));
    shape -= beside * solution.x;
  }
  const Eigen::VectorXd product = shape.cwiseProduct(white.col(0));
  std::vector<double> sums(static_cast<std::size_t>(data.about.seconds / kStretch_s) + 1, 0.0);
  for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
    const Block& block = data.layout.blocks[b];
    const auto stretch =
        std::min(sums.size() - 1, static_cast<std::size_t>(std::max(0.0, block.t_s) / kStretch_s));
    sums[stretch] += product.segment(block.first, block.count).sum() +
                     product[data.size() + static_cast<Eigen::Index>(b)];
  }
  double squares = 0.0;
  for (const double sum : sums)
    squares += sum * sum;
  const double expected = shape.squaredNorm();
  return expected > 0.0 ? std::max(1.0, squares / expected) : 1.0;
}

}  // namespace vgyro::gap
