#pragma once

// Recordings of the inputs, from the minutes before something went wrong. Frames of the configured
// inputs, and no others, wait in memory (capture_ring.h). A cause (capture_cause.h), or somebody
// who asks, has them written (capture_store.h) in a thread of its own, with some seconds of what
// came after it. Nothing here delays a rate or is fatal; what cannot be written is reported and
// counted. Clock-free: second_passed() is its clock.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "daemon/capture_cause.h"
#include "daemon/capture_ring.h"
#include "daemon/capture_status.h"
#include "daemon/capture_store.h"
#include "daemon/log.h"
#include "daemon/loose_thread.h"
#include "gateway/plan.h"
#include "gateway/router.h"
#include "gateway/status.h"

namespace vgyro::daemon {

class Capture {
 public:
  /// What comes after a cause belongs to its story; nothing does of a capture that is asked for.
  static constexpr int kAftermathSeconds = 10;

  struct Options {
    std::string directory;
    std::string instance;
    CaptureRing::Limits ring;
    CaptureLimits disk;
    int interval_s = 0;  ///< at least so long from one capture to the next of the same cause
  };
  /// Gets the folder, or why there is none.
  using Answer = std::function<void(const Expected<std::string>&)>;

  /// Throws std::system_error where there is no thread to be had.
  Capture(Options options, Log& log);
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;
  ~Capture();

  /// Call first. Error when another gateway has the directory; one that cannot be written is only
  /// reported. `now` on the host's clock.
  Expected<void> open(TimePoint now);

  /// The configuration in use. What is held is forgotten where it may hold frames that this one
  /// does not name.
  void use(const gateway::Plan& plan, const std::string& fingerprint);

  /// A frame that came. Cheap; it neither waits nor allocates. Frames that are no input are left
  /// out.
  void put(can::BusIndex bus, const can::Frame& frame, TimePoint stamp) {
    if (frame.is_data() && router_->roles(bus, frame) != 0) ring_.put(bus, frame, stamp);
  }

  /// To be called about once a second; `now` on the host's clock.
  void second_passed(const gateway::Status& status, TimePoint now);

  /// Has what is held now written; `answer` comes from second_passed(), unless the process ends
  /// before. Refused while an earlier request is under way.
  Expected<void> ask(Answer answer, TimePoint now);

  /// The last word: what a cause has begun is written, as far as the disk takes it in time.
  void finish();

  [[nodiscard]] CaptureStatus status() const;

 private:
  struct Desk;
  struct Input {
    std::string bus;
    gateway::FrameMatch match;  ///< its number of the bus is 0
    friend bool operator==(const Input&, const Input&) = default;
  };
  /// A capture that is to be written.
  struct Pending {
    CaptureNote note;
    int seconds_left = 0;                 ///< of its aftermath
    std::optional<std::uint32_t> sealed;  ///< all that belongs to it is with the ring's thread
    int packing_s = 0;                    ///< since then
  };

  void look_for_causes(const gateway::Status& status, TimePoint now);
  void begin(CaptureCause cause, std::string text, TimePoint now);
  [[nodiscard]] std::string text_of(CaptureCause cause, const gateway::Status& status) const;
  [[nodiscard]] CaptureNote note_of(CaptureCause cause, std::string text, TimePoint now) const;
  void second_passed(std::optional<Pending>& pending);
  void start_writing(std::optional<Pending>& pending);
  void write(CaptureRing::Blocks blocks);
  void take_result();
  void tell(const Expected<std::string>& written);
  void tell_failure(const Error& error);
  void answer(const Expected<std::string>& written);

  Options options_;
  Log& log_;
  std::shared_ptr<CaptureStore> store_;  ///< shared with the thread that writes
  CaptureRing ring_;
  std::unique_ptr<gateway::Router> router_;
  std::vector<Input> inputs_;
  std::array<std::string, 2> gyro_names_;
  std::string fingerprint_;
  CaptureTriggers triggers_;
  std::array<int, kCaptureCauses> quiet_s_{};  ///< left until the cause counts again
  std::optional<Pending> caused_;
  std::optional<Pending> asked_;
  Answer answer_;  ///< of the one who asked, until it is given
  std::shared_ptr<Desk> desk_;
  std::optional<CaptureNote> writing_;
  std::uint64_t writing_frames_ = 0;
  TimePoint writing_last_;  ///< the greatest stamp in it
  LooseThread thread_;
  std::array<std::uint64_t, kCaptureCauses> written_{};
  std::uint64_t failed_ = 0;
  std::uint64_t held_back_ = 0;
  bool told_of_failure_ = false;
  std::string last_;      ///< folder of the newest capture since the start
  TimePoint last_stamp_;  ///< the greatest one in it
};

}  // namespace vgyro::daemon
