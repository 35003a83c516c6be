#pragma once

// What was learned before a reload that requires a new calibration. The old biases are the ones
// worth keeping until the new calibration is complete. If it contradicts them by more than the σ of
// both explain (the platform turned, and that was learned as drift), they are kept until a stop has
// confirmed the new ones. Reads no clock; ages follow from the stamps of the frames.

#include <cstdint>
#include <optional>

#include "gateway/plan.h"
#include "gateway/saved_state.h"

namespace vgyro::gateway {

class Inheritance {
 public:
  /// Biases further apart than this many joint σ contradict each other. Both σ are honest, so a
  /// correct calibration exceeds the limit once in a million.
  static constexpr double kSigmasMost = 5.0;

  /// Keeps the state of the setup that is given up.
  void keep(SavedState before);
  /// The old biases are in use again, or not needed.
  void forget();

  /// The state to keep across a restart or for the next setup: the old biases, or the present state
  /// `now`, which then also drops the old ones. `stops` counts the stops learned from since the
  /// reload.
  std::optional<SavedState> choose(const std::optional<SavedState>& now, const Plan& plan,
                                   std::uint64_t stops);

  [[nodiscard]] bool is_contradicted() const { return contradicted_; }

 private:
  std::optional<SavedState> before_;
  bool contradicted_ = false;
};

}  // namespace vgyro::gateway
