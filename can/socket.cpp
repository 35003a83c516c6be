#include "can/socket.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "can/error_frame.h"

namespace vgyro::can {
namespace {

constexpr std::size_t kControlBytes =
    CMSG_SPACE(sizeof(scm_timestamping)) + CMSG_SPACE(sizeof(std::uint32_t));

template <class T>
bool set_option(int fd, int level, int name, const T& value) {
  return ::setsockopt(fd, level, name, &value, sizeof(value)) == 0;
}

ifreq request_for(const std::string& interface) {
  ifreq request{};
  interface.copy(request.ifr_name, IFNAMSIZ - 1);
  return request;
}

Expected<int> open_raw(const std::string& interface) {
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (fd >= 0) return fd;
  if (errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT) {
    return fail(interface, "this kernel has no SocketCAN",
                "load it with `modprobe can-raw`; Debian's -cloud- kernels and most containers' "
                "hosts lack it");
  }
  return fail(interface, "no CAN socket: " + system_reason(errno));
}

Expected<int> find_index(int fd, const std::string& interface) {
  ifreq request = request_for(interface);
  if (interface.size() >= IFNAMSIZ || ::ioctl(fd, SIOCGIFINDEX, &request) != 0) {
    return fail(interface, "no such interface",
                fmt::format("`ip link show type can` lists them; for a virtual one: `ip link add "
                            "{0} type vcan && ip link set {0} up`",
                            interface));
  }
  const int index = request.ifr_ifindex;
  if (::ioctl(fd, SIOCGIFHWADDR, &request) != 0 || request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
    return fail(interface, "not a CAN interface", "`ip link show type can` lists them");
  }
  return index;
}

bool set_filters(int fd, std::span<const Filter> filters) {
  std::vector<can_filter> raw;
  raw.reserve(filters.size());
  for (const Filter& filter : filters) {
    // Format and remote bit belong to the mask: a standard and an extended id may be equal numbers.
    const canid_t id_mask = filter.extended ? CAN_EFF_MASK : CAN_SFF_MASK;
    raw.push_back({(filter.id & id_mask) | (filter.extended ? CAN_EFF_FLAG : 0U),
                   (filter.mask & id_mask) | CAN_EFF_FLAG | CAN_RTR_FLAG});
  }
  return ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, raw.data(),
                      static_cast<socklen_t>(raw.size() * sizeof(can_filter))) == 0;
}

bool set_error_filter(int fd) {
  const can_err_mask_t wanted = kErrorsWanted;
  return set_option(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, wanted);
}

void set_buffers(int fd, const SocketOptions& options) {
  // The forced sizes need CAP_NET_ADMIN; without it the kernel grants what its limits allow.
  if (options.receive_buffer_bytes > 0 &&
      !set_option(fd, SOL_SOCKET, SO_RCVBUFFORCE, options.receive_buffer_bytes)) {
    set_option(fd, SOL_SOCKET, SO_RCVBUF, options.receive_buffer_bytes);
  }
  if (options.send_buffer_bytes > 0) {
    set_option(fd, SOL_SOCKET, SO_SNDBUF, options.send_buffer_bytes);
  }
}

bool set_stamps_and_drop_count(int fd) {
  const int stamps = SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE |
                     SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  return set_option(fd, SOL_SOCKET, SO_TIMESTAMPING, stamps) &&
         set_option(fd, SOL_SOCKET, SO_RXQ_OVFL, 1);
}

bool bind_to(int fd, int interface_index) {
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = interface_index;
  return ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
}

// Binding to a link that is down leaves ENETDOWN, as if it had gone down since.
void forget_error(int fd) {
  int error = 0;
  socklen_t size = sizeof(error);
  ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
}

TimePoint from_timespec(const timespec& t) {
  return time_from_ns(static_cast<std::int64_t>(t.tv_sec) * 1'000'000'000 + t.tv_nsec);
}

void from_kernel(const canfd_frame& raw, std::size_t bytes, Frame& frame) {
  const bool is_fd = bytes == CANFD_MTU;
  const bool extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.id = raw.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.flags = extended ? kExtended : 0;
  if ((raw.can_id & CAN_RTR_FLAG) != 0) frame.flags |= kRemote;
  if ((raw.can_id & CAN_ERR_FLAG) != 0) {
    frame.flags |= kError;
    frame.id = raw.can_id & CAN_ERR_MASK;
  }
  if (is_fd) {
    frame.flags |= kFd;
    if ((raw.flags & CANFD_BRS) != 0) frame.flags |= kBitRateSwitch;
    if ((raw.flags & CANFD_ESI) != 0) frame.flags |= kErrorStateIndicator;
  }
  const std::size_t most = is_fd ? kFdBytesMax : kClassicBytesMax;
  frame.length = static_cast<std::uint8_t>(std::min<std::size_t>(raw.len, most));
  // In a classic frame the raw DLC is in the last reserved byte of the FD layout.
  frame.raw_dlc = is_fd ? std::uint8_t{0} : raw.__res1;
  std::copy_n(std::begin(raw.data), frame.length, frame.data.begin());
}

std::size_t to_kernel(const Frame& frame, canfd_frame& raw) {
  raw.can_id = frame.id | (frame.has(kExtended) ? CAN_EFF_FLAG : 0U) |
               (frame.has(kRemote) ? CAN_RTR_FLAG : 0U) | (frame.has(kError) ? CAN_ERR_FLAG : 0U);
  raw.len = frame.length;
  std::copy_n(frame.data.begin(), frame.length, std::begin(raw.data));
  if (!frame.has(kFd)) {
    raw.__res1 = frame.raw_dlc;
    return CAN_MTU;
  }
  if (frame.has(kBitRateSwitch)) raw.flags |= CANFD_BRS;
  if (frame.has(kErrorStateIndicator)) raw.flags |= CANFD_ESI;
  return CANFD_MTU;
}

static_assert(offsetof(can_frame, len8_dlc) == offsetof(canfd_frame, __res1));
static_assert(offsetof(can_frame, data) == offsetof(canfd_frame, data));

static_assert(kSendTimeout == CAN_ERR_TX_TIMEOUT && kLostArbitration == CAN_ERR_LOSTARB &&
              kControllerProblem == CAN_ERR_CRTL && kProtocolViolation == CAN_ERR_PROT &&
              kTransceiver == CAN_ERR_TRX && kNotAcknowledged == CAN_ERR_ACK &&
              kBusOff == CAN_ERR_BUSOFF && kBusError == CAN_ERR_BUSERROR &&
              kRestarted == CAN_ERR_RESTARTED);
static_assert(kReceiveOverflow == CAN_ERR_CRTL_RX_OVERFLOW &&
              kSendOverflow == CAN_ERR_CRTL_TX_OVERFLOW &&
              kReceiveWarning == CAN_ERR_CRTL_RX_WARNING &&
              kSendWarning == CAN_ERR_CRTL_TX_WARNING &&
              kReceivePassive == CAN_ERR_CRTL_RX_PASSIVE &&
              kSendPassive == CAN_ERR_CRTL_TX_PASSIVE && kActiveAgain == CAN_ERR_CRTL_ACTIVE);

}  // namespace

struct Socket::Buffers {
  std::array<mmsghdr, kBatchFrames> headers{};
  std::array<iovec, kBatchFrames> parts{};
  std::array<canfd_frame, kBatchFrames> raw{};
  struct alignas(cmsghdr) Control {
    std::array<std::byte, kControlBytes> bytes{};
  };
  std::array<Control, kBatchFrames> control{};
  std::array<Received, kBatchFrames> frames{};

