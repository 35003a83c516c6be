#pragma once

// Power over frequency of what is left of observations, each sample counting by how sure it is.

#include <vector>

#include "gap/observations.h"

namespace vgyro::gap {

struct Periodogram {
  std::vector<double> power;   ///< from frequency 0, evenly
  double resolution_hz = 0.0;  ///< between them
  double weight = 0.0;         ///< sum of the samples' weights
  double frequencies = 1.0;    ///< how many of them are independent

  struct Peak {
    double frequency_hz = 0.0;
    /// |Σ w e exp|² · 2/Σw: of white noise χ² with two degrees of freedom.
    double statistic = 0.0;
  };
};

/// Of a residual at given noise; drift slower than some seconds is taken off.
Periodogram periodogram_of(const Observations& data, const Eigen::VectorXd& residual,
                           const PairNoise& noise, Part part);

/// The highest local maxima beyond what is drift, at most `most`.
std::vector<Periodogram::Peak> highest_peaks(const Periodogram& periodogram, std::size_t most);

}  // namespace vgyro::gap
