// daemon::Bus on a real kernel, while its interfaces are renamed, swapped, moved, taken down and
// given other MTUs, and while frames carry launch times. Run by run_vcan_tests.py in a network
// namespace or a kernel of its own, as root; never run it on a host's own network.

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <poll.h>
#include <string>
#include <sys/socket.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>

#include "can/socket.h"
#include "daemon/bus.h"

namespace vgyro::daemon {
namespace {

using namespace std::chrono_literals;
using can::SendResult;

constexpr const char* kBus = "probe0";
constexpr const char* kOtherBus = "probe1";
constexpr int kSettleMs = 20;  // the kernel may hand a frame on only when its own thread runs

// NOLINTBEGIN(*-avoid-non-const-global-variables): functions of TurnClock and Journal have no state
/// How far the clocks shown to the buses are ahead of the kernel's.
Duration wall_ahead{};
Duration steady_ahead{};
std::vector<std::string> said;
// NOLINTEND(*-avoid-non-const-global-variables)

template <clockid_t Clock>
TimePoint kernels_clock() {
  timespec now{};
  ::clock_gettime(Clock, &now);
  return time_from_ns(std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec);
}

TimePoint shown_wall() {
  return kernels_clock<CLOCK_REALTIME>() + wall_ahead;
}

TimePoint shown_steady() {
  return kernels_clock<CLOCK_MONOTONIC>() + steady_ahead;
}

int listen_to(const iovec* fields, int count) {
  constexpr std::string_view kMessage = "MESSAGE=";
  for (int i = 0; i < count; ++i) {
    const std::string_view field(static_cast<const char*>(fields[i].iov_base), fields[i].iov_len);
    if (field.starts_with(kMessage)) said.emplace_back(field.substr(kMessage.size()));
  }
  return 0;
}

can::Frame frame_of(std::uint32_t id, std::uint8_t flags = 0, std::uint8_t length = 8) {
  can::Frame frame;
  frame.id = id;
  frame.flags = flags;
  frame.length = length;
  return frame;
}

struct Seen {
  std::uint32_t id = 0;
  TimePoint stamp;
};

class BusProbe : public testing::Test {
 protected:
  BusProbe() { change_links(kRemoveAll + links({kBus, kOtherBus})); }
  ~BusProbe() override { wall_ahead = steady_ahead = {}; }
  BusProbe(const BusProbe&) = delete;
  BusProbe& operator=(const BusProbe&) = delete;

  static std::string links(const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& name : names)
      all += fmt::format("link add {0} mtu 16 type vcan\nlink set {0} up\n", name);
    return all;
  }

  /// Lines for `ip -batch`; `-force` goes on after one that fails.
  static void change_links(const std::string& lines) {
    const bool may_fail = lines.starts_with(kRemoveAll);
    const std::string command =
        fmt::format("printf '{}' | ip {} -batch - {}", lines, may_fail ? "-force" : "",
                    may_fail ? "2>/dev/null" : "");
    // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread starts programs
    const int status = std::system(command.c_str());
    ASSERT_TRUE(may_fail || status == 0) << lines;
  }

  void open(Bus& bus) {
    const Expected<void> opened = bus.open();
    ASSERT_TRUE(opened) << opened.error().message();
  }

  /// The loop's work of one second.
  void second(Bus& bus) {
    clock.begin_turn();
    bus.second_passed();
    if (!bus.is_open()) open(bus);
  }

  /// Frames that a turn of the loop takes from the bus, if there is something to read.
  std::vector<Seen> turn(Bus& bus) {
    clock.begin_turn();
    std::vector<Seen> seen;
    if (!bus.is_open()) return seen;
    pollfd entry{bus.socket().fd(), POLLIN, 0};
    if (::poll(&entry, 1, kSettleMs) == 0) return seen;
    bus.begin_reading();
    for (Arrival arrival = bus.peek(); arrival.frame != nullptr; arrival = bus.peek()) {
      seen.push_back({arrival.frame->id, arrival.stamp});
      bus.take();
    }
    return seen;
  }

  std::vector<std::uint32_t> ids_of(const std::vector<Seen>& seen) {
    std::vector<std::uint32_t> ids(seen.size());
    std::transform(seen.begin(), seen.end(), ids.begin(), [](const Seen& one) { return one.id; });
    return ids;
  }

  bool was_said(const std::string& text) {
    EXPECT_TRUE(log.flush(5s));
    return std::any_of(said.begin(), said.end(), [&](const std::string& line) {
      return line.find(text) != std::string::npos;
    });
  }

