#include "simulation/noise_source.h"

#include <cmath>

#include "base/fnv1a.h"

namespace vgyro::simulation {

namespace {

std::mt19937_64 engine_for(std::uint64_t seed, std::string_view sender, std::string_view purpose,
                           std::uint32_t ordinal) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U),
                         fnv1a(sender), fnv1a(purpose), ordinal};
  return std::mt19937_64(sequence);
}

}  // namespace

NoiseSource::NoiseSource(std::uint64_t seed, std::string_view sender, std::string_view purpose,
                         std::uint32_t ordinal)
    : engine_(engine_for(seed, sender, purpose, ordinal)) {}

double NoiseSource::uniform() {
  return static_cast<double>(engine_() >> 11U) * 0x1p-53;
}

// Marsaglia's polar method.
double NoiseSource::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double x = 0.0;
  double y = 0.0;
  double square = 0.0;
  do {
    x = 2.0 * uniform() - 1.0;
    y = 2.0 * uniform() - 1.0;
    square = x * x + y * y;
  } while (square >= 1.0 || square == 0.0);
  const double stretch = std::sqrt(-2.0 * std::log(square) / square);
  spare_ = y * stretch;
  has_spare_ = true;
  return x * stretch;
}

}  // namespace vgyro::simulation
