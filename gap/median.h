#pragma once

// The middle of some values: of an even number the upper one.

#include <algorithm>
#include <cstddef>
#include <vector>

namespace vgyro::gap {

/// Changes the order of the values. Precondition: there are some.
inline double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace vgyro::gap
