#pragma once

// The picture of a replay. First what matters: the heading that the raw gyros, their mean and the
// virtual gyro add up to from the first valid rate on, with the virtual gyro's σ. Then how far the
// others are off, what went on when (calibration, stops, faults, one gyro alone), the rates, each
// gyro's drift with its σ over what was measured of it, and the temperature where there is one.
// Samples go into a bounded number of buckets on the way, so a day draws as fast as a minute.

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "fusion/corrector.h"
#include "gateway/status.h"

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
  /// State, σ, drifts, faults and temperatures; in the order of t.
  void add_status(TimePoint t, const gateway::Status& status);
  /// σ of each gyro's drift; NaN where it is not known.
  void add_bias_sigma(TimePoint t, const std::array<double, 2>& sigma_dps);

  /// Error when there is nothing to draw, or as run_gnuplot().
  Expected<void> draw(const std::string& path, const PlotTexts& texts) const;

 private:
  /// Mean of what fell into one stretch of time.
  struct Mean {
    double sum = 0.0;
    std::uint64_t count = 0;
    void add(double value);
    void merge(const Mean& other);
    [[nodiscard]] double value() const { return sum / static_cast<double>(count); }
    [[nodiscard]] std::string text(double scale) const;
  };
  struct Bucket {
    std::array<Mean, 2> raw;
    Mean average;
    Mean rate;
    std::array<Mean, 2> excess;  ///< raw less virtual rate: what the drift should be
    std::array<Mean, 2> bias;
    std::array<Mean, 2> bias_sigma;
    std::array<Mean, 2> temperature;
    std::array<Mean, 4> heading;  ///< of gyro 1, gyro 2, their mean, the virtual gyro
    Mean heading_sigma;
    void merge(const Bucket& other);
  };
  /// The turn that a rate adds up to; between two samples it changes evenly.
  struct Heading {
    double deg = 0.0;
    double last_dps = 0.0;
    TimePoint last;
    bool begun = false;
    void add(TimePoint t, double rate_dps);
  };
  static constexpr std::size_t kBucketsMax = 2000;

  /// What a stretch of time was, the plainest first: a later one is drawn over an earlier one.
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

  struct Unit {
    const char* name;
    double in_base;  ///< of the base unit: s, or deg/s
  };
  /// What stands beneath what, with its height and the script that draws it.
  struct Panel {
    int height_px;
    std::string caption;
    std::string script;
    bool legend = true;
  };

  Bucket& bucket_at(TimePoint t);
  void add_heading(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps);
  void follow(Shade shade, TimePoint t, bool is_so) {
    stretches_[static_cast<std::size_t>(shade)].follow(t, is_so);
  }
  /// Per bucket: is this curve interrupted there?
  [[nodiscard]] std::vector<bool> breaks(const Mean& (*column)(const Bucket&)) const;
  void write_data(std::string& to) const;
  void write_known(std::string& to) const;
  [[nodiscard]] bool has(const Mean& (*column)(const Bucket&)) const;
  [[nodiscard]] double span_s() const;
  [[nodiscard]] Unit time_unit() const;
  [[nodiscard]] Unit drift_unit() const;
  [[nodiscard]] std::string script(const std::string& path, const PlotTexts& texts) const;
  [[nodiscard]] std::vector<Panel> panels(const PlotTexts& texts) const;
  [[nodiscard]] Panel heading_panel(const PlotTexts& texts) const;
  [[nodiscard]] Panel off_panel(const PlotTexts& texts) const;
  [[nodiscard]] Panel rate_panel(const PlotTexts& texts) const;
  [[nodiscard]] Panel drift_panel(const PlotTexts& texts, std::size_t gyro) const;
  [[nodiscard]] Panel temperature_panel(const PlotTexts& texts) const;
  [[nodiscard]] std::string drift_range(std::size_t gyro) const;
  [[nodiscard]] Panel events_panel(const PlotTexts& texts) const;
  [[nodiscard]] std::string lane_name(std::size_t shade, const PlotTexts& texts) const;
  [[nodiscard]] std::array<double, 2> ends(const Stretch& stretch) const;
  [[nodiscard]] std::string shades_script() const;

  bool begun_ = false;
  TimePoint begin_;
  Duration width_ = std::chrono::milliseconds(10);
  std::vector<Bucket> buckets_;
  std::array<Stretches, kShades> stretches_;
  std::array<std::set<gateway::Fault>, 2> faults_;  ///< of each gyro, seen so far

  bool valid_begun_ = false;  ///< a virtual rate was valid: headings count from there
  std::array<Heading, 4> headings_;
  double sigma_dps_ = 0.0;       ///< of the newest rate; 0 where it is not stated
  double bias_sigma_dps_ = 0.0;  ///< of the bias taken off it; 0 where it is not stated
  bool sigma_known_ = false;
  double heading_bias_deg_ = 0.0;    ///< σ of what the drifts left, at most: as if one error
  double heading_white_deg2_ = 0.0;  ///< variance of what the noise adds up to
};

}  // namespace vgyro::cli
