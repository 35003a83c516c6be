#pragma once

// The picture of a replay. First the headings of the raw gyros, their mean and the virtual gyro,
// with the virtual gyro's σ. Then how far the others are off, the times of events (calibration,
// stops, faults, one gyro alone), the rates, each gyro's drift with its σ over the measured values,
// and the temperature if there is one.

#include <array>
#include <string>

#include "base/error.h"
#include "cli/replay/course.h"

namespace vgyro::cli {

/// Most points that a picture shows.
constexpr std::size_t kPlotBuckets = 2000;

struct PlotTexts {
  std::string title;
  std::array<std::string, 2> gyro_names;
};

/// Draws the course with its own number of buckets. Error if there is nothing to draw, or as of
/// run_gnuplot().
Expected<void> draw_plot(const Course& course, const std::string& path, const PlotTexts& texts);

}  // namespace vgyro::cli
