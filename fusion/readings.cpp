#include "fusion/readings.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vgyro::fusion {

namespace {

// Prior of the rate of steady turns: 0.02 to 0.2 deg/s is as likely as 2 to 20; below 0.02 deg/s
// the density is about constant.
constexpr double kSlowTurn_dps = 0.02;
constexpr double kFastTurn_dps = 60.0;

// Probability that an interrupted turn (a circle with a wobble, a ferry in a swell) continues at
// its rate, or an interrupted stop (a passenger gets in) continues; how closely; and the
// probability that the next turn resembles the last one even after the platform has moved on.
constexpr double kGoesOn = 0.95;
constexpr double kGoesOnElsewhere = 0.05;
constexpr double kGoesOnWithin = 0.05;
// Gain that follows the level's scatter from run to run.
constexpr double kSwellGain = 0.3;

// Random walk of a turn's rate, per √s: none on a turntable, little in a ship's slow circle, more
// in a helmsman's or driver's hands; and the prior of each.
constexpr std::array<double, Readings::kTurnKinds> kTurnWalk_dps_rts{0.0, 2e-4, 0.002};
constexpr std::array<double, Readings::kTurnKinds> kTurnWalkShare_rts{0.0, 0.0, 0.02};
constexpr std::array<double, Readings::kTurnKinds> kTurnPrior{0.15, 0.25, 0.6};

// Probability that the next step is of the gyro that stepped last, forward or back.
constexpr double kSameGyroAgain = 0.97;
// Prior of a step in a window that deviates from its prediction.
constexpr double kStepInWindow = 1e-2;
// Hypothesis that the platform stands although the filters exclude its drifts: prior, least
// deviation in units of N per √1 s, greatest deviation.
constexpr double kSurprise = 1e-4;
constexpr double kSurpriseWhite = 30.0;
constexpr double kSurpriseMost_dps = 1.0;
// Prior that a contradiction was no drift of either gyro, but foreign frames or flipped bits.
constexpr double kNobodysDrift = 1e-3;
// A gyro that contradicts the other one and then falls out was the wrong one, except with this
// probability.
constexpr double kStepOfTheOther = 0.02;
// σ of a step when it is detected, as a share of it, in addition to the noise of its blocks.
constexpr double kStepDoubt = 0.05;

// A run of steady windows ends when its level has changed by this many standard deviations.
constexpr double kOtherRun = 3.5;

// σ of the limit max_bias_dps, as a share of it.
constexpr double kLimitSoftness = 0.1;

// Hypotheses are merged when their biases differ by less than this many σ, and their variances by
// less than this factor.
constexpr double kAlikeSigmas = 0.1;
constexpr double kAlikeVariance = 1.2;

constexpr double kHalfLogTwoPi = 0.918938533204672741780;

double log_normal(double away, double variance) {
  return -0.5 * (away * away / variance + std::log(variance)) - kHalfLogTwoPi;
}

double of_level(const std::array<double, 2>& weight, const DriftEstimate& estimate) {
  return weight[0] * estimate.mean(kBias1) + weight[1] * estimate.mean(kBias2);
}

double level_doubt(const std::array<double, 2>& weight, const DriftEstimate& estimate) {
  return weighted(weight, {estimate.covariance(kBias1, kBias1), estimate.covariance(kBias1, kBias2),
                           estimate.covariance(kBias2, kBias2)});
}

}  // namespace

template <std::size_t Count, std::size_t... I>
std::array<Readings::Reading, Count> Readings::empty_slots(
    const std::array<GyroParameters, 2>& gyros, std::index_sequence<I...> /*numbers*/) {
  return {((void)I, Reading{DriftBank(gyros)})...};
}

Readings::Readings(const std::array<GyroParameters, 2>& gyros)
    : gyros_(gyros), slots_(empty_slots<kSlots>(gyros, std::make_index_sequence<kSlots>())) {}

