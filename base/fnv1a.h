#pragma once

// FNV-1a of 32 bits: hashes a text to the same number on every machine and in every version. No
// protection against forgery.

#include <cstdint>
#include <string_view>

namespace vgyro {

inline constexpr std::uint32_t kFnv1aBegin = 2166136261U;

/// To hash several texts as one, pass the result of each as `begin` of the next.
constexpr std::uint32_t fnv1a(std::string_view text, std::uint32_t begin = kFnv1aBegin) {
  constexpr std::uint32_t kPrime = 16777619U;
  std::uint32_t hash = begin;
  for (const char c : text)
    hash = (hash ^ static_cast<unsigned char>(c)) * kPrime;
  return hash;
}

}  // namespace vgyro
