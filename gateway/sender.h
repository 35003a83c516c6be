#pragma once

// What leaves the gateway: VG_Rate, and the rate in every foreign layout, whenever there is one,
// VG_Bias with VG_Model on a grid of the bus's time and on request. Owns the
// frames with their counters, the grid, and the count of sent frames. Contains no estimation: it
// gets the frames' values, and times on the axis of fusion::StampGuard. Reads no clock,
// allocates nothing.

#include <cstddef>
#include <cstdint>

#include "base/time.h"
#include "gateway/frame_sink.h"
#include "gateway/output_frames.h"
#include "gateway/output_layout.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

/// Takes the rates of several senders that share a frame.
class RateCollector {
 public:
  virtual ~RateCollector() = default;
  virtual void collect(std::size_t axis, const RateOutput& output) = 0;
};

class Sender {
 public:
  static constexpr Duration kBiasPeriod = std::chrono::milliseconds(100);
  /// Samples drive the grid; the timer steps in only when none came for half a period more, so that
  /// a replay sends the same frames at the same places.
  static constexpr Duration kBiasGrace = kBiasPeriod / 2;
  /// No sample lies so far before the grid, for it stands a period ahead: the clock was set back.
  static constexpr Duration kGridAheadMax = std::chrono::seconds(1);

  explicit Sender(const OutputPlan& plan);

  /// As long as it lives, what is sent goes to its sink with its stamp. One at a time.
  class Turn {
   public:
    Turn(Sender& sender, FrameSink& sink, TimePoint stamp);
    ~Turn() { sender_.sink_ = nullptr; }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    Sender& sender_;
  };

  /// From now on rates of this axis go out in a frame of several, made elsewhere; its identifier is
  /// none of ours.
  void share_rates(RateCollector* collector, std::size_t axis) {
    collector_ = collector;
    axis_ = axis;
  }
  /// From now on rates of this axis go out in these layouts; there are none of our own.
  void share_layouts(LayoutSet* layouts, std::size_t axis) {
    shared_layouts_ = layouts;
    axis_ = axis;
  }

  /// Precondition of both: a Turn. A rate that the frame cannot carry goes out as invalid: false
  /// then, and where it was not valid before.
  bool send_rate(const RateOutput& output);
  /// At once, independent of the grid.
  void send_bias(const BiasOutput& bias, const ModelOutput& model);

  /// A sample says that time is `t`. Is a point of the grid reached? Then it is used up: send.
  bool reach_grid(TimePoint t);
  /// As above, of a timer: only where samples should have driven the grid and did not.
  /// `sample_interval` is that of the slower stream, 0 if unknown: its samples, however
  /// slow, keep their right to drive the grid.
  bool miss_grid(TimePoint t, Duration sample_interval);
  /// When miss_grid() is true, at the earliest.
  [[nodiscard]] TimePoint grid_missed_at(Duration sample_interval) const;

  /// The counters of frames that both send go on where the other's stand.
  void count_on_from(const Sender& before);
  /// From now on as this plan says; counters, books and grid go on.
  void change_plan(const OutputPlan& plan);

  /// How often there was something to say, whether or not a frame went out for it.
  [[nodiscard]] std::uint64_t spoken() const { return rates_ + bias_times_; }
  /// The last VG_Rate's; NaN when that was invalid.
  [[nodiscard]] double rate_dps() const { return rate_dps_; }

  /// σ of that rate; NaN when it was invalid, or where the method states none.
  [[nodiscard]] double sigma_dps() const { return sigma_dps_; }

  /// The books, and what the last rate said.
  void tell(Status& status) const;

 private:
  [[gnu::noinline]] void send_layouts(const RateOutput& output);

  OutputEncoder encoder_;
  LayoutSet layouts_;
  LayoutSet* shared_layouts_ = nullptr;
  bool vgyro_frames_;
  FrameSink* sink_ = nullptr;
  RateCollector* collector_ = nullptr;
  std::size_t axis_ = 0;
  TimePoint stamp_;
  TimePoint next_bias_;  ///< the next point of the grid, or 0: at once
  std::uint64_t rates_ = 0;
  std::uint64_t rates_valid_ = 0;
  std::uint64_t rates_out_of_range_ = 0;
  std::uint64_t biases_ = 0;
  std::uint64_t bias_times_ = 0;
  double rate_dps_;   ///< of the last VG_Rate; NaN when that was invalid
  double sigma_dps_;  ///< of the last VG_Rate; NaN when that was invalid
  Quality quality_ = Quality::kUnusable;
};

}  // namespace vgyro::gateway
