#pragma once

// Checks whether a kernel's stamp can be the time at which its frame arrived. Where a sender asks
// for a launch time (SO_TXTIME), a virtual link and some drivers report that time as the stamp to
// every reader, on whatever clock the sender chose. A frame that is read now arrived after its
// queue was last seen empty, so a correct stamp lies between then and now, on the present wall
// clock or, if that was set meanwhile, on the earlier one. Pure: reads no clock.

#include "base/time.h"

namespace vgyro::can {

class ArrivalWatch {
 public:
  /// The queue is checked once a second. is_near() thus saves the caller from reading clocks, and a
  /// stamp that is wrong by more than twice this is always found. Smaller errors are accepted,
  /// because slewing, a late check and a real wait in the queue cause them too.
  static constexpr Duration kTolerance = std::chrono::seconds(1);

  struct Clocks {
    TimePoint wall;    ///< the clock of the stamps, which may be set
    TimePoint steady;  ///< cannot be set
  };

  /// Starts the watch; the queue is empty.
  void opened(Clocks now) { last_ = before_ = now; }

  /// Records that the queue is empty: about once a second, unless frames were left in it.
  void seen_empty(Clocks now) {
    before_ = last_;
    last_ = now;
  }

  /// True if the stamp is close enough to the last check to be accepted as it is; true for nearly
  /// every frame.
  [[nodiscard]] bool is_near(TimePoint stamp) const {
    return stamp >= last_.wall - kTolerance && stamp <= last_.wall + 2 * kTolerance;
  }

  /// Precondition: `now` was read after the frame.
  [[nodiscard]] bool may_be_arrival(TimePoint stamp, Clocks now) const {
    // From the check before the last: a process may be stopped between checking and reading the
    // time.
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
