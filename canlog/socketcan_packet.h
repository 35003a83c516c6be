#pragma once

// Extracts the CAN frame of a captured packet, from CAN interfaces and from both cooked forms of
// Linux's "any" interface. Files and stamps are not known here.

#include <bit>
#include <cstdint>
#include <optional>
#include <string_view>

#include "canlog/record.h"

namespace vgyro::canlog {

/// The link types that may hold CAN frames.
enum LinkType : std::uint32_t {
  kLinkLinuxCooked = 113,
  kLinkSocketCan = 227,
  kLinkWiresharkExport = 252,
  kLinkLinuxCooked2 = 276
};
bool may_hold_can(std::uint32_t link);

struct Packet {
  std::uint32_t link = 0;
  std::string_view bytes;  ///< the captured bytes, or as many of them as any CAN frame has
  /// Byte order of the capturing machine, from its file. Cooked packets use it for identifiers,
  /// packets of CAN interfaces do not.
  std::endian host = std::endian::little;
};
/// A packet's head, frame and payload are never longer than this.
inline constexpr std::size_t kPacketBytesMax = 256 + kXlBytesMax;

struct PacketResult {
  enum class Kind : std::uint8_t { kFrame, kXl, kOther, kMalformed };
  Kind kind = Kind::kOther;
  const char* why = "";                    ///< for a malformed packet
  std::optional<std::uint32_t> interface;  ///< the kernel's interface number, if the packet has it
};
/// Fills in `record`, except for stamp and bus; or `xl`.
PacketResult read_packet(const Packet& packet, LogRecord& record, XlFrame& xl);

}  // namespace vgyro::canlog
