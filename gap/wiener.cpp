#include "gap/wiener.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include <unsupported/Eigen/FFT>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

// Motion comes and goes: each stretch of so many samples has a spectrum of its own. They overlap
// fourfold, so that a window that keeps great motion from leaking into other frequencies may stand
// before the transform and behind it: the squares of four add up to 3/2, and of each the mean is
// 3/8.
constexpr std::size_t kStretch = 256;
constexpr std::size_t kHop = kStretch / 4;
constexpr double kWindows = 1.5;
constexpr double kWindowSquare = 0.375;
// Neighbouring frequencies that tell the power at one; and how far it must stand above the noise,
// three standard errors of their mean.
constexpr std::size_t kReach = 10;
constexpr double kAbove = 1.5;
constexpr double kLine = 20.0;
// What moves at more than this share of the sampling rate is read between samples at four times the
// rate: there the curve's own sinc is no longer flat.
constexpr double kPlainShare = 0.4;
constexpr std::size_t kFiner = 4;
// Of a step: an instant of the even grid is a sample's.
constexpr double kSameInstant = 2e-4;

// The curve on an even grid, in the middle of stretches. At either end it goes on as its own image
// in the end point, as far as it reaches: level and slope go on.
std::vector<double> on_grid(const SampledCurve& curve, const std::vector<double>& t_s) {
  const std::size_t n = t_s.size();
  std::vector<double> value((n / kHop + 1) * kHop + 2 * kStretch);
  for (std::size_t i = 0; i < n; ++i) {
    const bool sampled = i < curve.times_s().size() &&
                         std::abs(curve.times_s()[i] - t_s[i]) < kSameInstant * curve.interval_s();
    value[kStretch + i] = sampled ? curve.values()[i] : curve.value_at(t_s[i]);
  }
  const std::size_t last = kStretch + n - 1;
  for (std::size_t k = 1; k <= kStretch; ++k)
    value[kStretch - k] = 2.0 * value[kStretch] - value[kStretch + std::min(k, n - 1)];
  for (std::size_t k = 1; last + k < value.size(); ++k)
    value[last + k] = 2.0 * value[last] - value[last - std::min(k, n - 1)];
  return value;
}

struct Line {
  double middle = 0.0;
  double slope = 0.0;

  [[nodiscard]] double at(double i) const { return middle + slope * (i - 0.5 * (kStretch - 1.0)); }
};

Line line_through(const double* value) {
  Line line;
  double products = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < kStretch; ++i) {
    const double x = static_cast<double>(i) - 0.5 * (kStretch - 1.0);
    line.middle += value[i] / kStretch;
    products += x * value[i];
    squares += x * x;
  }
  line.slope = products / squares;
  return line;
}

// Of so many samples, the first of which stands `first` sampling intervals behind its beginning.
std::vector<double> hann(std::size_t samples, double first) {
  std::vector<double> window(samples);
  for (std::size_t i = 0; i < samples; ++i)
    window[i] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * (static_cast<double>(i) + first) /
                                     static_cast<double>(samples));
  return window;
}

// What a stretch's spectrum holds at a frequency over the noise in it, that at the least which
// chance makes of it; 1 or less: nothing but noise.
void set_levels(const std::vector<std::complex<double>>& spectrum, double white_power,
                std::vector<double>& levels) {
  const std::size_t half = spectrum.size() - 1;
  levels.resize(half + 1);
  std::vector<double> power(half + 1);
  for (std::size_t i = 0; i <= half; ++i)
    power[i] = std::norm(spectrum[i]);
  std::vector<double> upper(power.begin() + static_cast<std::ptrdiff_t>(half / 2), power.end());
  const double noise = kAbove * std::min(median_of(upper) / std::numbers::ln2, white_power);
  double sum = 0.0;
  std::size_t count = std::min(kReach, half + 1);
  for (std::size_t i = 0; i < count; ++i)
    sum += power[i];
  for (std::size_t i = 0; i <= half; ++i) {
    if (i + kReach <= half) sum += power[i + kReach], ++count;
    if (i > kReach) sum -= power[i - kReach - 1], --count;
    const double mean = sum / static_cast<double>(count);
    // A line stands far above its neighbours, and is all motion.
    levels[i] = (power[i] > kLine * noise ? power[i] : mean) / noise;
  }
}

// A curve on an even grid, cut into stretches that overlap.
class Stretches {
 public:
  explicit Stretches(const SampledCurve& curve)
      : from_s_(curve.from_s()),
        step_s_(curve.interval_s()),
        count_(static_cast<std::size_t>((curve.to_s() - curve.from_s()) / step_s_) + 1) {
    std::vector<double> t_s(count_);
    for (std::size_t i = 0; i < count_; ++i)
      t_s[i] = from_s_ + step_s_ * static_cast<double>(i);
    value_ = on_grid(curve, t_s);
    transform_.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  }