  Buffers() {
    for (std::size_t i = 0; i < kBatchFrames; ++i) {
      parts[i] = {&raw[i], sizeof(raw[i])};
      headers[i].msg_hdr.msg_iov = &parts[i];
      headers[i].msg_hdr.msg_iovlen = 1;
      headers[i].msg_hdr.msg_control = control[i].bytes.data();
    }
  }
};

Expected<Socket> Socket::open(const std::string& interface, std::span<const Filter> filters,
                              const SocketOptions& options) {
  const Expected<int> fd = open_raw(interface);
  if (!fd) return tl::unexpected(fd.error());
  Socket socket(interface, *fd);
  const Expected<int> index = find_index(*fd, interface);
  if (!index) return tl::unexpected(index.error());
  socket.index_ = *index;
  // All before bind(): nothing unwanted or unstamped is ever queued.
  if (!set_filters(*fd, filters) || !set_error_filter(*fd)) {
    return fail(interface, "no CAN filters: " + system_reason(errno));
  }
  set_buffers(*fd, options);
  if (!set_stamps_and_drop_count(*fd)) {
    return fail(interface, "no kernel time stamps: " + system_reason(errno));
  }
  // Set whatever the MTU is now: it may be raised while the link is down.
  if (!set_option(*fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1)) {
    return fail(interface, "no CAN FD frames: " + system_reason(errno));
  }
  if (!bind_to(*fd, *index)) return fail(interface, "cannot bind: " + system_reason(errno));
  forget_error(*fd);
  socklen_t size = sizeof(socket.receive_buffer_bytes_);
  ::getsockopt(*fd, SOL_SOCKET, SO_RCVBUF, &socket.receive_buffer_bytes_, &size);
  return socket;
}

bool may_appear(const std::string& interface) {
  if (interface.size() >= IFNAMSIZ) return false;
  const Expected<int> fd = open_raw(interface);
  if (!fd) return false;
  ifreq request = request_for(interface);
  const bool is_there = ::ioctl(*fd, SIOCGIFINDEX, &request) == 0;
  ::close(*fd);
  return !is_there;
}

Socket::Socket(std::string interface, int fd)
    : interface_(std::move(interface)), fd_(fd), buffers_(std::make_unique<Buffers>()) {}

Socket::Socket(Socket&& other) noexcept
    : Transmitter(other),
      interface_(std::move(other.interface_)),
      fd_(std::exchange(other.fd_, -1)),
      index_(other.index_),
      receive_buffer_bytes_(other.receive_buffer_bytes_),
      last_errno_(other.last_errno_),
      kernel_drops_(other.kernel_drops_),
      drops_(other.drops_),
      buffers_(std::move(other.buffers_)) {}

Socket& Socket::operator=(Socket&& other) noexcept {
  std::swap(interface_, other.interface_);
  std::swap(fd_, other.fd_);
  std::swap(buffers_, other.buffers_);
  index_ = other.index_;
  receive_buffer_bytes_ = other.receive_buffer_bytes_;
  last_errno_ = other.last_errno_;
  kernel_drops_ = other.kernel_drops_;
  drops_ = other.drops_;
  return *this;
}

Socket::~Socket() {
  if (fd_ >= 0) ::close(fd_);
}

LinkState Socket::look() const {
  ifreq request = request_for(interface_);
  // Query by the configured name, which may be an alternative one (ip-link(8)).
  if (::ioctl(fd_, SIOCGIFINDEX, &request) != 0 || request.ifr_ifindex != index_) return {};
  LinkState link{.is_ours = true};
  link.is_up = ::ioctl(fd_, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0;
  // A CAN XL link also carries FD frames; its MTU is larger still.
  link.fd_frames = ::ioctl(fd_, SIOCGIFMTU, &request) == 0 && request.ifr_mtu >= int{CANFD_MTU};
  return link;
}

std::string Socket::name_now() const {
  ifreq request{};
  request.ifr_ifindex = index_;
  return ::ioctl(fd_, SIOCGIFNAME, &request) == 0 ? std::string(request.ifr_name) : std::string();
}

Batch Socket::receive() {
  for (mmsghdr& header : buffers_->headers)
    header.msg_hdr.msg_controllen = kControlBytes;
  const int got = ::recvmmsg(fd_, buffers_->headers.data(), kBatchFrames, MSG_DONTWAIT, nullptr);
  if (got < 0) {
    switch (errno) {
      case EAGAIN:
      case EINTR:
        return {{}, ReceiveStatus::kDrained};
      case ENETDOWN:
        return {{}, ReceiveStatus::kLinkDown};
      case ENODEV:
        return {{}, ReceiveStatus::kDeviceGone};
      default:
        last_errno_ = errno;
        return {{}, ReceiveStatus::kFailed};
    }
  }
  const auto count = static_cast<std::size_t>(got);
  for (std::size_t i = 0; i < count; ++i) {
    from_kernel(buffers_->raw[i], buffers_->headers[i].msg_len, buffers_->frames[i].frame);
    read_control(i, buffers_->frames[i]);
  }
  return {{buffers_->frames.data(), count},
          count == kBatchFrames ? ReceiveStatus::kMore : ReceiveStatus::kDrained};
}

void Socket::read_control(std::size_t index, Received& out) {
  out.stamp = TimePoint{};
  out.hardware = TimePoint{};
  msghdr& header = buffers_->headers[index].msg_hdr;
  out.local = (header.msg_flags & MSG_DONTROUTE) != 0;
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr; part = CMSG_NXTHDR(&header, part)) {
    if (part->cmsg_level != SOL_SOCKET) continue;
    if (part->cmsg_type == SCM_TIMESTAMPING) {
      scm_timestamping stamps{};
      std::memcpy(&stamps, CMSG_DATA(part), sizeof(stamps));
      out.stamp = from_timespec(stamps.ts[0]);
      out.hardware = from_timespec(stamps.ts[2]);
    } else if (part->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t total = 0;
      std::memcpy(&total, CMSG_DATA(part), sizeof(total));
      drops_ += total - kernel_drops_;  // modulo 2^32, as the kernel counts
      kernel_drops_ = total;
    }
  }
}

SendResult Socket::send(const Frame& frame) {
  canfd_frame raw{};
  const std::size_t size = to_kernel(frame, raw);
  if (::send(fd_, &raw, size, MSG_DONTWAIT) >= 0) return SendResult::kSent;
  switch (errno) {
    case ENOBUFS:
      return SendResult::kNoBuffer;
    case EAGAIN:
    case EINTR:
      return SendResult::kWouldBlock;
    case ENETDOWN:
    case ENODEV:
    case ENXIO:
      return SendResult::kLinkDown;
    case EINVAL:
    case EMSGSIZE:
      return SendResult::kUnsupported;
    default:
      last_errno_ = errno;
      return SendResult::kFailed;
  }
}

}  // namespace vgyro::can
