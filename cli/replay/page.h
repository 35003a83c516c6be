#pragma once

// The page of a replay (--html): what --plot draws, as one self-contained file that zooms and tells
// its values, with the summary's figures. The same input gives the same bytes.

#include <span>
#include <string>
#include <vector>

#include "cli/replay/course.h"
#include "cli/replay/summary.h"

namespace vgyro::cli {

/// Of a course that a page will show: what is left of an hour at 500 Hz is finer than a second, and
/// a megabyte and a half of text for each axis.
constexpr std::size_t kPageBuckets = 6000;

struct PageSubject {
  std::string title;  ///< names of the logs
  std::string config;
};

/// `courses`: one, or one for each axis of the plan. Error when none of them has a sample.
Expected<std::string> replay_page(const PageSubject& subject, const gateway::Plan& plan,
                                  const ReplaySummary& summary, std::span<const Course> courses);

}  // namespace vgyro::cli