  /// Mean of the spectra's squares, by frequency.
  [[nodiscard]] std::vector<double> mean_power() {
    const std::vector<double> window = hann(kStretch, 0.5);
    std::vector<double> power(kStretch / 2 + 1, 0.0);
    double stretches = 0.0;
    for (std::size_t from = kStretch; from + kStretch <= kStretch + count_; from += kHop) {
      transform(from, window, 1);
      for (std::size_t i = 0; i < power.size(); ++i)
        power[i] += std::norm(spectrum_[i]);
      stretches += 1.0;
    }
    for (double& one : power)
      one /= std::max(1.0, stretches);
    return power;
  }

  /// The curve when `weigh_spectrum` has weighed the spectrum of each stretch; `finer`: samples out
  /// for each one in.
  template <class Weigh>
  [[nodiscard]] SampledCurve filtered(std::size_t finer, const Weigh& weigh_spectrum) {
    // Behind the transform as before it, at the instants of the samples and at those between them.
    const std::vector<double> window = hann(kStretch * finer, 0.5 * static_cast<double>(finer));
    std::vector<double> sum(value_.size() * finer, 0.0);
    std::vector<double> out(kStretch * finer);
    for (std::size_t from = 0; from + kStretch <= value_.size(); from += kHop) {
      const Line line = transform(from, window, finer);
      weigh_spectrum(spectrum_);
      spectrum_.resize(kStretch * finer / 2 + 1);
      transform_.inv(out, spectrum_, static_cast<Eigen::Index>(kStretch * finer));
      for (std::size_t i = 0; i < out.size(); ++i) {
        const double at = static_cast<double>(i) / static_cast<double>(finer);
        const double back = out[i] * static_cast<double>(finer) + window[i] * line.at(at);
        sum[from * finer + i] += window[i] * back / kWindows;
      }
    }
    const std::size_t last = (count_ - 1) * finer + 1;
    std::vector<double> fine_s(last);
    for (std::size_t i = 0; i < last; ++i)
      fine_s[i] = from_s_ + step_s_ / static_cast<double>(finer) * static_cast<double>(i);
    return {fine_s, std::span(sum).subspan(kStretch * finer, last)};
  }

 private:
  // Of what is left of a stretch without its line, which is returned. `window`: `finer` places for
  // each sample.
  Line transform(std::size_t from, const std::vector<double>& window, std::size_t finer) {
    const Line line = line_through(&value_[from]);
    for (std::size_t i = 0; i < kStretch; ++i)
      part_[i] = window[i * finer] * (value_[from + i] - line.at(static_cast<double>(i)));
    transform_.fwd(spectrum_, part_);
    return line;
  }

  double from_s_;
  double step_s_;
  std::size_t count_;
  std::vector<double> value_;
  Eigen::FFT<double> transform_;
  std::vector<double> part_ = std::vector<double>(kStretch);
  std::vector<std::complex<double>> spectrum_;
};

}  // namespace

SampledCurve without_noise(const SampledCurve& curve, double noise_variance) {
  if (curve.empty()) return curve;
  const double white_power = noise_variance * kWindowSquare * kStretch;
  std::vector<double> levels;
  return Stretches(curve).filtered(1, [&](std::vector<std::complex<double>>& spectrum) {
    set_levels(spectrum, white_power, levels);
    for (std::size_t i = 0; i < spectrum.size(); ++i)
      spectrum[i] *= levels[i] > 1.0 ? 1.0 - 1.0 / levels[i] : 0.0;
  });
}

SampledCurve where_it_moves(const SampledCurve& curve, const SampledCurve& judge,
                            double least_variance) {
  if (curve.empty()) return curve;
  const double least = least_variance * kWindowSquare * kStretch;
  std::vector<double> mean_power = Stretches(judge).mean_power();
  // What lies on half the sampling rate has no phase, and none between the samples.
  mean_power.pop_back();
  constexpr auto kPlain = static_cast<std::ptrdiff_t>(kPlainShare * kStretch);
  const bool is_plain = std::all_of(mean_power.begin() + kPlain, mean_power.end(),
                                    [&](double power) { return power < least; });
  const auto keep_what_moves = [&](std::vector<std::complex<double>>& spectrum) {
    for (std::size_t i = 0; i < mean_power.size(); ++i)
      if (mean_power[i] < least) spectrum[i] = 0.0;
    spectrum.back() = 0.0;
  };
  return Stretches(curve).filtered(is_plain ? 1 : kFiner, keep_what_moves);
}

}  // namespace vgyro::gap
