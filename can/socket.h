#pragma once

// One raw SocketCAN socket on one interface; with socket.cpp the only place that uses linux/can.
// The kernel filters for exactly the wanted identifiers, and frames come in batches with the
// kernel's stamps; error frames (can/error_frame.h) come among them. Never blocks and never
// allocates once open. Other programs on the host keep seeing what it sends; it does not see its
// own frames.

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

/// What a socket's interface is at a moment. All false where it is not the one that the name means.
struct LinkState {
  bool is_ours = false;    ///< the name still means the interface that the socket is bound to
  bool is_up = false;      ///< set up; a controller may be bus-off all the same
  bool fd_frames = false;  ///< carries CAN FD
  bool operator==(const LinkState&) const = default;
};

/// Is there hope that the interface appears? Not where one of that name is of another kind, and not
/// where the kernel has no CAN.
bool may_appear(const std::string& interface);

struct Received {
  Frame frame;
  TimePoint stamp;     ///< kernel's software stamp, host clock; 0 in its first moments
  TimePoint hardware;  ///< controller's own clock, whatever its epoch; 0 where it has none
  bool local = false;  ///< sent by another socket of this host
};

enum class ReceiveStatus : std::uint8_t {
  kMore,        ///< the batch was full: ask again
  kDrained,     ///< nothing is left for now
  kLinkDown,    ///< once for each time that it went down; the socket goes on when it is up again
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

  /// Without filters the socket only writes. FD frames are received wherever the link carries them,
  /// now or later. A link that is down when it is bound is no event of receive(): look() says so.
  static Expected<Socket> open(const std::string& interface, std::span<const Filter> filters,
                               const SocketOptions& options = {});
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&& other) noexcept;
  ~Socket() override;

  Batch receive();
  SendResult send(const Frame& frame) override;

  [[nodiscard]] int fd() const { return fd_; }
  /// Asks the kernel, in two or three calls. The socket is bound to an index, and receives and
  /// sends there whatever the interface is called by then: a name that means another one is a
  /// removal.
  [[nodiscard]] LinkState look() const;
  /// What the interface that the socket was bound to is called; empty where it is no longer here.
  [[nodiscard]] std::string name_now() const;
  /// Received frames that the kernel dropped because the buffer was full, as far as reported.
  [[nodiscard]] std::uint64_t drops() const { return drops_; }
  [[nodiscard]] int receive_buffer_bytes() const { return receive_buffer_bytes_; }
  /// Of the last call that returned kFailed.
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
