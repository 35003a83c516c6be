#include <algorithm>
#include <cmath>
#include <limits>

#include "fusion/corrector.h"
#include "fusion/least_squares.h"

// The paper's steps, per window i, with P_k the fitted and p_k the predicted (extrapolated) drifts:
//   cross drifts   d₁ = y₁ − (y₂ − p₂) = δ + p₂,   d₂ = −δ + p₁,   δ = y₁ − y₂
//   fit            P₁ⁱ = D + p₂,   P₂ⁱ = −D + p₁;   D: fit of δ; a polynomial's fit is itself
//   average        c₁ = ½(p₁ + P₁ⁱ) = ½(S + D),   c₂ = ½(S − D),   S = p₁ + p₂
//   virtual gyro   Ω = ½(y₁ + y₂) − ½(c₁ + c₂) = ½(y₁ + y₂) − ½S
// and P₁ⁱ + P₂ⁱ = p₁ + p₂ = S is the calibration's sum, extrapolated for ever. So S from the
// calibration and one fit D per window are the whole method. docs/mutual.md has the derivation; the
// tests compare it with the literal steps.

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
// Limit of a count of skipped windows: a double beyond 64 bits cannot be converted.
constexpr double kSkippedMost = 1e15;

class MutualCorrector final : public Corrector {
 public:
  MutualCorrector(int order, double window_s)
      : order_(order), window_s_(window_s), window_(order, 0.0, window_s) {}

  [[nodiscard]] bool needs_calibration() const override { return true; }

  void start(const Calibration& calibration) override {
    sum_ = calibration.sum;
    difference_ = calibration.difference;
    newest_s_ = calibration.end_s;
    open_window(calibration.end_s);
    difference_until_s_ = window_end_s_;
  }

  VirtualRate update(const RatePair& pair) override {
    if (pair.t_s >= window_end_s_) close_window(pair.t_s);
    reach(pair.t_s);
    window_.add(pair.t_s, pair.rate_dps[0] - pair.rate_dps[1]);
    const double sum = sum_.at(pair.t_s);
    const double difference = difference_at(pair.t_s);
    return {
        0.5 * (pair.rate_dps[0] + pair.rate_dps[1]) - 0.5 * sum,
        kNone,
        {pair.rate_dps[0] - 0.5 * (sum + difference), pair.rate_dps[1] - 0.5 * (sum - difference)}};
  }

  VirtualRate update_alone(std::size_t gyro, const RatePair& pair) override {
    reach(pair.t_s);
    VirtualRate alone{pair.rate_dps[gyro] - drift(pair.t_s).bias_dps[gyro], kNone, {kNone, kNone}};
    alone.corrected_dps[gyro] = alone.rate_dps;
    return alone;
  }

  [[nodiscard]] Drift drift(double asked_s) const override {
    const double t_s = leap_to(asked_s) ? newest_s_ : asked_s;
    const double sum = sum_.at(t_s);
    const double difference = difference_at(t_s);
    return {{0.5 * (sum + difference), 0.5 * (sum - difference)},
            0.5 * sum_.slope_at(t_s),
            kNone,
            kNone};
  }

  [[nodiscard]] WindowCounts windows() const override { return counts_; }

 private:
  void open_window(double from_s) {
    window_end_s_ = from_s + window_s_;
    window_ = LeastSquares(order_, from_s, window_s_);
  }

  void close_window(double t_s) {
    if (const auto fit = window_.fit()) {
      difference_ = fit->polynomial;
      // The fit of a window is extrapolated through the next one; if that gives none, it is held.
      difference_until_s_ = window_end_s_ + window_s_;
      ++counts_.completed;
    } else {
      ++counts_.skipped;
    }
    // After a gap of any length the windows stay on their grid.
    const double behind = std::floor((t_s - window_end_s_) / window_s_);
    counts_.skipped += static_cast<std::uint64_t>(std::min(behind, kSkippedMost));
    open_window(window_end_s_ + behind * window_s_);
  }

  // The method extrapolates by one window. A longer silence cannot be bridged: the clock was set,
  // or the drifts changed in an unknown way.
  [[nodiscard]] bool leap_to(double t_s) const { return t_s - newest_s_ > window_s_; }

  // After a leap the polynomials continue from where they were.
  void reach(double t_s) {
    if (leap_to(t_s)) {
      const double leap_s = t_s - newest_s_;
      sum_.centre_s += leap_s;
      difference_.centre_s += leap_s;
      difference_until_s_ += leap_s;
    }
    newest_s_ = t_s;
  }

  [[nodiscard]] double difference_at(double t_s) const {
    return difference_.at(std::min(t_s, difference_until_s_));
  }

  int order_;
  double window_s_;
  LeastSquares window_;
  double window_end_s_ = 0.0;
  double newest_s_ = 0.0;
  Polynomial sum_;                   ///< S
  Polynomial difference_;            ///< D of the last completed window, or of the calibration
  double difference_until_s_ = 0.0;  ///< held from here on
  WindowCounts counts_;
};

}  // namespace

std::unique_ptr<Corrector> make_mutual_corrector(int order, double window_s) {
  return std::make_unique<MutualCorrector>(order, window_s);
}

}  // namespace vgyro::fusion
