#pragma once

// Is a kernel's stamp the time at which its frame arrived? Where a sender asks for a launch time
// (SO_TXTIME), a virtual link, and some drivers, hand that time to every reader as the stamp, on
// whatever clock the sender chose. A frame that is read now came after its queue was last seen
// empty, so a correct stamp lies between then and now, on the wall clock as it goes now or, where
// it was set meanwhile, as it went then. Pure: reads no clock.

#include "base/time.h"

namespace vgyro::can {

class ArrivalWatch {
 public:
  /// The queue is looked at once a second. So is_near() can spare the caller reading clocks, and a
  /// stamp that is wrong by more than twice this is always found. Nearer ones are left alone:
  /// slewing, a late look and a true wait in the queue stay below it.
  static constexpr Duration kTolerance = std::chrono::seconds(1);

  struct Clocks {
    TimePoint wall;    ///< the clock of the stamps, which may be set
    TimePoint steady;  ///< cannot be set
  };

  /// With an empty queue.
  void opened(Clocks now) { last_ = before_ = now; }

  /// About once a second, unless frames were left in the queue.
  void seen_empty(Clocks now) {
    before_ = last_;
    last_ = now;
  }

  /// So near the last look that nothing more has to be asked; true for nearly every frame.
  [[nodiscard]] bool is_near(TimePoint stamp) const {
    return stamp >= last_.wall - kTolerance && stamp <= last_.wall + 2 * kTolerance;
  }

  /// `now`: read after the frame was.
  [[nodiscard]] bool may_be_arrival(TimePoint stamp, Clocks now) const {
    // From the look before the last: a process may be stopped between looking and reading the time.
    const Duration since = now.steady - before_.steady;
    const auto lies_after = [&](TimePoint begin) {
      return stamp >= begin - kTolerance && stamp <= begin + since + kTolerance;
    };
    return lies_after(now.wall - since) || lies_after(before_.wall);
  }

 private:
  Clocks last_;
  Clocks before_;
};

}  // namespace vgyro::can
