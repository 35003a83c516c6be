#pragma once
#include "gap/transport.h"
namespace vgyro::gap {
std::vector<Finding> find_spikes(const Recording& recording, std::array<Transport, 2>& transports,
                                 const std::vector<model::Effect>& effects);
}
