// vgyro: replays, checks, decodes and judges recordings of the gateway's CAN traffic.

#include <charconv>
#include <sstream>

#include <CLI/CLI.hpp>

#include "base/printable.h"
#include "base/spelling.h"
#include "can/frame.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/gap/accept.h"
#include "cli/number_option.h"
#include "cli/output/errors.h"
#include "cli/output/terminal.h"
#include "cli/output/unfinished.h"
#include "gateway/config.h"

namespace {

using namespace vgyro::cli;

struct Options {
  CheckOptions check;
  InitOptions init;
  DecodeOptions decode;
  ConvertOptions convert;
  ReplayOptions replay;
  AllanOptions allan;
  CompareOptions compare;
  GapOptions gap;
  FleetOptions fleet;
  SimulateOptions simulate;
  StatusOptions status;
  std::string method;
};

void add_overrides(CLI::App& command, std::string& method, std::optional<std::string>& model) {
  command.add_option("--method", method, "corrector instead of the configured one")
      ->check(CLI::IsMember({"optimal", "mutual", "mean"}));
  command.add_option("--model", model, "model file instead of the configured one");
}

constexpr const char* kLogHelp = "log of any known form, packed or not; - is standard input";

void add_logs(CLI::App& command, std::vector<std::string>& logs) {
  command
      .add_option("LOG", logs,
                  "logs of any known form, packed or not; several are merged by stamp;\n"
                  "- is standard input")
      ->required();
}

void add_digits(CLI::App& command, unsigned& digits) {
  command
      .add_option("--digits", digits,
                  "digits of a stamp's fraction, 6 or 9; default: as the log has them.\n"
                  "canplayer wants 6")
      ->check(CLI::IsMember({6, 9}));
}

CLI::App* add_check(CLI::App& app, CheckOptions& options, std::string& method) {
  CLI::App* command = app.add_subcommand(
      "check", "Explain a configuration before it is trusted: which bits are used");
  command->add_option("CONFIG", options.config, "configuration, e.g. vgyro.toml")->required();
  add_overrides(*command, method, options.model);
  return command;
}

void read_ids(const std::vector<std::string>& words, std::vector<std::uint32_t>& ids) {
  for (const std::string& word : words) {
    std::string_view digits = word;
    if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
    std::uint32_t id = 0;
    const char* end = digits.data() + digits.size();
    const auto [at, code] = std::from_chars(digits.data(), end, id, 16);
    if (code != std::errc() || at != end || id > vgyro::can::kExtendedIdMax) {
      throw CLI::ValidationError("--id",
                                 fmt::format("\"{}\" is no identifier in hexadecimal digits, "
                                             "such as 1A4 or 18F02A0B",
                                             vgyro::printable(word)));
    }
    ids.push_back(id);
  }
}

CLI::App* add_init(CLI::App& app, InitOptions& options) {
  CLI::App* command = app.add_subcommand(
      "init", "Propose a configuration from a log: which two signals are the gyros");
  command->add_option("--dbc", options.dbc_files, "DBC file; may be given several times")
      ->allow_extra_args(false);
  command->add_option("-o,--output", options.output, "configuration; - is standard output")
      ->capture_default_str();
  command->add_flag("--force", options.force, "replaces a file that is there already");
  command
      ->add_option_function<std::vector<std::string>>(
          "--id",
          [&options](const std::vector<std::string>& words) { read_ids(words, options.ids); },
          "identifier (hex) to look at; may be given several times; without it all are")
      ->allow_extra_args(false);
  constexpr double kTurnedMost_deg = 1e6;
  add_number(
      *command, "--turned", options.turned_deg, {-kTurnedMost_deg, kTurnedMost_deg},
      "degrees by which the platform turned in the whole log, positive to the left; 0: not known");
  command->add_option("LOG", options.logs, "log in which both gyros turn; also DBC files")
      ->required();
  command->footer("Example: vgyro init drive.log --dbc car.dbc --dbc imu.dbc -o vgyro.toml");
  return command;
}

// What ends in .dbc among the logs is a DBC file.
void sort_init_files(InitOptions& options) {
  const auto is_dbc = [](const std::string& name) { return name.ends_with(".dbc"); };
  std::copy_if(options.logs.begin(), options.logs.end(), std::back_inserter(options.dbc_files),
               is_dbc);
  std::erase_if(options.logs, is_dbc);
}

CLI::App* add_decode(CLI::App& app, DecodeOptions& options) {
  CLI::App* command = app.add_subcommand(
      "decode", "Show what DBC files know of a log, frame by frame, as JSON lines");
  command->add_option("--dbc", options.dbc_files, "DBC file; may be given several times")
      ->required()
      ->allow_extra_args(false);
  command->add_flag("--text", options.text, "lines for people instead of JSON");
  add_logs(*command, options.logs);
  command->footer("Live monitor: candump -L can0 | vgyro decode --dbc vgyro.dbc --text -");
  return command;
}

CLI::App* add_convert(CLI::App& app, ConvertOptions& options) {
  CLI::App* command = app.add_subcommand(
      "convert", "Read logs of any known form and write one that other tools read");
  command
      ->add_option("-o,--output", options.output,
                   "the ending says the form: .log (candump), .asc, .blf (Vector); text\nalso "
                   "packed: .log.gz, .log.xz, .log.zst; - is a candump log on\nstandard output")
      ->required();
  add_digits(*command, options.digits);
  command->add_flag("-q,--quiet", options.quiet, "no summary on stderr");
  add_logs(*command, options.logs);
  command->footer(
      "Which tool reads what is in docs/log-format.md.\n"
      "Example: vgyro convert -o drive.log.xz drive.asc");
  return command;
}

CLI::App* add_replay(CLI::App& app, ReplayOptions& options, std::string& method) {
  CLI::App* command = app.add_subcommand(
      "replay", "Run the gateway over recorded traffic, as fast as the machine can");
  command->add_option("--config", options.config, "configuration, e.g. vgyro.toml")->required();
  add_overrides(*command, method, options.model);
  command->add_option("--state", options.state,
                      "starts with the biases that vgyrod kept in this file; it is only read");
  command->add_option("-o,--output", options.output,
                      "output frames as candump lines; default: standard output");
  command->add_option("--json", options.json, "summary as JSON; - is standard output");
  command->add_option("--csv", options.csv,
                      "rates, sigmas, biases and heading as a table; - is standard output");
  command->add_option("--plot", options.plot, "picture of rates and drifts: .svg, .png or .pdf");
  command
      ->add_option("--map", options.bus_map,
                   "LOGNAME=CONFIGNAME: the log's interface for one of the configuration;\n"
                   "may be given several times")
      ->allow_extra_args(false);
  command->add_flag("-q,--quiet", options.quiet, "no summary on stderr");
  add_digits(*command, options.digits);
  add_logs(*command, options.logs);
  command->footer(
      "The same input gives the same bytes out, on every run.\n"
      "Example: vgyro replay --config vgyro.toml -o out.log --plot drift.svg drive.log.xz");
  return command;
}

CLI::App* add_model(CLI::App& app) {
  CLI::App* command = app.add_subcommand("model", "What a model file may hold: model list");
  command->add_subcommand("list", "every kind of effect, its parameters and their limits");
  command->require_subcommand(1);
  return command;
}

CLI::App* add_simulate(CLI::App& app, SimulateOptions& options) {
  CLI::App* command = app.add_subcommand(
      "simulate", "Play a motion through a model: what such gyros would have recorded");
  command->add_option("--config", options.config, "configuration, e.g. vgyro.toml")->required();
  command->add_option("--model", options.model, "model file: what the gyros' errors are")
      ->required();
  command
      ->add_option("--profile", options.profile,
                   "motion, CSV: t_s,rate_dps[,temperature_c][,acc_x_g,acc_y_g,acc_z_g][,supply_v]"
                   "[,rate_x_dps,rate_y_dps,rate_z_dps]")
      ->required();
  add_number(*command, "--seed", options.seed, {}, "of the noise; the same gives the same bytes");
  command->add_option("-o,--output", options.output, "candump log; - is standard output")
      ->capture_default_str();
  const NumberRange<double> rates{0.1, 10'000.0};
  add_numbers(*command, "--gyro-rate", options.gyro_rates_hz, 2, rates,
              "samples a second, of both or A,B");
  add_number(*command, "--reference-rate", options.reference_rate_hz, rates, "samples a second");
  add_number(*command, "--accelerometer-rate", options.accelerometer_rate_hz, rates,
             "samples a second");
  add_number(*command, "--jitter", options.jitter_s, {0.0, 1.0},
             "every frame is late by |N(0, jitter)| seconds");
  add_number(*command, "--start", options.start_s, {0.0, 4e9},
             "stamp of the motion's beginning, seconds");
  command->add_flag("-q,--quiet", options.quiet, "no summary on stderr");
  command->footer(
      "The forms of the files are in docs/simulate.md and docs/model-file.md.\n"
      "Example: vgyro simulate --config vgyro.toml --model model.toml --profile turns.csv -o "
      "out.log");
  return command;
}

void add_axis(CLI::App& command, std::string& axis) {
  command
      .add_option("--axis", axis,
                  "of whole units only the pair about the vehicle's x, y or z;\n"
                  "without it all, one after the other")
      ->check(CLI::IsMember({"x", "y", "z"}));
}

CLI::App* add_allan(CLI::App& app, AllanOptions& options) {
  CLI::App* command =
      app.add_subcommand("allan", "Measure the gyros' noise (Allan deviation); recommend a window");
  command->add_option("--config", options.config, "configuration, e.g. vgyro.toml")->required();
  command->add_option("--json", options.json, "figures as JSON; - is standard output");
  command->add_option("--plot", options.plot,
                      "picture of the curves: .svg, .png or .pdf; of several axes one each,\n"
                      "allan-x.svg ... of allan.svg");
  command->add_option("--evidence", options.evidence,
                      "noise and biases, for vgyro fleet: one JSON line");
  add_axis(*command, options.axis);
  add_logs(*command, options.logs);
  command->footer(
      "Best on an hour or more at rest; what the figures mean is in docs/allan.md.\n"
      "Example: vgyro allan --config vgyro.toml --plot allan.svg rest.log.xz");
  return command;
}

void add_recording(CLI::App& command, std::string& config, std::vector<std::string>& measured,
                   std::string& axis) {
  command.add_option("--config", config, "configuration, e.g. vgyro.toml")->required();
  command
      .add_option("--measured", measured,
                  std::string(kLogHelp) + ";\nagain for a further recording of the same pair")
      ->required()
      ->allow_extra_args(false);
  add_axis(command, axis);
}

CLI::App* add_compare(CLI::App& app, CompareOptions& options) {
  CLI::App* command = app.add_subcommand(
      "compare", "Say how far a model's simulation and a recording disagree, and where");
  add_recording(*command, options.config, options.measured, options.axis);
  command->add_option("--model", options.model, "model file")->required();
  command->add_option("--json", options.json, "the same as JSON; - is standard output");
  add_number(*command, "--seed", options.seed, {}, "of the simulations");
  command->add_flag("-q,--quiet", options.quiet, "no table");
  command->footer(
      "Changes nothing. What the gap means is in docs/gap.md.\n"
      "Example: vgyro compare --config vgyro.toml --model model.toml --measured drive.log.xz");
  return command;
}

// Longer nobody waits.
constexpr double kTimeLimitMax_s = 1e6;

// Empty for a good one, as CLI11 wants it.
std::string wrong_acceptance(const std::string& word) {
  const auto acceptance = acceptance_from(word);
  if (acceptance) return {};
  return acceptance.error().what + "; " + acceptance.error().remedy;
}

CLI::App* add_gap(CLI::App& app, GapOptions& options) {
  CLI::App* command =
      app.add_subcommand("gap", "Find what the model lacks, name it, add it, show the gap shrink");
  add_recording(*command, options.config, options.measured, options.axis);
  command->add_option("--model", options.model,
                      "model file to begin with; default: the configured one, or none");
  command->add_option("--out", options.out, "folder for report.html, gap.json and model.toml")
      ->required();
  command
      ->add_option("--accept", options.accept,
                   "of ambiguous readings apply that of gyro=N, of kind=KIND, of both with\n"
                   "a comma between, or the likeliest; may be given again")
      ->allow_extra_args(false)
      ->check(wrong_acceptance);
  command->add_option("--evidence", options.evidence,
                      "what this recording says, for vgyro fleet: one JSON line");
  add_number(*command, "--time-limit", options.time_limit_s, {0.0, kTimeLimitMax_s},
             "after so many seconds what is certain is written; 0: no limit");
  add_number(*command, "--seed", options.seed, {}, "of the simulations");
  command->add_flag("-q,--quiet", options.quiet, "no summary");
  command->footer(
      "The folder is written whole or not at all; an earlier result in it is replaced.\n"
      "How to read the result is in docs/gap.md.\n"
      "Example: vgyro gap --config vgyro.toml --measured drive.log.xz --out found");
  return command;
}

CLI::App* add_fleet(CLI::App& app, FleetOptions& options) {
  CLI::App* command = app.add_subcommand(
      "fleet", "Pool the evidence of many drives: what types have, which units go bad");
  command
      ->add_option("EVIDENCE", options.evidence,
                   "files that vgyro gap, vgyro allan or vgyro fleet left;\nof a folder all *.json")
      ->required();
  command
      ->add_option("--out", options.out,
                   "folder for report.html, fleet.json, evidence.json and models/")
      ->required();
  constexpr double kFalseMost = 0.5;
  add_number(*command, "--false-names", options.false_names, {1e-9, kFalseMost},
             "share of all names that may be false, on average");
  command->add_flag("-q,--quiet", options.quiet, "no summary");
  command->footer(
      "evidence.json in the folder is all of it merged, and may be merged again.\n"
      "What is computed, and what a name means, is in docs/fleet.md.\n"
      "Example: vgyro fleet evidence/ --out fleet");
  return command;
}

CLI::App* add_status(CLI::App& app, StatusOptions& options) {
  CLI::App* command =
      app.add_subcommand("status", "Show what the running gateway knows: state, gyros, buses");
  CLI::Option* json = command->add_flag("--json", options.json, "the same as JSON");
  command->add_flag("-w,--watch", options.watch, "a live view; into a pipe: one line each time")
      ->excludes(json);
  add_number(*command, "--interval", options.interval_s, {0.1, 3600.0},
             "seconds between two looks with --watch");
  command->footer("Asks vgyrod over D-Bus. Every field is explained in docs/service.md.");
  return command;
}

CLI::App* add_recalibrate(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "recalibrate", "Let the running gateway forget its biases and calibrate anew");
  command->footer("Only for root. Platform at rest, unless a reference is configured.");
  return command;
}

// CLI11 would only say that a subcommand is missing.
std::optional<vgyro::Error> unknown_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return std::nullopt;
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  const std::string name = argv[1];
  if (std::find(names.begin(), names.end(), name) != names.end()) return std::nullopt;
  return vgyro::Error{"vgyro", "there is no command \"" + name + "\"",
                      vgyro::suggest_name(name, names)};
}

