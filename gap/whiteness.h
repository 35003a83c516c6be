#pragma once

// Whether what a model leaves is what its noise makes: white, Gaussian and alike throughout. Each
// figure is in standard deviations of what it would be by chance.

#include "gap/observations.h"
#include "gap/result.h"

namespace vgyro::gap {

struct Whiteness {
  double fast = 0.0;  ///< worst stretch's excess of scatter within blocks
  Where fast_at;
  double slow = 0.0;  ///< worst stretch's excess of the drift filter's innovations
  Where slow_at;
  double colour = 0.0;  ///< of neighbouring samples
  bool soft = false;    ///< they are alike, as behind a low-pass
  double spiky = 0.0;   ///< excess of the samples' fourth powers over a Gaussian's
  double heavy = 0.0;   ///< excess of fourth powers in sums of innovations over a Gaussian's
  double low = 0.0;     ///< excess of low frequencies in the innovations
  double slope = 0.0;   ///< of the innovations' spectrum there
};

/// Of one gyro's part of the observations under `effects`.
Whiteness whiteness_of(const Observations& data, std::size_t gyro, const Effects& effects);

/// Where whiteness is lost.
struct Flaws {
  bool coloured = false;        ///< neighbouring samples depend on each other
  bool spiky = false;           ///< single samples stand out
  bool uneven = false;          ///< the scatter is another one for a while
  bool bursts = false;          ///< drift comes and goes
  bool moves_too_much = false;  ///< somewhere more than its noise allows
  bool wanders = false;         ///< drift is none that the noise could make
  [[nodiscard]] bool fast() const { return coloured || spiky || uneven; }
  [[nodiscard]] bool slow() const { return bursts || wanders; }
};
/// `quick_drift`: a drift of a few seconds' memory is in the noise, whose own variance within
/// blocks is known only to a tenth or so.
Flaws flaws_of(const Whiteness& whiteness, bool quick_drift);
/// Memory of a drift that is quick.
inline constexpr double kQuickDrift_s = 3.0;

}  // namespace vgyro::gap
