#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/gap/accept.h"
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

// For the model file: with its doubt, within the limits of the format.
model::Effect with_doubt(const gap::NamedEffect& named) {
  model::Effect effect = named.effect;
  effect.ambiguous = !named.ambiguous_with.empty();
  const auto parameters = model::info(effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const bool has_one = std::isfinite(named.sigma[i]) && named.sigma[i] > 0.0;
    const bool is_number = parameters[i].form == model::Parameter::Form::kNumber;
    if (!has_one || !is_number) continue;
    effect.sigma[i] = std::min(named.sigma[i], parameters[i].maximum - parameters[i].minimum);
  }
  return effect;
}

model::Effect with_doubt(const gap::Reading& reading) {
  return {.gyro = reading.gyro,
          .kind = reading.kind,
          .parameters = reading.parameters,
          .ambiguous = true};
}

std::string comment_of(const GapSubject& subject, const gap::NamedEffect& named) {
  std::string text = fmt::format(
      "named by vgyro gap{}: {}; gap {:.4g} -> {:.4g} nats per sample, p {:.1g}",
      named.applied ? "" : " and not applied, for the recording cannot tell the readings apart",
      value_text(named), named.gap_before, named.gap_after, named.p_value);
  if (!named.evidence.empty()) text += "\n" + named.evidence;
  for (const gap::Reading& reading : named.ambiguous_with) {
    text += fmt::format("\nmay also be: {} of gyro {} ({})", model::info(reading.kind).name,
                        reading.gyro + 1, subject.gyros[reading.gyro]);
  }
  return text;
}

// Every reading as a table that only its "#" keep from being applied.
std::string readings_text(const gap::NamedEffect& named) {
  std::string text;
  if (!named.experiment.empty()) text += fmt::format("\nto tell: {}", named.experiment);
  text += "\nto apply one: vgyro gap --accept, or take the \"# \" off its lines";
  text += "\n\n" + model::effect_table(with_doubt(named));
  for (const gap::Reading& reading : named.ambiguous_with) {
    if (reading.is_fitted()) text += "\nor\n\n" + model::effect_table(with_doubt(reading));
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
    const std::string comment = comment_of(inputs.subject, named);
    text = named.applied ? model::append_effect(*text, with_doubt(named), comment)
                         : model::append_comment(*text, comment + readings_text(named));
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

using Clock = std::chrono::steady_clock;

// Reading the log counts too: the limit is what the user waits.
Expected<gap::Settings> settings_with(const GapOptions& options, Clock::time_point begin,
                                      Progress& progress) {
  gap::Settings settings = settings_of(options.seed, progress);
  for (const std::string& word : options.accept) {
    const auto acceptance = acceptance_from(word);
    if (!acceptance) return tl::unexpected(acceptance.error());
    settings.accept.push_back(*acceptance);
  }
  if (options.time_limit_s <= 0.0) return settings;
  settings.time_left = [begin, limit_s = options.time_limit_s] {
    const double spent_s = std::chrono::duration<double>(Clock::now() - begin).count();
    return std::max(0.0, 1.0 - spent_s / limit_s);
  };
  return settings;
}

Expected<gap::Result> work(const GapInputs& inputs, const GapOptions& options,
                           Clock::time_point begin) {
  Progress progress("gap");
  const auto settings = settings_with(options, begin, progress);
  if (!settings) return tl::unexpected(settings.error());
  auto result = gap::find_gap(inputs.recordings, inputs.model, *settings);
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
  const Clock::time_point begin = Clock::now();
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
  const auto result = work(*inputs, options, begin);
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
