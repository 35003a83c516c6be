#include "dbc/database.h"

#include <algorithm>

namespace vgyro::dbc {

namespace {

// J1939 identifiers: 3 bits priority, EDP, DP, PF, PS, source address. Priority and source do not
// name the content; below PF 240 (PDU1) neither does PS, which is then a destination address.
constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;
constexpr std::uint32_t kStandardMask = 0x7FF;
constexpr std::uint32_t kAllButPriority = 0x03FFFFFF;
constexpr std::uint32_t kPdu2Mask = 0x03FFFF00;
constexpr std::uint32_t kPdu1Mask = 0x03FF0000;
constexpr std::uint32_t kFirstPdu2Format = 240;

template <class T>
const T* find_named(const std::vector<T>& items, std::string_view name) {
  const auto with = [&](std::string T::*which) {
    return std::find_if(items.begin(), items.end(),
                        [&](const T& item) { return item.*which == name; });
  };
  auto found = with(&T::name);
  if (found == items.end() && !name.empty()) found = with(&T::long_name);
  return found == items.end() ? nullptr : &*found;
}

template <class T>
std::vector<std::string> names_of(const std::vector<T>& items) {
  std::vector<std::string> names;
  names.reserve(items.size());
  for (const T& item : items)
    names.push_back(item.name);
  for (const T& item : items) {
    if (!item.long_name.empty()) names.push_back(item.long_name);
  }
  return names;
}

}  // namespace

const std::string* Signal::label(std::int64_t raw) const {
  const auto found = std::find_if(labels.begin(), labels.end(),
                                  [raw](const ValueLabel& label) { return label.raw == raw; });
  return found == labels.end() ? nullptr : &found->text;
}

const Signal* Message::find_signal(std::string_view signal_name) const {
  return find_named(signals, signal_name);
}

std::vector<std::string> Message::signal_names() const {
  return names_of(signals);
}

bool Message::matches(std::uint32_t frame_id, bool frame_extended) const {
  const std::uint32_t mask = id_mask();
  return frame_extended == extended && (frame_id & mask) == (id & mask);
}

std::uint32_t Message::id_mask() const {
  if (!extended) return kStandardMask;
  return is_j1939 ? pgn_mask(id) : kExtendedMask;
}

std::uint32_t pgn_mask(std::uint32_t id) {
  return ((id >> 16U) & 0xFFU) < kFirstPdu2Format ? kPdu1Mask : kPdu2Mask;
}

bool same_sender(std::uint32_t id, std::uint32_t other) {
  return ((id ^ other) & kAllButPriority) == 0;
}

const Message* Database::find_message(std::string_view message_name) const {
  return find_named(messages, message_name);
}

std::vector<std::string> Database::message_names() const {
  return names_of(messages);
}

}  // namespace vgyro::dbc
