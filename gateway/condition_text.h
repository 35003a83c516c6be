#pragma once

// The corrector's findings as text for people: `vgyro status`, the journal and the summary of a
// replay use the same. Plain values in, sentences out; an empty text where there is nothing to
// report. The caller adds colours, line breaks and rate limits.

#include <array>
#include <cstdint>
#include <string>

#include "gateway/status.h"

namespace vgyro::gateway {

using GyroNames = std::array<std::string, 2>;
using Probabilities = std::array<double, fusion::kHypotheses>;

/// Less likely hypotheses are not reported.
inline constexpr double kWorthTelling = 0.05;

/// A normalised innovation above this is reported: four times its scatter above the expected 1.
inline constexpr double kInnovationHigh = 2.0;

/// Stretches in which both gyros were steady. Each was either learned from or refused; `open`
/// counts some of these.
struct SteadyStretches {
  std::uint64_t learned = 0;
  std::uint64_t refused = 0;
  std::uint64_t open = 0;
};
SteadyStretches steady_stretches(const Status& status);

/// "8 steady stretches: 7 stops learned, 1 refused: turning together".
std::string stretches_text(const SteadyStretches& stretches);
/// Advice on what to check if three or more, and more than half of all, taught little.
std::string stretches_advice(const SteadyStretches& stretches);

/// "standing 93 %, turning steadily 7 %; gyro fog has stepped 60 %".
std::string hypotheses_text(const Probabilities& probability, const GyroNames& names);
/// "warming up 80 %, random walk 20 %".
std::string drift_kind_text(const Probabilities& probability);
/// Text for two likely hypotheses: which ones, and the effect on σ.
std::string ambiguity_text(const Probabilities& probability, const GyroNames& names);

/// "left +3.12 ± 0.41, right -1.00 ± 0.65 deg/h an hour"; leaves out a slope that is NaN (unknown).
std::string slopes_text(const std::array<double, 2>& slope_dps_s,
                        const std::array<double, 2>& sigma_dps_s, const GyroNames& names);

/// What is wrong with a blind gyro, as the predicate of a sentence about it; and what to check.
std::string blind_text();
std::string blind_advice();
/// The contradiction ("mems moves -1.00 times fog: sign = -1?") and what to do; empty without one.
std::string contradiction_text(const fusion::PairVerdict& pair, const GyroNames& names);
std::string contradiction_advice();
/// "its counter always goes from 14 back to 0: counter_max = 14?"; empty if it does not.
std::string counter_text(const GyroStatus& gyro);
std::string rates_too_far_apart_text();
/// The data scatter far more than noise and drifts explain; empty where they do not, or where it is
/// not known.
std::string innovation_text(double normalized_innovation);
/// Says that the estimate was restarted, which is a fault of vgyro itself.
std::string restarts_text(std::uint64_t restarts);

}  // namespace vgyro::gateway
