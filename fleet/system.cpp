#include "fleet/system.h"

#include <Eigen/Dense>

namespace vgyro::fleet {

namespace {

// If the others build all but this share of a shape's information, it has nothing of its own.
constexpr double kOwnShareMin = 0.01;
// Added to the diagonal, as a share of it, so that shapes that were never seen together can be
// solved.
constexpr double kRidge = 1e-9;
// Error that all drives share, in standard errors of one drive: interpolation, filters, linearised
// timing. So no pool is more than twenty times as precise as one drive; at 400 drives it equals the
// random error.
constexpr double kCommonError = 0.05;

Eigen::MatrixXd ridged(const Eigen::MatrixXd& information, const std::vector<std::size_t>& fitted) {
  Eigen::MatrixXd own = information(fitted, fitted);
  own.diagonal() *= 1.0 + kRidge;
  return own;
}

}  // namespace

System::System(std::size_t columns)
    : score(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(columns))),
      information(Eigen::MatrixXd::Zero(score.size(), score.size())),
      drives(score),
      dispersion(Eigen::VectorXd::Ones(score.size())) {}

Eigen::VectorXd System::solve(const std::vector<std::size_t>& fitted) const {
  if (fitted.empty()) return {};
  return ridged(information, fitted).ldlt().solve(Eigen::VectorXd(score(fitted)));
}

Eigen::MatrixXd System::covariance(const std::vector<std::size_t>& fitted) const {
  const Eigen::MatrixXd own = ridged(information, fitted);
  return own.ldlt().solve(Eigen::MatrixXd::Identity(own.rows(), own.cols()));
}

std::vector<Left> System::beside(const std::vector<std::size_t>& fitted) const {
  const Eigen::Index count = score.size();
  std::vector<Left> left(static_cast<std::size_t>(count));
  Eigen::MatrixXd down;
  Eigen::VectorXd sizes;
  if (!fitted.empty()) {
    const Eigen::MatrixXd cross = information(fitted, Eigen::all);
    down = ridged(information, fitted).ldlt().solve(cross);
    sizes = solve(fitted);
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    Left& one = left[static_cast<std::size_t>(i)];
    const double whole = information(i, i);
    one = {score[i], whole};
    for (std::size_t k = 0; k < fitted.size(); ++k) {
      const double cross = information(static_cast<Eigen::Index>(fitted[k]), i);
      one.score -= cross * sizes[static_cast<Eigen::Index>(k)];
      one.information -= cross * down(static_cast<Eigen::Index>(k), i);
    }
    if (one.information <= kOwnShareMin * whole) one = {};
  }
  return left;
}

double System::doubt(std::size_t column) const {
  const auto i = static_cast<Eigen::Index>(column);
  return dispersion[i] + kCommonError * kCommonError * drives[i];
}

}  // namespace vgyro::fleet
