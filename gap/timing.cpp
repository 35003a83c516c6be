#include "gap/timing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <fmt/core.h>

#include "gap/median.h"
#include "gap/unseen_motion.h"
#include "gap/wiener.h"
#include "model/equation.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

// A window holds some turns; a clock that is wrong by a hundredth moves by a fifth of a second in
// it.
constexpr double kWindow_s = 20.0;
constexpr double kHop_s = 10.0;
// Lags that are tried in a window, about where the last one was.
constexpr double kReach_s = 1.0;
constexpr double kStep_s = 0.02;
// Of a window enough for a correlation; fewer tell none.
constexpr std::size_t kWindowSamplesMost = 400;
constexpr std::size_t kWindowSamplesMin = 40;
// What two sensors of one motion reach at the right lag.
constexpr double kLike = 0.8;
constexpr std::size_t kWindowsMin = 3;
// Clocks on which somebody relies are no worse than a hundredth.
constexpr double kDriftMost = 0.02;
// Least squares: samples enough for any accuracy, rounds that halve the error many times.
constexpr std::size_t kSamplesMost = 100000;
constexpr int kRounds = 12;
constexpr double kSettled_s = 1e-7;
// An offset for each stretch, which drift does not bend.
constexpr double kStretch_s = 10.0;
// What is off by more times the rms is a glitch.
constexpr double kGlitch = 10.0;
// Of a lag and of a drift that are believed, in standard errors.
constexpr double kSigmas = 6.0;
// Up to here the search finds a clock's error by itself, from zero on, and weighs rivals.
constexpr double kDriftLeast = 3e-4;
// Nothing comes early: both gyros by so much, and alike in this share, are held against a late
// reference.
constexpr double kEarlyLeast_s = 0.002;
constexpr double kAlikeShare = 0.2;
constexpr double kPpm = 1e6;
constexpr double kMilli = 1e3;

// A curve at even instants, for many looks.
class EvenCurve {
 public:
  explicit EvenCurve(const SampledCurve& curve) : from_s_(curve.from_s()) {
    const auto count = static_cast<std::size_t>((curve.to_s() - from_s_) / kStep_s) + 1;
    for (std::size_t i = 0; i < count; ++i)
      value_.push_back(curve.value_at(from_s_ + kStep_s * static_cast<double>(i)));
  }
  /// At the nearest of them; nothing beyond the ends.
  [[nodiscard]] const double* near(double t_s) const {
    const double place = std::round((t_s - from_s_) / kStep_s);
    if (place < 0.0 || place >= static_cast<double>(value_.size())) return nullptr;
    return &value_[static_cast<std::size_t>(place)];
  }

 private:
  double from_s_;
  std::vector<double> value_;
};

struct Samples {
  std::span<const double> t_s;
  std::span<const double> value;

  [[nodiscard]] std::size_t first_from(double from_s) const {
    return static_cast<std::size_t>(std::lower_bound(t_s.begin(), t_s.end(), from_s) - t_s.begin());
  }
};

double correlation(const EvenCurve& curve, const Samples& samples, double lag_s) {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  const std::size_t every = samples.t_s.size() / kWindowSamplesMost + 1;
  for (std::size_t i = 0; i < samples.t_s.size(); i += every) {
    const double* const at = curve.near(samples.t_s[i] - lag_s);
    if (at == nullptr) continue;
    // Squares keep their digits about the first.
    const double u = *at - samples.value[0];
    const double v = samples.value[i] - samples.value[0];
    n += 1.0, x += u, y += v, xx += u * u, xy += u * v, yy += v * v;
  }
  if (n < static_cast<double>(kWindowSamplesMin)) return 0.0;
  const double both = (xx - x * x / n) * (yy - y * y / n);
  return both > 0.0 ? (xy - x * y / n) / std::sqrt(both) : 0.0;
}

struct WindowLag {
  double t_s = 0.0;
  double lag_s = 0.0;
};

double drift_of(const std::vector<WindowLag>& lags) {
  std::vector<double> slopes;
  for (std::size_t i = 0; i < lags.size(); ++i) {
    for (std::size_t k = i + 1; k < lags.size(); ++k)
      slopes.push_back((lags[k].lag_s - lags[i].lag_s) / (lags[k].t_s - lags[i].t_s));
  }
  return slopes.empty() ? 0.0 : median_of(slopes);
}

