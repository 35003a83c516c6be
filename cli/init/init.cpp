// vgyro init: makes a proposal for vgyro.toml from a log and DBC files.

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/core.h>

#include "base/printable.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/init/config_text.h"
#include "cli/init/guess.h"
#include "cli/output/errors.h"
#include "cli/output/output_file.h"
#include "cli/output/overwrite.h"
#include "cli/output/terminal.h"
#include "dbc/parser.h"

namespace vgyro::cli {

namespace {

Expected<void> check_new(const std::string& path, bool force) {
  std::error_code failed;
  if (force || path == "-" || !std::filesystem::exists(path, failed)) return {};
  return fail(path, "exists already", "choose another name, or replace it with --force");
}

Expected<void> check_inputs(const InitOptions& options) {
  std::vector<std::string> inputs = options.logs;
  inputs.insert(inputs.end(), options.dbc_files.begin(), options.dbc_files.end());
  if (auto good = check_outputs(inputs, {options.output}); !good) return good;
  return check_new(options.output, options.force);
}

/// The DBC file for guessed layouts: vgyro.toml → vgyro-guess.dbc.
std::string guess_path(const std::string& output) {
  const std::filesystem::path path(output);
  return (path.parent_path() / (path.stem().string() + "-guess.dbc")).string();
}

/// What is known of the logs before a pair is chosen.
struct Material {
  Traffic traffic;
  std::vector<dbc::Database> databases;
  std::vector<Found> messages;
  std::unique_ptr<Guess> guess;
  std::unique_ptr<Described> described;
  std::vector<Candidate> candidates;
  Choice choice;
};

Expected<void> read(const InitOptions& options, Material& all) {
  for (const std::string& file : options.dbc_files) {
    auto loaded = dbc::load(file);
    if (!loaded) return tl::unexpected(loaded.error());
    all.databases.push_back(std::move(*loaded));
  }
  all.traffic.only(options.ids);
  if (auto read = all.traffic.read(options.logs); !read) return read;
  const Traffic& traffic = all.traffic;
  tell("{}", printable_lines(traffic.notes()));
  tell("{} frames of {} identifiers in {:.0f} s{}\n", traffic.frames(), traffic.streams().size(),
       traffic.seconds(), traffic.thinned() ? "; a long log: part of it was looked at" : "");
  return {};
}

/// Uses the DBC files, and if these do not describe two gyros, trial of layouts.
void find_pair(Material& all) {
  all.messages = find_messages(all.traffic, all.databases);
  all.candidates = find_candidates(all.messages);
  all.choice = choose(all.candidates);
  if (all.choice.pair) return;
  all.guess = guess_messages(all.traffic, all.messages);
  const bool none = all.databases.empty();
  tell("{}; the layouts of {}{} identifiers are tried.\n",
       none ? "No DBC file is given" : "The DBC files describe no two gyros in this log",
       all.guess->streams, none ? "" : " other");
  add_guessed(all.candidates, *all.guess);
  all.choice = choose(all.candidates);
}

void print_candidates(const std::vector<Candidate>& candidates, const Choice& choice) {
  const std::size_t base = choice.pair ? choice.pair->first : choice.alone.value_or(0);
  tell("{:<40}{:>8}{:>11}{:>11}{:>8}{:>11}{:>9}\n", "signal that may be a rate", "Hz", "step",
       "noise", "corr.", "scale", "lag ms");
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& one = candidates[i];
    std::string figures;
    for (const PairFigures& pair : choice.pairs) {
      const bool forward = pair.first == base && pair.second == i;
      if (!forward && !(pair.second == base && pair.first == i)) continue;
      const analysis::Likeness& alike = pair.likeness;
      figures = fmt::format("{:>+8.3f}{:>+11.4g}{:>+9.1f}", alike.correlation,
                            forward ? alike.scale : 1.0 / alike.scale,
                            1e3 * (forward ? alike.lag_s : -alike.lag_s));
    }
    tell("{:<40}{:>8.1f}{:>11}{:>11.3g}{}\n", printable(one.place()),
         1.0 / std::max(one.figures.interval_s, 1e-6),
         one.series.step > 0.0 ? fmt::format("{:.3g}", one.series.step) : "float",
         one.figures.noise, figures);
    if (!one.why_not.empty()) tell("    left out: {}\n", printable(one.why_not));
  }
  if (!candidates.empty()) {
    tell("Steps and noise in deg/s{}; correlation, scale and lag against {}.\n\n",
         candidates.back().guessed ? ", without a DBC file in raw numbers" : "",
         printable(candidates[base].place()));
  }
}

Expected<void> write(const std::string& path, const std::string& text) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  file->write(text);
  return file->close();
}

