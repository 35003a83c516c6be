#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/fleet/evidence_file.h"
#include "cli/gap/accept.h"
#include "cli/gap/axes.h"
#include "cli/gap/inputs.h"
#include "cli/gap/report.h"
#include "cli/gap/report_page.h"
#include "cli/output/errors.h"
#include "cli/output/json_text.h"
#include "cli/output/output_file.h"
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

model::Effect with_doubt(const GapSubject& subject, const gap::Reading& reading) {
  return {.gyro = reading.gyro,
          .kind = reading.kind,
          .parameters = reading.parameters,
          .ambiguous = true,
          .of_axis = subject.axis_of(reading.kind, reading.gyro)};
}

std::string comment_of(const GapSubject& subject, const gap::NamedEffect& named) {
  std::string text = fmt::format(
      "named by vgyro gap{}{}: {}; gap {:.4g} -> {:.4g} nats per sample, p {:.1g}",
      subject.axis.empty() ? "" : " about " + subject.axis,
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
std::string readings_text(const GapSubject& subject, const gap::NamedEffect& named) {
  std::string text;
  if (!named.experiment.empty()) text += fmt::format("\nto tell: {}", named.experiment);
  text += "\nto apply one: vgyro gap --accept, or take the \"# \" off its lines";
  text += "\n\n" + model::effect_table(with_doubt(named));
  for (const gap::Reading& reading : named.ambiguous_with) {
    if (reading.is_fitted()) text += "\nor\n\n" + model::effect_table(with_doubt(subject, reading));
  }
  return text;
}

Expected<std::string> extended(Expected<std::string> text, const AxisResult& axis) {
  for (const gap::NamedEffect& one : axis.judged.starting) {
    if (!text) return text;
    text = model::append_effect(*text, one.effect,
                                "starting model: fitted, for the given model says nothing of it");
  }
  for (const gap::NamedEffect& named : axis.judged.effects) {
    if (!text) return text;
    const std::string comment = comment_of(axis.subject, named);
    text = named.applied
               ? model::append_effect(*text, with_doubt(named), comment)
               : model::append_comment(*text, comment + readings_text(axis.subject, named));
  }
  return text;
}

Expected<std::string> extended_model(const std::string& given_text,
                                     const std::vector<AxisResult>& axes) {
  Expected<std::string> text = given_text;
  for (const AxisResult& axis : axes)
    text = extended(std::move(text), axis);
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

/// From when to when something may take.
struct TimeWindow {
  Clock::time_point from;
  Clock::time_point until;

  /// 1 to 0.
  [[nodiscard]] double left(Clock::time_point now) const {
    const double whole_s = std::chrono::duration<double>(until - from).count();
    const double left_s = std::chrono::duration<double>(until - now).count();
    return whole_s > 0.0 ? std::max(0.0, left_s / whole_s) : 0.0;
  }
};

/// Gives each of several equal shares of what is left. Reading the log counts too: the limit is
/// what the user waits.
class TimeBudget {
 public:
  TimeBudget(double limit_s, Clock::time_point begin, std::size_t shares)
      : limited_(limit_s > 0.0),
        from_(begin),
        until_(begin +
               std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(limit_s))),
        shares_(shares) {}

  /// Nothing where there is no limit.
  std::optional<TimeWindow> next() {
    const Clock::time_point from = std::exchange(from_, Clock::time_point::min());
    const Clock::time_point begin = from == Clock::time_point::min() ? Clock::now() : from;
    const auto share =
        (until_ - begin) / static_cast<Clock::rep>(std::max<std::size_t>(shares_, 1));
    if (shares_ > 0) --shares_;
    if (!limited_) return std::nullopt;
    return TimeWindow{begin, begin + share};
  }

 private:
  bool limited_;
  Clock::time_point from_;  ///< of the first
  Clock::time_point until_;
  std::size_t shares_;  ///< that are still to be given
};

Expected<gap::Settings> settings_with(const GapOptions& options, std::optional<TimeWindow> window,
                                      Progress& progress) {
  gap::Settings settings = settings_of(options.seed, progress);
  settings.with_evidence = !options.evidence.empty();
  for (const std::string& word : options.accept) {
    const auto acceptance = acceptance_from(word);
    if (!acceptance) return tl::unexpected(acceptance.error());
    settings.accept.push_back(*acceptance);
  }
  if (window) settings.time_left = [window] { return window->left(Clock::now()); };
  return settings;
}

Expected<gap::Result> work(const GapPair& pair, const GapOptions& options,
                           std::optional<TimeWindow> window) {
  Progress progress(pair.doing("gap"));
  const auto settings = settings_with(options, window, progress);
  if (!settings) return tl::unexpected(settings.error());
  auto result = gap::find_gap(pair.recordings, pair.model, *settings);
  if (!result) return tl::unexpected(at_log(result.error(), pair.subject));
  pair.tell_of_sensors(*result);
  round_to_sigma(*result);
  return result;
}

// How far the readings of gyro 1 are from their mean, squared.
double motion_of(const GapPair& pair) {
  double sum = 0.0;
  double squares = 0.0;
  double count = 0.0;
  for (const gap::Recording& recording : pair.recordings) {
    for (const double rate_dps : recording.gyros[0].rate_dps) {
      sum += rate_dps;
      squares += rate_dps * rate_dps;
      count += 1.0;
    }
  }
  return count > 0.0 ? squares / count - std::pow(sum / count, 2) : 0.0;
}

// What is all the unit's (a delay, lost frames) shows best where it moves most: that axis comes
// first, and the others know of it.
std::vector<std::size_t> by_motion(const std::vector<GapPair>& pairs) {
  std::vector<std::size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<double> motion;
  std::transform(pairs.begin(), pairs.end(), std::back_inserter(motion), motion_of);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return motion[a] > motion[b]; });
  return order;
}

