// can::Socket on a real kernel. Run by run_vcan_tests.py in a network namespace or a kernel of its
// own, as root, because it makes and breaks interfaces; never run it on a host's own network.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <poll.h>
#include <string>
#include <thread>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "can/error_frame.h"
#include "can/socket.h"
#include "can/transmit.h"

namespace vgyro::can {
namespace {

using namespace std::chrono_literals;

constexpr const char* kBus = "probe0";  // carries FD
constexpr const char* kClassicBus = "probe1";

TimePoint host_clock() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return time_from_ns(std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec);
}

Frame frame_of(std::uint32_t id, std::uint8_t flags, std::uint8_t length) {
  Frame frame;
  frame.id = id;
  frame.flags = flags;
  frame.length = length;
  for (std::size_t i = 0; i < length; ++i)
    frame.data[i] = static_cast<std::uint8_t>(id + i);
  return frame;
}

Frame classic(std::uint32_t id) {
  return frame_of(id, 0, 8);
}

short poll_events(const Socket& socket, short wanted) {
  pollfd entry{socket.fd(), wanted, 0};
  poll(&entry, 1, 0);
  return entry.revents;
}

constexpr int kArrivalMs = 1000;  // the kernel may hand a frame on only when its own thread runs
constexpr int kSettleMs = 20;

bool wait_readable(const Socket& socket, int timeout_ms) {
  pollfd entry{socket.fd(), POLLIN, 0};
  return poll(&entry, 1, timeout_ms) > 0;
}

std::vector<Received> receive_now(Socket& socket) {
  std::vector<Received> all;
  Batch batch;
  do {
    batch = socket.receive();
    all.insert(all.end(), batch.frames.begin(), batch.frames.end());
  } while (batch.status == ReceiveStatus::kMore);
  EXPECT_EQ(batch.status, ReceiveStatus::kDrained);
  return all;
}

// Receives until no more frames arrive.
std::vector<Received> receive_all(Socket& socket, int first_within_ms = kArrivalMs) {
  std::vector<Received> all;
  for (int wait_ms = first_within_ms; wait_readable(socket, wait_ms); wait_ms = kSettleMs) {
    const std::vector<Received> more = receive_now(socket);
    all.insert(all.end(), more.begin(), more.end());
  }
  return all;
}

std::vector<Frame> frames_of(const std::vector<Received>& all) {
  std::vector<Frame> frames;
  frames.reserve(all.size());
  for (const Received& one : all)
    frames.push_back(one.frame);
  return frames;
}

class SocketProbe : public testing::Test {
 protected:
  void SetUp() override {
    if (pristine_) return;
    change_links(
        "ip link del probe0 2>/dev/null; ip link del probe1 2>/dev/null; "
        "ip link add probe0 mtu 72 type vcan && ip link set probe0 up && "
        "ip link add probe1 mtu 16 type vcan && ip link set probe1 up");
    pristine_ = true;
  }

  static void change_links(const std::string& command) {
    pristine_ = false;
    // NOLINTNEXTLINE(concurrency-mt-unsafe): the program has one thread
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
  }

  static Socket open(const std::string& bus, const std::vector<Filter>& filters,
                     const SocketOptions& options = {}) {
    Expected<Socket> socket = Socket::open(bus, filters, options);
    if (!socket) {
      ADD_FAILURE() << socket.error().message();
      std::exit(1);  // NOLINT(concurrency-mt-unsafe): nothing can be tested
    }
    return std::move(*socket);
  }

  const std::vector<Filter> everything_{{0, 0, false}, {0, 0, true}};

 private:
  static inline bool pristine_ = false;  ///< starting programs is slow in User Mode Linux
};

TEST_F(SocketProbe, SaysWhatToDoWhenTheInterfaceIsMissingOrNoCanInterface) {
  const Expected<Socket> missing = Socket::open("nosuch0", {});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().where, "nosuch0");
  EXPECT_NE(missing.error().remedy.find("ip link add nosuch0 type vcan"), std::string::npos);
  const Expected<Socket> loopback = Socket::open("lo", {});
  ASSERT_FALSE(loopback);
  EXPECT_EQ(loopback.error().what, "not a CAN interface");
  EXPECT_FALSE(Socket::open("a-name-that-is-longer-than-the-kernel-allows", {}));
}

