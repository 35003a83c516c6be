#pragma once

// The small rotation θ between two whole units: unit 2 reads Ω + Ω × θ. Learned from the difference
// of the units while they turn, together with the other effects of turning: a scale factor
// difference of each axis and a time skew. Cells of a tenth of a second make segments of some
// seconds; within a segment biases are constant and cancel. Each segment estimates its own noise.
// docs/optimal.md derives it. Rates in deg/s, θ in rad. Nothing is allocated; a platform of two
// axes has a third one that does not turn.

#include <array>
#include <cstddef>

#include <Eigen/Core>

namespace vgyro::fusion {

inline constexpr std::size_t kPlatformAxes = 3;

/// About x, y, z.
using AxisRates = std::array<double, kPlatformAxes>;

struct MisalignmentMemory {
  std::array<double, 3> angle_rad{};
  std::array<double, 6> covariance{};  ///< xx, xy, xz, yy, yz, zz, rad²
};

class Misalignment {
 public:
  /// Prior σ of θ between two units whose mounts are given.
  static constexpr double kPrior_deg = 1.0;
  static constexpr double kCell_s = 0.1;
  static constexpr std::size_t kSegmentCells = 50;

  Misalignment();

  /// The axes about which both units measure the rate.
  using Both = std::array<bool, kPlatformAxes>;

  /// The readings of both units at one instant, biases included; t_s grows. About an axis that only
  /// one unit measures, both rates are the best known one, or 0.
  void add(double t_s, const AxisRates& first_dps, const AxisRates& second_dps,
           const Both& both = {true, true, true});
  /// The next sample does not continue the present segment.
  void break_off();

  /// Excess of unit 2 about `axis` while the platform turns at `rate_dps`.
  [[nodiscard]] double cross_dps(std::size_t axis, const AxisRates& rate_dps) const;
  /// Variance of cross_dps(), (deg/s)².
  [[nodiscard]] double cross_variance(std::size_t axis, const AxisRates& rate_dps) const;

  [[nodiscard]] std::array<double, 3> angle_rad() const;
  [[nodiscard]] std::array<double, 3> sigma_rad() const;
  /// Number of segments that were used.
  [[nodiscard]] std::size_t segments() const { return segments_used_; }

  [[nodiscard]] MisalignmentMemory memory() const;
  /// False if the memory cannot be right; then nothing has changed.
  bool resume(const MisalignmentMemory& memory, double age_s);

 private:
  /// θx, θy, θz; scale factor differences of x, y, z; skew in seconds.
  static constexpr int kStates = 7;
  using State = Eigen::Matrix<double, kStates, 1>;
  using Square = Eigen::Matrix<double, kStates, kStates>;

  struct Cell {
    AxisRates rate_dps{};        ///< mean of both units
    AxisRates difference_dps{};  ///< unit 2 less unit 1
  };

  void close_cell();
  void close_segment();
  void grow(double length_s);
  /// Row of `axis` in a cell.
  [[nodiscard]] State regressor(std::size_t axis, std::size_t cell) const;
  /// False if the axis has no information.
  bool add_axis(std::size_t axis, Square& information, State& right) const;
  [[nodiscard]] double noise_variance(std::size_t axis) const;
  void learn(Square information, State right);

  Both both_{true, true, true};  ///< in the present segment
  State mean_ = State::Zero();
  Square covariance_ = Square::Zero();
  std::size_t segments_used_ = 0;
  int unlikely_ = 0;  ///< segments in a row that contradict all that is known

  double cell_from_s_ = 0.0;
  double newest_s_ = 0.0;
  double learned_until_s_ = 0.0;
  double count_ = 0.0;
  AxisRates first_sum_{};
  AxisRates second_sum_{};
  std::array<Cell, kSegmentCells> cells_;
  std::size_t cells_count_ = 0;
  bool begun_ = false;
};

}  // namespace vgyro::fusion