std::vector<WindowLag> window_lags(const SampledCurve& curve, const Samples& samples) {
  const EvenCurve even(curve);
  std::vector<WindowLag> lags;
  const double last_s = samples.t_s.back() - kWindow_s;
  double about_s = 0.0;
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter): a time
  for (double from_s = samples.t_s.front(); from_s <= last_s; from_s += kHop_s) {
    const std::size_t first = samples.first_from(from_s);
    const std::size_t count = samples.first_from(from_s + kWindow_s) - first;
    if (count < kWindowSamplesMin) continue;
    const Samples window{samples.t_s.subspan(first, count), samples.value.subspan(first, count)};
    double best = kLike;
    std::optional<double> found_s;
    for (int step = -static_cast<int>(kReach_s / kStep_s); step <= kReach_s / kStep_s; ++step) {
      const double lag_s = about_s + kStep_s * step;
      const double like = correlation(even, window, lag_s);
      if (like > best) best = like, found_s = lag_s;
    }
    if (!found_s) continue;
    about_s = *found_s;
    lags.push_back({from_s + 0.5 * kWindow_s, *found_s});
  }
  return lags;
}

// Lag at a middle instant, its drift, scale: refined by Gauss and Newton.
class Refinement {
 public:
  Refinement(const SampledCurve& curve, const Samples& samples, double pivot_s)
      : curve_(curve), pivot_s_(pivot_s) {
    const std::size_t every = samples.t_s.size() / kSamplesMost + 1;
    for (std::size_t i = 0; i < samples.t_s.size(); i += every) {
      t_s_.push_back(samples.t_s[i]);
      value_.push_back(samples.value[i]);
    }
  }

  // Nothing when it does not settle.
  [[nodiscard]] std::optional<Lag> run(double lag_s, double drift, bool drifts) {
    unknown_ = Eigen::Vector3d(1.0, lag_s, drift);
    rms_ = 0.0;
    drifts_ = drifts;
    bool settled = false;
    for (int round = 0; round < kRounds && !settled; ++round) {
      accumulate();
      if (!solvable()) return {};
      const Eigen::Vector3d change = normal_.ldlt().solve(right_);
      if (!change.allFinite() || std::abs(change[1]) > kReach_s) return {};
      unknown_ += change;
      settled = std::abs(change[1]) < kSettled_s + 1e-3 * sigma(1);
    }
    if (!settled || std::abs(unknown_[2]) > kDriftMost || unknown_[0] <= 0.0) return {};
    Lag lag;
    lag.drift = unknown_[2];
    lag.start_s = unknown_[1] - unknown_[2] * pivot_s_;
    lag.start_sigma_s = std::hypot(sigma(1), pivot_s_ * sigma(2));
    lag.drift_sigma = sigma(2);
    return lag;
  }

 private:
  [[nodiscard]] bool solvable() const {
    return normal_(0, 0) > 0.0 && normal_(1, 1) > 0.0 && normal_(2, 2) > 0.0;
  }

  // Of the stretches' own scatter: neighbouring errors hang together.
  [[nodiscard]] double sigma(Eigen::Index k) const {
    const Eigen::Matrix3d inverse = normal_.inverse();
    const double variance = (inverse * scores_ * inverse)(k, k);
    return std::sqrt(std::max(0.0, variance));
  }

  void accumulate() {
    normal_.setZero();
    right_.setZero();
    scores_.setZero();
    const double limit = kGlitch * rms_;
    square_ = count_ = 0.0;
    for (std::size_t from = 0; from < t_s_.size();) {
      std::size_t to = from;
      while (to < t_s_.size() && t_s_[to] < t_s_[from] + kStretch_s)
        ++to;
      add_stretch(from, to, limit);
      from = to;
    }
    rms_ = count_ > 0.0 ? std::sqrt(square_ / count_) : 0.0;
    // Unknown is only what is asked for.
    if (drifts_) return;
    normal_.row(2).setZero();
    normal_.col(2).setZero();
    normal_(2, 2) = 1.0;
    right_[2] = 0.0;
    scores_.row(2).setZero();
    scores_.col(2).setZero();
  }

