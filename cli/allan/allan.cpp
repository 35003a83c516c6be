#include <cstdio>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "analysis/pair_noise.h"
#include "analysis/recommendation.h"
#include "cli/allan/plot.h"
#include "cli/allan/report.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/log_notes.h"
#include "cli/output/errors.h"
#include "cli/output/gnuplot.h"
#include "cli/output/json_text.h"
#include "cli/output/overwrite.h"
#include "cli/output/terminal.h"
#include "cli/pair_recording.h"
#include "cli/role_frames.h"
#include "gateway/config.h"

namespace vgyro::cli {

namespace {

// Where not even white noise can be told from nothing.
constexpr double kSecondsMin = 10.0;

Expected<AllanReport> judge(const AllanOptions& options, const gateway::Plan& plan) {
  const auto recording = read_pair_recording(options.logs, plan);
  if (!recording) return tl::unexpected(recording.error());
  const double seconds = recording->paired[0].seconds();
  if (seconds < kSecondsMin) {
    return fail(
        name_of(options.logs),
        fmt::format("holds {:.1f} s of both gyros, too short to tell noise from drift", seconds),
        fmt::format("{:g} s at the least; an hour at rest shows drift", kSecondsMin));
  }
  AllanReport report{name_of(options.logs), {plan.gyros[0].name, plan.gyros[1].name}, {}, {}};
  report.noise = analysis::judge_pair(*recording);
  if (const auto& fit = report.noise.difference.fit) {
    report.recommendation = analysis::recommend(*fit, report.noise.difference.seconds);
  }
  return report;
}

}  // namespace

int run_allan(const AllanOptions& options) {
  const auto loaded = gateway::load_config(options.config);
  if (!loaded) return report(loaded.error());
  if (const auto units = several_axes(options.config, loaded->plan, "allan"); units)
    return report(*units);
  for (const Error& warning : loaded->warnings)
    warn(warning);
  if (!options.plot.empty()) {
    if (const auto good = check_picture_path(options.plot); !good) return report(good.error());
  }
  std::vector<std::string> inputs = loaded->files;
  inputs.insert(inputs.end(), options.logs.begin(), options.logs.end());
  const auto free = check_outputs(inputs, {options.json, options.plot});
  if (!free) return report(free.error());
  const auto judged = judge(options, loaded->plan);
  if (!judged) return report(judged.error());
  // JSON on standard output stands there alone.
  put_text(options.json == "-" ? stderr : stdout, to_text(*judged));
  if (!options.json.empty()) {
    if (const auto done = write_json(options.json, to_json(*judged)); !done)
      return report(done.error());
  }
  if (!options.plot.empty()) {
    if (const auto done = draw_allan(options.plot, *judged); !done) return report(done.error());
  }
  return kDone;
}

}  // namespace vgyro::cli
