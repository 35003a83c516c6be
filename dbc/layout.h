#pragma once

// Which bytes a signal occupies. Intel signals grow from their least significant bit towards later
// bytes; Motorola signals grow from their most significant bit downwards, then on into later bytes.

#include <cstddef>
#include <cstdint>

#include "dbc/database.h"

namespace vgyro::dbc {

inline constexpr std::size_t kSignalBitsMax = 64;

struct BitPlace {
  std::size_t first_byte = 0;
  std::size_t last_byte = 0;
  std::uint8_t lowest_bit = 0;  ///< place of the least significant bit inside its byte
};

/// Precondition: length_bits > 0.
BitPlace bit_place(const Signal& signal);

}  // namespace vgyro::dbc
