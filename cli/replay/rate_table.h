#pragma once

// The virtual gyro as a table for other programs: a CSV line for every VG_Rate, with the biases and
// the heading that it adds up to.

#include <array>
#include <optional>
#include <string>

#include "base/error.h"
#include "base/time.h"
#include "cli/output/output_file.h"
#include "gateway/pipeline.h"

namespace vgyro::cli {

class RateTable final : public gateway::OutputObserver {
 public:
  /// "-" is standard output.
  static Expected<RateTable> open(const std::string& path);

  void on_output(const gateway::RateOutput& output, const std::array<double, 2>& bias_dps) override;
  /// The error names the file and the reason.
  Expected<void> close() { return file_.close(); }

 private:
  explicit RateTable(OutputFile file);
  /// Adds the turn since the last valid rate. Between two instants, and across a hole, the rate is
  /// taken to change evenly.
  void turn(TimePoint instant, double rate_dps);

  OutputFile file_;
  struct Rate {
    TimePoint instant;
    double rate_dps = 0.0;
  };
  std::optional<Rate> last_;  ///< the last valid one
  double heading_deg_ = 0.0;
};

}  // namespace vgyro::cli
