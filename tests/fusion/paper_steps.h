#pragma once

// The paper's mutual calibration in its literal steps: predict, correct, cross-calibrate, average;
// all samples of a window are kept. Shares no code with the product. In long double, because P₁ and
// P₂ by themselves grow with every window and cancel only in their sum.

#include <array>
#include <vector>

namespace vgyro::fusion {

class PaperSteps {
 public:
  using Real = long double;

  struct Drift {
    Real centre_s = 0;
    Real half_width_s = 1;
    std::vector<Real> coefficient;
    [[nodiscard]] Real at(Real t_s) const;
  };
  struct PaperSample {
    double t_s = 0;
    std::array<double, 2> rate_dps{};
  };
  struct Window {
    std::vector<Real> virtual_dps;   ///< Ω_v at each sample
    std::array<Drift, 2> predicted;  ///< p_k
    std::array<Drift, 2> renewed;    ///< P_k of this window
    Real largest_dps = 0;            ///< largest magnitude in any step
  };

  PaperSteps(int order, std::array<Drift, 2> calibration)
      : order_(order), drift_(std::move(calibration)) {}

  /// `samples`: all of [from_s, from_s + width_s).
  Window window(double from_s, double width_s, const std::vector<PaperSample>& samples);

 private:
  [[nodiscard]] Drift fit(Real from_s, Real width_s, const std::vector<PaperSample>& samples,
                          const std::vector<Real>& values) const;

  int order_;
  std::array<Drift, 2> drift_;
};

}  // namespace vgyro::fusion
