#include "canlog/binary_reader.h"

#include "canlog/writer.h"

namespace vgyro::canlog {

bool BinaryReader::set_bus(std::string_view name, LogRecord& record) {
  const auto bus = interfaces_.index_of(name);
  if (bus) record.bus = *bus;
  return bus.has_value();
}

bool BinaryReader::set_new_channel(unsigned channel, LogRecord& record) {
  if (!set_bus(channel == 0 ? "can" : channel_name(channel), record)) return false;
  if (channel < known_.size()) known_[channel] = record.bus;
  return true;
}

}  // namespace vgyro::canlog
