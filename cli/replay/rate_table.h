#pragma once

// The virtual gyro as a table for other programs: a CSV line for every VG_Rate, with the biases and
// the heading, which is the integral of the rate.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "cli/output/output_file.h"
#include "gateway/pipeline.h"

namespace vgyro::cli {

class RateTable final : public gateway::OutputObserver {
 public:
  /// "-" is standard output.
  static Expected<RateTable> open(const std::string& path, const gateway::Plan& plan);

  void on_output(const gateway::RateOutput& output, const std::array<double, 2>& bias_dps) override;
  /// On a platform with several axes: the observer for the rates of axis `place`. A line holds all
  /// axes of an instant, and the heading about z.
  [[nodiscard]] gateway::OutputObserver* column(std::size_t place) {
    columns_[place].table = this;
    columns_[place].place = place;
    return &columns_[place];
  }
  /// The error names the file and the reason.
  Expected<void> close();

 private:
  struct Column final : gateway::OutputObserver {
    void on_output(const gateway::RateOutput& output,
                   const std::array<double, 2>& bias_dps) override {
      table->gather(place, output, bias_dps);
    }
    RateTable* table = nullptr;
    std::size_t place = 0;
  };
  /// One axis of a line.
  struct Entry {
    gateway::RateOutput output;
    std::array<double, 2> bias_dps{};
  };

  RateTable(OutputFile file, const gateway::Plan& plan);
  void gather(std::size_t place, const gateway::RateOutput& output,
              const std::array<double, 2>& bias_dps);
  void write_line();
  /// Adds the turn since the last valid rate. Between two instants, and across a hole, the rate is
  /// taken to change linearly.
  void turn(TimePoint instant, double rate_dps);

  OutputFile file_;
  struct Rate {
    TimePoint instant;
    double rate_dps = 0.0;
  };
  std::optional<Rate> last_;  ///< the last valid one
  double heading_deg_ = 0.0;

  std::vector<std::size_t> axes_;  ///< of the platform; empty: a single axis
  std::array<Column, gateway::kAxes> columns_;
  std::array<std::optional<Entry>, gateway::kAxes> entries_;
  bool any_ = false;
};

}  // namespace vgyro::cli