void Readings::begin(const std::array<double, 2>& white_dps_rthz,
                     const std::array<double, 2>& bias_dps, const Symmetric& covariance) {
  slots_[0].bank.begin(white_dps_rthz, bias_dps, covariance);
  slots_[0].log_weight = 0.0;
  slots_[0].steady = Steady::kNo;
  slots_[0].stepped = kNoGyro;
  slots_[0].last = Steady::kNo;
  count_ = 1;
}

void Readings::resume(const DriftMemory& memory, double age_s) {
  begin({1.0, 1.0}, {0.0, 0.0}, {1.0, 0.0, 1.0});
  slots_[0].bank.resume(memory, age_s);
}

void Readings::go_back(const DriftBank& bank, double gone_s) {
  slots_[0].bank = bank;
  slots_[0].log_weight = 0.0;
  slots_[0].steady = Steady::kNo;
  slots_[0].stepped = kNoGyro;
  slots_[0].last = Steady::kNo;
  count_ = 1;
  predict(gone_s);
}

void Readings::add_back(const DriftBank& bank, double gone_s) {
  Reading& back = slots_[count_++];
  back.bank = bank;
  back.bank.predict(gone_s);
  back.log_weight = std::log(kNobodysDrift);
  back.steady = Steady::kNo;
  back.stepped = kNoGyro;
  back.last = Steady::kNo;
}

void Readings::predict(double length_s) {
  for (std::size_t i = 0; i < count_; ++i)
    slots_[i].bank.predict(length_s);
}

void Readings::learn(double length_s, const DriftMeasurement& measurement) {
  for (std::size_t i = 0; i < count_; ++i)
    slots_[i].log_weight += slots_[i].bank.learn(length_s, measurement);
  settle();
}

// --- steady: does it stand, or turn? -------------------------------------------------------------

void Readings::learn_steady(const SteadyWindow& window) {
  if (standing() + turning() > 0.0 && goes_on(window)) {
    go_on_steady(window);
  } else {
    begin_steady(window);
  }
  settle();
}

// A run ends where its likeliest hypothesis no longer fits: a ferry that casts off, a circle that
// ends.
bool Readings::goes_on(const SteadyWindow& window) {
  const Reading& best = slots_[likeliest()];
  const DriftEstimate known = best.bank.estimate();
  const double away = window.level_dps - of_level(window.weight, known);
  const double variance = window.level_variance + level_doubt(window.weight, known);
  const bool at_rest = squared(away) <= squared(kOtherRun) * variance;
  const bool was_far = squared(best.last_turn_dps) > squared(2.0 * kOtherRun) * variance;
  const bool fits = best.steady == Steady::kStands ? at_rest : !(at_rest && was_far);
  if (fits) return true;
  end_steady();
  return false;
}

double Readings::turn_density(const Reading& reading, const SteadyWindow& window,
                              const DriftEstimate& estimate) const {
  static const double kSpan = 2.0 * std::log((kFastTurn_dps + kSlowTurn_dps) / kSlowTurn_dps);
  const double turn = window.level_dps - of_level(window.weight, estimate);
  const double variance = window.level_variance + level_doubt(window.weight, estimate);
  const double anew = 1.0 / (kSpan * (kSlowTurn_dps + std::sqrt(turn * turn + variance)));
  if (reading.last != Steady::kTurns) return anew;
  const double share = window.elsewhere ? kGoesOnElsewhere : kGoesOn;
  // While the platform has not moved on, swell_variance_ holds the observed scatter instead.
  const double within = window.elsewhere ? squared(kGoesOnWithin * reading.last_turn_dps) : 0.0;
  const double on_variance = variance + within + swell_variance_;
  return (1.0 - share) * anew +
         share * std::exp(log_normal(turn - reading.last_turn_dps, on_variance));
}

double Readings::beyond_limits(const DriftEstimate& estimate) const {
  double penalty = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!gyros_[gyro].max_bias_dps) continue;
    const double limit = *gyros_[gyro].max_bias_dps;
    const double beyond = std::abs(estimate.mean(static_cast<int>(gyro))) - limit;
    if (beyond > 0.0) penalty += 0.5 * squared(beyond / (kLimitSoftness * limit));
  }
  return penalty;
}

