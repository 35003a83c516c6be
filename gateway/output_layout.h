#pragma once

// The virtual rate as a frame of a foreign layout: the gateway replaces a sensor that receivers
// already use. Every frame holds what the sensor's DBC file defines: the rate or the rates about
// several axes, rounded to the nearest step, σ rounded up, validity, alive counter, check value. A
// rate is sent as the layout's "not available" or invalid if it is not valid, or if its signal
// cannot carry it, or if the σ signal would understate σ. If the layout can express neither, no
// frame is sent, which every receiver takes for a silent sensor. Allocates nothing; reads no clock.

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

  /// The rates of one frame, by axis of the platform; null: no rate.
  using Rates = std::array<const RateOutput*, kAxes>;

  /// The frame to send; null if none is due, or if the layout cannot express these rates.
  const can::Frame* rates(const Rates& rates, TimePoint stamp);
  /// The frame to send of a layout that carries one rate; null as for rates().
  const can::Frame* rate(const RateOutput& output, TimePoint stamp);

  [[nodiscard]] bool sends_same_frame(const LayoutEncoder& other) const;
  /// Continues the counter and the due time of the other encoder.
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
  TimePoint next_;  ///< when the next frame is due, within the tolerance that `every` allows
  LayoutCounts counts_;
};

/// All layouts of a platform. A layout of a single rate is sent with that rate; one of several
/// rates once all axes in use have a new one, and never with rates of different motion: it marks an
/// axis that has long been silent as "not available".
class LayoutSet {
 public:
  /// Rates further apart in time than this belong to different motion.
  static constexpr Duration kApartMost = std::chrono::milliseconds(25);

  explicit LayoutSet(const OutputPlan& plan);

  [[nodiscard]] bool empty() const { return layouts_.empty(); }
  /// A new rate about an axis of the platform; with two single gyros the axis is 0.
  void take(std::size_t axis, const RateOutput& output, TimePoint stamp, FrameSink& sink);
  /// The frame received last yields no more rates.
  void settle(TimePoint stamp, FrameSink& sink);

  /// Continues the counters of the frames that both sets send.
  void count_on_from(const LayoutSet& before);
  /// Replaces the plan; counters and counts go on.
  void change_plan(const OutputPlan& plan);
  void tell(Status& status) const;

 private:
  /// The newest rate about an axis.
  struct Newest {
    RateOutput output;
    bool there = false;
    bool fresh = false;  ///< no frame of several rates has carried it yet
  };

  void begin_round(TimePoint instant);
  [[nodiscard]] bool speaks(const Newest& one) const;
  void send_all_axes(TimePoint stamp, FrameSink& sink);
  void put(const LayoutEncoder& layout, const can::Frame* frame, TimePoint stamp,
           FrameSink& sink) const;
  /// The layout of `before` that sent the frame of the own layout `index`; null: none did.
  [[nodiscard]] const LayoutEncoder* predecessor(std::size_t index, const LayoutSet& before) const;

  std::vector<LayoutEncoder> layouts_;
  can::BusIndex bus_;
  bool any_of_several_ = false;  ///< a layout carries several rates
  std::array<Newest, kAxes> newest_;
  TimePoint newest_instant_{};
  Duration pause_before_{};  ///< pause before the first of the fresh rates
};

}  // namespace vgyro::gateway
