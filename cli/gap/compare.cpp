#include <cstdio>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/gap/axes.h"
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

Expected<AxisComparison> judge(const GapPair& pair, std::uint64_t seed) {
  Progress progress(pair.doing("compare"));
  auto comparison = gap::compare(pair.recordings, pair.model, settings_of(seed, progress));
  if (!comparison) return tl::unexpected(at_log(comparison.error(), pair.subject));
  return AxisComparison{pair.subject, *std::move(comparison)};
}

nlohmann::ordered_json json_of(const std::vector<AxisComparison>& axes) {
  if (axes.size() > 1) return axes_comparison_json(axes);
  return comparison_json(axes.front().subject, axes.front().judged);
}

std::string text_of(const std::vector<AxisComparison>& axes) {
  std::string text;
  for (const AxisComparison& axis : axes)
    text += comparison_text(axis.subject, axis.judged) + (axes.size() > 1 ? "\n" : "");
  return axes.size() > 1 ? text + axes_text(axes) : text;
}

}  // namespace

int run_compare(const CompareOptions& options) {
  const auto inputs = load_gap_inputs(
      {options.config, options.model, options.measured, options.axis}, "compare", {options.json});
  if (!inputs) return report(inputs.error());
  std::vector<AxisComparison> axes;
  for (const GapPair& pair : inputs->pairs) {
    auto comparison = judge(pair, options.seed);
    if (!comparison) return report(comparison.error());
    axes.push_back(*std::move(comparison));
  }
  if (!options.json.empty()) {
    if (const auto done = write_json(options.json, json_of(axes)); !done) {
      return report(done.error());
    }
  }
  // JSON on standard output stands there alone.
  if (!options.quiet) put_text(options.json == "-" ? stderr : stdout, text_of(axes));
  return kDone;
}

}  // namespace vgyro::cli