// Prior log odds of a turn against a stop: those of any steady stretch, or, while the platform has
// not moved on, those of continuing as in the last run.
double Readings::log_turning(const Reading& reading, const SteadyWindow& window) {
  if (window.elsewhere || reading.last == Steady::kNo) return window.log_turning;
  const double persists = std::log(kGoesOn / (1.0 - kGoesOn));
  return reading.last == Steady::kTurns ? persists : -persists;
}

void Readings::begin_steady(const SteadyWindow& window) {
  follow_swell(window);
  const std::size_t before = count_;
  for (std::size_t i = 0; i < before; ++i) {
    Reading& turns = slots_[i];
    const DriftEstimate known = turns.bank.estimate();
    Reading& stands = slots_[count_++];
    stands = turns;
    stand(stands, window);
    Reading& surprised = slots_[count_++];
    surprised = turns;
    if (surprise(surprised, window, known)) {
      stand(surprised, window);
    } else {
      --count_;
    }
    turns.steady = Steady::kTurns;
    begin_turn(turns, window);
    turns.log_weight += log_turning(turns, window) + std::log(turn_density(turns, window, known));
    turns.last_turn_dps = window.level_dps - of_level(window.weight, known);
    if (window.turning.values.size() == 0) {
      turns.bank.predict(window.length_s);
    } else {
      turns.log_weight += turns.bank.learn(window.length_s, window.turning);
    }
  }
}

void Readings::follow_swell(const SteadyWindow& window) {
  if (window.elsewhere) {
    swell_variance_ = 0.0;
  } else {
    swell_variance_ += kSwellGain * (squared(window.level_dps - last_level_dps_) - swell_variance_);
  }
  last_level_dps_ = window.level_dps;
}

void Readings::stand(Reading& reading, const SteadyWindow& window) {
  reading.steady = Steady::kStands;
  reading.log_weight += reading.bank.learn(window.length_s, window.standing);
  reading.log_weight -= beyond_limits(reading.bank.estimate());
}

// The platform stands, and the estimated drifts are wrong. No model of drift holds for ever;
// without this hypothesis a stop that was once refused would always be refused. Its variance is at
// least the squared deviation, so its density falls with it. False where no gyro drifts so far.
bool Readings::surprise(Reading& reading, const SteadyWindow& window, const DriftEstimate& known) {
  if (!window.elsewhere) return false;
  std::array<double, 2> variance{};
  for (int row = 0; row < window.standing.values.size(); ++row) {
    const int bias = window.standing.rows(row, kBias1) > 0.0 ? kBias1 : kBias2;
    const auto gyro = static_cast<std::size_t>(bias);
    const double away = window.standing.values(row) - known.mean(bias);
    if (std::abs(away) > kSurpriseMost_dps) return false;
    variance[gyro] =
        std::max(squared(kSurpriseWhite) * reading.bank.white_density(gyro), squared(away));
  }
  reading.bank.widen(variance[0], 0.0, variance[1]);
  reading.log_weight += std::log(kSurprise);
  return true;
}

void Readings::begin_turn(Reading& reading, const SteadyWindow& window) {
  for (std::size_t i = 0; i < kTurnKinds; ++i)
    reading.turn[i] = {window.level_dps, window.level_variance, kTurnPrior[i]};
}

// Log density of the next level, if the platform continues to turn.
double Readings::follow_turn(Reading& reading, const SteadyWindow& window, double turn_dps,
                             double drift_growth) {
  std::array<double, kTurnKinds> log_density{};
  for (std::size_t i = 0; i < kTurnKinds; ++i) {
    SteadyTurn& turn = reading.turn[i];
    const double walk =
        squared(kTurnWalk_dps_rts[i]) + squared(kTurnWalkShare_rts[i] * turn_dps) + drift_growth;
    turn.variance += walk * window.length_s;
    const double away = window.level_dps - turn.level_dps;
    const double expected = turn.variance + window.level_variance;
    log_density[i] = std::log(std::max(turn.weight, kGone)) + log_normal(away, expected);
    const double gain = turn.variance / expected;
    turn.level_dps += gain * away;
    turn.variance *= 1.0 - gain;
  }
  const double greatest = *std::max_element(log_density.begin(), log_density.end());
  double sum = 0.0;
  for (const double one : log_density)
    sum += std::exp(one - greatest);
  for (std::size_t i = 0; i < kTurnKinds; ++i)
    reading.turn[i].weight = std::exp(log_density[i] - greatest) / sum;
  return greatest + std::log(sum);
}