  static can::Socket neighbour(const std::string& interface) {
    const std::vector<can::Filter> everything{{0, 0, false}, {0, 0, true}};
    Expected<can::Socket> socket = can::Socket::open(interface, everything);
    if (!socket) std::abort();
    return std::move(*socket);
  }

  static std::size_t heard(can::Socket& socket) {
    std::size_t count = 0;
    pollfd entry{socket.fd(), POLLIN, 0};
    while (::poll(&entry, 1, kSettleMs) > 0 && entry.revents != 0)
      count += socket.receive().frames.size();
    return count;
  }

  Bus bus_on(const std::string& name) {
    return {name, {{0x100, 0x700, false}}, IdentifierWatch(), {}, clock, log};
  }

  static inline const std::string kRemoveAll =
      "link del probe0\\nlink del probe1\\nlink del probe2\\nlink del probe9\\n";

  TurnClock clock{&shown_wall, &shown_steady};
  Log log{&listen_to};

 private:
  struct Silence {
    Silence() { said.clear(); }
  } silence_;
};

TEST_F(BusProbe, ARenamedInterfaceIsLetGoAndTheOneThatHasItsNameNowIsBound) {
  Bus bus = bus_on(kBus);
  open(bus);
  EXPECT_EQ(bus.send(frame_of(0x610)), SendResult::kSent);
  change_links("link set probe0 down\nlink set probe0 name probe9\nlink set probe9 up\n" +
               links({kBus}));
  can::Socket renamed = neighbour("probe9");
  can::Socket present = neighbour(kBus);
  for (std::size_t i = 0; i <= can::Socket::kBatchFrames; ++i)
    EXPECT_EQ(renamed.send(frame_of(0x101)), SendResult::kSent);
  EXPECT_EQ(bus.send(frame_of(0x610)), SendResult::kLinkDown) << "before anybody has looked";
  EXPECT_TRUE(turn(bus).empty()) << "nor is another bus heard";
  EXPECT_TRUE(bus.drained()) << "so that time may pass";
  second(bus);
  EXPECT_TRUE(was_said("probe0: the interface is now called probe9; looking for probe0 again"));
  EXPECT_TRUE(was_said("probe0: open again"));
  EXPECT_FALSE(was_said("link is up again"));
  EXPECT_EQ(bus.send(frame_of(0x610)), SendResult::kSent);
  EXPECT_EQ(heard(renamed), 0U);
  EXPECT_EQ(heard(present), 1U);
  for (const std::uint32_t id : {0x101U, 0x201U})
    EXPECT_EQ(present.send(frame_of(id)), SendResult::kSent);
  EXPECT_EQ(present.send(frame_of(can::kBusOff, can::kError)), SendResult::kSent);
  EXPECT_EQ(ids_of(turn(bus)), std::vector<std::uint32_t>{0x101}) << "with its filters";
  EXPECT_EQ(bus.status().controller, can::ControllerState::kBusOff) << "and the error filter";
  EXPECT_EQ(bus.status().downs, 1U);
  EXPECT_EQ(bus.status().reopened, 1U);
}

TEST_F(BusProbe, ARenameBeforeTheLinkWasEverUpIsSeen) {
  change_links("link set probe0 down\n");
  Bus bus = bus_on(kBus);
  open(bus);
  EXPECT_TRUE(was_said("probe0: link is down"));
  change_links("link set probe0 name probe9\nlink set probe9 up\n");
  can::Socket renamed = neighbour("probe9");
  EXPECT_EQ(renamed.send(frame_of(0x101)), SendResult::kSent);
  EXPECT_EQ(bus.send(frame_of(0x610)), SendResult::kLinkDown);
  EXPECT_TRUE(turn(bus).empty());
  second(bus);
  EXPECT_FALSE(bus.is_open());
  EXPECT_FALSE(bus.status().present);
  EXPECT_EQ(heard(renamed), 0U);
  change_links(links({kBus}));
  second(bus);
  EXPECT_TRUE(bus.is_up());
  EXPECT_EQ(bus.status().downs, 0U) << "it was never up";
  EXPECT_EQ(bus.status().reopened, 1U);
}

TEST_F(BusProbe, TwoBusesWhoseNamesAreSwappedFollowTheirNames) {
  Bus first = bus_on(kBus);
  Bus second_bus = bus_on(kOtherBus);
  open(first);
  open(second_bus);
  change_links(
      "link set probe0 down\nlink set probe1 down\nlink set probe0 name probe2\n"
      "link set probe1 name probe0\nlink set probe2 name probe1\n"
      "link set probe0 up\nlink set probe1 up\n");
  second(first);
  second(second_bus);
  EXPECT_TRUE(was_said("probe0: the interface is now called probe1; looking for probe0 again"));
  EXPECT_TRUE(was_said("probe1: the interface is now called probe0; looking for probe1 again"));
  can::Socket on_first = neighbour(kBus);
  can::Socket on_second = neighbour(kOtherBus);
  EXPECT_EQ(on_first.send(frame_of(0x101)), SendResult::kSent);
  EXPECT_EQ(on_second.send(frame_of(0x102)), SendResult::kSent);
  EXPECT_EQ(ids_of(turn(first)), std::vector<std::uint32_t>{0x101});
  EXPECT_EQ(ids_of(turn(second_bus)), std::vector<std::uint32_t>{0x102});
  EXPECT_EQ(first.send(frame_of(0x610)), SendResult::kSent);
  EXPECT_EQ(heard(on_first), 1U);
  EXPECT_EQ(heard(on_second), 0U);
}

/// Another network namespace, kept alive by an idle process.
class Elsewhere {
 public:
  Elsewhere() {
    std::array<int, 2> is_there{};
    EXPECT_EQ(::pipe(is_there.data()), 0);
    process_ = ::fork();
    if (process_ == 0) {
      const char done = ::unshare(CLONE_NEWNET) == 0 ? 'y' : 'n';
      if (::write(is_there[1], &done, 1) == 1) ::pause();
      ::_exit(1);
    }
    char done = 'n';
    EXPECT_TRUE(::read(is_there[0], &done, 1) == 1 && done == 'y');
    for (const int end : is_there)
      ::close(end);
  }
  Elsewhere(const Elsewhere&) = delete;
  Elsewhere& operator=(const Elsewhere&) = delete;
  ~Elsewhere() {
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  [[nodiscard]] pid_t process() const { return process_; }

 private:
  pid_t process_ = 0;
};

TEST_F(BusProbe, AnInterfaceThatMovesToAnotherNamespaceIsGoneUntilItComesBack) {
  Bus bus = bus_on(kBus);
  open(bus);
  const Elsewhere elsewhere;
  change_links(fmt::format("link set probe0 netns {}\n", elsewhere.process()));
  turn(bus);
  second(bus);
  EXPECT_FALSE(bus.is_open());
  EXPECT_TRUE(was_said("probe0: the interface was removed; waiting for it"));
  const std::string back = fmt::format("nsenter --target {} --net ip link set probe0 netns {}",
                                       elsewhere.process(), ::getpid());
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread starts programs
  ASSERT_EQ(std::system(back.c_str()), 0);
  change_links("link set probe0 up\n");
  second(bus);
  EXPECT_TRUE(bus.is_up());
  can::Socket peer = neighbour(kBus);
  EXPECT_EQ(peer.send(frame_of(0x101)), SendResult::kSent);
  EXPECT_EQ(turn(bus).size(), 1U);
  EXPECT_EQ(bus.status().downs, 1U);
}

TEST_F(BusProbe, ANameThatComesBackWithAnotherIndexIsBoundAnewAlsoWhenNobodyReadInBetween) {
  Bus bus = bus_on(kBus);
  open(bus);
  change_links(
      "link del probe0\nlink add probe0 index 4711 mtu 16 type vcan\nlink set probe0 up\n");
  second(bus);
  EXPECT_TRUE(was_said("probe0: open again"));
  can::Socket peer = neighbour(kBus);
  EXPECT_EQ(peer.send(frame_of(0x101)), SendResult::kSent);
  EXPECT_EQ(turn(bus).size(), 1U);
  EXPECT_EQ(bus.status().downs, 1U);
}

TEST_F(BusProbe, AnAlternativeNameIsAName) {
  change_links("link property add dev probe0 altname gyros-left\n");
  Bus bus = bus_on("gyros-left");
  open(bus);
  ASSERT_TRUE(bus.is_up());
  second(bus);
  EXPECT_TRUE(bus.is_up());
  EXPECT_EQ(bus.status().reopened, 0U);
}

TEST_F(BusProbe, WhatHasTheNameAndIsNoCanInterfaceIsSaidOnce) {
  Bus bus = bus_on(kBus);
  open(bus);
  change_links(
      "link set probe0 down\nlink set probe0 name probe9\nlink set lo down\nlink set lo name "
      "probe0\n");
  for (int i = 0; i < 3; ++i) {
    clock.begin_turn();
    bus.second_passed();
    EXPECT_TRUE(bus.is_open() || !bus.open());
  }
  change_links("link set probe0 name lo\nlink set lo up\n");
  ASSERT_TRUE(log.flush(5s));
  EXPECT_EQ(std::count_if(said.begin(), said.end(),
                          [](const std::string& line) {
                            return line.find("probe0: not a CAN interface") != std::string::npos;
                          }),
            1);
}

// --- a link that goes down -----------------------------------------------------------------------

TEST_F(BusProbe, EachDownCountsOnceWhoeverSeesItFirst) {
  Bus bus = bus_on(kBus);
  open(bus);
  std::uint64_t downs = 0;
  const std::vector<std::string> seers{"send",      "read",      "send read",
                                       "read send", "send send", "read read"};
  for (const bool up_before_seen : {false, true}) {
    for (const std::string& seer : seers) {
      change_links(up_before_seen ? "link set probe0 down\nlink set probe0 up\n"
                                  : "link set probe0 down\n");
      for (std::size_t at = 0; at < seer.size(); at += 5)
        seer.compare(at, 4, "send") == 0 ? void(bus.send(frame_of(0x610))) : void(turn(bus));
      EXPECT_EQ(bus.status().downs, ++downs) << seer << (up_before_seen ? ", up again" : "");
      if (!up_before_seen) change_links("link set probe0 up\n");
      EXPECT_EQ(bus.send(frame_of(0x610)), SendResult::kSent) << "at once when it is up: " << seer;
      EXPECT_TRUE(bus.is_up());
    }
  }
  change_links("link del probe0\n");
  bus.send(frame_of(0x610));
  turn(bus);
  EXPECT_EQ(bus.status().downs, downs + 1) << "nor does a removal count twice";
  EXPECT_FALSE(bus.is_open());
}

TEST_F(BusProbe, ABusThatIsOnlyReadCountsDownsWithinOneSecond) {
  Bus bus = bus_on(kBus);
  open(bus);
  for (std::uint64_t i = 1; i <= 5; ++i) {
    change_links("link set probe0 down\nlink set probe0 up\n");
    turn(bus);
    EXPECT_EQ(bus.status().downs, i);
  }
  second(bus);
  EXPECT_TRUE(bus.is_up());
}

TEST_F(BusProbe, ALinkThatIsGivenAnotherMtuWhileItIsDownCarriesFdWhenItIsUp) {
  Bus bus = bus_on(kBus);
  open(bus);
  EXPECT_FALSE(bus.carries_fd());
  EXPECT_EQ(bus.send(frame_of(0x610, can::kFd, 32)), SendResult::kUnsupported);
  bool by_sending = true;
  for (const int mtu : {72, 2060}) {
    change_links("link set probe0 down\nlink set probe0 mtu 16\nlink set probe0 up\n");
    second(bus);
    EXPECT_FALSE(bus.carries_fd());
    change_links(
        fmt::format("link set probe0 down\nlink set probe0 mtu {}\nlink set probe0 up\n", mtu));
    turn(bus);
    if (!std::exchange(by_sending, false)) second(bus);
    can::Socket peer = neighbour(kBus);
    EXPECT_EQ(bus.send(frame_of(0x610, can::kFd, 32)), SendResult::kSent) << mtu;
    EXPECT_TRUE(bus.carries_fd());
    EXPECT_EQ(peer.send(frame_of(0x101, can::kFd, 64)), SendResult::kSent);
    EXPECT_EQ(turn(bus).size(), 1U) << mtu;
    EXPECT_EQ(heard(peer), 1U);
  }
  EXPECT_TRUE(was_said("probe0: link is up again, CAN FD"));
}

// --- stamps --------------------------------------------------------------------------------------

/// Sends with a launch time (SO_TXTIME), like a program that schedules its frames.
class Launcher {
 public:
  Launcher(const char* interface, clockid_t clock) : fd_(::socket(PF_CAN, SOCK_RAW, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface));
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    const sock_txtime launch{.clockid = clock, .flags = 0};
    EXPECT_EQ(::setsockopt(fd_, SOL_SOCKET, SO_TXTIME, &launch, sizeof(launch)), 0);
  }
  Launcher(const Launcher&) = delete;
  Launcher& operator=(const Launcher&) = delete;
  ~Launcher() { ::close(fd_); }

