#pragma once

// The result of `vgyro fleet`: fleet.json for programs, report.html and a summary for people, and
// model files for vgyrod.

#include <string>
#include <vector>

#include "base/error.h"
#include "cli/output/result_folder.h"
#include "fleet/judge.h"

namespace vgyro::cli {

std::string fleet_json(const fleet::Pool& pool, const fleet::Judgement& judgement);
/// A self-contained page without scripts; all names are escaped.
std::string fleet_page(const fleet::Pool& pool, const fleet::Judgement& judgement);
std::string fleet_text(const fleet::Pool& pool, const fleet::Judgement& judgement);

/// models/TYPE.toml, models/TYPE-UNIT.toml of each unit that differs, and models/A+B.toml of each
/// pair of types in a vehicle. A gyro has the number in a file that it has in its vehicles.
Expected<std::vector<ResultFile>> fleet_models(const fleet::Pool& pool,
                                               const fleet::Judgement& judgement);

}  // namespace vgyro::cli
