#pragma once

// How much later one recorded rate is than another, told before anything is judged: what stands out
// must stand out at the right instant, a clock that runs away is beyond what a search from zero
// finds, and two gyros that both come before the reference say that the reference is late.
//
// By windows first, which a clock that runs away does not smear, each about where the last one was;
// then by least squares over all, with an offset for every stretch and one scale beside it, so that
// neither biases nor drift have a say.

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gap/curve.h"
#include "gap/recording.h"
#include "gap/transport.h"
#include "model/effect.h"

namespace vgyro::gap {

/// value(t) follows curve(t − at(t)).
struct Lag {
  double start_s = 0.0;  ///< at time 0
  double drift = 0.0;    ///< seconds in a second
  double start_sigma_s = 0.0;
  double drift_sigma = 0.0;

  [[nodiscard]] double at(double t_s) const { return start_s + drift * t_s; }
};

/// Nothing where there is too little motion, or none that both show.
std::optional<Lag> lag_behind(const SampledCurve& curve, std::span<const double> t_s,
                              std::span<const double> value);

struct Timing {
  ScalarSeries reference_dps;     ///< with its lateness taken off
  double reference_late_s = 0.0;  ///< 0: it is not, as far as anybody can tell
  std::array<Lag, 2> lag;         ///< of each gyro behind the reference, else behind the other one
  std::vector<Finding> findings;  ///< clocks that run away beyond what `known` says
  std::vector<std::string> notes;
};

/// "both gyros lead the reference by 0.100 s: the reference is late"
std::string reference_late_text(double late_s);

/// `known`: the model's effects. Precondition: the transports are those of the recording.
Timing find_timing(const Recording& recording, const std::array<Transport, 2>& transports,
                   const std::vector<model::Effect>& known);

}  // namespace vgyro::gap
