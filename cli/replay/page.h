#pragma once

// The page of a replay (--html): the plots of --plot as one self-contained file, with zoom and
// readout, and the summary's figures. The same input gives the same bytes.

#include <span>
#include <string>
#include <vector>

#include "cli/replay/course.h"
#include "cli/replay/summary.h"

namespace vgyro::cli {

/// Buckets of a course for a page: of an hour at 500 Hz they are shorter than a second, and take
/// one and a half megabytes of text for each axis.
constexpr std::size_t kPageBuckets = 6000;

struct PageSubject {
  std::string title;  ///< names of the logs
  std::string config;
};

/// `courses`: one, or one for each axis of the plan. Error if none has a sample.
Expected<std::string> replay_page(const PageSubject& subject, const gateway::Plan& plan,
                                  const ReplaySummary& summary, std::span<const Course> courses);

}  // namespace vgyro::cli
