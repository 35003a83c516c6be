#include "fusion/readings.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vgyro::fusion {

namespace {

// How fast platforms turn when they turn steadily: as likely between 0.02 and 0.2 deg/s as between
// 2 and 20; below 0.02 about even.
constexpr double kSlowTurn_dps = 0.02;
constexpr double kFastTurn_dps = 60.0;

// A steady turn that was interrupted goes on as it was: a circle with a wobble, a ferry in a swell,
// a turntable; and so does a stop in which somebody gets in. How likely, and how nearly. When the
// platform has moved on in between, the next turn may be like the last one all the same.
constexpr double kGoesOn = 0.95;
constexpr double kGoesOnElsewhere = 0.05;
constexpr double kGoesOnWithin = 0.05;
// How fast the level's scatter from run to run is followed.
constexpr double kSwellGain = 0.3;

// How a steady turn wanders, per √s: not at all on a turntable, little on a ship's slow circle,
// more in a helmsman's and a driver's hands. How common each is.
constexpr std::array<double, Readings::kTurnKinds> kTurnWalk_dps_rts{0.0, 2e-4, 0.002};
constexpr std::array<double, Readings::kTurnKinds> kTurnWalkShare_rts{0.0, 0.0, 0.02};
constexpr std::array<double, Readings::kTurnKinds> kTurnPrior{0.15, 0.25, 0.6};

// A step is of one gyro; one that has stepped is the one to step again, or back.
constexpr double kSameGyroAgain = 0.97;
// How likely a step is in a window that contradicts what is foretold.
constexpr double kStepInWindow = 1e-2;
// At a stop the drifts are not where they can be: how likely, and how far they are off at least,
// over N per √1 s, and at most.
constexpr double kSurprise = 1e-4;
constexpr double kSurpriseWhite = 30.0;
constexpr double kSurpriseMost_dps = 1.0;
// What contradicted was no drift of either: frames of somebody else, bits that fell over.
constexpr double kNobodysDrift = 1e-3;
// A gyro that contradicts the other one and then falls out was the wrong one, but for this share.
constexpr double kStepOfTheOther = 0.02;
// How far a step is known when it is seen: by the blocks that show it, and this share of it.
constexpr double kStepDoubt = 0.05;

// A run of steady windows is another one when its level has changed by so many standard deviations.
constexpr double kOtherRun = 3.5;

// A bias beyond what its gyro can have: σ of that limit, as a share of it.
constexpr double kLimitSoftness = 0.1;

// Readings so much alike are one.
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

// A run ends where its likeliest reading no longer fits: a ferry that casts off, a circle that
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
  // Where it has not moved on, how nearly it goes on has been seen.
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

// Prior odds of a turn against a stop: those of any steady stretch, or what it was before.
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

// The platform stands, and what was thought to be known of the drifts is wrong: no model of drift
// holds for ever, and without this a stop once refused would be refused for ever. The doubt is as
// wide as what was found, so that its density falls with it; false where no gyro drifts so far.
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

// Log density of the next level, if the platform turns on.
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
  // One for all: else the reading in which the turn is slowest would be the likeliest.
  double turn_dps = 0.0;
  for (std::size_t i = 0; i < count_ && turn_dps == 0.0; ++i)
    turn_dps = slots_[i].steady == Steady::kTurns ? slots_[i].last_turn_dps : 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    Reading& one = slots_[i];
    if (one.steady == Steady::kStands) {
      one.log_weight += one.bank.learn(window.length_s, window.standing);
      continue;
    }
    // What both read drifts on while the platform turns.
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
  // Within the window the step may have been anywhere.
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
  // Once: a gyro that comes and goes proves no more than one that has gone.
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

// Weights sum to 1, the likeliest come first, and what weighs nothing is gone.
void Readings::settle() {
  // By swaps: no bank may lose the memory that it has.
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

// Readings that have come to say the same are one again.
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