struct FoundBefore {
  model::Effect effect;
  std::string note;
};

// What an axis found of the whole unit, for those that come after it.
void keep_found(const AxisResult& axis, std::vector<FoundBefore>& found) {
  for (const gap::NamedEffect& named : axis.judged.effects) {
    if (!named.applied || !model::acts_on_unit(named.effect.kind)) continue;
    found.push_back(
        {named.effect, fmt::format("{} of gyro {}, found about {}, is known here",
                                   model::info(named.effect.kind).name,
                                   axis.subject.gyros[named.effect.gyro], axis.subject.axis)});
  }
}

Expected<std::vector<AxisResult>> work_through(GapInputs& inputs, const GapOptions& options,
                                               Clock::time_point begin) {
  TimeBudget budget(options.time_limit_s, begin, inputs.pairs.size());
  std::vector<AxisResult> axes(inputs.pairs.size());
  std::vector<FoundBefore> found;
  for (const std::size_t i : by_motion(inputs.pairs)) {
    GapPair& pair = inputs.pairs[i];
    for (const FoundBefore& one : found)
      pair.model.effects.push_back(one.effect);
    auto result = work(pair, options, budget.next());
    if (!result) return tl::unexpected(result.error());
    for (const FoundBefore& one : found)
      result->notes.push_back(one.note);
    axes[i] = {pair.subject, *std::move(result)};
    keep_found(axes[i], found);
  }
  return axes;
}

// What a result may consist of: of one pair, or of several axes.
std::vector<std::string> result_names() {
  std::vector<std::string> names{"gap.json", "model.toml", "report.html"};
  for (const char axis : gateway::kAxisNames)
    names.push_back(fmt::format("report-{}.html", axis));
  return names;
}

Expected<std::vector<std::string>> write(const std::string& folder, const std::string& given_text,
                                         const std::vector<AxisResult>& axes) {
  auto model = extended_model(given_text, axes);
  if (!model) return tl::unexpected(model.error());
  const bool several = axes.size() > 1;
  const AxisResult& first = axes.front();
  std::vector<ResultFile> files{
      {"report.html", several ? overview_page(axes) : report_page(first.subject, first.judged)}};
  for (std::size_t i = 0; several && i < axes.size(); ++i) {
    files.push_back(
        {report_name(axes[i].subject), report_page(axes[i].subject, axes[i].judged, axes)});
  }
  files.push_back({"gap.json", json_text(several ? axes_gap_json(axes)
                                                 : gap_json(first.subject, first.judged))});
  files.push_back({"model.toml", std::move(*model)});
  if (auto done = write_result_folder(folder, files, result_names()); !done) {
    return tl::unexpected(done.error());
  }
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const ResultFile& file : files)
    names.push_back(file.name);
  return names;
}

std::string text_of(const std::vector<AxisResult>& axes) {
  std::string text;
  for (const AxisResult& axis : axes)
    text += gap_text(axis.subject, axis.judged) + (axes.size() > 1 ? "\n" : "");
  return axes.size() > 1 ? text + axes_text(axes) : text;
}

// One line for each pair.
Expected<void> leave_evidence(const GapOptions& options, const GapInputs& inputs,
                              const std::vector<AxisResult>& axes) {
  if (options.evidence.empty()) return {};
  std::string text;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const GapPair& pair = inputs.pairs[i];
    text += drive_text({pair.subject, pair.recordings, *axes[i].judged.evidence, pair.flipped,
                        std::string(gap::verdict_name(axes[i].judged.verdict))},
                       inputs.files, inputs.model.file);
  }
  auto file = OutputFile::open(options.evidence);
  if (!file) return tl::unexpected(file.error());
  file->write(text);
  return file->close();
}

// After the work: a sum of a long recording takes a moment, and a failed run needs none.
void tell_provenance(const GapOptions& options, const GapInputs& inputs,
                     std::vector<AxisResult>& axes) {
  Provenance provenance{options.command, {}};
  for (const std::string& file : inputs.files)
    provenance.files.push_back(input_file(file));
  const std::vector<gap::Recording>& recordings = inputs.pairs.front().recordings;
  for (std::size_t i = 0; i < options.measured.size(); ++i) {
    provenance.files.push_back(input_file(options.measured[i]));
    provenance.files.back().began = began_text(recordings[i].began_s);
  }
  for (AxisResult& axis : axes)
    axis.subject.provenance = provenance;
}

}  // namespace

int run_gap(const GapOptions& options) {
  const Clock::time_point begin = Clock::now();
  const auto free = check_result_folder(options.out, result_names());
  if (!free) return report(free.error());
  std::vector<std::string> outputs;
  for (const std::string& name : result_names())
    outputs.push_back(std::filesystem::path(options.out) / name);
  if (!options.evidence.empty()) outputs.push_back(options.evidence);
  auto inputs = load_gap_inputs({options.config, options.model, options.measured, options.axis},
                                "gap", outputs);
  if (!inputs) return report(inputs.error());
  const auto given_text = model_text(inputs->model);
  if (!given_text) return report(given_text.error());
  auto axes = work_through(*inputs, options, begin);
  if (!axes) return report(axes.error());
  if (auto left = leave_evidence(options, *inputs, *axes); !left) return report(left.error());
  tell_provenance(options, *inputs, *axes);
  const auto written = write(options.out, *given_text, *axes);
  if (!written) return report(written.error());
  if (options.quiet) return kDone;
  say("{}written: {}: {}\n", text_of(*axes), options.out, fmt::join(*written, ", "));
  return kDone;
}

}  // namespace vgyro::cli
