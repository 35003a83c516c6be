#pragma once

// Sends the gateway's output: VG_Rate and every foreign layout whenever there is a rate, VG_Bias
// with VG_Model on a grid of the bus's time and on request. Owns the frames with their counters,
// the grid, and the counts of sent frames. Contains no estimation: it receives the values, and
// times on the axis of fusion::StampGuard. Reads no clock, allocates nothing.

#include <cstddef>
#include <cstdint>

#include "base/time.h"
#include "gateway/frame_sink.h"
#include "gateway/output_frames.h"
#include "gateway/output_layout.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

/// Collects the rates of several senders that share a frame.
class RateCollector {
 public:
  virtual ~RateCollector() = default;
  virtual void collect(std::size_t axis, const RateOutput& output) = 0;
};

class Sender {
 public:
  static constexpr Duration kBiasPeriod = std::chrono::milliseconds(100);
  /// Samples drive the grid; the timer sends only if none has come half a period later, so that a
  /// replay sends the same frames at the same places.
  static constexpr Duration kBiasGrace = kBiasPeriod / 2;
  /// The next grid point is one period ahead; a sample this far before it means a clock set back.
  static constexpr Duration kGridAheadMax = std::chrono::seconds(1);

  explicit Sender(const OutputPlan& plan);

  /// While it lives, the sender's output goes to its sink with its stamp. One at a time.
  class Turn {
   public:
    Turn(Sender& sender, FrameSink& sink, TimePoint stamp);
    ~Turn() { sender_.sink_ = nullptr; }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    Sender& sender_;
  };

  /// From now on rates of this axis are sent in a shared frame, made by the collector; the own
  /// VG_Rate is not sent.
  void share_rates(RateCollector* collector, std::size_t axis) {
    collector_ = collector;
    axis_ = axis;
  }
  /// From now on rates of this axis are sent in these layouts; the sender has none of its own.
  void share_layouts(LayoutSet* layouts, std::size_t axis) {
    shared_layouts_ = layouts;
    axis_ = axis;
  }

  /// Precondition of both: a Turn. A rate that the frame cannot carry is sent as invalid. Returns
  /// whether the rate was sent as valid.
  bool send_rate(const RateOutput& output);
  /// Sends VG_Bias and VG_Model at once, independent of the grid.
  void send_bias(const BiasOutput& bias, const ModelOutput& model);

  /// True if a sample of time `t` reaches a grid point; the point is used up, and the caller sends.
  bool reach_grid(TimePoint t);
  /// The same for the timer: true only if samples should have driven the grid and did not.
  /// `sample_interval` is that of the slower stream, 0 if unknown: its samples, however slow, drive
  /// the grid first.
  bool miss_grid(TimePoint t, Duration sample_interval);
  /// The earliest time at which miss_grid() is true.
  [[nodiscard]] TimePoint grid_missed_at(Duration sample_interval) const;

  /// Continues the counters of the frames that both senders send.
  void count_on_from(const Sender& before);
  /// Replaces the plan; counters, counts and grid go on.
  void change_plan(const OutputPlan& plan);

  /// How often there was something to send, whether or not a frame was sent.
  [[nodiscard]] std::uint64_t spoken() const { return rates_ + bias_times_; }
  /// The rate in the last VG_Rate; NaN if that was invalid.
  [[nodiscard]] double rate_dps() const { return rate_dps_; }

  /// σ of that rate; NaN if it was invalid, or if the method states no σ.
  [[nodiscard]] double sigma_dps() const { return sigma_dps_; }

  /// Adds the counts and the last rate to the status.
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
  TimePoint next_bias_;  ///< the next point of the grid; 0: send at once
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
