#pragma once

// Recordings of the inputs from the minutes before something went wrong. The last frames of the
// configured inputs, and of no others, are kept in memory (capture_ring.h). After a cause
// (capture_cause.h), or on request, a separate thread writes them to disk (capture_store.h); after
// a cause the frames of kAftermathSeconds are added. Nothing here delays a rate or is fatal; a
// failure to write is logged and counted. Clock-free: second_passed() is its clock.

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
  /// A capture includes this much after its cause. A requested capture ends with the request.
  static constexpr int kAftermathSeconds = 10;

  struct Options {
    std::string directory;
    std::string instance;
    CaptureRing::Limits ring;
    CaptureLimits disk;
    int interval_s = 0;  ///< least time between two captures of the same cause
  };
  /// Receives the folder of the capture, or the error.
  using Answer = std::function<void(const Expected<std::string>&)>;

  /// Throws std::system_error if no thread can be started.
  Capture(Options options, Log& log);
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;
  ~Capture();

  /// Call first. Error if another gateway uses the directory; a directory that cannot be written is
  /// only logged. `now` is on the host's clock.
  Expected<void> open(TimePoint now);

  /// Sets the configuration in use. Forgets the frames in memory if it lacks an input of the
  /// earlier one.
  void use(const gateway::Plan& plan, const std::string& fingerprint);

  /// Keeps a received frame if it is an input. Cheap: neither waits nor allocates.
  void put(can::BusIndex bus, const can::Frame& frame, TimePoint stamp) {
    if (frame.is_data() && router_->roles(bus, frame) != 0) ring_.put(bus, frame, stamp);
  }

  /// To be called about once a second; `now` is on the host's clock.
  void second_passed(const gateway::Status& status, TimePoint now);

  /// Has the frames now in memory written. second_passed() calls `answer`, unless the process ends
  /// before. Error while an earlier request is being written.
  Expected<void> ask(Answer answer, TimePoint now);

  /// Call at the end of the process: writes the capture that a cause began, if the disk takes it in
  /// time.
  void finish();

  [[nodiscard]] CaptureStatus status() const;

 private:
  struct Desk;
  struct Input {
    std::string bus;
    gateway::FrameMatch match;  ///< with bus 0; `bus` above names it
    friend bool operator==(const Input&, const Input&) = default;
  };
  /// A capture that is not being written yet.
  struct Pending {
    CaptureNote note;
    int seconds_left = 0;                 ///< until its aftermath ends
    std::optional<std::uint32_t> sealed;  ///< from ring_.seal(), after its last frame
    int packing_s = 0;                    ///< time since `sealed` was set
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
  std::array<int, kCaptureCauses> quiet_s_{};  ///< time left until the cause may start a capture
  std::optional<Pending> caused_;
  std::optional<Pending> asked_;
  Answer answer_;  ///< of the request under way; null: none
  std::shared_ptr<Desk> desk_;
  std::optional<CaptureNote> writing_;
  std::uint64_t writing_frames_ = 0;
  TimePoint writing_last_;  ///< the greatest stamp in `writing_`
  LooseThread thread_;
  std::array<std::uint64_t, kCaptureCauses> written_{};
  std::uint64_t failed_ = 0;
  std::uint64_t held_back_ = 0;
  bool told_of_failure_ = false;
  std::string last_;      ///< folder of the newest capture since the start
  TimePoint last_stamp_;  ///< the greatest stamp in `last_`
};

}  // namespace vgyro::daemon
