#pragma once

// The result of `vgyro fleet`: fleet.json for programs, a summary for people, and model files for
// vgyrod. The page is in cli/fleet/page.h.

#include <string>
#include <vector>

#include "base/error.h"
#include "cli/output/result_folder.h"
#include "fleet/judge.h"

namespace vgyro::cli {

std::string fleet_json(const fleet::Pool& pool, const fleet::Judgement& judgement);
std::string fleet_text(const fleet::Pool& pool, const fleet::Judgement& judgement);

/// models/TYPE.toml, models/TYPE-UNIT.toml of each unit that differs, and models/A+B.toml of each
/// pair of types in a vehicle. A gyro has the number in a file that it has in its vehicles.
Expected<std::vector<ResultFile>> fleet_models(const fleet::Pool& pool,
                                               const fleet::Judgement& judgement);

// Words that the summary and the page have in common.

/// Of the parameter that people know: a low-pass is told by its cut-off.
double fleet_sigma(const fleet::PooledEffect& effect, double sigma);
std::string fleet_size_text(const fleet::PooledEffect& effect);
std::string fleet_trend_text(const fleet::TypeTrend& trend);
/// How often names are false.
std::string fleet_promise(const fleet::Judgement& judgement);
/// A type's or a unit's name in that of a file: a colon of an axis is none.
std::string fleet_file_word(std::string_view text);

}  // namespace vgyro::cli
