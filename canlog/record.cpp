#include "canlog/record.h"

#include <algorithm>

namespace vgyro::canlog {

std::optional<can::BusIndex> InterfaceTable::index_of(std::string_view name) {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found != names_.end()) return static_cast<can::BusIndex>(found - names_.begin());
  if (names_.size() == kMax) return std::nullopt;
  names_.emplace_back(name);
  return static_cast<can::BusIndex>(names_.size() - 1);
}

}  // namespace vgyro::canlog
