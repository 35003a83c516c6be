#include "gap/transport.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/core.h>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

// Logs and kernels count microseconds; candump's rounding is no lateness.
constexpr double kStampResolution_s = 3e-6;
constexpr std::size_t kStuckMin = 8;
constexpr double kStuckMin_s = 0.15;
constexpr double kChance = 1e-9;
/// Share of equal neighbours above which a sensor is coarse.
constexpr double kCoarse = 0.02;
constexpr std::size_t kPlateauMin = 6;
constexpr std::size_t kLostMin = 3;

bool knows(const std::vector<Effect>& effects, Kind kind) {
  return std::any_of(effects.begin(), effects.end(),
                     [&](const Effect& effect) { return effect.kind == kind; });
}

class Check {
 public:
  Check(const GyroSeries& series, std::size_t gyro, const std::vector<Effect>& known)
      : series_(series), gyro_(gyro), known_(known), n_(series.t_s.size()) {}

  Transport run() {
    result_.t_s = series_.t_s;
    result_.masked.assign(n_, 0);
    result_.late_s.assign(n_, 0.0);
    count_frames();
    find_lost();
    find_lateness();
    find_lattice();
    result_.lattice_dps = lattice_dps_;
    find_stuck();
    find_saturation();
    find_dead_band();
    count_repeats();
    return std::move(result_);
  }

 private:
  [[nodiscard]] Where whole() const {
    return {series_.t_s.front(), series_.t_s.back(), 0.0, 0.5 / result_.interval_s};
  }

  void add(Kind kind, model::Parameters parameters, model::Parameters sigma, double statistic,
           Where where, std::string evidence, Figure figure = {}) {
    Finding finding;
    finding.effect = Effect{gyro_, kind, parameters, 0};
    finding.sigma = sigma;
    finding.statistic = statistic;
    finding.p_value = std::min(1e-6, std::exp(-0.5 * statistic));
    finding.where = where;
    finding.evidence = std::move(evidence);
    finding.figure = std::move(figure);
    result_.findings.push_back(std::move(finding));
  }

  void count_repeats() {
    std::size_t good = 0;
    std::size_t same = 0;
    for (std::size_t i = 1; i < n_; ++i) {
      if (result_.masked[i] + result_.masked[i - 1] > 0) continue;
      ++good;
      if (series_.rate_dps[i] == series_.rate_dps[i - 1]) ++same;
    }
    if (good > 0) result_.repeats = static_cast<double>(same) / static_cast<double>(good);
  }

  // Number of the sample on the even clock: by the alive counter where there is one.
  void count_frames() {
    std::vector<double> steps_s;
    for (std::size_t i = 1; i < n_; ++i)
      steps_s.push_back(series_.t_s[i] - series_.t_s[i - 1]);
    std::vector<double> unordered_s = steps_s;
    result_.interval_s = median_of(unordered_s);
    number_.assign(n_, 0.0);
    const bool counted = series_.counter.size() == n_ && series_.counter_modulus > 1;
    for (std::size_t i = 1; i < n_; ++i) {
      const double by_time = std::max(1.0, std::round(steps_s[i - 1] / result_.interval_s));
      double step = by_time;
      if (counted) {
        const double modulus = series_.counter_modulus;
        const double by_counter = static_cast<double>(
            (series_.counter[i] + series_.counter_modulus - series_.counter[i - 1]) %
            series_.counter_modulus);
        // Whole turns of the counter are told by time.
        const double turns =
            std::round((steps_s[i - 1] / result_.interval_s - by_counter) / modulus);
        step = std::max(1.0, by_counter + std::max(0.0, turns) * modulus);
      }
      number_[i] = number_[i - 1] + step;
    }
  }

