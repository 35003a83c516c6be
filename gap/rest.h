#pragma once

// When the platform rests: then both gyros should read the known rate at rest, which without a
// reference is all that tells which of them is wrong. A turn slower than the gyros' biases could be
// is taken for rest; a turn that either gyro feels is not.

#include <array>
#include <cstdint>
#include <vector>

#include "gap/recording.h"
#include "gap/transport.h"

namespace vgyro::gap {

/// The whole seconds in which both gyros rest: second k is from k to k + 1.
class RestingSeconds {
 public:
  RestingSeconds() = default;
  /// One entry for each second from time 0 on, 1 where it is at rest.
  explicit RestingSeconds(std::vector<std::uint8_t> rests);

  /// Times before 0 are of the first second; beyond the last second nothing rests.
  [[nodiscard]] bool at(double t_s) const;
  [[nodiscard]] double count() const { return count_; }

 private:
  std::vector<std::uint8_t> rests_;
  double count_ = 0.0;
};

/// Seconds in which both gyros are as steady as in their steadiest seconds and read what they read
/// in the beginning. None when a gyro has too few seconds near that to tell how steady it is.
/// Precondition: the transports are those of the recording.
RestingSeconds find_rest(const Recording& recording, const std::array<Transport, 2>& transports);

}  // namespace vgyro::gap
