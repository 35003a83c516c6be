#pragma once

// report.html: one self-contained page that tells what `vgyro gap` found, with plots. Everything
// that comes from a user's file reaches the page as text, never as markup.

#include <string>

#include "cli/gap/report.h"
#include "gap/result.h"

namespace vgyro::cli {

std::string report_page(const GapSubject& subject, const gap::Result& result);

}  // namespace vgyro::cli
