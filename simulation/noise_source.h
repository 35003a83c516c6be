#pragma once

// Random numbers that are the same on every machine and in every version: the standard's mt19937_64
// and seed_seq, whose output is laid down, and a transform of our own, because
// std::normal_distribution's is not. Every purpose has a stream of its own, so that one more effect
// leaves the others' noise as it is; and a stream is known by names, so that one more kind of
// effect does.

#include <array>
#include <cstdint>
#include <random>
#include <string_view>

namespace vgyro::simulation {

/// Whose streams they are, in their names: as the model file counts the gyros.
inline constexpr std::array<std::string_view, 2> kGyroSenders{"gyro 1", "gyro 2"};

class NoiseSource {
 public:
  /// `sender`, `purpose` (a kind's name in the catalogue, where it is one) and `ordinal`, how many
  /// the sender has before it for the same purpose, name the stream.
  NoiseSource(std::uint64_t seed, std::string_view sender, std::string_view purpose,
              std::uint32_t ordinal);

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