TEST_F(SocketProbe, ReceivesExactlyTheFilteredIdentifiers) {
  Socket sender = open(kBus, {});
  Socket receiver = open(kBus, {{0x101, 0x7FF, false}, {0xF02A00, 0xFFFF00, true}});
  const std::vector<Frame> wanted{classic(0x101), frame_of(0x0CF02AE2, kExtended, 8),
                                  frame_of(0x18F02A03, kExtended, 8)};
  const std::vector<Frame> unwanted{classic(0x102), frame_of(0x101, kExtended, 8),
                                    frame_of(0x101, kRemote, 0), frame_of(0x0CF02BE2, kExtended, 8),
                                    classic(0x0E2)};
  for (const auto* frames : {&unwanted, &wanted, &unwanted}) {
    for (const Frame& frame : *frames)
      EXPECT_EQ(sender.send(frame), SendResult::kSent);
  }
  EXPECT_EQ(frames_of(receive_all(receiver)), wanted);
}

TEST_F(SocketProbe, ReceivesNothingWithoutFilters) {
  Socket sender = open(kBus, {});
  Socket writer = open(kBus, {});
  EXPECT_EQ(sender.send(classic(0x101)), SendResult::kSent);
  EXPECT_EQ(poll_events(writer, POLLIN), 0);
  EXPECT_TRUE(receive_all(writer, kSettleMs).empty());
}

TEST_F(SocketProbe, HidesItsOwnFramesButShowsThemToOtherPrograms) {
  Socket self = open(kBus, everything_);
  Socket other = open(kBus, everything_);
  EXPECT_EQ(self.send(classic(0x610)), SendResult::kSent);
  EXPECT_TRUE(receive_all(self, kSettleMs).empty());
  EXPECT_EQ(frames_of(receive_all(other)), (std::vector<Frame>{classic(0x610)}));
}

TEST_F(SocketProbe, CarriesEveryKindOfFrameUnchanged) {
  Socket sender = open(kBus, {});
  Socket receiver = open(kBus, everything_);
  std::vector<Frame> frames{classic(0x7FF),
                            frame_of(0x1FFFFFFF, kExtended, 3),
                            frame_of(0x123, 0, 0),
                            frame_of(0x123, kFd | kBitRateSwitch, 64),
                            frame_of(0x1ABCDEF0, kExtended | kFd | kErrorStateIndicator, 12),
                            frame_of(0x77, kFd, 8)};
  frames.push_back(classic(0x321));
  frames.back().raw_dlc = 13;
  for (const Frame& frame : frames)
    EXPECT_EQ(sender.send(frame), SendResult::kSent);
  EXPECT_EQ(frames_of(receive_all(receiver)), frames);
}

TEST_F(SocketProbe, RefusesFdFramesOnAClassicLink) {
  Socket socket = open(kClassicBus, {});
  EXPECT_EQ(socket.look(), (LinkState{.is_ours = true, .is_up = true, .fd_frames = false}));
  EXPECT_EQ(socket.send(frame_of(0x123, kFd, 32)), SendResult::kUnsupported);
  EXPECT_EQ(socket.send(classic(0x123)), SendResult::kSent);
}

TEST_F(SocketProbe, GivesTheKernelsStampsTheSameToEveryReceiver) {
  Socket sender = open(kBus, {});
  Socket one = open(kBus, everything_);
  Socket two = open(kBus, everything_);
  std::this_thread::sleep_for(20ms);  // the kernel turns stamping on a moment after it is asked to
  const TimePoint before = host_clock();
  for (std::uint32_t i = 0; i < 20; ++i) {
    EXPECT_EQ(sender.send(classic(i)), SendResult::kSent);
    std::this_thread::sleep_for(1ms);
  }
  const TimePoint after = host_clock();
  std::this_thread::sleep_for(20ms);
  const std::vector<Received> first = receive_all(one);
  const std::vector<Received> second = receive_all(two);
  ASSERT_EQ(first.size(), 20U);
  ASSERT_EQ(second.size(), 20U);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].stamp, second[i].stamp);
    EXPECT_EQ(first[i].hardware, TimePoint{}) << "a virtual link has no controller";
    EXPECT_GT(first[i].stamp, i == 0 ? before : first[i - 1].stamp);
    EXPECT_LT(first[i].stamp, after) << "stamped when read, not when received";
  }
}