int nothing_found(const Material& all) {
  const std::size_t guessed = all.candidates.size();
  return report(Error{
      "vgyro init",
      fmt::format("no signal of the DBC files looks like a rate of rotation in this log ({} of "
                  "{} identifiers are known to them), and no two fields of the others follow "
                  "one rotation{}",
                  all.messages.size(), all.traffic.streams().size(),
                  guessed == 0 ? "" : fmt::format(" ({} were looked at)", guessed)),
      "a log in which the platform turns to and fro, and the DBC files of the sensors: --dbc "
      "FILE (dbc/profiles has those of ten); `vgyro decode --dbc FILE LOG` shows what a file "
      "knows of it"});
}

int one_found(const std::string& name, const Material& all) {
  return report(Error{
      name,
      fmt::format("only one gyro was found, {}: nothing else in the log follows its rotation, and "
                  "vgyro needs two; the second [[gyro]] is a comment",
                  all.candidates[*all.choice.alone].place()),
      "a log in which the platform turns and both sensors send, and a DBC file of each; a "
      "gateway's "
      "copy of a gyro is not a second gyro. Is the second sensor on another bus, in a log of its "
      "own? "
      "Then name both logs"});
}

/// Writes the proposal, and the DBC file of guessed layouts.
Expected<void> write_all(const InitOptions& options, Material& all) {
  const std::string path = guess_path(options.output);
  const bool turned = options.turned_deg != 0.0;
  all.described = describe(all.candidates, all.choice, path,
                           turned ? std::optional(options.turned_deg) : std::nullopt);
  if (all.described) {
    if (options.output == "-") {
      return fail("-o -", "layouts were guessed, and the DBC file that describes them has no place",
                  "-o vgyro.toml writes it beside the configuration");
    }
    if (auto good = check_new(path, options.force); !good) return good;
    if (auto written = write(path, all.described->text); !written) return written;
    tell("{} describes the fields found by trial.\n", path);
  }
  const Circumstances circumstances =
      find_circumstances(all.messages, all.candidates, all.choice, all.traffic.begin_s());
  Proposal proposal{all.candidates,
                    all.choice,
                    all.messages,
                    circumstances,
                    all.traffic,
                    std::filesystem::path(options.output).parent_path().string(),
                    {},
                    {}};
  if (turned && all.choice.pair) {
    proposal.turn =
        Turn{options.turned_deg, turned_angle(all.candidates[all.choice.pair->first].series)};
  }
  if (all.described) proposal.remarks = all.described->remarks;
  return write(options.output, config_text(proposal));
}

}  // namespace

int run_init(const InitOptions& options) {
  if (const auto good = check_inputs(options); !good) return report(good.error());
  Material all;
  if (const auto good = read(options, all); !good) return report(good.error());
  find_pair(all);
  tell("\n");
  print_candidates(all.candidates, all.choice);
  const Choice& choice = all.choice;
  if (!choice.pair && !choice.alone) return nothing_found(all);
  if (const auto written = write_all(options, all); !written) return report(written.error());
  const std::string name = options.output == "-" ? "standard output" : options.output;
  if (!choice.pair) return one_found(name, all);
  tell(
      "Chosen: a = {}, b = {}. {} holds the proposal; look at the lines with CHECK, then\n"
      "    vgyro check {}\n",
      printable(all.candidates[choice.pair->first].place()),
      printable(all.candidates[choice.pair->second].place()), name,
      options.output == "-" ? "vgyro.toml" : options.output);
  return kDone;
}

}  // namespace vgyro::cli