  void find_lost() {
    double lost = 0.0;
    std::size_t events = 0;
    double longest = 0.0;
    Curve marks{"frames missing at once", {}, {}, {}, true};
    for (std::size_t i = 1; i < n_; ++i) {
      const double missing = number_[i] - number_[i - 1] - 1.0;
      if (missing < 1.0) continue;
      lost += missing;
      longest = std::max(longest, missing);
      ++events;
      marks.x.push_back(series_.t_s[i]);
      marks.y.push_back(missing);
    }
    const double sent = lost + static_cast<double>(n_);
    const double share = lost / sent;
    result_.lost_share = share;
    if (lost == 0.0 || knows(known_, Kind::kDroppedFrames)) return;
    if (events < kLostMin || longest > 0.5 * lost) {
      result_.notes.push_back(fmt::format("{}: {:.0f} frames are missing, {:.0f} of them at once",
                                          series_.name, lost, longest));
      return;
    }
    Figure figure{
        "Frames that the counter says are missing", "time / s", "frames", false, false, {marks}};
    add(Kind::kDroppedFrames, {share}, {std::sqrt(share * (1.0 - share) / sent)},
        2.0 * lost * std::log(1e6 * share + 1.0), whole(),
        fmt::format("the counter of {} skips {:.0f} of {:.0f} frames, at {} places", series_.name,
                    lost, sent, events),
        figure);
  }

  // The even clock is the line below which no stamp lies, up to the stamps' resolution: nothing
  // comes early. It is found on the lower envelope of short stretches.
  void find_lateness() {
    if (n_ < 200) return;
    const std::size_t stretch = std::max<std::size_t>(50, n_ / 200);
    double slope = result_.interval_s;
    double offset = series_.t_s.front();
    const auto residual = [&](std::size_t i) {
      return series_.t_s[i] - offset - slope * number_[i];
    };
    // First by least squares, then on the least residual of each stretch.
    for (int round = 0; round < 4; ++round) {
      double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0, count = 0.0;
      const double pivot = number_[n_ / 2];
      for (std::size_t from = 0; from < n_; from += stretch) {
        const std::size_t to = std::min(n_, from + stretch);
        std::size_t best = from;
        for (std::size_t i = from; i < to; ++i) {
          if (residual(i) < residual(best)) best = i;
          if (round > 0) continue;
          const double x = number_[i] - pivot;
          sx += x, sy += residual(i), sxx += x * x, sxy += x * residual(i), count += 1.0;
        }
        if (round == 0) continue;
        const double x = number_[best] - pivot;
        sx += x, sy += residual(best), sxx += x * x, sxy += x * residual(best), count += 1.0;
      }
      const double determinant = count * sxx - sx * sx;
      if (determinant <= 0.0) return;
      const double change = (count * sxy - sx * sy) / determinant;
      const double shift = (sy - change * sx) / count;
      slope += change;
      offset += shift - change * pivot;
    }
    double least = 1e300;
    for (std::size_t i = 0; i < n_; ++i)
      least = std::min(least, residual(i));
    double sum = 0.0, squares = 0.0, cubes = 0.0;
    for (std::size_t i = 0; i < n_; ++i) {
      result_.late_s[i] = residual(i) - least;
      sum += result_.late_s[i];
    }
    const double mean = sum / static_cast<double>(n_);
    for (std::size_t i = 0; i < n_; ++i) {
      const double x = result_.late_s[i] - mean;
      squares += x * x;
      cubes += x * x * x;
    }
    result_.interval_s = slope;
    const double deviation = std::sqrt(squares / static_cast<double>(n_));
    // A clock that wanders is no random lateness: neighbours then agree.
    double steps = 0.0;
    for (std::size_t i = 1; i < n_; ++i) {
      const double x = result_.late_s[i] - result_.late_s[i - 1];
      steps += x * x;
    }
    const double rough = std::sqrt(0.5 * steps / static_cast<double>(n_ - 1));
    if (deviation < kStampResolution_s || rough < 0.3 * deviation) return;
    if (deviation > 3.0 * slope) return;
    const double skewness = cubes / static_cast<double>(n_) / (deviation * deviation * deviation);
    // The folded normal has a skewness of 0.995, the exponential 2, the normal 0.
    double sigma_s = deviation;
    if (skewness > 0.5 && skewness < 1.5) sigma_s = deviation / std::sqrt(1.0 - 2.0 / M_PI);
    for (std::size_t i = 0; i < n_; ++i)
      result_.t_s[i] = offset + least + slope * number_[i];
    // Of symmetrical lateness the mean is the place of the clock.
    if (skewness < 0.5) {
      for (double& t : result_.t_s)
        t += mean;
    }
    if (knows(known_, Kind::kTimestampJitter)) return;
    Curve curve{"lateness of each stamp", {}, {}, {}, true};
    const std::size_t every = std::max<std::size_t>(1, n_ / 3000);
    for (std::size_t i = 0; i < n_; i += every) {
      curve.x.push_back(series_.t_s[i]);
      curve.y.push_back(result_.late_s[i] * 1e3);
    }
    add(Kind::kTimestampJitter, {sigma_s}, {sigma_s / std::sqrt(static_cast<double>(n_))},
        static_cast<double>(n_), whole(),
        fmt::format(
            "stamps of {} stand up to {:.3g} ms behind an even clock of {:.6g} ms", series_.name,
            1e3 * *std::max_element(result_.late_s.begin(), result_.late_s.end()), 1e3 * slope),
        Figure{"How late each stamp is behind the even clock",
               "time / s",
               "lateness / ms",
               false,
               false,
               {curve}});
  }

