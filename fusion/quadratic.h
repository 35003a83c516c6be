#pragma once

// The form in which variances of two gyros are kept, and the quadratic forms computed from it.

#include <array>

namespace vgyro::fusion {

/// Symmetric 2×2: gyro 1, covariance, gyro 2.
using Symmetric = std::array<double, 3>;

constexpr double squared(double value) {
  return value * value;
}

/// Variance of weight₁·y₁ + weight₂·y₂.
constexpr double weighted(const std::array<double, 2>& weight, const Symmetric& matrix) {
  return weight[0] * weight[0] * matrix[0] + 2.0 * weight[0] * weight[1] * matrix[1] +
         weight[1] * weight[1] * matrix[2];
}

/// Variance of y₁ − y₂.
constexpr double of_difference(const Symmetric& matrix) {
  return matrix[0] - 2.0 * matrix[1] + matrix[2];
}

}  // namespace vgyro::fusion
