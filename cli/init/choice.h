#pragma once

// Chooses the two gyros among the signals that could be rates: different sensors of one rotation.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cli/init/candidates.h"

namespace vgyro::cli {

struct PairFigures {
  std::size_t first = 0;  ///< index in the candidates
  std::size_t second = 0;
  analysis::Likeness likeness;
  [[nodiscard]] bool alike() const;
};

struct Choice {
  std::vector<PairFigures> pairs;  ///< all that could be judged
  std::optional<PairFigures> pair;
  std::optional<std::size_t> alone;    ///< if there is no pair: the only gyro
  std::vector<PairFigures> others;     ///< other pairs that move alike, likelier ones first
  std::vector<std::size_t> followers;  ///< neither chosen nor copies, but they follow the same
                                       ///< rotation
};

/// Marks copies in `why_not` of the candidates.
Choice choose(std::vector<Candidate>& candidates);

}  // namespace vgyro::cli
