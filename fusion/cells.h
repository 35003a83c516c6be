#pragma once

// Samples of both gyros → means over about a tenth of a second (cells) → about half a second of
// cells (block). Averaging white noise loses no information about drift, stops and scale factors,
// so the samples are not stored. O(1) a sample.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

/// The gyros whose samples a block holds.
enum class Present : std::uint8_t { kGyro1 = 0, kGyro2 = 1, kBoth = 2 };

struct Cell {
  double length_s = 0.0;
  double count = 0.0;
  std::array<double, 2> mean_dps{};
  /// Sums of squares and product of both gyros' samples about the cell's mean.
  Symmetric scatter{};
  /// Mean of RatePair::noise_gain.
  std::array<double, 2> noise_gain{};
};

struct CellBlock {
  static constexpr std::size_t kCellsMax = 12;
  Present present = Present::kBoth;
  double from_s = 0.0;
  double to_s = 0.0;
  std::size_t count = 0;
  std::array<Cell, kCellsMax> cells;
  double cross_variance = 0.0;  ///< mean of Corrector::set_cross_variance(), (deg/s)²

  [[nodiscard]] double length_s() const { return to_s - from_s; }
  [[nodiscard]] double mean_dps(std::size_t gyro) const {
    double sum = 0.0;
    double length = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      sum += cells[i].mean_dps[gyro] * cells[i].length_s;
      length += cells[i].length_s;
    }
    return sum / length;
  }
};

class CellBuilder {
 public:
  static constexpr double kCell_s = 0.1;
  static constexpr double kBlock_s = 0.5;
  static constexpr std::size_t kBlockCellsMin = 5;
  /// A silence longer than this and than four intervals ends a block.
  static constexpr double kGap_s = 0.5;

  /// The next sample. True when it began a new block: then last() is the one before, complete.
  bool add(double t_s, const std::array<double, 2>& rate_dps,
           const std::array<double, 2>& noise_gain, Present present) {
    bool closed = false;
    if (count_ > 0.0) {
      const double step = t_s - newest_s_;
      const bool gap = intervals_ > 0.0 && step > kGap_s && step > kGapIntervals * interval_s_;
      // The first intervals contained a gap.
      if (intervals_ < kGapIntervals && kGapIntervals * step < interval_s_) intervals_ = 0.0;
      if (gap || present != block_.present) {
        close_cell(newest_s_ + interval_s_);
        closed = close_block();
        begin_block(t_s, present);
      } else {
        // The first intervals count fully, later ones as a mean over some hundred.
        if (intervals_ < kIntervals) intervals_ += 1.0;
        interval_s_ += (step - interval_s_) / intervals_;
        if (t_s - cell_from_s_ >= kCell_s) {
          close_cell(t_s);
          if ((t_s - block_.from_s >= kBlock_s && block_.count >= kBlockCellsMin) ||
              block_.count == CellBlock::kCellsMax) {
            closed = close_block();
            begin_block(t_s, present);
          }
        }
      }
    } else {
      begin_block(t_s, present);
    }
    if (count_ == 0.0) origin_ = rate_dps;
    const double first = rate_dps[0] - origin_[0];
    const double second = rate_dps[1] - origin_[1];
    sum_[0] += first;
    sum_[1] += second;
    square_[0] += first * first;
    square_[1] += first * second;
    square_[2] += second * second;
    gain_[0] += noise_gain[0];
    gain_[1] += noise_gain[1];
    count_ += 1.0;
    newest_s_ = t_s;
    return closed;
  }

  /// Precondition: add() has returned true.
  [[nodiscard]] const CellBlock& last() const { return last_; }
  [[nodiscard]] double interval_s() const { return interval_s_; }
  /// Forget all samples, keep the interval.
  void clear() {
    count_ = 0.0;
    block_.count = 0;
  }

 private:
  static constexpr double kIntervals = 256.0;
  static constexpr double kGapIntervals = 4.0;

  void begin_block(double t_s, Present present) {
    block_.present = present;
    block_.from_s = t_s;
    block_.count = 0;
    begin_cell(t_s);
  }
  void begin_cell(double t_s) {
    cell_from_s_ = t_s;
    count_ = 0.0;
    sum_ = {};
    square_ = {};
    gain_ = {};
  }
  void close_cell(double to_s) {
    Cell& cell = block_.cells[block_.count++];
    cell.length_s = to_s - cell_from_s_;
    cell.count = count_;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      cell.mean_dps[gyro] = origin_[gyro] + sum_[gyro] / count_;
      cell.noise_gain[gyro] = gain_[gyro] / count_;
    }
    // Rounding may leave the sum of squares of equal values below zero.
    cell.scatter = {std::max(square_[0] - sum_[0] * sum_[0] / count_, 0.0),
                    square_[1] - sum_[0] * sum_[1] / count_,
                    std::max(square_[2] - sum_[1] * sum_[1] / count_, 0.0)};
    block_.to_s = to_s;
    begin_cell(to_s);
  }
  bool close_block() {
    if (block_.count == 0) return false;
    last_ = block_;
    return true;
  }

  CellBlock block_;
  CellBlock last_;
  double interval_s_ = 0.0;
  double intervals_ = 0.0;
  double newest_s_ = 0.0;
  double cell_from_s_ = 0.0;
  double count_ = 0.0;
  std::array<double, 2> origin_{};
  std::array<double, 2> sum_{};
  Symmetric square_{};
  std::array<double, 2> gain_{};
};

}  // namespace vgyro::fusion