// vcan makes no error frames itself, but a peer may send them.
TEST_F(SocketProbe, HearsErrorFramesAlsoWithoutFiltersAndAfterRebinding) {
  const auto error_frame = [](std::uint32_t classes) { return frame_of(classes, kError, 8); };
  for (int round = 0; round < 2; ++round) {
    Socket sender = open(kBus, {});
    Socket writer = open(kBus, {});
    Socket receiver = open(kBus, {{0x101, 0x7FF, false}});
    for (const std::uint32_t classes :
         {std::uint32_t{kBusOff}, std::uint32_t{kLostArbitration},
          std::uint32_t{kProtocolViolation}, std::uint32_t{kBusError}})
      EXPECT_EQ(sender.send(error_frame(classes)), SendResult::kSent);
    EXPECT_EQ(sender.send(classic(0x101)), SendResult::kSent);
    const std::vector<Frame> errors{error_frame(kBusOff), error_frame(kLostArbitration)};
    EXPECT_EQ(frames_of(receive_all(writer)), errors);
    EXPECT_EQ(frames_of(receive_all(receiver)),
              (std::vector<Frame>{errors[0], errors[1], classic(0x101)}));
    if (round > 0) break;
    change_links(
        "ip link del probe0 && ip link add probe0 mtu 72 type vcan && ip link set probe0 up");
  }
}

TEST_F(SocketProbe, KnowsWhichInterfacesMayStillAppear) {
  EXPECT_TRUE(may_appear("nosuch0"));
  EXPECT_FALSE(may_appear("lo"));
  EXPECT_FALSE(may_appear(kBus));
  EXPECT_FALSE(may_appear("a-name-that-is-longer-than-the-kernel-allows"));
}

// Frames in the kernel cannot be recalled, so it must hold few.
TEST_F(SocketProbe, HoldsFewFramesInTheKernelWhereTheBufferIsSmall) {
  change_links("tc qdisc add dev probe0 root tbf rate 1kbit burst 200 limit 100000");
  Socket socket = open(kBus, {}, {.send_buffer_bytes = 1});
  int sent = 0;
  while (sent < 1000 && socket.send(classic(0x610)) == SendResult::kSent)
    ++sent;
  constexpr int kPassedAtOnce = 200 / 16;  // the bucket's
  EXPECT_LE(sent - kPassedAtOnce, 8);
  EXPECT_GE(sent - kPassedAtOnce, 3) << "VG_Rate, VG_Bias and VG_Model go out together";
}

