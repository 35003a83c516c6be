#pragma once

// The picture of a replay. First what matters: the heading that the raw gyros, their mean and the
// virtual gyro add up to, with the virtual gyro's σ. Then how far the others are off, what went on
// when (calibration, stops, faults, one gyro alone), the rates, each gyro's drift with its σ over
// what was measured of it, and the temperature where there is one.

#include <array>
#include <string>

#include "base/error.h"
#include "cli/replay/course.h"

namespace vgyro::cli {

/// As many points as a picture shows.
constexpr std::size_t kPlotBuckets = 2000;

struct PlotTexts {
  std::string title;
  std::array<std::string, 2> gyro_names;
};

/// Error when there is nothing to draw, or as run_gnuplot(). The course is drawn as it is, in its
/// own number of buckets.
Expected<void> draw_plot(const Course& course, const std::string& path, const PlotTexts& texts);

}  // namespace vgyro::cli