  void find_lattice() {
    std::vector<double> values = series_.rate_dps;
    std::sort(values.begin(), values.end());
    const double tolerance = std::max(0.6 * series_.step_dps, 1e-12);
    std::vector<double> levels;
    for (const double value : values) {
      if (levels.empty() || value - levels.back() > tolerance) levels.push_back(value);
    }
    lattice_dps_ = series_.step_dps;
    if (levels.size() < 3) return;
    std::vector<double> steps;
    for (std::size_t i = 1; i < levels.size(); ++i)
      steps.push_back(levels[i] - levels[i - 1]);
    // Levels that neighbour each other are one step apart: the tenth part with the least distance.
    std::sort(steps.begin(), steps.end());
    double step = steps[steps.size() / 20];
    // On three of the frame's steps or fewer every value would seem to stand on the lattice below.
    if (step < 3.5 * std::max(series_.step_dps, 1e-12)) return;
    // Refine: every level is a whole number of steps; the number is sure near zero first.
    std::vector<double> sizes;
    sizes.reserve(levels.size());
    for (const double level : levels)
      sizes.push_back(std::abs(level));
    std::sort(sizes.begin(), sizes.end());
    for (int round = 0; round < 3; ++round) {
      double mm = 0.0;
      double mv = 0.0;
      double reach = 20.0 * step;
      for (const double size : sizes) {
        if (size > reach) {
          step = mm > 0.0 ? mv / mm : step;
          reach *= 1.5;
          if (size > reach) reach = size;
        }
        const double m = std::round(size / step);
        mm += m * m;
        mv += m * size;
      }
      if (mm > 0.0) step = mv / mm;
    }
    double worst = 0.0;
    std::size_t off = 0;
    for (const double size : sizes) {
      const double error = std::abs(size - step * std::round(size / step));
      worst = std::max(worst, error);
      if (error > 0.2 * step + tolerance) ++off;
    }
    if (off * 50 > sizes.size()) return;
    lattice_dps_ = step;
    if (knows(known_, Kind::kQuantization)) return;
    Curve before{"values near zero", {}, {}, {}, true};
    for (std::size_t i = 0; i < n_; i += std::max<std::size_t>(1, n_ / 2000)) {
      before.x.push_back(series_.t_s[i]);
      before.y.push_back(series_.rate_dps[i]);
    }
    add(Kind::kQuantization, {step},
        {std::max(series_.step_dps, 1e-9) / std::sqrt(12.0 * static_cast<double>(levels.size()))},
        2.0 * static_cast<double>(n_) * std::log(step / std::max(series_.step_dps, 1e-12)), whole(),
        fmt::format(
            "all values of {} lie on multiples of {:.6g} deg/s, the frame could carry steps "
            "of {:.2g}",
            series_.name, step, series_.step_dps),
        Figure{"The readings stand on a lattice", "time / s", "deg/s", false, false, {before}});
  }

