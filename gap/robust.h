#pragma once

// How sure a fitted size is by what the residual does, instead of by what the noise model says of
// it. Where the noise is another one than the model's, in places or in colour, the two differ.

#include "gap/regression.h"

namespace vgyro::gap {

/// Variance of the size of term `index` over what the model's noise gives it, by sums over
/// stretches of time; 1 at the least. `fit` holds all terms, fitted.
double inflation(const Regression& regression, const Fit& fit, std::size_t index);

}  // namespace vgyro::gap