void Readings::go_on_steady(const SteadyWindow& window) {
  // One turn rate for all hypotheses: with a rate of its own, the hypothesis with the slowest turn
  // would expect the least wander and be the likeliest.
  double turn_dps = 0.0;
  for (std::size_t i = 0; i < count_ && turn_dps == 0.0; ++i)
    turn_dps = slots_[i].steady == Steady::kTurns ? slots_[i].last_turn_dps : 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    Reading& one = slots_[i];
    if (one.steady == Steady::kStands) {
      one.log_weight += one.bank.learn(window.length_s, window.standing);
      continue;
    }
    // The level drifts with the biases while the platform turns.
    const auto growth = one.bank.estimate().growth;
    const double drift = weighted(window.weight, {growth[0], 0.0, growth[1]});
    one.log_weight += window.log_turning + follow_turn(one, window, turn_dps, drift);
    if (window.turning.values.size() == 0) {
      one.bank.predict(window.length_s);
    } else {
      one.log_weight += one.bank.learn(window.length_s, window.turning);
    }
  }
}

void Readings::end_steady() {
  for (std::size_t i = 0; i < count_; ++i) {
    if (slots_[i].steady == Steady::kStands) slots_[i].stepped = kNoGyro;
    slots_[i].last = slots_[i].steady;
    slots_[i].steady = Steady::kNo;
  }
  join_alike();
}

// --- steps ---------------------------------------------------------------------------------------

void Readings::step(Reading& reading, std::size_t gyro, double away_dps, double doubt,
                    double share) {
  if (reading.stepped != kNoGyro)
    share = reading.stepped == gyro ? kSameGyroAgain : 1.0 - kSameGyroAgain;
  reading.bank.shift(gyro, gyro == 0 ? away_dps : -away_dps, doubt);
  reading.log_weight += std::log(share);
  reading.stepped = gyro;
}

void Readings::split_step(double away_dps, double variance, double first_share) {
  const std::size_t before = count_;
  suspected_ = {};
  const double doubt = variance + squared(kStepDoubt * away_dps);
  for (std::size_t i = 0; i < before; ++i) {
    Reading& second = slots_[count_++];
    second = slots_[i];
    step(slots_[i], 0, away_dps, doubt, first_share);
    step(second, 1, away_dps, doubt, 1.0 - first_share);
  }
  settle();
}

void Readings::learn_maybe_step(double length_s, const DriftMeasurement& measurement,
                                const DriftMeasurement& doubted, double away_dps, double variance,
                                double first_share) {
  const std::size_t before = count_;
  // The step may be anywhere in the window.
  const double doubt = variance + squared(away_dps);
  for (std::size_t i = 0; i < before; ++i) {
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      Reading& stepped = slots_[count_++];
      stepped = slots_[i];
      step(stepped, gyro, away_dps, doubt, gyro == 0 ? first_share : 1.0 - first_share);
      stepped.log_weight += std::log(kStepInWindow) + stepped.bank.learn(length_s, measurement);
    }
    slots_[i].log_weight += slots_[i].bank.learn(length_s, doubted);
  }
  settle();
}

void Readings::suspect(std::size_t gyro) {
  // Only once: a gyro that comes and goes proves no more than one that stays away.
  if (suspected_[gyro]) return;
  suspected_[gyro] = true;
  for (std::size_t i = 0; i < count_; ++i) {
    if (slots_[i].stepped == 1 - gyro) slots_[i].log_weight += std::log(kStepOfTheOther);
  }
  settle();
}

void Readings::set_temperature(const std::array<double, 2>& temperature_c) {
  for (std::size_t i = 0; i < count_; ++i)
    slots_[i].bank.set_temperature(temperature_c);
}