  void add_stretch(std::size_t from, std::size_t to, double limit) {
    rows_.clear();
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (std::size_t i = from; i < to; ++i) {
      const double lag_s = unknown_[1] + unknown_[2] * (t_s_[i] - pivot_s_);
      const double at_s = t_s_[i] - lag_s;
      if (at_s < curve_.from_s() || at_s > curve_.to_s()) continue;
      const SampledCurve::Point point = curve_.at(at_s);
      const double late = -unknown_[0] * point.slope;
      const double error = value_[i] - unknown_[0] * point.value;
      rows_.emplace_back(point.value, late, late * (t_s_[i] - pivot_s_), error);
      sum += rows_.back();
    }
    if (rows_.empty()) return;
    const Eigen::Vector4d mean = sum / static_cast<double>(rows_.size());
    Eigen::Vector3d score = Eigen::Vector3d::Zero();
    for (const Eigen::Vector4d& row : rows_) {
      const Eigen::Vector4d x = row - mean;
      if (limit > 0.0 && std::abs(x[3]) > limit) continue;
      normal_ += x.head<3>() * x.head<3>().transpose();
      score += x.head<3>() * x[3];
      square_ += x[3] * x[3];
      count_ += 1.0;
    }
    right_ += score;
    scores_ += score * score.transpose();
  }

  const SampledCurve& curve_;
  double pivot_s_;
  std::vector<double> t_s_;
  std::vector<double> value_;
  bool drifts_ = true;
  Eigen::Vector3d unknown_ = Eigen::Vector3d::Zero();  ///< scale, lag, drift
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scores_ = Eigen::Matrix3d::Zero();
  std::vector<Eigen::Vector4d> rows_;
  double rms_ = 0.0;
  double square_ = 0.0;
  double count_ = 0.0;
};

}  // namespace

std::optional<Lag> lag_behind(const SampledCurve& curve, std::span<const double> t_s,
                              std::span<const double> value) {
  if (curve.empty() || t_s.size() < kWindowSamplesMin) return {};
  const Samples samples{t_s, value};
  const std::vector<WindowLag> lags = window_lags(curve, samples);
  if (lags.size() < kWindowsMin) return {};
  const double drift = std::clamp(drift_of(lags), -kDriftMost, kDriftMost);
  const double pivot_s = 0.5 * (lags.front().t_s + lags.back().t_s);
  std::vector<double> middles;
  for (const WindowLag& window : lags)
    middles.push_back(window.lag_s - drift * (window.t_s - pivot_s));
  const double middle_s = median_of(middles);
  Refinement refinement(curve, samples, pivot_s);
  const std::optional<Lag> lag = refinement.run(middle_s, drift, true);
  if (lag && std::abs(lag->drift) > std::max(kDriftLeast, kSigmas * lag->drift_sigma)) return lag;
  return refinement.run(middle_s, 0.0, false);
}

