#pragma once

// What the two gyros' variances are kept in, and the few forms that are made of them.

#include <array>

namespace vgyro::fusion {

/// Symmetric 2×2: of gyro 1, of both, of gyro 2.
using Symmetric = std::array<double, 3>;

constexpr double squared(double value) {
  return value * value;
}

/// Of weight₁·y₁ + weight₂·y₂.
constexpr double weighted(const std::array<double, 2>& weight, const Symmetric& matrix) {
  return weight[0] * weight[0] * matrix[0] + 2.0 * weight[0] * weight[1] * matrix[1] +
         weight[1] * weight[1] * matrix[2];
}

/// Of y₁ − y₂.
constexpr double of_difference(const Symmetric& matrix) {
  return matrix[0] - 2.0 * matrix[1] + matrix[2];
}

}  // namespace vgyro::fusion