  void send(std::uint32_t id, TimePoint launch) const {
    can_frame frame{};
    frame.can_id = id;
    iovec part{&frame, sizeof(frame)};
    alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(std::uint64_t))> control{};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* const cmsg = CMSG_FIRSTHDR(&header);
    cmsg->cmsg_level = SOL_SOCKET;
    cmsg->cmsg_type = SCM_TXTIME;
    cmsg->cmsg_len = CMSG_LEN(sizeof(std::uint64_t));
    const auto at = static_cast<std::uint64_t>(to_ns(launch));
    std::memcpy(CMSG_DATA(cmsg), &at, sizeof(at));
    EXPECT_EQ(::sendmsg(fd_, &header, 0), static_cast<ssize_t>(sizeof(frame)));
  }

 private:
  int fd_;
};

class StampProbe : public BusProbe {
 protected:
  StampProbe() {
    open(bus);
    std::this_thread::sleep_for(
        20ms);  // the kernel turns stamping on a moment after it is asked to
  }
  Bus bus = bus_on(kBus);
};

TEST_F(StampProbe, ALaunchTimeThatIsNoTimeOfArrivalIsReplacedByTheTimeOfReading) {
  std::uint64_t replaced = 0;
  const Duration leads[] = {37s, 3s, -3s, -20h};
  for (const Duration lead : leads) {
    const TimePoint before = kernels_clock<CLOCK_REALTIME>();
    Launcher(kBus, CLOCK_REALTIME).send(0x101, before + lead);
    const std::vector<Seen> seen = turn(bus);
    ASSERT_EQ(seen.size(), 1U);
    EXPECT_GE(seen[0].stamp, before);
    EXPECT_LE(seen[0].stamp, kernels_clock<CLOCK_REALTIME>());
    EXPECT_EQ(bus.status().restamped, ++replaced);
  }
  const TimePoint before = kernels_clock<CLOCK_REALTIME>();
  Launcher(kBus, CLOCK_MONOTONIC).send(0x101, kernels_clock<CLOCK_MONOTONIC>());
  EXPECT_GE(turn(bus).at(0).stamp, before);
  EXPECT_EQ(bus.status().restamped, ++replaced);
}