TEST_F(SocketProbe, CountsFramesThatTheKernelDropped) {
  Socket sender = open(kBus, {});
  Socket receiver = open(kBus, everything_, {.receive_buffer_bytes = 20'000});
  constexpr std::uint32_t kSent = 500;
  for (std::uint32_t i = 0; i < kSent; ++i) {
    EXPECT_EQ(sender.send(classic(i)), SendResult::kSent);
  }
  const std::size_t got = receive_all(receiver).size();
  EXPECT_LT(got, kSent);
  EXPECT_EQ(sender.send(classic(1)), SendResult::kSent);
  EXPECT_EQ(receive_all(receiver).size(), 1U) << "the count comes with the next frame";
  EXPECT_EQ(receiver.drops(), kSent - got);
}

TEST_F(SocketProbe, HoldsASecondOfABusyBus) {
  Socket sender = open(kBus, {});
  Socket receiver = open(kBus, everything_);
  for (std::uint32_t i = 0; i < 2000; ++i) {
    EXPECT_EQ(sender.send(classic(i & 0x7FFU)), SendResult::kSent);
  }
  EXPECT_EQ(receive_all(receiver).size(), 2000U) << receiver.receive_buffer_bytes();
  EXPECT_EQ(receiver.drops(), 0U);
}

TEST_F(SocketProbe, SaysNoBufferWhileAFullDeviceQueueStillPollsWritable) {
  change_links("tc qdisc add dev probe0 root tbf rate 100kbit burst 200 limit 400");
  Socket socket = open(kBus, {});
  int sent = 0;
  SendResult result = SendResult::kSent;
  while (sent < 1000 && (result = socket.send(classic(0x610))) == SendResult::kSent)
    ++sent;
  EXPECT_EQ(result, SendResult::kNoBuffer);
  EXPECT_GT(sent, 5);
  EXPECT_EQ(poll_events(socket, POLLOUT), POLLOUT);
}

TEST_F(SocketProbe, SaysWouldBlockWhileAFullSocketBufferPollsNotWritable) {
  change_links("tc qdisc add dev probe0 root tbf rate 100kbit burst 200 limit 100000");
  Socket socket = open(kBus, {}, {.send_buffer_bytes = 1});
  int sent = 0;
  SendResult result = SendResult::kSent;
  while (sent < 1000 && (result = socket.send(classic(0x610))) == SendResult::kSent)
    ++sent;
  EXPECT_EQ(result, SendResult::kWouldBlock);
  EXPECT_EQ(poll_events(socket, POLLOUT), 0);
}

TEST_F(SocketProbe, SendsWhatASlowBusTakesInTimeAndDropsTheRest) {
  change_links("tc qdisc add dev probe0 root tbf rate 32kbit burst 200 limit 400");
  Socket socket = open(kBus, {});
  Socket listener = open(kBus, everything_);
  TransmitQueue queue;
  constexpr int kFrames = 500;
  for (int i = 0; i < kFrames; ++i) {
    const TimePoint now = host_clock();
    queue.push(classic(static_cast<std::uint32_t>(i)), now + 20ms);
    queue.drain(now, socket);
    std::this_thread::sleep_for(2ms);
  }
  while (queue.size() > 0)
    queue.drain(host_clock(), socket);
  const TransmitCounts& counts = queue.counts();
  EXPECT_EQ(counts.sent + counts.dropped_stale, std::uint64_t{kFrames});
  EXPECT_GT(counts.sent, 100U);
  EXPECT_GT(counts.dropped_stale, 50U);
  EXPECT_GT(counts.retries, 10U);
  const std::vector<Received> heard = receive_all(listener);
  EXPECT_EQ(heard.size(), counts.sent) << "a refused frame must not reach other programs";
  EXPECT_TRUE(std::is_sorted(heard.begin(), heard.end(), [](const Received& a, const Received& b) {
    return a.frame.id < b.frame.id;
  }));
}

TEST_F(SocketProbe, GoesOnWithTheSameSocketAfterTheLinkWasDown) {
  Socket sender = open(kBus, {});
  Socket receiver = open(kBus, everything_);
  EXPECT_TRUE(receiver.look().is_up);
  change_links("ip link set probe0 down");
  EXPECT_EQ(receiver.receive().status, ReceiveStatus::kLinkDown);
  EXPECT_EQ(receiver.receive().status, ReceiveStatus::kDrained) << "told once";
  EXPECT_FALSE(receiver.look().is_up);
  EXPECT_EQ(sender.receive().status, ReceiveStatus::kLinkDown) << "a writer learns it too";
  EXPECT_EQ(sender.send(classic(1)), SendResult::kLinkDown);
  EXPECT_EQ(sender.send(classic(1)), SendResult::kLinkDown);
  change_links("ip link set probe0 up");
  EXPECT_TRUE(receiver.look().is_up);
  EXPECT_EQ(sender.send(classic(2)), SendResult::kSent);
  EXPECT_EQ(frames_of(receive_all(receiver)), (std::vector<Frame>{classic(2)}));
}

TEST_F(SocketProbe, OpensOnALinkThatIsDown) {
  change_links("ip link set probe0 down");
  Socket receiver = open(kBus, everything_);
  EXPECT_FALSE(receiver.look().is_up);
  EXPECT_EQ(receiver.receive().status, ReceiveStatus::kDrained) << "it did not go down since";
  change_links("ip link set probe0 up");
  Socket sender = open(kBus, {});
  EXPECT_EQ(sender.send(classic(2)), SendResult::kSent);
  EXPECT_EQ(receive_all(receiver).size(), 1U);
}

TEST_F(SocketProbe, HearsFdFramesOnALinkThatIsGivenAnFdMtuLater) {
  Socket socket = open(kClassicBus, everything_);
  for (const char* mtu : {"72", "2060"}) {
    change_links(fmt::format(
        "ip link set probe1 down && ip link set probe1 mtu {} && ip link set probe1 up", mtu));
    EXPECT_EQ(socket.receive().status, ReceiveStatus::kLinkDown);
    EXPECT_TRUE(socket.look().fd_frames) << mtu;
    Socket sender = open(kClassicBus, {});
    const Frame frame = frame_of(0x123, kFd, 32);
    EXPECT_EQ(sender.send(frame), SendResult::kSent) << mtu;
    EXPECT_EQ(frames_of(receive_all(socket)), (std::vector<Frame>{frame})) << mtu;
  }
}

TEST_F(SocketProbe, KnowsThatItsNameMeansAnotherInterface) {
  Socket socket = open(kBus, everything_);
  EXPECT_TRUE(socket.look().is_ours);
  EXPECT_EQ(socket.name_now(), kBus);
  change_links(
      "ip link set probe0 down && ip link set probe0 name probe2 && ip link set probe2 up");
  EXPECT_EQ(socket.look(), LinkState{}) << "nothing has its name";
  EXPECT_EQ(socket.name_now(), "probe2");
  change_links("ip link add probe0 mtu 72 type vcan && ip link set probe0 up");
  EXPECT_EQ(socket.look(), LinkState{}) << "another one has its name";
  change_links("ip link del probe2");
  EXPECT_EQ(socket.look(), LinkState{});
  EXPECT_EQ(socket.name_now(), "");
}

TEST_F(SocketProbe, NeedsANewSocketAfterTheDeviceWasDeleted) {
  const std::vector<Filter> filters{{0x101, 0x7FF, false}};
  Socket receiver = open(kBus, filters);
  change_links(
      "ip link del probe0 && ip link add probe0 mtu 72 type vcan && ip link set probe0 up");
  ReceiveStatus status = receiver.receive().status;
  if (status == ReceiveStatus::kLinkDown) status = receiver.receive().status;
  EXPECT_EQ(status, ReceiveStatus::kDeviceGone);
  EXPECT_EQ(receiver.receive().status, ReceiveStatus::kDrained) << "told once";
  EXPECT_EQ(receiver.send(classic(1)), SendResult::kLinkDown);

  receiver = open(kBus, filters);
  Socket sender = open(kBus, {});
  EXPECT_EQ(sender.send(classic(0x101)), SendResult::kSent);
  EXPECT_EQ(sender.send(classic(0x102)), SendResult::kSent);
  EXPECT_EQ(frames_of(receive_all(receiver)), (std::vector<Frame>{classic(0x101)}));
}

TEST_F(SocketProbe, RelaysBatchesWithoutLoss) {
  Socket source = open(kBus, {});
  Socket in = open(kBus, everything_);
  Socket out = open(kClassicBus, {});
  Socket sink = open(kClassicBus, everything_);
  constexpr std::uint32_t kFrames = 6'400;
  Duration relaying{};
  std::size_t arrived = 0;
  for (std::uint32_t i = 0; i < kFrames; i += 640) {
    for (std::uint32_t k = 0; k < 640; ++k)
      source.send(classic(k));
    wait_readable(in, kArrivalMs);
    const TimePoint begin = host_clock();
    Batch batch;
    do {
      batch = in.receive();
      for (const Received& one : batch.frames)
        out.send(one.frame);
    } while (batch.status == ReceiveStatus::kMore);
    relaying += host_clock() - begin;
    arrived += receive_now(sink).size();
  }
  for (const Received& late : receive_all(in, kSettleMs))
    out.send(late.frame);
  arrived += receive_all(sink, kSettleMs).size();
  EXPECT_EQ(arrived, kFrames);
  fmt::print("relayed {:.0f} frames/s in batches\n", kFrames / to_seconds(relaying));
}

}  // namespace
}  // namespace vgyro::can