namespace {

// Without its noise: that is less between samples than at them, and where the others' instants keep
// to one place between them, its slope would pass for a lag.
SampledCurve curve_of(const ScalarSeries& rate) {
  const SampledCurve curve(rate.t_s, rate.value);
  return without_noise(curve, quiet_variance(curve));
}

// Of the first behind the second; the one with more samples makes the curve, for it is known better
// between them.
std::optional<Lag> lag_between(const ScalarSeries& first, const ScalarSeries& second) {
  if (first.t_s.size() < kWindowSamplesMin || second.t_s.size() < kWindowSamplesMin) return {};
  if (first.t_s.size() <= second.t_s.size())
    return lag_behind(curve_of(second), first.t_s, first.value);
  auto lag = lag_behind(curve_of(first), second.t_s, second.value);
  if (!lag) return {};
  // second(t) = first(t − start − drift·t): the other way round.
  const double rate = 1.0 - lag->drift;
  lag->start_s = -lag->start_s / rate;
  lag->drift = -lag->drift / rate;
  return lag;
}

model::Equation equation_of(const std::vector<Effect>& effects, std::size_t gyro) {
  std::vector<Effect> mine;
  for (const Effect& effect : effects) {
    if (effect.gyro == gyro) mine.push_back(effect);
  }
  return model::Equation(mine);
}

// What a lag behind a clock of that rate says of a clock beyond what the model knows; 0 where it is
// nothing great.
double skew_beyond(const Lag& lag, double against, const model::Equation& known) {
  if (lag.drift_sigma <= 0.0) return 0.0;
  // What is stamped t is of t − start − drift·t.
  const double skew = against / (1.0 - lag.drift) - known.clock_rate();
  return std::abs(skew) > std::max(kDriftLeast, kSigmas * lag.drift_sigma) ? skew : 0.0;
}

Finding skew_finding(const Recording& recording, const Transport& transport, std::size_t gyro,
                     double skew, const Lag& lag) {
  Finding finding;
  finding.effect = Effect{gyro, Kind::kClockSkew, {kPpm * skew}, 0};
  finding.sigma = {kPpm * lag.drift_sigma};
  finding.statistic = (skew / lag.drift_sigma) * (skew / lag.drift_sigma);
  finding.p_value = kFoundPValue;
  finding.where = {0.0, recording.seconds, 0.0, 0.5 / transport.interval_s};
  if (!recording.has_reference) finding.ambiguous_with = {{Kind::kClockSkew, 1 - gyro}};
  finding.evidence =
      fmt::format("{} is {:+.0f} ms off {} in the beginning and {:+.0f} ms in the end",
                  recording.gyros[gyro].name, kMilli * lag.at(0.0),
                  recording.has_reference ? "the reference" : recording.gyros[1 - gyro].name,
                  kMilli * lag.at(recording.seconds));
  Curve line{"lag behind what it is judged against", {}, {}, {}, false};
  line.x = {0.0, recording.seconds};
  line.y = {kMilli * lag.at(0.0), kMilli * lag.at(recording.seconds)};
  finding.figure = Figure{"A clock runs away", "time / s", "lag / ms", false, false, {line}};
  return finding;
}

// By how much both gyros lead it; 0 where they do not.
double lateness_of_reference(const std::array<std::optional<Lag>, 2>& lags,
                             const std::array<model::Equation, 2>& known) {
  std::array<double, 2> early_s{};
  double weight = 0.0;
  double sum = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!lags[gyro]) return 0.0;
    const Lag& lag = *lags[gyro];
    early_s[gyro] = known[gyro].lag_s() - lag.start_s;
    const double sigma_s = std::max(lag.start_sigma_s, kSettled_s);
    if (early_s[gyro] < std::max(kEarlyLeast_s, kSigmas * sigma_s)) return 0.0;
    sum += early_s[gyro] / (sigma_s * sigma_s);
    weight += 1.0 / (sigma_s * sigma_s);
  }
  // Where they differ the one that leads by more is on time, and the other one late.
  const double most_s = std::max(early_s[0], early_s[1]);
  const bool alike = std::abs(early_s[0] - early_s[1]) < kAlikeShare * most_s;
  return alike ? sum / weight : most_s;
}

}  // namespace

std::string reference_late_text(double late_s) {
  return fmt::format("both gyros lead the reference by {:.3f} s: the reference is late", late_s);
}

Timing find_timing(const Recording& recording, const std::array<Transport, 2>& transports,
                   const std::vector<Effect>& known) {
  Timing timing;
  timing.reference_dps = recording.reference_dps;
  const std::array good{usable(recording.gyros[0], transports[0]),
                        usable(recording.gyros[1], transports[1])};
  const std::array equations{equation_of(known, 0), equation_of(known, 1)};
  std::array<std::optional<Lag>, 2> lags;
  if (recording.has_reference) {
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      lags[gyro] = lag_between(good[gyro], recording.reference_dps);
    timing.reference_late_s = lateness_of_reference(lags, equations);
  } else {
    lags[1] = lag_between(good[1], good[0]);
    if (lags[1]) {
      lags[0] = *lags[1];
      lags[0]->start_s = -lags[1]->start_s / (1.0 - lags[1]->drift);
      lags[0]->drift = -lags[1]->drift / (1.0 - lags[1]->drift);
    }
  }
  for (double& t_s : timing.reference_dps.t_s)
    t_s -= timing.reference_late_s;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!lags[gyro]) continue;
    timing.lag[gyro] = *lags[gyro];
    timing.lag[gyro].start_s += timing.reference_late_s;
    // Between two gyros nothing tells whose clock it is: it is told of one, and may be the other's.
    if (!recording.has_reference && gyro == 0) continue;
    const double skew =
        skew_beyond(*lags[gyro], recording.has_reference ? 1.0 : equations[1 - gyro].clock_rate(),
                    equations[gyro]);
    if (skew == 0.0) continue;
    timing.findings.push_back(
        skew_finding(recording, transports[gyro], gyro, skew, timing.lag[gyro]));
  }
  if (timing.reference_late_s > 0.0) {
    timing.notes.push_back(reference_late_text(timing.reference_late_s) +
                           "; all is judged with the reference moved");
  }
  return timing;
}

}  // namespace vgyro::gap
