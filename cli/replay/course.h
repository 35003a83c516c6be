#pragma once

// The course of a replay, which its pictures show: the headings of the raw gyros, their mean and
// the virtual gyro, integrated from the first valid rate on, with the virtual gyro's σ; the rates;
// each gyro's drift with its σ and the measured values; the temperatures; and the times of events
// (calibration, stops, faults, one gyro alone). Samples are collected in a bounded number of
// buckets, so a day takes as much memory as a minute. Draws nothing.

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "base/time.h"
#include "fusion/corrector.h"
#include "gateway/status.h"

namespace vgyro::cli {

class Course {
 public:
  /// Mean of the values in one stretch of time.
  struct Mean {
    double sum = 0.0;
    std::uint64_t count = 0;
    void add(double value);
    void merge(const Mean& other);
    [[nodiscard]] double value() const { return sum / static_cast<double>(count); }
  };
  /// A mean with the least and the greatest value, because a mean alone hides what a zoom should
  /// show.
  struct Envelope : Mean {
    double least = std::numeric_limits<double>::infinity();
    double greatest = -std::numeric_limits<double>::infinity();
    void add(double value);
    void merge(const Envelope& other);
  };
  struct Bucket {
    std::array<Envelope, 2> raw;
    Envelope average;
    Envelope rate;
    std::array<Mean, 2> excess;  ///< raw minus virtual rate: measures the drift
    std::array<Mean, 2> bias;
    std::array<Mean, 2> bias_sigma;
    std::array<Mean, 2> temperature;
    std::array<Mean, 4> heading;  ///< of gyro 1, gyro 2, their mean, the virtual gyro
    Mean heading_sigma;
    void merge(const Bucket& other);
  };
  using Column = const Mean& (*)(const Bucket&);

  /// Kinds of stretches of time, the least notable first: a later one is drawn over an earlier one.
  enum class Shade : std::uint8_t {
    kCalibrating,
    kStop,
    kRefused,
    kAmbiguous,
    kOneGyro,
    kFault1,
    kFault2,
    kContradicted
  };
  static constexpr std::size_t kShades = 8;
  struct Stretch {
    TimePoint from;
    TimePoint to;
  };

  /// `buckets_max`: an even number.
  explicit Course(std::size_t buckets_max) : buckets_max_(buckets_max) {}

  void add_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps);
  /// In the order of t, not before the first add_rate().
  void add_condition(TimePoint t, const fusion::Condition& condition);
  /// State, σ, drifts, faults and temperatures; in the order of t.
  void add_status(TimePoint t, const gateway::Status& status);
  /// σ of each gyro's drift; NaN if unknown.
  void add_bias_sigma(TimePoint t, const std::array<double, 2>& sigma_dps);

  /// The same course in fewer buckets.
  [[nodiscard]] Course coarser(std::size_t buckets_max) const;

  /// Whether no rate was added.
  [[nodiscard]] bool empty() const { return !rate_seen_; }
  [[nodiscard]] TimePoint begin() const { return begin_; }
  [[nodiscard]] Duration width() const { return width_; }
  [[nodiscard]] double span_s() const;
  [[nodiscard]] const std::vector<Bucket>& buckets() const { return buckets_; }
  [[nodiscard]] bool has(Column column) const;
  /// For each bucket, whether this curve is interrupted there.
  [[nodiscard]] std::vector<bool> breaks(Column column) const;
  [[nodiscard]] const std::vector<Stretch>& stretches(std::size_t shade) const {
    return stretches_[shade].all();
  }
  /// Label of a shade, for example "stop learned"; for a fault, the gyro's name and its faults.
  [[nodiscard]] std::string shade_name(std::size_t shade,
                                       const std::array<std::string, 2>& gyro_names) const;

  /// Whether a virtual rate was valid. Headings start at the first one.
  [[nodiscard]] bool is_valid_begun() const { return valid_begun_; }
  [[nodiscard]] TimePoint valid_begin() const { return valid_begin_; }
  /// Time of the last valid rate.
  [[nodiscard]] TimePoint valid_end() const { return headings_[3].last; }
  /// Heading at the end: of gyro 1, gyro 2, their mean, the virtual gyro.
  [[nodiscard]] double heading_deg(std::size_t which) const { return headings_[which].deg; }
  /// σ of the virtual gyro's heading at the end: an upper bound, see docs/man/vgyro.1.scd, --plot.
  [[nodiscard]] double heading_sigma_deg() const;
  /// Range of the drift's curve, its band and all measured points but outliers; {0, 0} if it has no
  /// height.
  [[nodiscard]] std::array<double, 2> drift_range_dps(std::size_t gyro) const;
  [[nodiscard]] double largest_bias_dps() const;

 private:
  /// Integral of a rate, which is taken to change linearly between two samples.
  struct Heading {
    double deg = 0.0;
    double last_dps = 0.0;
    TimePoint last;
    bool begun = false;
    void add(TimePoint t, double rate_dps);
  };
  /// Successive stretches of one shade; beyond kMax, the two nearest ones are joined.
  class Stretches {
   public:
    void follow(TimePoint t, bool is_so);
    [[nodiscard]] const std::vector<Stretch>& all() const { return stretches_; }

   private:
    static constexpr std::size_t kMax = 500;
    /// A longer interval without samples ends a stretch; every useful gyro sends more often.
    static constexpr Duration kHole = std::chrono::seconds(5);
    void join_nearest();
    std::vector<Stretch> stretches_;
    bool open_ = false;
  };

  Bucket& bucket_at(TimePoint t);
  void halve();
  void add_heading(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps);
  void follow(Shade shade, TimePoint t, bool is_so) {
    stretches_[static_cast<std::size_t>(shade)].follow(t, is_so);
  }

  std::size_t buckets_max_;
  bool begun_ = false;
  bool rate_seen_ = false;
  TimePoint begin_;
  Duration width_ = std::chrono::milliseconds(10);
  std::vector<Bucket> buckets_;
  std::array<Stretches, kShades> stretches_;
  std::array<std::set<gateway::Fault>, 2> faults_;  ///< of each gyro, so far

  bool valid_begun_ = false;
  TimePoint valid_begin_;
  std::array<Heading, 4> headings_;
  double sigma_dps_ = 0.0;       ///< of the newest rate; 0 if not stated
  double bias_sigma_dps_ = 0.0;  ///< of the bias subtracted from it; 0 if not stated
  bool sigma_known_ = false;
  double heading_bias_deg_ = 0.0;    ///< σ from the biases, as an upper bound: fully correlated
  double heading_white_deg2_ = 0.0;  ///< variance from the white noise
};

}  // namespace vgyro::cli
