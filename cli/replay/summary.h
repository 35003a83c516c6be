#pragma once

// The summary of a replay, as JSON for programs and as a few lines for people. Nothing in it
// differs from run to run: no wall-clock time, no paths of temporary files.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "canlog/record.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::cli {

/// Counts frames by interface and identifier. Bounded: only the first kExtendedMax extended
/// identifiers are counted; the counts of the logs include all frames.
class IdCounts {
 public:
  void add(can::BusIndex bus, const can::Frame& frame) {
    if (!frame.has(can::kExtended) && !frame.has(can::kError)) {
      if (bus >= standard_.size()) standard_.resize(bus + 1U);
      ++standard_[bus][frame.id & can::kStandardIdMax];
    } else {
      add_extended(bus, frame);
    }
  }

  struct Row {
    can::BusIndex bus = 0;
    std::uint32_t id = 0;
    bool extended = false;
    std::uint64_t frames = 0;
  };
  /// Sorted by interface, then identifier.
  [[nodiscard]] std::vector<Row> rows() const;
  [[nodiscard]] std::uint64_t error_frames() const { return error_frames_; }

 private:
  static constexpr std::size_t kExtendedMax = 4096;
  /// Twice as many places as identifiers, so that probing ends after a few places.
  static constexpr std::size_t kPlaces = 2 * kExtendedMax;
  struct Place {
    std::uint64_t key = 0;     ///< interface and identifier
    std::uint64_t frames = 0;  ///< 0: free
  };
  void add_extended(can::BusIndex bus, const can::Frame& frame);
  std::vector<std::array<std::uint64_t, can::kStandardIdMax + 1>> standard_;
  std::vector<Place> extended_;  ///< kPlaces once the first such identifier came
  std::size_t extended_count_ = 0;
  std::uint64_t error_frames_ = 0;
};

struct LogSummary {
  std::string path;
  canlog::LogCounts counts;
};

struct Gap {
  double from_s = 0.0;  ///< since the first pair
  double length_s = 0.0;
};

/// One axis of a platform with several.
struct AxisSummary {
  char name = 'x';
  gateway::Status status;
  double rate_sum_dps = 0.0;  ///< over the valid virtual rates
  std::uint64_t rates = 0;
  std::array<double, 2> bias_sigma_dps{};  ///< of the biases, at the end; 0 if unknown
};

struct ReplaySummary {
  std::vector<LogSummary> logs;
  std::vector<std::string> interfaces;
  IdCounts ids;
  gateway::Status status;
  std::array<double, 2> slope_dps_s{};        ///< of the biases, at the end
  std::array<double, 2> slope_sigma_dps_s{};  ///< of these; NaN if unknown
  std::array<double, 2> bias_sigma_dps{};     ///< of the biases; NaN if unknown
  std::uint64_t frames_out = 0;
  double first_s = 0.0;  ///< stamps of the first and the last frame
  double last_s = 0.0;
  double rate_sum_dps = 0.0;  ///< over the valid virtual rates
  std::uint64_t rates = 0;
  std::array<double, 2> raw_sum_dps{};  ///< over the same instants, if the gyro took part
  std::array<std::uint64_t, 2> raws{};
  std::uint64_t gaps = 0;         ///< between successive virtual rates, longer than kGap_s
  std::vector<AxisSummary> axes;  ///< empty: two single gyros
  std::vector<Gap> longest_gaps;  ///< at most kGapsShown, longest first
  static constexpr double kGap_s = 0.5;
  static constexpr std::size_t kGapsShown = 5;

  void add_gap(const Gap& gap);
};

nlohmann::ordered_json to_json(const ReplaySummary& summary, const gateway::Plan& plan);
std::string to_text(const ReplaySummary& summary, const gateway::Plan& plan);

}  // namespace vgyro::cli
