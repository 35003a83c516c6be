#include "cli/gap/inputs.h"

#include <fmt/format.h>

#include "cli/axis_choice.h"
#include "cli/output/errors.h"
#include "cli/output/overwrite.h"
#include "cli/recording.h"
#include "gateway/config.h"
#include "model/mirror.h"

namespace vgyro::cli {

namespace {

GapPair pair_of(const gateway::Plan& plan, const GapRequest& request) {
  GapPair pair;
  if (plan.model) pair.model = *plan.model;
  pair.subject = {request.config,
                  pair.model.file,
                  fmt::format("{}", fmt::join(request.logs, ", ")),
                  {plan.gyros[0].name, plan.gyros[1].name},
                  axis_name(plan),
                  {plan.gyros[0].type, plan.gyros[1].type},
                  {plan.gyros[0].serial, plan.gyros[1].serial},
                  {plan.gyros[0].sensor_axis, plan.gyros[1].sensor_axis}};
  pair.flipped = {plan.gyros[0].flipped, plan.gyros[1].flipped};
  for (model::Effect& effect : pair.model.effects) {
    if (pair.flipped[effect.gyro]) effect = model::mirrored(effect);
    effect.of_axis.reset();
  }
  return pair;
}

}  // namespace

model::Effect GapPair::for_file(const model::Effect& effect) const {
  model::Effect own = flipped[effect.gyro] ? model::mirrored(effect) : effect;
  own.of_axis = subject.axis_of(effect.kind, effect.gyro);
  return own;
}

void GapPair::tell_of_sensors(gap::Result& result) const {
  if (subject.axis.empty()) return;
  for (auto* list : {&result.starting, &result.effects}) {
    for (gap::NamedEffect& named : *list) {
      named.effect = for_file(named.effect);
      for (gap::Reading& reading : named.ambiguous_with) {
        if (!reading.is_fitted()) continue;
        reading.parameters =
            for_file({.gyro = reading.gyro, .kind = reading.kind, .parameters = reading.parameters})
                .parameters;
      }
    }
  }
  for (model::Effect& effect : result.model.effects)
    effect = for_file(effect);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!flipped[gyro]) continue;
    result.notes.push_back(fmt::format(
        "gyro {} is mounted against {}: values are in its own sign, as in the model file; pictures "
        "and descriptions are about the vehicle's {}",
        subject.gyros[gyro], subject.axis, subject.axis));
  }
}

std::string GapPair::doing(const std::string& command) const {
  return subject.axis.empty() ? command : fmt::format("{}, axis {}", command, subject.axis);
}

tl::expected<GapInputs, std::vector<Error>> load_gap_inputs(
    const GapRequest& request, const std::string& command,
    const std::vector<std::string>& outputs) {
  const auto failed = [](const Error& error) { return tl::unexpected(std::vector<Error>{error}); };
  auto loaded = gateway::load_config(request.config, {.model = request.model});
  if (!loaded) return tl::unexpected(loaded.error());
  const auto plans = chosen_pairs(request.config, loaded->plan, request.axis);
  if (!plans) return failed(plans.error());
  for (const Error& warning : loaded->warnings)
    warn(warning);
  std::vector<std::string> read = loaded->files;
  read.insert(read.end(), request.logs.begin(), request.logs.end());
  if (const auto free = check_outputs(read, outputs); !free) return failed(free.error());
  GapInputs inputs;
  inputs.files = loaded->files;
  if (loaded->plan.model) inputs.model = *loaded->plan.model;
  for (const gateway::Plan& plan : *plans)
    inputs.pairs.push_back(pair_of(plan, request));
  for (const std::string& log : request.logs) {
    auto recordings = read_recordings(log, *plans, command);
    if (!recordings) return failed(recordings.error());
    for (std::size_t i = 0; i < plans->size(); ++i)
      inputs.pairs[i].recordings.push_back(std::move((*recordings)[i]));
  }
  return inputs;
}

gap::Settings settings_of(std::uint64_t seed, Progress& progress) {
  gap::Settings settings;
  settings.seed = seed;
  settings.progress = [&progress](std::string_view what, double share) {
    progress.update(what, share);
  };
  return settings;
}

Error at_log(Error error, const GapSubject& subject) {
  if (error.where.empty()) error.where = subject.log;
  if (!subject.axis.empty()) error.what = fmt::format("about {}: {}", subject.axis, error.what);
  return error;
}

}  // namespace vgyro::cli
