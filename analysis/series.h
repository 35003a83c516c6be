#pragma once

// A gyro's samples on an even grid, as Allan deviation and spectrum need them. A sample's stamp
// selects its grid place, so jitter below half an interval changes nothing. Short holes are filled
// with the mean of their neighbours; a longer gap ends one part and begins the next. Nothing is
// interpolated across a gap.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vgyro::analysis {

struct Part {
  double begin_s = 0.0;
  std::vector<double> rate_dps;
};

struct Series {
  double interval_s = 0.0;
  std::vector<Part> parts;
  double filled_share = 0.0;  ///< share of the samples that were filled in, not measured

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] double seconds() const { return static_cast<double>(size()) * interval_s; }
};

/// The samples in [from_s, to_s).
Series slice(const Series& series, double from_s, double to_s);

/// Builds the series of up to two quantities that were sampled together.
class SeriesBuilder {
 public:
  /// Missing samples in a row that are filled in.
  static constexpr std::size_t kBridgedMax = 4;

  /// t_s in the order of time; an older sample is dropped.
  void add(double t_s, const std::array<double, 2>& values);

  /// Both quantities on one grid. Empty when fewer than three samples came.
  std::array<Series, 2> finish();

 private:
  struct StampedValues {
    double t_s;
    std::array<double, 2> values;
  };
  static constexpr std::size_t kSamplesToJudge = 512;

  void find_interval();
  void place(const StampedValues& sample);
  void begin_part(const StampedValues& sample);
  void append(const std::array<double, 2>& values);
  void close_part();
  void bridge();

  std::vector<StampedValues> first_;  ///< until the interval is known
  double interval_s_ = 0.0;
  double newest_s_ = 0.0;  ///< time of the grid's newest place, jitter averaged
  int merged_ = 1;         ///< number of samples in the newest place
  std::size_t holes_ = 0;  ///< places before the newest one that no sample took
  std::size_t hole_at_ = 0;
  std::uint64_t filled_ = 0;
  /// For the mean interval: total time of the parts, and their number of places.
  double grid_s_ = 0.0;
  double grid_places_ = 0.0;
  double part_begin_s_ = 0.0;
  std::array<Series, 2> series_;
};

}  // namespace vgyro::analysis
