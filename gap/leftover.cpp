#include "gap/leftover.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "gap/score.h"
#include "gap/whiteness.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

// Of the statistic of the noise that is taken back: what is smaller may be a part of it.
constexpr double kSmallShare = 0.03;

// What looked like an effect and is none.
Unexplained resembling(const Found& one, double seconds) {
  const model::Effect& effect = one.effect;
  const KindRow& its = row(effect.kind);
  Unexplained left;
  left.signature = its.signature;
  left.gyro = effect.gyro;
  left.to_s = seconds;
  if (its.finder == Finder::kLine) {
    left.frequency_hz = effect.parameters[0];
    left.amplitude_dps = std::abs(effect.parameters[1]);
    left.text = fmt::format("line near {:.4g} Hz, {:.2g} deg/s, not steady", effect.parameters[0],
                            std::abs(effect.parameters[1]));
  } else if (its.finder == Finder::kStep) {
    left.from_s = effect.parameters[1];
    left.amplitude_dps = std::abs(effect.parameters[0]);
    left.text = fmt::format("one of several steps: {:.3g} deg/s at {:.1f} s", effect.parameters[0],
                            effect.parameters[1]);
  } else {
    left.text = fmt::format("resembles {} ({}), but does not keep its size through the recording",
                            model::info(effect.kind).name, model::parameters_text(effect));
  }
  return left;
}

bool is_fast_noise(const Found& one) {
  const Random part = row(one.effect.kind).random;
  return part == Random::kWhite || part == Random::kRatio;
}

bool is_drift(const Found& one) {
  return is_drift(row(one.effect.kind).random);
}

bool is_quick_drift(const Found& one) {
  return row(one.effect.kind).random == Random::kMarkov && one.effect.parameters[1] < kQuickDrift_s;
}

// One gyro's names and what is left of it.
class Leftovers {
 public:
  Leftovers(std::size_t gyro, double seconds, std::vector<Found>& found,
            std::vector<Unexplained>& list)
      : gyro_(gyro), seconds_(seconds), found_(found), list_(list) {}

  void judge(const Whiteness& whiteness) {
    const bool quick = std::any_of(found_.begin(), found_.end(), [&](const Found& one) {
      return one.effect.gyro == gyro_ && is_quick_drift(one);
    });
    const Flaws flaws = flaws_of(whiteness, quick);
    if (flaws.fast()) say_fast(flaws, whiteness);
    if (flaws.slow()) say_slow(flaws, whiteness);
  }

 private:
  [[nodiscard]] Unexplained left(std::string_view signature, double from_s, double to_s) const {
    Unexplained left;
    left.signature = signature;
    left.gyro = gyro_;
    left.from_s = from_s;
    left.to_s = to_s;
    return left;
  }

  // Takes noise of the gyro back, and what is so small beside it that it may be a part of it.
  template <class Predicate>
  void withdraw(const Predicate& is) {
    const auto end = std::stable_partition(found_.begin(), found_.end(), [&](const Found& one) {
      return one.effect.gyro != gyro_ || !is(one);
    });
    double weight = 0.0;
    for (auto one = end; one != found_.end(); ++one)
      weight += one->statistic;
    found_.erase(end, found_.end());
    const auto small = std::stable_partition(found_.begin(), found_.end(), [&](const Found& one) {
      return one.effect.gyro != gyro_ || one.statistic > kSmallShare * weight;
    });
    for (auto one = small; one != found_.end(); ++one)
      list_.push_back(resembling(*one, seconds_));
    found_.erase(small, found_.end());
  }

  void say_fast(const Flaws& flaws, const Whiteness& whiteness) {
    withdraw(is_fast_noise);
    Unexplained what = left("noise", 0.0, seconds_);
    if (flaws.coloured) {
      what.text = fmt::format(
          "neighbouring samples hang together, by {:.0f} standard errors: the noise is not white",
          whiteness.colour);
      what.is_soft = whiteness.soft;
      // Coloured fast noise is no drift either.
      withdraw(is_drift);
    } else if (flaws.spiky) {
      what.signature = "outliers";
      what.text = fmt::format(
          "single samples stand out of the noise, by {:.0f} standard errors of their fourth power",
          whiteness.spiky);
    } else {
      what.from_s = whiteness.fast_at.from_s;
      what.to_s = whiteness.fast_at.to_s;
      what.text =
          fmt::format("the noise is another one from {:.0f} to {:.0f} s, by {:.0f} standard errors",
                      what.from_s, what.to_s, whiteness.fast);
    }
    list_.push_back(std::move(what));
  }

  void say_slow(const Flaws& flaws, const Whiteness& whiteness) {
    withdraw(is_drift);
    Unexplained what = flaws.bursts
                           ? left("bursts", whiteness.slow_at.from_s, whiteness.slow_at.to_s)
                           : left("slow", 0.0, seconds_);
    what.text =
        flaws.moves_too_much
            ? fmt::format(
                  "the drift moves more than its noise allows, most from {:.0f} to {:.0f} s",
                  what.from_s, what.to_s)
            : std::string(
                  "a slow drift that no random walk and none of the recorded quantities follows");
    list_.push_back(std::move(what));
  }

  std::size_t gyro_;
  double seconds_;
  std::vector<Found>& found_;
  std::vector<Unexplained>& list_;
};

}  // namespace

std::vector<Unexplained> leftovers(const Search& search, std::vector<Found>& found) {
  const Study& study = search.study();
  const double seconds = study.recording().seconds;
  std::vector<Unexplained> list;
  for (const Found& one : search.rejected())
    list.push_back(resembling(one, seconds));
  // Noise that was named must leave innovations that are white and alike throughout.
  const Effects effects = search.effects();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    // The rounding of slow readings is neither white nor alike throughout.
    if (study.is_coarse(gyro)) continue;
    Leftovers(gyro, seconds, found, list)
        .judge(whiteness_of(study.observations_of(gyro), gyro, effects));
  }
  return list;
}

namespace {

double held_out_nats(const Study& study, Effects effects, const std::vector<Found>& found,
                     std::size_t left_out) {
  for (std::size_t i = 0; i < found.size(); ++i)
    if (i != left_out) effects.push_back(found[i].effect);
  return observed(study, effects, Part::kHeldOut).nats;
}

}  // namespace

std::vector<Unexplained> unproven(const Study& study, const Effects& others,
                                  std::vector<Found>& found) {
  std::vector<Unexplained> list;
  while (!found.empty()) {
    const double with = held_out_nats(study, others, found, found.size());
    std::size_t worst = found.size();
    double least = with;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const double without = held_out_nats(study, others, found, i);
      if (without <= least) least = without, worst = i;
    }
    if (worst == found.size()) break;
    Unexplained left = resembling(found[worst], study.recording().seconds);
    const model::Effect& effect = found[worst].effect;
    left.text =
        fmt::format("resembles {} ({}), but the samples that were set aside do not bear it out",
                    model::info(effect.kind).name, model::parameters_text(effect));
    list.push_back(std::move(left));
    found.erase(found.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return list;
}

}  // namespace vgyro::gap
