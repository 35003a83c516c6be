#include "canlog/packet_reader.h"

#include <algorithm>

#include <fmt/core.h>

namespace vgyro::canlog {

bool PacketReader::take_packet(const Packet& packet, Interface& interface, LogRecord& record) {
  using Kind = PacketResult::Kind;
  ++counts_.lines;
  record = {};
  const PacketResult result = read_packet(packet, record, xl_);
  if (result.kind == Kind::kOther) {
    ++counts_.other_lines;
    return false;
  }
  if (result.kind == Kind::kMalformed) {
    counts_.add_malformed(result.why);
    return false;
  }
  if (!set_interface(result, interface, record)) {
    counts_.add_malformed("more than 64 different interfaces");
    return false;
  }
  record.is_xl = result.kind == Kind::kXl;
  ++(record.is_xl ? counts_.xl_frames : counts_.frames);
  return true;
}

// A capture of all interfaces has no names, but may have the kernel's interface numbers.
bool PacketReader::set_interface(const PacketResult& result, Interface& interface,
                                 LogRecord& record) {
  if (result.interface) {
    const auto known =
        std::find(kernel_interfaces_.begin(), kernel_interfaces_.end(), *result.interface);
    const auto number = static_cast<unsigned>(known - kernel_interfaces_.begin());
    if (known == kernel_interfaces_.end()) {
      if (number == InterfaceTable::kMax) return false;
      kernel_interfaces_.push_back(*result.interface);
    }
    return set_channel(number + 1, record);
  }
  if (!interface.bus) {
    const bool done = interface.name.empty() ? set_channel(interface.number + 1, record)
                                             : set_bus(interface.name, record);
    if (!done) return false;
    interface.bus = record.bus;
  }
  record.bus = *interface.bus;
  return true;
}

void PacketReader::end_inside() {
  if (bytes_->error()) {
    error_ = bytes_->error();
  } else {
    counts_.cut_off_lines = 1;
  }
}

void PacketReader::end_damaged(const char* what) {
  error_ = Error{bytes_->name(), fmt::format("behind packet {}: {}", counts_.lines, what),
                 "the file is damaged there; everything before it was read"};
}

}  // namespace vgyro::canlog
