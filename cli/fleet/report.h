#pragma once

// What a fleet showed: fleet.json for programs, report.html and a summary for people, model files
// that vgyrod takes.

#include <string>
#include <vector>

#include "base/error.h"
#include "cli/output/result_folder.h"
#include "fleet/judge.h"

namespace vgyro::cli {

std::string fleet_json(const fleet::Pool& pool, const fleet::Judgement& judgement);
/// One page that holds all it needs and runs no script; names reach it as text.
std::string fleet_page(const fleet::Pool& pool, const fleet::Judgement& judgement);
std::string fleet_text(const fleet::Pool& pool, const fleet::Judgement& judgement);

/// models/TYPE.toml, models/UNIT.toml of each unit that differs, and models/A+B.toml of each two
/// types that share a vehicle. In a file a gyro has the number that it has in its vehicles.
Expected<std::vector<ResultFile>> fleet_models(const fleet::Pool& pool,
                                               const fleet::Judgement& judgement);

}  // namespace vgyro::cli
