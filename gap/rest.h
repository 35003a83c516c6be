#pragma once

// When the platform rests: then both gyros should read the known rate at rest, which without a
// reference is all that tells which of them is wrong. What rest is says analysis/rest, for
// `vgyro allan` too; here it is asked at the recording's instants.

#include <array>
#include <cstdint>
#include <span>
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
  /// And half a second before and behind: what is late there is of the rest, too.
  [[nodiscard]] bool deep_at(double t_s) const;
  [[nodiscard]] double count() const { return count_; }

 private:
  static constexpr double kEdge_s = 0.5;
  std::vector<std::uint8_t> rests_;
  double count_ = 0.0;
};

/// Takes off what one gyro reads where it should read `rest_dps`: the drift that its stops show,
/// straight between them and level before the first and behind the last. What hurries on between
/// two stops stays. Of stops shorter than three seconds nothing is told. Shape: one rate an
/// instant.
void take_off_drift_at_rest(const RestingSeconds& rest, std::span<const double> t_s,
                            double rest_dps, std::vector<double>& rate_dps);

/// Seconds in which both gyros rest, by analysis::RestFinder, of which no part of a second is left.
/// Precondition: the transports are those of the recording.
RestingSeconds find_rest(const Recording& recording, const std::array<Transport, 2>& transports);

}  // namespace vgyro::gap
