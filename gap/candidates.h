#pragma once

// What the search tries: every deterministic kind of the catalogue that a recording could show, and
// what it must bring to be believed.

#include <cstddef>
#include <string>
#include <vector>

#include "gap/result.h"
#include "gap/study.h"
#include "model/effect.h"

namespace vgyro::gap {

/// An effect with parameters to be estimated.
struct Term {
  model::Effect effect;
  std::vector<std::size_t> free;  ///< indices of parameters
};

struct Candidate {
  Term term;
  double penalty = 0.0;  ///< of its statistic: places that were tried for it
};

/// The parameters of a kind that the data estimate by least squares.
std::vector<std::size_t> free_parameters(model::Kind kind);
/// Those in which the reading is linear.
bool is_linear(model::Kind kind, std::size_t parameter);

/// d contribution / d parameter, of every sample of the problem.
Eigen::VectorXd derivative(const Study& study, const Problem& problem, const model::Effect& effect,
                           std::size_t parameter);

/// Candidates whose shape is known but for their size; lines and steps are searched for elsewhere.
/// Their effects have unit size.
std::vector<Candidate> shaped_candidates(const Study& study, std::size_t gyro);

/// Kinds that this recording cannot show, with the reason.
std::vector<NotIdentifiable> not_identifiable(const Study& study);

/// What would tell two readings apart.
std::string experiment_for(const Reading& first, const Reading& second, bool with_reference);

}  // namespace vgyro::gap
