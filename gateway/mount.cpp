#include "gateway/mount.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/core.h>

namespace vgyro::gateway {

namespace {

using Matrix = std::array<double, kAxes * kAxes>;

// An angle beyond a whole turn either way is a mistake.
constexpr double kAngleMost_deg = 360.0;
// A flatter matrix has no well-defined nearest rotation in the digits that people write.
constexpr double kDeterminantMin = 0.01;
// Each step of the iteration doubles the number of correct digits.
constexpr int kStepsMost = 20;

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (std::size_t i = 0; i < kAxes; ++i) {
    for (std::size_t j = 0; j < kAxes; ++j) {
      for (std::size_t k = 0; k < kAxes; ++k)
        c[kAxes * i + j] += a[kAxes * i + k] * b[kAxes * k + j];
    }
  }
  return c;
}

/// det(m) · m⁻ᵀ
Matrix cofactors(const Matrix& m) {
  Matrix c{};
  for (std::size_t i = 0; i < kAxes; ++i) {
    for (std::size_t j = 0; j < kAxes; ++j) {
      const auto at = [&](std::size_t di, std::size_t dj) {
        return m[kAxes * ((i + di) % kAxes) + (j + dj) % kAxes];
      };
      c[kAxes * i + j] = at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1);
    }
  }
  return c;
}

double determinant(const Matrix& m, const Matrix& cofactor) {
  return m[0] * cofactor[0] + m[1] * cofactor[1] + m[2] * cofactor[2];
}

double furthest(const Matrix& a, const Matrix& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

// Newton's iteration for the orthogonal factor of the polar decomposition: R ← ½(R + R⁻ᵀ).
// Precondition: the determinant is positive.
Matrix nearest_rotation(Matrix m) {
  for (int step = 0; step < kStepsMost; ++step) {
    const Matrix before = m;
    const Matrix cofactor = cofactors(m);
    const double det = determinant(m, cofactor);
    for (std::size_t i = 0; i < m.size(); ++i)
      m[i] = 0.5 * (before[i] + cofactor[i] / det);
    if (furthest(m, before) < 1e-16) break;
  }
  // Keep a permutation of axes exact: remove what rounding has left of zeros and ones.
  for (double& element : m) {
    if (std::abs(element - std::round(element)) < 1e-15) element = std::round(element) + 0.0;
  }
  return m;
}

bool add_numbers(const toml::array& list, std::vector<double>& numbers) {
  for (const toml::node& node : list) {
    if (const toml::array* row = node.as_array()) {
      if (!add_numbers(*row, numbers)) return false;
      continue;
    }
    const auto number = node.is_number() ? node.value<double>() : std::nullopt;
    if (!number || !std::isfinite(*number) || numbers.size() == kAxes * kAxes) return false;
    numbers.push_back(*number);
  }
  return true;
}

constexpr const char* kForms =
    "mount = [roll, pitch, yaw] in degrees, or the nine numbers of the matrix, row by row";

std::optional<Mount> checked_matrix(TomlReader& reader, const std::vector<double>& numbers) {
  Matrix given{};
  std::copy(numbers.begin(), numbers.end(), given.begin());
  const double det = determinant(given, cofactors(given));
  if (det < -kDeterminantMin) {
    reader.complain(reader.where("mount"),
                    fmt::format("mount mirrors: its determinant is {:.3g}", det),
                    "a rotation, whose determinant is 1: one axis has the wrong sign, or two are "
                    "exchanged");
    return std::nullopt;
  }
  Mount mount;
  const bool has_nearest = det > kDeterminantMin;
  if (has_nearest) mount.matrix = nearest_rotation(given);
  mount.corrected = furthest(given, mount.matrix);
  if (has_nearest && mount.corrected <= kMountRounding) return mount;
  reader.complain(
      reader.where("mount"),
      has_nearest
          ? fmt::format("mount is not a rotation: the nearest one differs by {:.2g} in an element",
                        mount.corrected)
          : fmt::format("mount is not a rotation: its determinant is {:.3g}", det),
      fmt::format("rows and columns of length 1 at right angles, to {:g}", kMountRounding));
  return std::nullopt;
}

}  // namespace

Mount mount_of_angles(const std::array<double, 3>& roll_pitch_yaw_deg) {
  std::array<double, 3> c{};
  std::array<double, 3> s{};
  for (std::size_t i = 0; i < 3; ++i) {
    c[i] = std::cos(roll_pitch_yaw_deg[i] * std::numbers::pi / 180.0);
    s[i] = std::sin(roll_pitch_yaw_deg[i] * std::numbers::pi / 180.0);
  }
  const Matrix roll{1, 0, 0, 0, c[0], -s[0], 0, s[0], c[0]};
  const Matrix pitch{c[1], 0, s[1], 0, 1, 0, -s[1], 0, c[1]};
  const Matrix yaw{c[2], -s[2], 0, s[2], c[2], 0, 0, 0, 1};
  return {.matrix = nearest_rotation(product(yaw, product(pitch, roll)))};
}

std::optional<Mount> read_mount(TomlReader& reader) {
  const toml::array* list = reader.array("mount", kForms);
  if (list == nullptr) return std::nullopt;
  std::vector<double> numbers;
  if (!add_numbers(*list, numbers) || (numbers.size() != 3 && numbers.size() != kAxes * kAxes)) {
    reader.complain(reader.where("mount"), "mount is neither three numbers nor nine", kForms);
    return std::nullopt;
  }
  if (numbers.size() == kAxes * kAxes) return checked_matrix(reader, numbers);
  for (const double angle_deg : numbers) {
    if (std::abs(angle_deg) <= kAngleMost_deg) continue;
    reader.complain(reader.where("mount"), fmt::format("mount has an angle of {:g} deg", angle_deg),
                    "-360 to 360");
    return std::nullopt;
  }
  return mount_of_angles({numbers[0], numbers[1], numbers[2]});
}

}  // namespace vgyro::gateway
