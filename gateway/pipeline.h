#pragma once

// The gateway itself: frames and time in, frames out. Decode → align → correct → encode.
// One object behind the daemon, the replay and the tests; it opens nothing and reads no clock, and
// once it is constructed neither a frame nor passing time makes it allocate. The states and their
// transitions are in ARCHITECTURE.md.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "can/frame.h"
#include "gateway/frame_sink.h"
#include "gateway/output_frames.h"
#include "gateway/plan.h"
#include "gateway/saved_state.h"
#include "gateway/status.h"

namespace vgyro::fusion {
class Corrector;
}

namespace vgyro::gateway {

/// For those who draw or add up: every virtual rate with what it was made of, before it becomes a
/// frame, also where it is beyond what the frame can carry. NaN stands for a missing gyro, and for
/// a rate that is not known yet.
class RateObserver {
 public:
  virtual ~RateObserver() = default;
  virtual void on_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) = 0;
  /// What the corrector thinks of its data, at every rate once it is calibrated; before on_rate().
  virtual void on_condition(TimePoint /*t*/, const fusion::Condition& /*condition*/) {}
};

/// For those who write down what goes out: every VG_Rate as it was sent.
class OutputObserver {
 public:
  virtual ~OutputObserver() = default;
  /// `bias_dps` as VG_Bias would say it at this moment; NaN where it is not known.
  virtual void on_output(const RateOutput& output, const std::array<double, 2>& bias_dps) = 0;
};

class Pipeline {
 public:
  explicit Pipeline(const Plan& plan);
  /// With a corrector of the caller's instead of the plan's.
  Pipeline(const Plan& plan, std::unique_ptr<fusion::Corrector> corrector);
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;
  ~Pipeline();

  /// One received frame. `bus` indexes Plan::buses. Stamps are used in whole microseconds, the
  /// resolution of a candump log, so that a replay of what candump saw repeats the run bit for bit.
  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& out);

  /// Time passed without a frame: time-outs, and VG_Bias where no sample drives it. Cheap when
  /// nothing is due.
  void advance(TimePoint now, FrameSink& out);

  /// When advance() has to be called next, at the latest.
  [[nodiscard]] TimePoint next_deadline() const;

  [[nodiscard]] const Status& status() const;

  /// How often there was something to say so far, whether or not a frame went out for it. No state
  /// changes without.
  [[nodiscard]] std::uint64_t spoken() const;

  /// What to keep across a restart; nothing before there is anything worth it. What was given to
  /// resume() and not taken up yet is.
  [[nodiscard]] std::optional<SavedState> memory() const;

  /// Before the first frame: the first pair takes this up instead of a calibration, aged by the
  /// time between its own stamp and the state's. Error when the state is of other gyros, or the
  /// method keeps none; then nothing has changed.
  Expected<void> resume(const SavedState& state);

  /// Before the first output: the counters of the frames' headers go on where another one's stand,
  /// so that receivers see no break. A frame with another identifier is another stream and begins
  /// anew.
  void count_on_from(const Pipeline& before);

  /// Instead of a beginning: goes on as another one whose plan is the same but for the output, and
  /// which is at its end then. The frames' counters go on as with count_on_from().
  void take_over(Pipeline&& before);

  /// Null to take it off again.
  void observe(RateObserver* observer);
  void observe_output(OutputObserver* observer);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vgyro::gateway
