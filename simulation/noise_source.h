#pragma once

// Random numbers that are the same on every machine and in every version: the standard's mt19937_64
// and seed_seq, whose output is specified, and a transform of its own, because that of
// std::normal_distribution is not. Every purpose has a stream of its own, so that one more effect
// leaves the noise of the others unchanged; streams are identified by names, so that one more kind
// does too.

#include <array>
#include <cstdint>
#include <random>
#include <string_view>

namespace vgyro::simulation {

/// Senders in the names of streams; the gyros are numbered as in the model file.
inline constexpr std::array<std::string_view, 2> kGyroSenders{"gyro 1", "gyro 2"};

class NoiseSource {
 public:
  /// The stream is identified by `sender`, `purpose` (the kind's name in the catalogue, if it is a
  /// kind) and `ordinal`, the number of earlier streams of the same sender and purpose.
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
