#pragma once

// The axes of two whole units side by side: what was found about each, and about all. A gap of all
// axes is that of all their held-out samples together; its band is that of independent axes.

#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cli/gap/report.h"
#include "gap/result.h"

namespace vgyro::cli {

template <class Judged>
struct OfAxis {
  GapSubject subject;
  Judged judged;
};
using AxisResult = OfAxis<gap::Result>;
using AxisComparison = OfAxis<gap::Comparison>;

/// "report-z.html": of one of several axes.
std::string report_name(const GapSubject& subject);

/// The fields of one pair's result over all axes, and under "axes" each axis's own.
nlohmann::ordered_json axes_gap_json(std::span<const AxisResult> axes);
nlohmann::ordered_json axes_comparison_json(std::span<const AxisComparison> axes);

/// A table with one line for each axis.
std::string axes_text(std::span<const AxisResult> axes);
std::string axes_text(std::span<const AxisComparison> axes);

}  // namespace vgyro::cli
