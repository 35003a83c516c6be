#include <limits>

#include "fusion/corrector.h"

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

class OptimalCorrector final : public Corrector {
 public:
  [[nodiscard]] bool needs_calibration() const override { return true; }
  void start(const Calibration& calibration) override {
    bias_dps_ = {calibration.bias_dps(0, calibration.end_s),
                 calibration.bias_dps(1, calibration.end_s)};
  }
  VirtualRate update(const RatePair& pair) override {
    VirtualRate out;
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      out.corrected_dps[gyro] = pair.rate_dps[gyro] - bias_dps_[gyro];
    out.rate_dps = 0.5 * (out.corrected_dps[0] + out.corrected_dps[1]);
    out.sigma_dps = kNone;
    return out;
  }
  VirtualRate update_alone(std::size_t gyro, const RatePair& pair) override {
    VirtualRate out{pair.rate_dps[gyro] - bias_dps_[gyro], kNone, {kNone, kNone}};
    out.corrected_dps[gyro] = out.rate_dps;
    return out;
  }
  [[nodiscard]] Drift drift(double /*t_s*/) const override {
    return {bias_dps_, 0.0, kNone, kNone};
  }
  [[nodiscard]] WindowCounts windows() const override { return {}; }

 private:
  std::array<double, 2> bias_dps_{};
};

}  // namespace

std::unique_ptr<Corrector> make_optimal_corrector(const OptimalSettings& /*settings*/) {
  return std::make_unique<OptimalCorrector>();
}

}  // namespace vgyro::fusion
