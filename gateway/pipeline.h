#pragma once

// The gateway itself: frames and time in, frames out. Decode → align → correct → encode. The
// daemon, the replay and the tests use this one object; it opens nothing and reads no clock, and
// after construction neither frames nor passing time make it allocate. ARCHITECTURE.md lists the
// states and their transitions.

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
#include "gateway/observers.h"
#include "gateway/plan.h"
#include "gateway/saved_state.h"
#include "gateway/status.h"

namespace vgyro::fusion {
class Corrector;
}

namespace vgyro::gateway {

class AxisPipeline;
class UnitPipeline;

class Pipeline {
 public:
  explicit Pipeline(const Plan& plan);
  /// Uses the caller's corrector instead of the plan's. Precondition: two single gyros.
  Pipeline(const Plan& plan, std::unique_ptr<fusion::Corrector> corrector);
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;
  ~Pipeline();

  /// One received frame. `bus` indexes Plan::buses. Stamps are used in whole microseconds, the
  /// resolution of a candump log, so that a replay of what candump saw repeats the run bit for bit.
  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& out);

  /// Passes time without a frame: time-outs, and VG_Bias if no sample triggers it. Cheap when
  /// nothing is due.
  void advance(TimePoint now, FrameSink& out);

  /// The latest time at which advance() must be called next.
  [[nodiscard]] TimePoint next_deadline() const;

  [[nodiscard]] const Status& status() const;
  /// The number of axes of the platform, in the order of Plan::axes, and the status of each; none
  /// with two single gyros.
  [[nodiscard]] std::size_t axis_count() const;
  [[nodiscard]] const Status& axis_status(std::size_t place) const;

  /// How often there was something to send so far, whether or not a frame was sent. Grows with
  /// every change of state.
  [[nodiscard]] std::uint64_t spoken() const;

  /// The state to keep across a restart; nothing before anything worth keeping was learned. A state
  /// given to resume() that was not taken up yet is returned unchanged.
  [[nodiscard]] std::optional<SavedState> memory() const;

  /// Call before the first frame: the first pair takes the state up instead of a calibration, aged
  /// by the time between its own stamp and the state's. Error if the state belongs to other gyros,
  /// or if the method keeps no state; nothing has changed then.
  Expected<void> resume(const SavedState& state);

  /// Call before the first output: continues the counters of another pipeline's frames, so that
  /// receivers see no break. A frame with another identifier is another stream and begins anew.
  void count_on_from(const Pipeline& before);

  /// Call before the first frame: continues as another pipeline, whose plan differs in the output
  /// alone and which must not be used afterwards. The frames' counters go on as with
  /// count_on_from().
  void take_over(Pipeline&& before);

  /// Null removes the observer. On a platform of several axes, `place` selects the axis.
  void observe(RateObserver* observer, std::size_t place = 0);
  void observe_output(OutputObserver* observer, std::size_t place = 0);

 private:
  std::unique_ptr<AxisPipeline> single_;  ///< with two single gyros …
  std::unique_ptr<UnitPipeline> units_;   ///< … or with two units; the other is null
};

}  // namespace vgyro::gateway
