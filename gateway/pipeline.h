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
  /// With a corrector of the caller's instead of the plan's. Precondition: two single gyros.
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
  /// Of a platform of several axes how many there are, in the order of Plan::axes, and what the
  /// pipeline has of each; of two single gyros there are none.
  [[nodiscard]] std::size_t axis_count() const;
  [[nodiscard]] const Status& axis_status(std::size_t place) const;

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

  /// Null to take it off again. Of a platform of several axes of the one in this `place`.
  void observe(RateObserver* observer, std::size_t place = 0);
  void observe_output(OutputObserver* observer, std::size_t place = 0);

 private:
  std::unique_ptr<AxisPipeline> single_;  ///< of two single gyros …
  std::unique_ptr<UnitPipeline> units_;   ///< … or of two units; the other is null
};

}  // namespace vgyro::gateway
