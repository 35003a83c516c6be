#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/fleet/evidence_file.h"
#include "cli/fleet/page.h"
#include "cli/fleet/report.h"
#include "cli/output/errors.h"
#include "cli/output/progress.h"
#include "cli/output/result_folder.h"
#include "cli/output/terminal.h"

namespace vgyro::cli {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kResult{"report.html", "fleet.json", "evidence.json", "models"};

// Replaces folders by their *.json files, sorted by name.
Expected<std::vector<std::string>> files_of(const std::vector<std::string>& named) {
  std::vector<std::string> files;
  for (const std::string& name : named) {
    std::error_code code;
    if (!fs::is_directory(name, code)) {
      files.push_back(name);
      continue;
    }
    std::vector<std::string> inside;
    for (const fs::directory_entry& entry : fs::directory_iterator(name, code))
      if (entry.path().extension() == ".json") inside.push_back(entry.path().string());
    if (code) return fail(name, "cannot be read: " + code.message());
    if (inside.empty()) return fail(name, "holds no *.json", "a folder with evidence files");
    std::sort(inside.begin(), inside.end());
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

Expected<fleet::Pool> pool_of(const std::vector<std::string>& files, std::size_t& again) {
  Progress progress("fleet");
  fleet::Pool pool;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto added = add_evidence(files[i], pool);
    if (!added) return tl::unexpected(added.error());
    again += *added;
    progress.update("merging", static_cast<double>(i + 1) / static_cast<double>(files.size()));
  }
  if (pool.drives.empty()) return fail("", "there is no drive in the evidence");
  return pool;
}

}  // namespace

int run_fleet(const FleetOptions& options) {
  if (auto free = check_result_folder(options.out, kResult); !free) return report(free.error());
  const auto files = files_of(options.evidence);
  if (!files) return report(files.error());
  std::size_t again = 0;
  const auto pool = pool_of(*files, again);
  if (!pool) return report(pool.error());
  const fleet::Judgement judgement = fleet::judge(*pool, {options.false_names});
  auto models = fleet_models(*pool, judgement);
  if (!models) return report(models.error());
  std::vector<ResultFile> result{{"report.html", fleet_page(*pool, judgement)},
                                 {"fleet.json", fleet_json(*pool, judgement)},
                                 {"evidence.json", pool_text(*pool)}};
  result.insert(result.end(), models->begin(), models->end());
  if (auto done = write_result_folder(options.out, result, kResult); !done)
    return report(done.error());
  if (again > 0)
    warn({"", fmt::format("{} drives were given more than once and count once", again), ""});
  if (!options.quiet)
    say("{}written: {}: report.html, fleet.json, evidence.json, models/\n",
        fleet_text(*pool, judgement), options.out);
  return kDone;
}

}  // namespace vgyro::cli
