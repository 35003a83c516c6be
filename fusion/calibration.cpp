#include "fusion/calibration.h"

namespace vgyro::fusion {

namespace {
// Sum and difference of two independent noises have equal variance; noises correlated by 0.6 give a
// ratio of 4. Beyond that it is motion.
constexpr double kMotionVarianceRatio = 4.0;
}  // namespace

bool Calibration::platform_moved() const {
  return common_variance > kMotionVarianceRatio * difference_variance;
}

Calibrator::Calibrator(int order, double rest_s)
    : order_(order), rest_s_(rest_s), sum_(order, 0.0, rest_s), difference_(order, 0.0, rest_s) {}

bool Calibrator::add(double t_s, const std::array<double, 2>& rate_dps, double true_rate_dps) {
  if (!started_) {
    started_ = true;
    from_s_ = t_s;
    sum_ = LeastSquares(order_, t_s, rest_s_);
    difference_ = LeastSquares(order_, t_s, rest_s_);
  }
  covered_s_ = t_s - from_s_;
  if (covered_s_ >= rest_s_) {
    covered_s_ = rest_s_;
    const auto sum = sum_.fit();
    const auto difference = difference_.fit();
    if (sum && difference) {
      result_ = {.end_s = from_s_ + rest_s_,
                 .sum = sum->polynomial,
                 .difference = difference->polynomial,
                 .common_variance = sum->residual_variance,
                 .difference_variance = difference->residual_variance};
      return false;
    }
    // A stream with holes: what was gathered cannot carry the fit. Begin again with this pair.
    started_ = false;
    return add(t_s, rate_dps, true_rate_dps);
  }
  sum_.add(t_s, rate_dps[0] + rate_dps[1] - 2.0 * true_rate_dps);
  difference_.add(t_s, rate_dps[0] - rate_dps[1]);
  return true;
}

}  // namespace vgyro::fusion
