#pragma once

// Replaces the test program's operator new by one that counts allocations, each thread for itself.

#include <cstddef>

namespace vgyro {

std::size_t allocations_so_far();

}  // namespace vgyro
