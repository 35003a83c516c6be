#include "canlog/socketcan_packet.h"

#include <cstring>

#include "canlog/byte_order.h"
#include "canlog/frame_fields.h"

namespace vgyro::canlog {

namespace {

using Kind = PacketResult::Kind;

// linux/if_ether.h, linux/if_packet.h, linux/can.h
constexpr std::uint16_t kProtocolCan = 0x0C;
constexpr std::uint16_t kProtocolCanFd = 0x0D;
constexpr std::uint16_t kProtocolCanXl = 0x0E;
constexpr unsigned kOutgoing = 4;
constexpr std::uint32_t kExtendedFlag = 1U << 31U;
constexpr std::uint32_t kRemoteFlag = 1U << 30U;
constexpr std::uint32_t kErrorFlag = 1U << 29U;
constexpr unsigned kFdRateSwitch = 1;
constexpr unsigned kFdErrorState = 2;
constexpr unsigned kFdFormat = 4;
constexpr unsigned kXlFormat = 0x80;

// struct can_frame and canfd_frame
constexpr std::size_t kLengthAt = 4;
constexpr std::size_t kFdFlagsAt = 5;
constexpr std::size_t kRawDlcAt = 7;
constexpr std::size_t kDataAt = 8;
constexpr std::size_t kFdFrameBytes = 72;

constexpr const char* kCutOff = "the packet is cut off: it was captured with too small a limit";

/// A packet without the head of its link.
struct Content {
  std::string_view bytes;
  std::uint16_t protocol = kProtocolCan;
  std::endian id_order = std::endian::big;
  std::endian xl_order = std::endian::little;  ///< of length and acceptance field
};

PacketResult malformed(const char* why) {
  return {Kind::kMalformed, why, {}};
}

void read_xl(const Content& content, XlFrame& xl, PacketResult& result) {
  constexpr std::size_t kHeadBytes = 12;
  if (content.bytes.size() < kHeadBytes) {
    result = malformed(kCutOff);
    return;
  }
  const char* from = content.bytes.data();
  const auto priority = load<std::uint32_t>(from, content.id_order);
  constexpr unsigned kVcidShift = 16;
  xl = {};
  xl.priority = static_cast<std::uint16_t>(priority & can::kStandardIdMax);
  xl.vcid = static_cast<std::uint8_t>(priority >> kVcidShift);
  xl.flags = load_byte(from + 4);
  xl.sdt = load_byte(from + 5);
  xl.length = load<std::uint16_t>(from + 6, content.xl_order);
  xl.acceptance = load<std::uint32_t>(from + 8, content.xl_order);
  if (xl.length < 1 || xl.length > kXlBytesMax) {
    result = malformed("length: no CAN XL frame has it");
  } else if (content.bytes.size() < kHeadBytes + xl.length) {
    result = malformed(kCutOff);
  } else {
    std::memcpy(xl.data.data(), from + kHeadBytes, xl.length);
    result.kind = Kind::kXl;
  }
}

// Captures of a CAN interface by libpcap 1.10 lack the FD flags, but have the size.
bool is_fd(const Content& content, unsigned length, unsigned flags) {
  return content.protocol == kProtocolCanFd || (flags & kFdFormat) != 0 ||
         length > can::kClassicBytesMax || content.bytes.size() >= kFdFrameBytes;
}

// Returns null, or why it is no frame.
const char* read_frame(const Content& content, can::Frame& frame) {
  if (content.bytes.size() < kDataAt) return kCutOff;
  const char* from = content.bytes.data();
  const auto id = load<std::uint32_t>(from, content.id_order);
  const unsigned length = load_byte(from + kLengthAt);
  const unsigned fd_flags = load_byte(from + kFdFlagsAt);
  if ((id & kErrorFlag) != 0) {
    frame.flags = can::kError;
    frame.id = id & can::kExtendedIdMax;
  } else {
    if (is_fd(content, length, fd_flags)) {
      frame.flags |= can::kFd;
      if ((fd_flags & kFdRateSwitch) != 0) frame.flags |= can::kBitRateSwitch;
      if ((fd_flags & kFdErrorState) != 0) frame.flags |= can::kErrorStateIndicator;
    }
    const std::uint32_t bare = id & ~(kExtendedFlag | kRemoteFlag);
    if (const char* why = set_id(bare, (id & kExtendedFlag) != 0, frame)) return why;
    if ((id & kRemoteFlag) != 0) frame.flags |= can::kRemote;
    if (frame.has(can::kFd) && frame.has(can::kRemote)) {
      return "a remote frame of CAN FD, which does not exist";
    }
  }
  if (const char* why = set_length(length, frame)) return why;
  const unsigned raw_dlc = load_byte(from + kRawDlcAt);
  constexpr unsigned kRawDlcMax = 15;
  if (!frame.has(can::kFd) && length == can::kClassicBytesMax && raw_dlc > length &&
      raw_dlc <= kRawDlcMax) {
    frame.raw_dlc = static_cast<std::uint8_t>(raw_dlc);
  }
  if (frame.has(can::kRemote)) return nullptr;
  if (content.bytes.size() < kDataAt + length) return kCutOff;
  std::memcpy(frame.data.data(), from + kDataAt, length);
  return nullptr;
}

// Linux's "any" interface, in the first and second form; false if the packet is cut off.
bool read_cooked(const Packet& packet, Content& content, LogRecord& record, PacketResult& result) {
  const bool is_second = packet.link == kLinkLinuxCooked2;
  const std::size_t head_bytes = is_second ? 20 : 16;
  if (packet.bytes.size() < head_bytes) return false;
  const char* head = packet.bytes.data();
  content.bytes.remove_prefix(head_bytes);
  content.protocol = load_big<std::uint16_t>(head + (is_second ? 0 : 14));
  content.id_order = content.xl_order = packet.host;
  const unsigned kind = is_second ? load_byte(head + 10) : load_big<std::uint16_t>(head);
  if (kind == kOutgoing) record.direction = Direction::kTransmitted;
  if (is_second) result.interface = load_big<std::uint32_t>(head + 4);
  return true;
}

// Skips the tags before the frame, one of which names its dissector; false if they are cut off.
bool read_export(const Packet& packet, Content& content) {
  constexpr std::size_t kTagBytes = 4;
  constexpr unsigned kReaderTag = 12;
  content.protocol = 0;
  content.id_order = content.xl_order = packet.host;
  while (content.bytes.size() >= kTagBytes) {
    const unsigned tag = load_big<std::uint16_t>(content.bytes.data());
    const std::size_t size = load_big<std::uint16_t>(&content.bytes[2]);
    content.bytes.remove_prefix(kTagBytes);
    if (tag == 0) return true;
    if (content.bytes.size() < size) return false;
    if (tag == kReaderTag) {
      const std::string_view padded = content.bytes.substr(0, size);
      const std::string_view reader = padded.substr(0, padded.find('\0'));
      if (reader == "can-bigendian") content.id_order = std::endian::big;
      if (reader == "can-hostendian" || reader == "can-bigendian") content.protocol = kProtocolCan;
      if (reader == "canfd") content.protocol = kProtocolCanFd;
    }
    content.bytes.remove_prefix(size);
  }
  return false;
}

// Skips what the packet's link type puts before the frame; false if it is cut off.
bool read_link(const Packet& packet, Content& content, LogRecord& record, PacketResult& result) {
  content.bytes = packet.bytes;
  if (packet.link == kLinkWiresharkExport) return read_export(packet, content);
  if (packet.link != kLinkSocketCan) return read_cooked(packet, content, record, result);
  const bool is_xl =
      packet.bytes.size() > kLengthAt && (load_byte(&packet.bytes[kLengthAt]) & kXlFormat) != 0;
  if (is_xl) content.protocol = kProtocolCanXl;
  return true;
}

}  // namespace

bool may_hold_can(std::uint32_t link) {
  return link == kLinkSocketCan || link == kLinkLinuxCooked || link == kLinkLinuxCooked2 ||
         link == kLinkWiresharkExport;
}

PacketResult read_packet(const Packet& packet, LogRecord& record, XlFrame& xl) {
  PacketResult result;
  if (!may_hold_can(packet.link)) return result;
  Content content;
  if (!read_link(packet, content, record, result)) return malformed(kCutOff);
  switch (content.protocol) {
    case kProtocolCan:
    case kProtocolCanFd:
      result.kind = Kind::kFrame;
      if (const char* why = read_frame(content, record.frame)) return malformed(why);
      return result;
    case kProtocolCanXl:
      read_xl(content, xl, result);
      return result;
    default:
      return result;
  }
}

}  // namespace vgyro::canlog
