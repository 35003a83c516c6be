// Captures made byte by byte, odd and damaged ones; tests/canlog/capture_oracle_test.py uses those
// of tcpdump and Wireshark, and every variant of the forms.

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "canlog/byte_order.h"
#include "canlog/stamp_order.h"
#include "tests/canlog/opened_log.h"

namespace vgyro::canlog {
namespace {

using namespace std::string_literals;
using Lines = std::vector<std::string>;

constexpr std::uint32_t kSocketCan = 227;
constexpr std::uint32_t kEthernet = 1;

template <class T>
std::string little(T value) {
  std::string bytes(sizeof(T), '\0');
  store_little(bytes.data(), value);
  return bytes;
}
std::string big32(std::uint32_t value) {
  return little(swapped(value));
}

std::string can_frame(std::uint32_t id, const std::string& data, const std::string& middle = "") {
  std::string bytes = big32(id) + std::string(1, static_cast<char>(data.size()));
  bytes += middle.empty() ? std::string(3, '\0') : middle;
  return bytes + data;
}

std::string pcap_head(std::uint32_t link, std::uint32_t magic = 0xA1B2C3D4U) {
  return little(magic) + "\2\0\4\0"s + std::string(8, '\0') + little(std::uint32_t{65535}) +
         little(link);
}
std::string pcap_packet(const std::string& bytes, std::uint32_t micros = 0) {
  const auto size = static_cast<std::uint32_t>(bytes.size());
  return little(std::uint32_t{1'700'000'000}) + little(micros) + little(size) + little(size) +
         bytes;
}

std::string block(std::uint32_t type, std::string content) {
  content.resize((content.size() + 3) / 4 * 4, '\0');
  const std::string size = little(static_cast<std::uint32_t>(content.size() + 12));
  return little(type) + size + content + size;
}
std::string section() {
  return block(0x0A0D0D0A, little(0x1A2B3C4DU) + "\1\0\0\0"s + std::string(8, '\xFF'));
}
std::string interface(std::uint16_t link, const std::string& name = "") {
  std::string content = little(link) + std::string(6, '\0');
  if (!name.empty()) {
    content += little(std::uint16_t{2}) + little(static_cast<std::uint16_t>(name.size())) + name;
    content.resize((content.size() + 3) / 4 * 4, '\0');
  }
  return block(1, content);
}
std::string packet(std::uint32_t number, const std::string& bytes, std::uint64_t micros = 0) {
  const auto size = static_cast<std::uint32_t>(bytes.size());
  return block(6, little(number) + little(static_cast<std::uint32_t>(micros >> 32U)) +
                      little(static_cast<std::uint32_t>(micros)) + little(size) + little(size) +
                      bytes);
}

ReadLog read(const std::string& bytes) {
  ReadLog whole = open_and_read(bytes);
  for (const std::size_t chunk : {1U, 7U, 100U}) {
    const ReadLog pieces = open_and_read(bytes, chunk);
    EXPECT_EQ(as_candump(whole), as_candump(pieces)) << chunk;
    EXPECT_EQ(told(whole.counts), told(pieces.counts)) << chunk;
    EXPECT_EQ(whole.error, pieces.error) << chunk;
  }
  return whole;
}

const std::string kStamp = "(1700000000.000000) ";

TEST(Pcap, FramesOfEveryKind) {
  const auto log =
      read(pcap_head(kSocketCan) + pcap_packet(can_frame(0x123, "\x11\x22")) +
           pcap_packet(can_frame(0x80000123U, "\x11\x22")) +
           pcap_packet(big32(0x40000123U) + "\5\0\0\0"s) +
           pcap_packet(can_frame(0x20000004U, "12345678")) +
           pcap_packet(can_frame(0x123, "12345678", "\0\0\x0F"s)) +
           pcap_packet(can_frame(0x123, "a", "\7\0\0"s)) + pcap_packet(can_frame(0x123, "")) +
           pcap_packet(can_frame(0x123, "0123456789ab")) +
           pcap_packet(can_frame(0x123, "") + std::string(64, 'x')));
  EXPECT_EQ(
      as_candump(log),
      (Lines{kStamp + "can0 123#1122", kStamp + "can0 00000123#1122", kStamp + "can0 123#R5",
             kStamp + "can0 20000004#3132333435363738", kStamp + "can0 123#3132333435363738_F",
             kStamp + "can0 123##361", kStamp + "can0 123#",
             kStamp + "can0 123##0303132333435363738396162", kStamp + "can0 123##0"}));
  EXPECT_EQ(log.counts.item, "packet");
}

TEST(Pcap, CanXlHasItsIdentifierAndItsLengthInDifferentOrders) {
  const std::string xl = big32(0x00450123) + "\x81\7"s + little(std::uint16_t{2}) +
                         little(std::uint32_t{0x12345678}) + "\xAA\xBB"s;
  const auto log = read(pcap_head(kSocketCan) + pcap_packet(xl));
  ASSERT_EQ(log.counts.xl_frames, 1U);
  ASSERT_EQ(log.records.at(0).xl.size(), 1U);
  const XlFrame& frame = log.records[0].xl[0];
  EXPECT_EQ(format_xl_line(time_from_ns(0), "can0", frame, 6, Direction::kUnknown),
            "(0000000000.000000) can0 45123#81:07:12345678#AABB\n");
}

TEST(Pcap, OddPacketsAreCountedAndThoseBehindThemRead) {
  const std::vector<std::string> odd{
      can_frame(0x123, "12345678").substr(0, 12),  // cut off by the capture's limit
      can_frame(0x123, "").substr(0, 7),           // less than a frame's head
      can_frame(0x800, ""),                        // wrong identifier
      big32(0x40000123U) + "\0\4\0\0"s,            // FD has no remote frames
      can_frame(0x20000001U, "123456789"),         // an error frame of nine bytes
      can_frame(0x123, std::string(65, 'x')),      // more than 64 bytes
      big32(0x123) + "\x81\0\0\0\0\0\0\0"s,        // CAN XL without bytes
      "",
  };
  for (const std::string& bytes : odd) {
    const auto log = read(pcap_head(kSocketCan) + pcap_packet(can_frame(1, "a")) +
                          pcap_packet(bytes) + pcap_packet(can_frame(2, "b")));
    EXPECT_EQ(as_candump(log), (Lines{kStamp + "can0 001#61", kStamp + "can0 002#62"}));
    ASSERT_EQ(log.counts.malformed_lines, 1U);
    EXPECT_EQ(log.counts.first_malformed[0].line, 2U);
  }
}

TEST(Pcap, PacketsOfOtherLinksAreNamed) {
  const auto log = read(pcap_head(kEthernet) + pcap_packet("anything"));
  EXPECT_NE(log.error.find("link type 1"), std::string::npos) << log.error;
  const auto cooked = read(pcap_head(113) + pcap_packet("\0\0\3\4\0\6\0\0\0\0\0\0\0\0\x08\0IP"s));
  EXPECT_EQ(cooked.counts.other_lines, 1U);
}

TEST(Pcap, ItIsReadUpToWhereItEnds) {
  const std::string whole =
      pcap_head(kSocketCan) + pcap_packet(can_frame(1, "a")) + pcap_packet(can_frame(2, "b"));
  const std::size_t each = 16 + 9;
  for (std::size_t cut = 25; cut < whole.size(); ++cut) {
    const auto log = open_and_read(whole.substr(0, cut));
    EXPECT_EQ(log.counts.frames, (cut - 24) / each) << cut;
    EXPECT_EQ(log.counts.cut_off_lines, (cut - 24) % each == 0 ? 0U : 1U) << cut;
  }
  EXPECT_NE(open_and_read(whole.substr(0, 20)).error.find("cut off"), std::string::npos);
  const auto damaged = read(whole + std::string(16, '\xFF'));
  EXPECT_EQ(damaged.counts.frames, 2U);
  EXPECT_NE(damaged.error.find("behind packet 2"), std::string::npos) << damaged.error;
}

TEST(Pcapng, InterfacesWithAndWithoutNames) {
  const auto log = read(section() + interface(kSocketCan, "body") + interface(kEthernet) +
                        interface(kSocketCan) + packet(0, can_frame(1, "a"), 1) +
                        packet(1, "Ethernet", 2) + packet(2, can_frame(2, "b"), 3) + section() +
                        interface(kSocketCan, "body") + packet(0, can_frame(3, "c"), 4));
  EXPECT_EQ(as_candump(log),
            (Lines{"(0000000000.000001) body 001#61", "(0000000000.000003) can2 002#62",
                   "(0000000000.000004) body 003#63"}));
  EXPECT_EQ(log.counts.other_lines, 1U);
}

TEST(Pcapng, BlocksOfOtherKindsArePassedOver) {
  const auto log =
      read(section() + block(4, std::string(300'000, 'x')) + interface(kSocketCan) +
           block(5, "statistics") + packet(0, can_frame(1, "a")) + block(0x0BAD, "another"));
  EXPECT_EQ(log.counts.frames, 1U);
  EXPECT_EQ(log.counts.malformed_lines + log.counts.other_lines, 0U);
}

TEST(Pcapng, OddBlocks) {
  const auto log = read(section() + packet(0, can_frame(1, "a")) + interface(kSocketCan) +
                        block(3, little(std::uint32_t{9}) + can_frame(1, "a")) + block(6, "short") +
                        packet(0, can_frame(2, "b"), UINT64_MAX) + packet(0, can_frame(3, "c")));
  EXPECT_EQ(as_candump(log), (Lines{"(0000000000.000000) can0 003#63"}));
  EXPECT_EQ(log.counts.malformed_lines, 4U);
  EXPECT_EQ(log.counts.frames, 1U);
}

TEST(Pcapng, DamageIsSaidWithItsPlace) {
  const std::string begun = section() + interface(kSocketCan) + packet(0, can_frame(1, "a"));
  for (const std::string& rest : {little(6U) + little(7U) + std::string(12, '\0'),
                                  little(0x0A0D0D0AU) + little(28U) + std::string(20, '\0')}) {
    const auto log = read(begun + rest);
    EXPECT_EQ(log.counts.frames, 1U);
    EXPECT_NE(log.error.find("behind packet 1"), std::string::npos) << log.error;
  }
  for (std::size_t cut = 1; cut < 20; ++cut)
    EXPECT_EQ(read(begun + packet(0, can_frame(1, "a")).substr(0, cut)).counts.cut_off_lines, 1U);
  std::string many = section();
  for (int i = 0; i < 2'000; ++i)
    many += interface(kSocketCan);
  EXPECT_NE(open_and_read(many).error, "");
}

TEST(StampOrder, EachBusKeepsItsOwnOrderThoughItsClockIsSetBack) {
  StampOrder order(1'000'000'000);
  LogRecord record;
  const auto push = [&](can::BusIndex bus, std::int64_t ms) {
    record.bus = bus;
    record.stamp = time_from_ns(ms * 1'000'000);
    record.frame.id = static_cast<std::uint32_t>(ms);
    order.push(record, nullptr, bus);
  };
  push(0, 10'000);
  EXPECT_FALSE(order.is_ready());
  push(0, 10'100);
  push(1, 10'050);
  EXPECT_FALSE(order.is_ready()) << "more of a bus may come late";
  push(0, 5'000);  // the clock was set back
  std::vector<std::uint32_t> out;
  while (order.is_ready())
    out.push_back(order.pop().record.frame.id);
  EXPECT_EQ(out, (std::vector<std::uint32_t>{10'000, 10'050, 10'100}));
  order.close();
  EXPECT_EQ(order.pop().record.frame.id, 5'000U);
  EXPECT_TRUE(order.is_empty());
}

TEST(StampOrder, HoldsNoMoreThanItSays) {
  StampOrder order(1'000'000'000);
  LogRecord record;
  std::size_t pushed = 0;
  while (!order.is_ready()) {
    order.push(record, nullptr, 0);
    ++pushed;
  }
  EXPECT_EQ(pushed, StampOrder::kHeldMax);
}

}  // namespace
}  // namespace vgyro::canlog
