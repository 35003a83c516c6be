#include "cli/gap/inputs.h"

#include <fmt/format.h>

#include "cli/output/errors.h"
#include "cli/output/overwrite.h"
#include "cli/recording.h"
#include "cli/role_frames.h"
#include "gateway/config.h"

namespace vgyro::cli {

tl::expected<GapInputs, std::vector<Error>> load_gap_inputs(
    const std::string& config, const std::optional<std::string>& model,
    const std::vector<std::string>& logs, const std::string& doing,
    const std::vector<std::string>& outputs) {
  auto loaded = gateway::load_config(config, {.model = model});
  if (!loaded) return tl::unexpected(loaded.error());
  if (const auto units = several_axes(config, loaded->plan, doing); units)
    return tl::unexpected(std::vector<Error>{*units});
  for (const Error& warning : loaded->warnings)
    warn(warning);
  std::vector<std::string> read = loaded->files;
  read.insert(read.end(), logs.begin(), logs.end());
  if (const auto free = check_outputs(read, outputs); !free) {
    return tl::unexpected(std::vector<Error>{free.error()});
  }
  const gateway::Plan& plan = loaded->plan;
  GapInputs inputs;
  if (plan.model) inputs.model = *plan.model;
  inputs.subject = {config,
                    inputs.model.file,
                    fmt::format("{}", fmt::join(logs, ", ")),
                    {plan.gyros[0].name, plan.gyros[1].name}};
  for (const std::string& log : logs) {
    auto recording = read_recording(log, plan, doing);
    if (!recording) return tl::unexpected(std::vector<Error>{recording.error()});
    inputs.recordings.push_back(*std::move(recording));
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

Error at_log(Error error, const std::string& log) {
  if (error.where.empty()) error.where = log;
  return error;
}

}  // namespace vgyro::cli