// The exit code of the command, or of what the command line is instead of one.
int run(int argc, char** argv) {
  CLI::App app{"vgyro: two gyros on CAN in, one better gyro out"};
  app.set_version_flag("--version", "vgyro " VGYRO_VERSION);
  app.require_subcommand(1);
  app.footer("Exit codes: 0 done, 1 bad input (told on stderr), 2 wrong usage.");
  Options options;
  CLI::App* check = add_check(app, options.check, options.method);
  CLI::App* init = add_init(app, options.init);
  CLI::App* decode = add_decode(app, options.decode);
  CLI::App* convert = add_convert(app, options.convert);
  CLI::App* replay = add_replay(app, options.replay, options.method);
  CLI::App* model = add_model(app);
  CLI::App* allan = add_allan(app, options.allan);
  CLI::App* compare = add_compare(app, options.compare);
  CLI::App* gap = add_gap(app, options.gap);
  CLI::App* fleet = add_fleet(app, options.fleet);
  CLI::App* simulate = add_simulate(app, options.simulate);
  CLI::App* status = add_status(app, options.status);
  CLI::App* recalibrate = add_recalibrate(app);
  if (const auto unknown = unknown_command(app, argc, argv)) {
    report(*unknown);
    return kWrongUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::ostringstream out;
    std::ostringstream complaint;
    const int code = app.exit(error, out, complaint);
    put_text(stdout, out.str());
    put_text(stderr, complaint.str());
    return code == 0 ? kDone : kWrongUsage;
  }
  const auto method = vgyro::gateway::method_from(options.method);
  options.check.method = method;
  options.replay.method = method;
  if (check->parsed()) return run_check(options.check);
  if (init->parsed()) {
    sort_init_files(options.init);
    return run_init(options.init);
  }
  if (decode->parsed()) return run_decode(options.decode);
  if (convert->parsed()) return run_convert(options.convert);
  if (model->parsed()) return run_model_list();
  if (allan->parsed()) return run_allan(options.allan);
  if (compare->parsed()) return run_compare(options.compare);
  if (gap->parsed()) return run_gap(options.gap);
  if (fleet->parsed()) return run_fleet(options.fleet);
  if (simulate->parsed()) return run_simulate(options.simulate);
  if (status->parsed()) return run_status(options.status);
  if (recalibrate->parsed()) return run_recalibrate();
  // Frames are the main result; they give way only to a summary or a table that wants the same
  // place.
  const bool output_given = replay->count("--output") > 0;
  const bool stdout_taken = options.replay.json == "-" || options.replay.csv == "-";
  if (!output_given && !stdout_taken) options.replay.output = "-";
  return run_replay(options.replay);
}

}  // namespace

int main(int argc, char** argv) {
  keep_standard_streams();
  guard_unfinished();
  const int code = run(argc, argv);
  const auto finished = finish_output();
  if (!finished) report(finished.error());
  return code == kDone && !finished ? kBadInput : code;
}
