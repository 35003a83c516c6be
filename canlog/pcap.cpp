#include "canlog/pcap.h"

#include <array>

#include <fmt/core.h>

#include "canlog/byte_order.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::size_t kFileHeadBytes = 24;
constexpr std::size_t kPacketHeadBytes = 16;
constexpr std::size_t kLinkAt = 20;

struct Magic {
  std::uint32_t number;
  std::int64_t fraction_ns;
};
constexpr std::array kMagics{Magic{0xA1B2C3D4, 1'000}, Magic{0xA1B23C4D, 1}};

struct Form {
  std::endian order;
  std::int64_t fraction_ns;
};
std::optional<Form> form_of(std::string_view head) {
  if (head.size() < sizeof(std::uint32_t)) return std::nullopt;
  for (const Magic& magic : kMagics) {
    for (const std::endian order : {std::endian::little, std::endian::big}) {
      if (load<std::uint32_t>(head.data(), order) == magic.number) {
        return Form{order, magic.fraction_ns};
      }
    }
  }
  return std::nullopt;
}

}  // namespace

bool is_pcap(std::string_view head) {
  return form_of(head).has_value();
}

Expected<std::unique_ptr<LogReader>> PcapReader::open(std::unique_ptr<ByteSource> bytes) {
  auto window = std::make_unique<ByteWindow>(std::move(bytes));
  const std::string_view head = window->peek(kFileHeadBytes);
  const auto form = form_of(head);
  if (!form || head.size() < kFileHeadBytes) {
    return fail(window->name(), "begins like a pcap file, but its head is cut off");
  }
  // The upper bits have another meaning.
  constexpr std::uint32_t kLinkBits = 0xFFFF;
  const std::uint32_t link = load<std::uint32_t>(&head[kLinkAt], form->order) & kLinkBits;
  if (!may_hold_can(link)) {
    return fail(
        window->name(),
        fmt::format("is a capture, but its packets are not CAN frames (link type {})", link),
        "capture the CAN interface itself: `tcpdump -i can0 -w FILE`");
  }
  window->take(kFileHeadBytes);
  std::unique_ptr<PcapReader> reader(
      new PcapReader(std::move(window), form->order, form->fraction_ns));
  reader->interface_.link = link;
  return reader;
}

bool PcapReader::next(LogRecord& record) {
  while (!ended_) {
    const std::string_view head = bytes().peek(kPacketHeadBytes);
    ended_ = head.size() < kPacketHeadBytes;
    if (ended_) {
      if (!head.empty() || bytes().error()) end_inside();
      return false;
    }
    const std::int64_t second = load<std::uint32_t>(&head[0], order_);
    const std::int64_t fraction = load<std::uint32_t>(&head[4], order_);
    const std::uint32_t captured = load<std::uint32_t>(&head[8], order_);
    // Wireshark's limit is the same.
    constexpr std::uint32_t kCapturedMax = 128U << 20U;
    if (captured > kCapturedMax || fraction * fraction_ns_ >= kSecond_ns) {
      ended_ = true;
      end_damaged("no valid packet follows");
      return false;
    }
    bytes().take(kPacketHeadBytes);
    const std::size_t shown = std::min<std::size_t>(captured, kPacketBytesMax);
    const std::string_view packet = bytes().peek(shown);
    const bool whole = packet.size() == shown;
    const bool is_frame =
        whole && take_packet({interface_.link, packet, order_}, interface_, record);
    set_stamp(second * kSecond_ns + fraction * fraction_ns_, record);
    if (!whole || !bytes().pass(captured)) {
      ended_ = true;
      end_inside();
      return is_frame;
    }
    if (is_frame) return true;
  }
  return false;
}

}  // namespace vgyro::canlog
