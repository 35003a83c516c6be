#pragma once

// The picture of a replay: raw, mean and virtual rate, and each gyro's drift curve over what was
// measured of it; behind them, stretches that were learned from as stops, that were refused, and in
// which two readings were likely. Samples go into a bounded number of buckets on the way, so a day
// of data draws as fast as a minute.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "fusion/corrector.h"

namespace vgyro::cli {

struct PlotTexts {
  std::string title;
  std::array<std::string, 2> gyro_names;
};

class ReplayPlot {
 public:
  void add_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps);
  /// In the order of t, not before the first add_rate().
  void add_condition(TimePoint t, const fusion::Condition& condition);
  void add_bias(TimePoint t, const std::array<double, 2>& bias_dps);

  /// Error when there is nothing to draw, or as run_gnuplot().
  Expected<void> draw(const std::string& path, const PlotTexts& texts) const;

 private:
  /// Mean of what fell into one stretch of time.
  struct Mean {
    double sum = 0.0;
    std::uint64_t count = 0;
    void add(double value);
    void merge(const Mean& other);
    [[nodiscard]] std::string text(double scale) const;
  };
  struct Bucket {
    std::array<Mean, 2> raw;
    Mean average;
    Mean rate;
    std::array<Mean, 2> excess;  ///< raw less virtual rate: what the drift should be
    std::array<Mean, 2> bias;
    void merge(const Bucket& other);
  };
  static constexpr std::size_t kBucketsMax = 2000;

  /// What a stretch of time was, the plainest first: a later one is drawn over an earlier one.
  enum class Shade : std::uint8_t { kStop, kRefused, kAmbiguous };
  static constexpr std::size_t kShades = 3;
  struct Stretch {
    TimePoint from;
    TimePoint to;
  };
  /// Successive stretches of one shade; beyond the limit the two with the least between them are
  /// joined.
  class Stretches {
   public:
    void follow(TimePoint t, bool is_so);
    [[nodiscard]] const std::vector<Stretch>& all() const { return stretches_; }

   private:
    static constexpr std::size_t kMax = 500;
    /// Nobody knows what was in between: longer than the pace of any gyro worth having.
    static constexpr Duration kHole = std::chrono::seconds(5);
    void join_nearest();
    std::vector<Stretch> stretches_;
    bool open_ = false;
  };

  Bucket& bucket_at(TimePoint t);
  /// Per bucket: is this curve interrupted there?
  [[nodiscard]] std::vector<bool> breaks(const Mean& (*column)(const Bucket&)) const;
  void write_data(std::string& to) const;
  [[nodiscard]] bool has_rates() const;
  [[nodiscard]] std::string script(const std::string& path, const PlotTexts& texts) const;
  [[nodiscard]] bool has_biases() const;
  [[nodiscard]] std::string drift_script(const PlotTexts& texts) const;
  [[nodiscard]] std::string shades_script() const;
  [[nodiscard]] std::string shades_legend() const;

  bool begun_ = false;
  TimePoint begin_;
  Duration width_ = std::chrono::milliseconds(10);
  std::vector<Bucket> buckets_;
  std::array<Stretches, kShades> stretches_;
};

}  // namespace vgyro::cli
