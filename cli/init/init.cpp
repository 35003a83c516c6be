// vgyro init: a log and DBC files → a proposal for vgyro.toml.

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/core.h>

#include "base/printable.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/init/config_text.h"
#include "cli/output/errors.h"
#include "cli/output/output_file.h"
#include "cli/output/overwrite.h"
#include "cli/output/terminal.h"
#include "dbc/parser.h"

namespace vgyro::cli {

namespace {

Expected<void> check_inputs(const InitOptions& options) {
  std::vector<std::string> inputs = options.logs;
  inputs.insert(inputs.end(), options.dbc_files.begin(), options.dbc_files.end());
  if (const auto good = check_outputs(inputs, {options.output}); !good) return good;
  if (options.dbc_files.empty()) {
    return fail("vgyro init", "no DBC file is given, so nothing says which bits are a rate",
                "--dbc FILE; ready-made ones of nine gyros are in dbc/profiles");
  }
  std::error_code failed;
  const bool there = options.output != "-" && std::filesystem::exists(options.output, failed);
  if (there && !options.force)
    return fail(options.output, "is there already", "choose another name, or --force replaces it");
  return {};
}

void print_candidates(const std::vector<Candidate>& candidates, const Choice& choice) {
  const std::size_t base = choice.pair ? choice.pair->first : choice.alone.value_or(0);
  tell("{:<40}{:>8}{:>11}{:>11}{:>8}{:>9}{:>9}\n", "signal that may be a rate", "Hz", "step",
       "noise", "corr.", "scale", "lag ms");
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& one = candidates[i];
    std::string figures;
    for (const PairFigures& pair : choice.pairs) {
      const bool forward = pair.first == base && pair.second == i;
      if (!forward && !(pair.second == base && pair.first == i)) continue;
      const analysis::Likeness& alike = pair.likeness;
      figures = fmt::format("{:>+8.3f}{:>+9.4f}{:>+9.1f}", alike.correlation,
                            forward ? alike.scale : 1.0 / alike.scale,
                            1e3 * (forward ? alike.lag_s : -alike.lag_s));
    }
    tell("{:<40}{:>8.1f}{:>11}{:>11.3g}{}\n", printable(one.place()),
         1.0 / std::max(one.figures.interval_s, 1e-6),
         one.series.step > 0.0 ? fmt::format("{:.3g}", one.series.step) : "float",
         one.figures.noise, figures);
    if (!one.why_not.empty()) tell("    left out: {}\n", printable(one.why_not));
  }
  if (!candidates.empty())
    tell("Steps and noise in deg/s; correlation, scale and lag against {}.\n\n",
         printable(candidates[base].place()));
}

Expected<void> write(const std::string& path, const std::string& text) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  file->write(text);
  return file->close();
}

int nothing_found(const Traffic& traffic, const std::vector<Found>& messages) {
  return report(
      Error{"vgyro init",
            fmt::format(
                "no signal of the DBC files looks like a rate of rotation in this log: {} of {} "
                "identifiers are known to the files, none has a changing signal in deg/s or rad/s",
                messages.size(), traffic.streams().size()),
            "`vgyro decode --dbc FILE LOG` shows what the files know of it"});
}

}  // namespace

int run_init(const InitOptions& options) {
  if (const auto good = check_inputs(options); !good) return report(good.error());
  std::vector<dbc::Database> databases;
  for (const std::string& file : options.dbc_files) {
    auto loaded = dbc::load(file);
    if (!loaded) return report(loaded.error());
    databases.push_back(std::move(*loaded));
  }
  Traffic traffic;
  if (const auto read = traffic.read(options.logs); !read) return report(read.error());
  tell("{}", printable_lines(traffic.notes()));
  tell("{} frames of {} identifiers in {:.0f} s{}\n\n", traffic.frames(), traffic.streams().size(),
       traffic.seconds(), traffic.thinned() ? "; a long log: part of it was looked at" : "");
  const auto messages = find_messages(traffic, databases);
  auto candidates = find_candidates(messages);
  const Choice choice = choose(candidates);
  print_candidates(candidates, choice);
  if (!choice.pair && !choice.alone) return nothing_found(traffic, messages);
  const Circumstances circumstances =
      find_circumstances(messages, candidates, choice, traffic.begin_s());
  const Proposal proposal{candidates, choice,
                          messages,   circumstances,
                          traffic,    std::filesystem::path(options.output).parent_path().string()};
  if (const auto written = write(options.output, config_text(proposal)); !written)
    return report(written.error());
  const std::string name = options.output == "-" ? "standard output" : options.output;
  if (!choice.pair) {
    return report(Error{name,
                        fmt::format("only one gyro was found, {}: no other signal follows its "
                                    "rotation; the second [[gyro]] is a comment",
                                    candidates[*choice.alone].place()),
                        "a log in which both turn, and a DBC file of each"});
  }
  tell(
      "Chosen: a = {}, b = {}. {} holds the proposal; look at the lines with CHECK, then\n"
      "    vgyro check {}\n",
      printable(candidates[choice.pair->first].place()),
      printable(candidates[choice.pair->second].place()), name,
      options.output == "-" ? "vgyro.toml" : options.output);
  return kDone;
}

}  // namespace vgyro::cli
