#pragma once

// What was learned before a reload that calls for a new calibration. Until the new one is complete
// the old biases are what is worth keeping. A new calibration that contradicts them by more than
// both are unsure of (the platform turned, and that was learned as drift) does not take their place
// before a stop has confirmed it. Clock-free; ages go by the stamps of the frames.

#include <cstdint>
#include <optional>

#include "gateway/plan.h"
#include "gateway/saved_state.h"

namespace vgyro::gateway {

class Inheritance {
 public:
  /// Biases apart by more of their joint σ contradict each other. Both σ are honest, so what is
  /// beyond is one calibration in a million.
  static constexpr double kSigmasMost = 5.0;

  /// From the setup that is given up.
  void keep(SavedState before);
  /// They are in use again, or not needed.
  void forget();

  /// What is worth keeping across a restart or for the next setup: the old biases, or what is known
  /// now, with which the old ones are forgotten. `stops` were learned from since.
  std::optional<SavedState> choose(const std::optional<SavedState>& now, const Plan& plan,
                                   std::uint64_t stops);

  [[nodiscard]] bool is_contradicted() const { return contradicted_; }

 private:
  std::optional<SavedState> before_;
  bool contradicted_ = false;
};

}  // namespace vgyro::gateway
