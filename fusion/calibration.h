#pragma once

// Initial calibration: with the true rate Ω known, y_k − Ω over rest_s seconds gives each gyro's
// drift polynomial P_k⁰ by least squares. Fitted as sum and difference of the two gyros, because
// the sum shows whether the platform really stands still: second by second, a step of the common
// rate that noise cannot explain is motion, and what was gathered so far is thrown away.

#include <array>
#include <cstdint>

#include "fusion/least_squares.h"
#include "fusion/polynomial.h"

namespace vgyro::fusion {

struct Calibration {
  double end_s = 0.0;         ///< the first window starts here
  double used_until_s = 0.0;  ///< what came later was not used: motion
  Polynomial sum;             ///< P₁⁰ + P₂⁰, deg/s
  Polynomial difference;      ///< P₁⁰ − P₂⁰, deg/s
  bool in_motion = false;     ///< the platform moved, and that was accepted

  /// Motion has ended it before its time.
  [[nodiscard]] bool cut_short() const { return used_until_s < end_s; }

  [[nodiscard]] double bias_dps(std::size_t gyro, double t_s) const {
    return 0.5 * (sum.at(t_s) + (gyro == 0 ? difference.at(t_s) : -difference.at(t_s)));
  }
};

/// What to do when the platform moves while it should rest.
enum class WhenMoving : std::uint8_t {
  kWait,    ///< begin again: the calibration is the first rest_s seconds of rest
  kAccept,  ///< go on, say so in Calibration::in_motion, and learn no slope from the motion
  kKnown    ///< the true rate comes from a reference: motion does not matter
};

class Calibrator {
 public:
  /// A common rate that moves less than this from second to second never counts as motion: no
  /// vehicle turns so slowly for long, and a platform that only sways must be able to calibrate.
  static constexpr double kStill_dps = 0.05;
  /// On top, this many standard errors of a block's mean, from the noise of the difference.
  static constexpr double kNoiseFactor = 10.0;
  static constexpr double kBlock_s = 1.0;
  /// Fewer pairs are not judged; slow gyros get longer blocks.
  static constexpr std::uint64_t kBlockPairsMin = 8;
  /// Motion that begins after this share of rest_s ends the calibration instead of spoiling it.
  static constexpr double kEnoughShare = 0.9;
  /// Two sensors of one type may both be biased, but not both by so much and by the same within
  /// this share of it.
  static constexpr double kLargeBias_dps = 5.0;
  static constexpr double kSameBias = 0.1;

  /// order 0…kOrderMax, rest_s > 0.
  Calibrator(int order, double rest_s, WhenMoving when_moving = WhenMoving::kWait);

  /// The next pair and the true rate at its time; t_s grows. Returns false when the calibration is
  /// complete and this pair was not used for it: then result() is there.
  bool add(double t_s, const std::array<double, 2>& rate_dps, double true_rate_dps);

  /// Seconds gathered so far.
  [[nodiscard]] double covered_s() const { return covered_s_; }
  /// Times that motion, or holes in the stream, made it begin again.
  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }
  /// Precondition: add() has returned false.
  [[nodiscard]] const Calibration& result() const { return result_; }
  /// Precondition: add() has returned false. Can what both gyros read at rest be their biases? Not
  /// where one is larger than `max_bias_dps` says (infinite: nothing is said), nor where both are
  /// large and the same: that is a platform that turns steadily.
  [[nodiscard]] bool plausible(const std::array<double, 2>& max_bias_dps) const;
  /// The result is rejected: begin again with the next pair.
  void reject();

  /// Somebody else saw that the platform moves, and stood still until `still_until_s`, a block ago
  /// at most; asked before add() has returned false. As if these pairs had shown it: true when the
  /// calibration is complete, else it begins again, or goes on where motion is accepted or known.
  bool cut_short(double t_s, double still_until_s);
  /// Motion was accepted, here or, by note_motion(), elsewhere.
  [[nodiscard]] bool moved() const { return moved_; }
  void note_motion();

 private:
  struct Sums {
    LeastSquares sum;
    LeastSquares level;  ///< the sum as a constant
    LeastSquares difference;
  };
  /// A second of pairs, or more of slow gyros: is it as still as those before?
  struct StillnessBlock {
    double from_s = 0.0;
    std::uint64_t count = 0;
    double common = 0.0;              ///< Σ ½(y₁ + y₂) − Ω
    double difference = 0.0;          ///< Σ ½(y₁ − y₂)
    double difference_squares = 0.0;  ///< Σ of its squares
  };

  void begin(double t_s);
  [[nodiscard]] Sums empty_sums(double from_s) const;
  /// Judges the block that ends; false when it holds motion.
  bool close_block();
  bool finish(const Sums& sums, double t_s, double used_until_s);

  int order_;
  double rest_s_;
  WhenMoving when_moving_;
  bool started_ = false;
  bool moved_ = false;
  double from_s_ = 0.0;
  double covered_s_ = 0.0;
  std::uint64_t restarts_ = 0;
  Sums sums_;
  Sums calm_;  ///< up to the last block that was judged still
  double calm_until_s_ = 0.0;
  Sums calmer_;  ///< up to the one before
  double calmer_until_s_ = 0.0;
  StillnessBlock block_;
  double level_dps_ = 0.0;  ///< common rate of the last blocks, smoothed
  bool level_known_ = false;
  Calibration result_;
};

}  // namespace vgyro::fusion
