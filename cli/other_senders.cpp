#include "cli/other_senders.h"

#include <fmt/core.h>

#include "dbc/database.h"

namespace vgyro::cli {

namespace {
constexpr std::uint32_t kSourceMask = 0xFF;
constexpr std::uint32_t kPriorityMask = 0x1C000000;
constexpr std::size_t kShownMost = 8;
}  // namespace

void OtherSenders::add(std::uint32_t message_id, std::uint32_t frame_id) {
  const std::uint32_t mask = dbc::pgn_mask(message_id);
  if (((message_id ^ frame_id) & mask) == 0) addresses_.insert(frame_id & kSourceMask);
}

std::string OtherSenders::text(const std::string& message, std::uint32_t message_id) const {
  std::string senders;
  std::size_t shown = 0;
  for (const std::uint32_t address : addresses_) {
    if (shown++ == kShownMost) {
      senders += ", …";
      break;
    }
    senders += fmt::format("{}0x{:02X}", senders.empty() ? "" : ", ", address);
  }
  return fmt::format("no frame {:08X} came ({}), but the same PGN came from {}", message_id,
                     message, senders);
}

std::string OtherSenders::remedy(std::uint32_t mask) const {
  const bool exact = (mask & kPriorityMask) != 0;
  return exact ? "if it is a J1939 message, mark it so in the DBC file: VFrameFormat = J1939PG"
               : "another source_address";
}

}  // namespace vgyro::cli