  void find_stuck() {
    const std::vector<double>& y = series_.rate_dps;
    const double extreme = *std::max_element(y.begin(), y.end());
    const double least = *std::min_element(y.begin(), y.end());
    double repeats = 0.0;
    std::size_t run = 1;
    for (std::size_t i = 1; i < n_; ++i) {
      run = y[i] == y[i - 1] ? run + 1 : 1;
      if (run > 1 && run < 5) repeats += 1.0;
    }
    const double chance =
        std::clamp(repeats / static_cast<double>(n_), 1.0 / static_cast<double>(n_), 0.999);
    // A coarse sensor repeats itself at rest: there only a run beyond all others counts.
    std::vector<double> runs_s;
    coarse_ = chance > kCoarse;
    if (coarse_) {
      for (std::size_t i = 0; i < n_;) {
        std::size_t end = i + 1;
        while (end < n_ && y[end] == y[i])
          ++end;
        runs_s.push_back(series_.t_s[end - 1] - series_.t_s[i]);
        i = end;
      }
      std::sort(runs_s.begin(), runs_s.end());
    }
    const double longest_s = runs_s.size() > 1 ? runs_s[runs_s.size() - 2] : 0.0;
    for (std::size_t i = 0; i < n_;) {
      std::size_t end = i + 1;
      while (end < n_ && y[end] == y[i])
        ++end;
      const std::size_t length = end - i;
      const double logp =
          static_cast<double>(length - 1) * std::log(chance) + std::log(static_cast<double>(n_));
      const bool long_enough = length >= kStuckMin && series_.t_s[end - 1] - series_.t_s[i] >=
                                                          std::max(kStuckMin_s, 10.0 * longest_s);
      if (long_enough && logp < std::log(kChance) && y[i] != extreme && y[i] != least &&
          y[i] != 0.0) {
        // Frozen from some instant between its first sample and the next.
        const double from_s = 0.5 * (series_.t_s[i] + series_.t_s[i + 1]);
        const double to_s = end < n_ ? series_.t_s[end] : series_.t_s[n_ - 1];
        // The first value may be a fresh one.
        for (std::size_t j = i + 1; j < end; ++j)
          result_.masked[j] = 1;
        bool known = false;
        for (const Effect& effect : known_) {
          known = known || (effect.kind == Kind::kStuck && effect.parameters[0] < to_s &&
                            effect.parameters[1] > from_s);
        }
        if (!known) {
          const double sigma_s = 0.5 * result_.interval_s;
          Curve curve{"reading", {}, {}, {}, true};
          for (std::size_t j = i > 200 ? i - 200 : 0; j < std::min(n_, end + 200); ++j) {
            curve.x.push_back(series_.t_s[j]);
            curve.y.push_back(y[j]);
          }
          add(Kind::kStuck, {from_s, to_s}, {sigma_s, sigma_s}, -2.0 * logp,
              {from_s, to_s, 0.0, 0.5 / result_.interval_s},
              fmt::format("{} repeats the value {:.6g} {} times", series_.name, y[i], length),
              Figure{"The value freezes", "time / s", "deg/s", false, false, {curve}});
        }
      }
      i = end;
    }
  }

