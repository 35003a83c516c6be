#pragma once

// Random numbers that are the same on every machine: the standard's mt19937_64 and seed_seq, whose
// output is laid down, and a transform of our own, because std::normal_distribution's is not. Every
// purpose has a stream of its own, so that one more effect leaves the others' noise as it is.

#include <cstdint>
#include <random>

namespace vgyro::simulation {

class NoiseSource {
 public:
  /// `purpose` and `ordinal` name the stream; both are any numbers.
  NoiseSource(std::uint64_t seed, std::uint32_t gyro, std::uint32_t purpose, std::uint32_t ordinal);

  /// In [0, 1), 53 bits.
  double uniform();
  /// Mean 0, variance 1.
  double normal();

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace vgyro::simulation