TEST_F(StampProbe, AmongHonestStampsOnlyTheOthersAreReplaced) {
  const Launcher launcher(kBus, CLOCK_MONOTONIC);
  can::Socket honest = neighbour(kBus);
  const TimePoint before = kernels_clock<CLOCK_REALTIME>();
  for (int i = 0; i < 10; ++i) {
    launcher.send(0x101, kernels_clock<CLOCK_MONOTONIC>());
    EXPECT_EQ(honest.send(frame_of(0x102)), SendResult::kSent);
  }
  const TimePoint sent = kernels_clock<CLOCK_REALTIME>();
  const std::vector<Seen> seen = turn(bus);
  ASSERT_EQ(seen.size(), 20U);
  for (const Seen& one : seen) {
    EXPECT_GE(one.stamp, before);
    EXPECT_TRUE(one.id != 0x102 || one.stamp <= sent) << "the kernel's own";
  }
  EXPECT_EQ(bus.status().restamped, 10U);
}

TEST_F(StampProbe, WhatWaitedInTheQueueOfAStoppedProcessKeepsItsStamp) {
  for (int i = 0; i < 3; ++i)
    second(bus);
  can::Socket honest = neighbour(kBus);
  const TimePoint before = kernels_clock<CLOCK_REALTIME>();
  for (int i = 0; i < 200; ++i)
    EXPECT_EQ(honest.send(frame_of(0x102)), SendResult::kSent);
  Launcher(kBus, CLOCK_MONOTONIC).send(0x101, kernels_clock<CLOCK_MONOTONIC>());
  const TimePoint sent = kernels_clock<CLOCK_REALTIME>();
  wall_ahead = steady_ahead = 90s;  // as after a process was stopped for so long
  const std::vector<Seen> seen = turn(bus);
  ASSERT_EQ(seen.size(), 201U);
  for (const Seen& one : seen) {
    if (one.id == 0x101) continue;
    EXPECT_GE(one.stamp, before);
    EXPECT_LE(one.stamp, sent);
  }
  EXPECT_GE(seen.back().stamp, sent + 90s);
  EXPECT_EQ(bus.status().restamped, 1U);
}

TEST_F(StampProbe, StampsOfAClockThatWasSetMeanwhileAreTheKernelsOwn) {
  // The kernel's clocks cannot be set here, so the earlier turns see another clock instead.
  wall_ahead = 3h;
  for (int i = 0; i < 3; ++i)
    second(bus);
  wall_ahead = {};
  can::Socket honest = neighbour(kBus);
  EXPECT_EQ(honest.send(frame_of(0x102)), SendResult::kSent);
  const TimePoint sent = kernels_clock<CLOCK_REALTIME>();
  const std::vector<Seen> seen = turn(bus);
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_LE(seen[0].stamp, sent);
  EXPECT_EQ(bus.status().restamped, 0U);
}

}  // namespace
}  // namespace vgyro::daemon
