#pragma once

// report.html: one self-contained page that tells what `vgyro gap` found, with plots. Everything
// that comes from a user's file reaches the page as text, never as markup.

#include <span>
#include <string>

#include "cli/gap/axes.h"
#include "cli/gap/report.h"
#include "gap/result.h"

namespace vgyro::cli {

/// `axes`: all of a result of several, of which this is one.
std::string report_page(const GapSubject& subject, const gap::Result& result,
                        std::span<const AxisResult> axes = {});

/// The first page of a result of several axes: a line for each, with a link to its report.
std::string overview_page(std::span<const AxisResult> axes);

}  // namespace vgyro::cli