  void find_saturation() {
    const std::vector<double>& y = series_.rate_dps;
    const double top = *std::max_element(y.begin(), y.end());
    const double bottom = *std::min_element(y.begin(), y.end());
    double limit = 0.0;
    std::size_t best = 0;
    std::size_t total = 0;
    for (const double level : {top, bottom}) {
      std::size_t at = 0;
      std::size_t near = 0;  // as far again inside as the lattice or half a per cent reaches
      const double reach = std::max(3.0 * lattice_dps_, 0.001 * std::abs(level));
      for (const double value : y) {
        if (value == level) {
          ++at;
        } else if (std::abs(value - level) <= reach) {
          ++near;
        }
      }
      const double expected =
          lattice_dps_ > 0.0 ? static_cast<double>(near) * lattice_dps_ / reach : 0.0;
      if (at >= kPlateauMin && static_cast<double>(at) > 8.0 * expected + 4.0) {
        total += at;
        if (at > best) best = at, limit = std::abs(level);
      }
    }
    for (const Effect& effect : known_) {
      if (effect.kind != Kind::kSaturation) continue;
      mask_beyond(effect.parameters[0]);
      return;
    }
    if (best == 0) return;
    // Nothing lies beyond the limit on the other side either.
    if (std::max(std::abs(top), std::abs(bottom)) > limit * (1.0 + 1e-9)) return;
    // On a coarse lattice a steady turn stands on one value.
    if (limit < 20.0 * lattice_dps_ || coarse_) return;
    mask_beyond(limit);
    Curve curve{"reading", {}, {}, {}, false};
    std::size_t at = 0;
    while (std::abs(y[at]) < limit)
      ++at;
    for (std::size_t j = at > 300 ? at - 300 : 0; j < std::min(n_, at + 600); ++j) {
      curve.x.push_back(series_.t_s[j]);
      curve.y.push_back(y[j]);
    }
    add(Kind::kSaturation, {limit}, {std::max(series_.step_dps, 1e-9) / std::sqrt(12.0)},
        30.0 + 10.0 * static_cast<double>(total), whole(),
        fmt::format("{} samples of {} read exactly {:.6g} deg/s, none more", total, series_.name,
                    limit),
        Figure{"Readings end at a limit", "time / s", "deg/s", false, false, {curve}});
  }

  void mask_beyond(double limit) {
    for (std::size_t i = 0; i < n_; ++i) {
      if (std::abs(series_.rate_dps[i]) >= limit * (1.0 - 1e-3)) result_.masked[i] = 1;
    }
  }

  void find_dead_band() {
    const std::vector<double>& y = series_.rate_dps;
    std::size_t zeros = 0;
    std::vector<double> sizes;
    for (const double value : y) {
      if (std::abs(value) <= 0.25 * series_.step_dps) {
        ++zeros;
      } else {
        sizes.push_back(std::abs(value));
      }
    }
    for (const Effect& effect : known_) {
      if (effect.kind != Kind::kDeadBand) continue;
      mask_below(effect.parameters[0]);
      return;
    }
    if (zeros < kPlateauMin || sizes.size() < 100) return;
    std::sort(sizes.begin(), sizes.end());
    const double width = sizes.front();
    // A lattice alone has its next level one step away and as often.
    if (width < 2.5 * lattice_dps_) return;
    std::size_t next = 0;
    while (next < sizes.size() && sizes[next] < 2.0 * width)
      ++next;
    if (next < 3) return;
    // The edge lies below the least size, by the distance of its followers.
    const std::size_t followers = std::min<std::size_t>(sizes.size() - 1, 10);
    const double spacing = (sizes[followers] - sizes[0]) / static_cast<double>(followers);
    mask_below(width);
    Curve curve{"reading", {}, {}, {}, true};
    for (std::size_t i = 0; i < n_ && curve.x.size() < 3000; ++i) {
      if (std::abs(y[i]) > 5.0 * width) continue;
      curve.x.push_back(series_.t_s[i]);
      curve.y.push_back(y[i]);
    }
    add(Kind::kDeadBand, {std::max(width - spacing, 0.0)}, {std::max(spacing, 1e-9)},
        30.0 + 4.0 * static_cast<double>(zeros), whole(),
        fmt::format("{} samples of {} are exactly 0 and none lies between 0 and {:.4g} deg/s",
                    zeros, series_.name, width),
        Figure{"Nothing is read near zero", "time / s", "deg/s", false, false, {curve}});
  }

  void mask_below(double width) {
    for (std::size_t i = 0; i < n_; ++i) {
      if (std::abs(series_.rate_dps[i]) < 1.5 * width) result_.masked[i] = 1;
    }
  }

  const GyroSeries& series_;
  std::size_t gyro_;
  const std::vector<Effect>& known_;
  std::size_t n_;
  std::vector<double> number_;  ///< on the even clock
  double lattice_dps_ = 0.0;
  bool coarse_ = false;
  Transport result_;
};

}  // namespace

Transport check_transport(const GyroSeries& series, std::size_t gyro,
                          const std::vector<Effect>& known) {
  return Check(series, gyro, known).run();
}

}  // namespace vgyro::gap
