#pragma once

// FNV-1a of 32 bits: a number for a text that is the same on every machine and in every version.
// Finds no forger.

#include <cstdint>
#include <string_view>

namespace vgyro {

inline constexpr std::uint32_t kFnv1aBegin = 2166136261U;

/// Of several texts one behind the other: the first one's result is where the next one begins.
constexpr std::uint32_t fnv1a(std::string_view text, std::uint32_t begin = kFnv1aBegin) {
  constexpr std::uint32_t kPrime = 16777619U;
  std::uint32_t hash = begin;
  for (const char c : text)
    hash = (hash ^ static_cast<unsigned char>(c)) * kPrime;
  return hash;
}

}  // namespace vgyro
