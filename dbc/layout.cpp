#include "dbc/layout.h"

namespace vgyro::dbc {

BitPlace bit_place(const Signal& signal) {
  const std::size_t first_byte = signal.start_bit / 8U;
  const std::size_t bit = signal.start_bit % 8U;
  if (signal.byte_order == ByteOrder::kIntel) {
    const std::size_t last_byte = (signal.start_bit + signal.length_bits - 1U) / 8U;
    return {first_byte, last_byte, static_cast<std::uint8_t>(bit)};
  }
  // Counted from the top of the first byte, a Motorola signal's bits are consecutive.
  const std::size_t end = 7 - bit + signal.length_bits - 1U;
  return {first_byte, first_byte + end / 8, static_cast<std::uint8_t>(7 - end % 8)};
}

}  // namespace vgyro::dbc