void Readings::observe_at(const std::array<double, 2>& temperature_c) {
  for (std::size_t i = 0; i < count_; ++i)
    slots_[i].bank.observe_at(temperature_c);
}

// --- weights -------------------------------------------------------------------------------------

std::size_t Readings::likeliest() const {
  std::size_t best = 0;
  for (std::size_t i = 1; i < count_; ++i) {
    if (slots_[i].log_weight > slots_[best].log_weight) best = i;
  }
  return best;
}

// Normalizes the weights, puts the likeliest hypothesis first and drops those without weight.
void Readings::settle() {
  // Swaps keep the memory of every bank, so nothing is allocated.
  for (std::size_t i = 1; i < count_; ++i) {
    for (std::size_t j = i; j > 0 && slots_[j].log_weight > slots_[j - 1].log_weight; --j)
      std::swap(slots_[j], slots_[j - 1]);
  }
  const double greatest = slots_[0].log_weight;
  while (count_ > 1 &&
         (count_ > kKept || slots_[count_ - 1].log_weight < greatest + std::log(kGone)))
    --count_;
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i)
    sum += std::exp(slots_[i].log_weight - greatest);
  for (std::size_t i = 0; i < count_; ++i)
    slots_[i].log_weight -= greatest + std::log(sum);
}

// Merges hypotheses whose biases have become alike.
void Readings::join_alike() {
  std::array<DriftEstimate, kKept> estimate;
  for (std::size_t i = 0; i < count_; ++i)
    estimate[i] = slots_[i].bank.estimate();
  const auto alike = [&](std::size_t a, std::size_t b) {
    for (int bias = kBias1; bias <= kBias2; ++bias) {
      const double variance = estimate[a].covariance(bias, bias);
      const double other = estimate[b].covariance(bias, bias);
      const double away = estimate[a].mean(bias) - estimate[b].mean(bias);
      if (squared(away) > squared(kAlikeSigmas) * std::min(variance, other)) return false;
      if (std::max(variance, other) > kAlikeVariance * std::min(variance, other)) return false;
    }
    return true;
  };
  for (std::size_t i = 0; i < count_; ++i) {
    for (std::size_t j = count_ - 1; j > i; --j) {
      if (!alike(i, j)) continue;
      slots_[i].log_weight =
          std::log(std::exp(slots_[i].log_weight) + std::exp(slots_[j].log_weight));
      if (j + 1 < count_) {
        std::swap(slots_[j], slots_[count_ - 1]);
        std::swap(estimate[j], estimate[count_ - 1]);
      }
      --count_;
    }
  }
  settle();
}

DriftEstimate Readings::estimate() const {
  if (count_ == 1) return slots_[0].bank.estimate();
  EstimateMixer mixer;
  for (std::size_t i = 0; i < count_; ++i)
    mixer.add(std::exp(slots_[i].log_weight), slots_[i].bank.estimate());
  return mixer.result();
}

double Readings::standing() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i)
    sum += slots_[i].steady == Steady::kStands ? std::exp(slots_[i].log_weight) : 0.0;
  return sum;
}

double Readings::turning() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i)
    sum += slots_[i].steady == Steady::kTurns ? std::exp(slots_[i].log_weight) : 0.0;
  return sum;
}

double Readings::stepped(std::size_t gyro) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i)
    sum += slots_[i].stepped == gyro ? std::exp(slots_[i].log_weight) : 0.0;
  return sum;
}

bool Readings::ambiguous() const {
  if (count_ < 2 || std::exp(slots_[1].log_weight) < kWorthTelling) return false;
  const DriftEstimate first = slots_[0].bank.estimate();
  for (std::size_t i = 1; i < count_ && std::exp(slots_[i].log_weight) >= kWorthTelling; ++i) {
    const DriftEstimate other = slots_[i].bank.estimate();
    for (int bias = kBias1; bias <= kBias2; ++bias) {
      const double apart = first.mean(bias) - other.mean(bias);
      if (squared(apart) > 4.0 * (first.covariance(bias, bias) + other.covariance(bias, bias)))
        return true;
    }
  }
  return false;
}

}  // namespace vgyro::fusion
