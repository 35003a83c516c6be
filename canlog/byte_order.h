#pragma once

// Reads and writes numbers of binary forms, in either byte order.

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace vgyro::canlog {

template <std::unsigned_integral T>
T swapped(T value) {
  std::uint64_t out = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    out |= (std::uint64_t{value} >> (8 * i) & 0xFFU) << (8 * (sizeof(T) - 1 - i));
  return static_cast<T>(out);
}

/// Reads sizeof(T) bytes at `from`.
template <std::unsigned_integral T>
T load(const char* from, std::endian order) {
  T value = 0;
  std::memcpy(&value, from, sizeof(T));
  return order == std::endian::native ? value : swapped(value);
}
template <std::unsigned_integral T>
T load_little(const char* from) {
  return load<T>(from, std::endian::little);
}
template <std::unsigned_integral T>
T load_big(const char* from) {
  return load<T>(from, std::endian::big);
}
inline std::uint8_t load_byte(const char* from) {
  return static_cast<std::uint8_t>(*from);
}

template <std::unsigned_integral T>
void store_little(char* to, T value) {
  if constexpr (std::endian::native != std::endian::little) value = swapped(value);
  std::memcpy(to, &value, sizeof(T));
}

}  // namespace vgyro::canlog
