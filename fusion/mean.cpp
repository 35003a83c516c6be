#include <limits>

#include "fusion/corrector.h"

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

class MeanCorrector final : public Corrector {
 public:
  [[nodiscard]] bool needs_calibration() const override { return false; }
  void start(const Calibration& /*calibration*/) override {}
  VirtualRate update(const RatePair& pair) override {
    return {0.5 * (pair.rate_dps[0] + pair.rate_dps[1]), kNone, pair.rate_dps};
  }
  VirtualRate update_alone(std::size_t gyro, const RatePair& pair) override {
    VirtualRate alone{pair.rate_dps[gyro], kNone, {kNone, kNone}};
    alone.corrected_dps[gyro] = pair.rate_dps[gyro];
    return alone;
  }
  [[nodiscard]] Drift drift(double /*t_s*/) const override {
    return {{kNone, kNone}, kNone, kNone, kNone};
  }
  [[nodiscard]] WindowCounts windows() const override { return {}; }
};

}  // namespace

std::unique_ptr<Corrector> make_mean_corrector() {
  return std::make_unique<MeanCorrector>();
}

}  // namespace vgyro::fusion
