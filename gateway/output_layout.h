#pragma once

// The virtual rate as a frame of a foreign layout: the gateway replaces a sensor that
// receivers already use. Every frame holds what the sensor's DBC file defines: the rate to the
// nearest step, or those about several axes, σ rounded up, validity, alive counter, check value. A
// rate that is not valid, or beyond what its signal can carry, or whose σ is and would be
// understated, goes out as the layout's "not available" or invalid; where the layout has no way to
// say so nothing goes out, which every receiver takes for a silent sensor. Allocates nothing; reads
// no clock.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.h"
#include "can/frame.h"
#include "gateway/frame_sink.h"
#include "gateway/output_frames.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class LayoutEncoder {
 public:
  explicit LayoutEncoder(const OutputLayout& plan);

  /// The rates of one frame, by axis of the platform; null: there is none.
  using Rates = std::array<const RateOutput*, kAxes>;

  /// The frame to send; null when none is due, or when the layout cannot say what is to be said.
  const can::Frame* rates(const Rates& rates, TimePoint stamp);
  /// The frame to send of a layout that carries one rate; null as for rates().
  const can::Frame* rate(const RateOutput& output, TimePoint stamp);

  [[nodiscard]] bool sends_same_frame(const LayoutEncoder& other) const;
  /// The counter, and when the next frame is due, go on where the other's stand.
  void go_on_from(const LayoutEncoder& before);
  void take_books_of(const LayoutEncoder& before) { counts_ = before.counts_; }

  [[nodiscard]] const LayoutCounts& counts() const { return counts_; }
  [[nodiscard]] const OutputLayout& plan() const { return plan_; }

 private:
  bool is_due(TimePoint stamp);
  void put_rate(const LayoutRate& one, const RateOutput* output, bool valid);
  void put_sigma(const OutputField& field, double sigma_dps, bool valid);
  void put_flag(const OutputFlag& flag, bool valid);
  void protect();

  OutputLayout plan_;
  can::Frame frame_;
  std::uint32_t counter_ = 0;
  TimePoint next_;  ///< when the next frame is due, give or take what `every` allows
  LayoutCounts counts_;
};

/// All layouts of a platform. One of a single rate goes out with that; one of several once all axes
/// in use have a new one, and never with rates of another motion: an axis that has long been
/// silent is "not available" in it.
class LayoutSet {
 public:
  /// Rates further apart than this are of different motion.
  static constexpr Duration kApartMost = std::chrono::milliseconds(25);

  explicit LayoutSet(const OutputPlan& plan);

  [[nodiscard]] bool empty() const { return layouts_.empty(); }
  /// A new rate about an axis of the platform; of two single gyros that is 0.
  void take(std::size_t axis, const RateOutput& output, TimePoint stamp, FrameSink& sink);
  /// No more rates come of what was received.
  void settle(TimePoint stamp, FrameSink& sink);

  /// The counters of frames that both send go on where the other's stand.
  void count_on_from(const LayoutSet& before);
  /// From now on as this plan says; counters and books go on.
  void change_plan(const OutputPlan& plan);
  void tell(Status& status) const;

 private:
  /// The newest rate about an axis.
  struct Newest {
    RateOutput output;
    bool there = false;
    bool fresh = false;  ///< no frame of several rates carried it yet
  };

  void begin_round(TimePoint instant);
  [[nodiscard]] bool speaks(const Newest& one) const;
  void send_all_axes(TimePoint stamp, FrameSink& sink);
  void put(const LayoutEncoder& layout, const can::Frame* frame, TimePoint stamp,
           FrameSink& sink) const;
  /// The layout of `before` that the frame of our layout `index` was; null: there was none.
  [[nodiscard]] const LayoutEncoder* predecessor(std::size_t index, const LayoutSet& before) const;

  std::vector<LayoutEncoder> layouts_;
  can::BusIndex bus_;
  bool any_of_several_ = false;  ///< a layout carries several rates
  std::array<Newest, kAxes> newest_;
  TimePoint newest_instant_{};
  Duration pause_before_{};  ///< before the first of the fresh ones
};

}  // namespace vgyro::gateway
