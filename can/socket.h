#pragma once

// One raw SocketCAN socket on one interface; together with socket.cpp the only place that uses
// linux/can. The kernel filters for exactly the wanted identifiers, and frames come in batches with
// the kernel's stamps, error frames (can/error_frame.h) among them. Never blocks and never
// allocates once open. Other programs on the host still see the frames that it sends; it does not
// see its own frames.

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/error.h"
#include "base/time.h"
#include "can/frame.h"
#include "can/transmitter.h"

namespace vgyro::can {

/// Matches when (frame.id & mask) == (id & mask) and the format agrees.
struct Filter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0;
  bool extended = false;
};

struct SocketOptions {
  int receive_buffer_bytes = 2 << 20;  ///< the kernel may grant less
  int send_buffer_bytes = 0;           ///< 0: the kernel's default
};

/// The state of a socket's interface. All false if the name no longer refers to that interface.
struct LinkState {
  bool is_ours = false;    ///< the name still refers to the interface that the socket is bound to
  bool is_up = false;      ///< set up; the controller may still be bus-off
  bool fd_frames = false;  ///< carries CAN FD
  bool operator==(const LinkState&) const = default;
};

/// Can the interface still appear? No if the name belongs to an interface of another kind, or if
/// the kernel has no CAN.
bool may_appear(const std::string& interface);

struct Received {
  Frame frame;
  TimePoint stamp;     ///< kernel's software stamp, host clock; 0 in its first moments
  TimePoint hardware;  ///< controller's own clock, whatever its epoch; 0 without one
  bool local = false;  ///< sent by another socket of this host
};

enum class ReceiveStatus : std::uint8_t {
  kMore,        ///< the batch was full: ask again
  kDrained,     ///< nothing is left for now
  kLinkDown,    ///< once each time that the link goes down; the socket continues when it is up
                ///< again
  kDeviceGone,  ///< returned once; the socket is dead, open a new one
  kFailed       ///< see last_errno()
};

struct Batch {
  std::span<const Received> frames;  ///< valid until the next receive()
  ReceiveStatus status = ReceiveStatus::kDrained;
};

class Socket final : public Transmitter {
 public:
  static constexpr std::size_t kBatchFrames = 64;

  /// Without filters the socket only writes. FD frames are received whenever the link carries them,
  /// now or later. A link that is already down is reported by look(), not by receive().
  static Expected<Socket> open(const std::string& interface, std::span<const Filter> filters,
                               const SocketOptions& options = {});
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&& other) noexcept;
  ~Socket() override;

  Batch receive();
  SendResult send(const Frame& frame) override;

  [[nodiscard]] int fd() const { return fd_; }
  /// Queries the kernel, in two or three calls. The socket is bound to an index, and receives and
  /// sends there even if the interface is renamed; a name that now belongs to another interface
  /// counts as a removal.
  [[nodiscard]] LinkState look() const;
  /// The present name of the interface that the socket is bound to; empty if it is gone.
  [[nodiscard]] std::string name_now() const;
  /// Received frames that the kernel dropped because the buffer was full, as far as reported.
  [[nodiscard]] std::uint64_t drops() const { return drops_; }
  [[nodiscard]] int receive_buffer_bytes() const { return receive_buffer_bytes_; }
  /// errno of the last call that returned kFailed.
  [[nodiscard]] int last_errno() const { return last_errno_; }

 private:
  struct Buffers;
  Socket(std::string interface, int fd);
  void read_control(std::size_t index, Received& out);

  std::string interface_;
  int fd_ = -1;
  int index_ = 0;
  int receive_buffer_bytes_ = 0;
  int last_errno_ = 0;
  std::uint32_t kernel_drops_ = 0;
  std::uint64_t drops_ = 0;
  std::unique_ptr<Buffers> buffers_;
};

}  // namespace vgyro::can
