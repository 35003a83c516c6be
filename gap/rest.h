#pragma once
#include "gap/transport.h"
namespace vgyro::gap {
struct Rest {
  std::vector<std::uint8_t> by_second;
  double seconds = 0.0;
  bool at(double t_s) const {
    const auto cell = static_cast<std::size_t>(t_s > 0.0 ? t_s : 0.0);
    return cell < by_second.size() && by_second[cell] != 0;
  }
};
Rest find_rest(const Recording& recording, const std::array<Transport, 2>& transports);
}  // namespace vgyro::gap
