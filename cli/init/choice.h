#pragma once

// Of the signals that could be rates, the two gyros: different sensors that feel one rotation.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cli/init/candidates.h"

namespace vgyro::cli {

struct PairFigures {
  std::size_t first = 0;  ///< into the candidates
  std::size_t second = 0;
  analysis::Likeness likeness;
  [[nodiscard]] bool alike() const;
};

struct Choice {
  std::vector<PairFigures> pairs;  ///< of all that could be judged
  std::optional<PairFigures> pair;
  std::optional<std::size_t> alone;    ///< where there is no pair: the one gyro that is there
  std::vector<PairFigures> others;     ///< that move alike too, likelier ones first
  std::vector<std::size_t> followers;  ///< neither chosen nor copies, but of the same rotation
};

/// Marks copies in `why_not` of the candidates.
Choice choose(std::vector<Candidate>& candidates);

}  // namespace vgyro::cli
