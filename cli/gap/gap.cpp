#include <cstdio>
#include <filesystem>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/gap/inputs.h"
#include "cli/gap/report.h"
#include "cli/gap/report_page.h"
#include "cli/output/errors.h"
#include "cli/output/json_text.h"
#include "cli/output/progress.h"
#include "cli/output/result_folder.h"
#include "cli/output/terminal.h"
#include "gap/workflow.h"
#include "model/catalogue.h"
#include "model/edit.h"

namespace vgyro::cli {

namespace {

std::string comment_of(const GapSubject& subject, const gap::NamedEffect& named) {
  std::string text =
      fmt::format("named by vgyro gap: {}; gap {:.4g} -> {:.4g} nats per sample, p {:.1g}",
                  value_text(named), named.gap_before, named.gap_after, named.p_value);
  if (!named.evidence.empty()) text += "\n" + named.evidence;
  for (const gap::Reading& reading : named.ambiguous_with) {
    text += fmt::format("\nmay also be: {} of gyro {} ({})", model::info(reading.kind).name,
                        reading.gyro + 1, subject.gyros[reading.gyro]);
  }
  return text;
}

Expected<std::string> extended_model(const GapInputs& inputs, const std::string& given_text,
                                     const gap::Result& result) {
  Expected<std::string> text = given_text;
  for (const gap::NamedEffect& one : result.starting) {
    if (!text) return text;
    text = model::append_effect(*text, one.effect,
                                "starting model: fitted, for the given model says nothing of it");
  }
  for (const gap::NamedEffect& named : result.effects) {
    if (!text) return text;
    text = model::append_effect(*text, named.effect, comment_of(inputs.subject, named));
  }
  if (text && text->empty()) return model::to_toml({});
  return text;
}

// Before the work: a file that nothing can be added to is told at once.
Expected<std::string> model_text(const model::Model& model) {
  if (model.file.empty()) return std::string();
  auto text = read_file(model.file);
  if (!text) return text;
  constexpr model::Effect kTrial{0, model::Kind::kBias, {0.0}, 0};
  if (const auto trial = model::append_effect(*text, kTrial, {}); !trial) {
    // It was given a text without a name, and knows at most the line.
    Error error = trial.error();
    const std::size_t colon = error.where.rfind(':');
    error.where = model.file + (colon == std::string::npos ? "" : error.where.substr(colon));
    return tl::unexpected(error);
  }
  return text;
}

Expected<gap::Result> work(const GapInputs& inputs, const GapOptions& options) {
  Progress progress("gap");
  auto result = gap::find_gap(inputs.recording, inputs.model, settings_of(options.seed, progress));
  if (!result) return tl::unexpected(at_log(result.error(), inputs.subject.log));
  round_to_sigma(*result);
  return result;
}

Expected<void> write(const std::string& folder, const GapInputs& inputs,
                     const std::string& given_text, const gap::Result& result) {
  auto model = extended_model(inputs, given_text, result);
  if (!model) return tl::unexpected(model.error());
  return write_result_folder(folder, {{"gap.json", json_text(gap_json(result))},
                                      {"model.toml", std::move(*model)},
                                      {"report.html", report_page(inputs.subject, result)}});
}

}  // namespace

int run_gap(const GapOptions& options) {
  const std::vector<std::string> names{"gap.json", "model.toml", "report.html"};
  const auto free = check_result_folder(options.out, names);
  if (!free) return report(free.error());
  std::vector<std::string> outputs;
  outputs.reserve(names.size());
  for (const std::string& name : names)
    outputs.push_back(std::filesystem::path(options.out) / name);
  const auto inputs =
      load_gap_inputs(options.config, options.model, options.measured, "gap", outputs);
  if (!inputs) return report(inputs.error());
  const auto given_text = model_text(inputs->model);
  if (!given_text) return report(given_text.error());
  const auto result = work(*inputs, options);
  if (!result) return report(result.error());
  if (const auto done = write(options.out, *inputs, *given_text, *result); !done) {
    return report(done.error());
  }
  if (options.quiet) return kDone;
  say("{}written: {}: report.html, gap.json, model.toml\n", gap_text(inputs->subject, *result),
      options.out);
  return kDone;
}

}  // namespace vgyro::cli
