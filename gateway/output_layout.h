#pragma once

// The virtual rate as a frame of a foreign layout: the gateway takes the place of a sensor that
// somebody already listens to. Every frame holds what the sensor's DBC file says: the rate to the
// nearest step, σ rounded up, validity, alive counter, check value. A rate that is not valid, or
// beyond what its signal can carry, or whose σ is and would be understated, goes out as the
// layout's "not available" or invalid; where the layout has no way to say so nothing goes out,
// which every receiver takes for a silent sensor. Allocates nothing; reads no clock.

#include <cstdint>

#include "base/time.h"
#include "can/frame.h"
#include "gateway/output_frames.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class LayoutEncoder {
 public:
  explicit LayoutEncoder(const OutputLayout& plan);

  /// The frame to send; null when none is due, or when the layout cannot say what is to be said.
  const can::Frame* rate(const RateOutput& output, TimePoint stamp);

  [[nodiscard]] bool sends_same_frame(const LayoutEncoder& other) const;
  /// The counter, and when the next frame is due, go on where the other's stand.
  void go_on_from(const LayoutEncoder& before);
  void take_books_of(const LayoutEncoder& before) { counts_ = before.counts_; }

  [[nodiscard]] const LayoutCounts& counts() const { return counts_; }
  [[nodiscard]] can::BusIndex bus() const { return plan_.bus; }

 private:
  [[nodiscard]] bool can_say(const RateOutput& output) const;
  bool is_due(TimePoint stamp);
  void put_rate(const RateOutput& output, bool valid);
  void put_sigma(const OutputField& field, double sigma_dps, bool valid);
  void protect();

  OutputLayout plan_;
  can::Frame frame_;
  std::uint32_t counter_ = 0;
  TimePoint next_;  ///< when the next frame is due, give or take what `every` allows
  LayoutCounts counts_;
};

}  // namespace vgyro::gateway
