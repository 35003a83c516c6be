#include <cstdio>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/gap/inputs.h"
#include "cli/gap/report.h"
#include "cli/output/errors.h"
#include "cli/output/json_text.h"
#include "cli/output/overwrite.h"
#include "cli/output/progress.h"
#include "cli/output/terminal.h"
#include "gap/workflow.h"

namespace vgyro::cli {

namespace {

Expected<gap::Comparison> judge(const GapInputs& inputs, const CompareOptions& options) {
  Progress progress("compare");
  auto comparison =
      gap::compare(inputs.recordings, inputs.model, settings_of(options.seed, progress));
  if (!comparison) return tl::unexpected(at_log(comparison.error(), inputs.subject.log));
  return comparison;
}

}  // namespace

int run_compare(const CompareOptions& options) {
  const auto inputs =
      load_gap_inputs(options.config, options.model, options.measured, "compare", {options.json});
  if (!inputs) return report(inputs.error());
  const auto comparison = judge(*inputs, options);
  if (!comparison) return report(comparison.error());
  if (!options.json.empty()) {
    if (const auto done = write_json(options.json, comparison_json(*comparison)); !done) {
      return report(done.error());
    }
  }
  // JSON on standard output stands there alone.
  if (!options.quiet) {
    put_text(options.json == "-" ? stderr : stdout, comparison_text(inputs->subject, *comparison));
  }
  return kDone;
}

}  // namespace vgyro::cli
