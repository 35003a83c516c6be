#pragma once

// The part of a gyro's temperature history that still has an effect: enough to compute, for any
// play, the position of a follower with that play. The follower begins at the first temperature,
// stays where it is while the temperature is within the play on both sides of it, and is dragged
// along beyond that.
//
// Only those extremes of the temperature matter that no larger swing has erased. They are kept as
// the follower's position over the play, which bends at each of them. The number of bends is
// limited; if there are more, the least important one is dropped. Adding allocates nothing.

#include <array>
#include <cstddef>

namespace vgyro::model {

class TemperaturePast {
 public:
  /// Number of swings kept, each smaller than the one before. A drive leaves three or four.
  static constexpr std::size_t kBendsMax = 16;

  [[nodiscard]] bool empty() const { return count_ == 0; }

  /// Precondition: finite.
  void add(double temperature_c);

  /// The follower's position once the temperature has moved from the newest one to `now_c`, in
  /// degC. Preconditions: not empty; play_k >= 0.
  [[nodiscard]] double followed_c(double play_k, double now_c) const;

 private:
  struct Bend {
    double play_k = 0.0;
    double followed_c = 0.0;
  };
  static std::size_t least_of(const std::array<Bend, kBendsMax + 1>& bends);

  /// The first is the newest temperature; plays increase; beyond the last the follower has not
  /// moved.
  std::array<Bend, kBendsMax> bends_{};
  std::size_t count_ = 0;
};

}  // namespace vgyro::model
