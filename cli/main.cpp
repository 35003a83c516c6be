// vgyro: replays, checks, decodes and judges recordings of the gateway's CAN traffic.

#include <charconv>
#include <sstream>

#include <CLI/CLI.hpp>

#include "base/instance_name.h"
#include "base/printable.h"
#include "base/spelling.h"
#include "can/frame.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/gap/accept.h"
#include "cli/gap/provenance.h"
#include "cli/gyro_names.h"
#include "cli/number_option.h"
#include "cli/output/errors.h"
#include "cli/output/terminal.h"
#include "cli/output/unfinished.h"
#include "cli/usage.h"
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
  WhichGateway recalibrate;
  WhichGateway capture;
  std::string method;
};

void add_overrides(CLI::App& command, std::string& method, std::optional<std::string>& model) {
  command.add_option("--method", method, "corrector instead of the configured one")
      ->check(CLI::IsMember({"optimal", "mutual", "mean"}));
  command.add_option("--model", model, "model file instead of the configured one");
}

constexpr const char* kLogHelp = "log in any known form, packed or not; - is standard input";

void add_logs(CLI::App& command, std::vector<std::string>& logs) {
  command
      .add_option("LOG", logs,
                  "logs in any known form, packed or not; several are merged by stamp;\n"
                  "- is standard input")
      ->required();
}

void add_digits(CLI::App& command, unsigned& digits) {
  command
      .add_option("--digits", digits,
                  "digits of a stamp's fraction, 6 or 9; default: as in the log.\n"
                  "canplayer needs 6")
      ->check(CLI::IsMember({6, 9}));
}

CLI::App* add_check(CLI::App& app, CheckOptions& options, std::string& method) {
  CLI::App* command =
      app.add_subcommand("check", "Show how a configuration is understood, down to the bits");
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
  command->add_option("--dbc", options.dbc_files, "DBC file; may be repeated")
      ->allow_extra_args(false);
  command->add_option("-o,--output", options.output, "configuration; - is standard output")
      ->capture_default_str();
  command->add_flag("--force", options.force, "replace existing files");
  command
      ->add_option_function<std::vector<std::string>>(
          "--id",
          [&options](const std::vector<std::string>& words) { read_ids(words, options.ids); },
          "identifier (hex) to examine; may be repeated; default: all")
      ->allow_extra_args(false);
  constexpr double kTurnedMost_deg = 1e6;
  add_number(*command, "--turned", options.turned_deg, {-kTurnedMost_deg, kTurnedMost_deg},
             "angle that the platform turned in the whole log, deg, positive to the left;\n0: "
             "unknown");
  command->add_option("LOG", options.logs, "logs in which both gyros turn; also DBC files")
      ->required();
  command->footer("Example: vgyro init drive.log --dbc car.dbc --dbc imu.dbc -o vgyro.toml");
  return command;
}

// A name that ends in .dbc among the logs is a DBC file.
void sort_init_files(InitOptions& options) {
  const auto is_dbc = [](const std::string& name) { return name.ends_with(".dbc"); };
  std::copy_if(options.logs.begin(), options.logs.end(), std::back_inserter(options.dbc_files),
               is_dbc);
  std::erase_if(options.logs, is_dbc);
}

CLI::App* add_decode(CLI::App& app, DecodeOptions& options) {
  CLI::App* command =
      app.add_subcommand("decode", "Decode a log with DBC files, frame by frame, as JSON lines");
  command->add_option("--dbc", options.dbc_files, "DBC file; may be repeated")
      ->required()
      ->allow_extra_args(false);
  command->add_flag("--text", options.text, "lines for people instead of JSON");
  add_logs(*command, options.logs);
  command->footer("Live monitor: candump -L can0 | vgyro decode --dbc vgyro.dbc --text -");
  return command;
}

CLI::App* add_convert(CLI::App& app, ConvertOptions& options) {
  CLI::App* command = app.add_subcommand(
      "convert", "Convert logs of any known form into one that other tools read");
  command
      ->add_option(
          "-o,--output", options.output,
          "output; its ending sets the form: .log (candump), .asc, .blf (Vector);\ntext may be "
          "packed: .log.gz, .log.xz, .log.zst; - is a candump log on\nstandard output")
      ->required();
  add_digits(*command, options.digits);
  command->add_flag("-q,--quiet", options.quiet, "no summary on stderr");
  add_logs(*command, options.logs);
  command->footer(
      "vgyro(1) names the forms.\n"
      "Example: vgyro convert -o drive.log.xz drive.asc");
  return command;
}

CLI::App* add_replay(CLI::App& app, ReplayOptions& options, std::string& method) {
  CLI::App* command = app.add_subcommand(
      "replay", "Run the gateway over recorded traffic, as fast as the machine can");
  command->add_option("--config", options.config, "configuration, e.g. vgyro.toml")->required();
  add_overrides(*command, method, options.model);
  command->add_option("--state", options.state,
                      "start with the biases in this state file of vgyrod; it is not changed");
  command->add_option("-o,--output", options.output,
                      "output frames as candump lines; default: standard output");
  command->add_option("--json", options.json, "summary as JSON; - is standard output");
  command->add_option("--csv", options.csv,
                      "rates, sigmas, biases and heading as CSV; - is standard output");
  command->add_option("--plot", options.plot, "picture of rates and drifts: .svg, .png or .pdf");
  command->add_option("--html", options.html,
                      "the same as one web page that zooms; - is standard output");
  command
      ->add_option("--map", options.bus_map,
                   "LOGNAME=CONFIGNAME: use the log's interface for one of the\n"
                   "configuration; may be repeated")
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
  CLI::App* command = app.add_subcommand("model", "List what a model file may contain: model list");
  command->add_subcommand("list", "every kind of effect, its parameters and their limits");
  command->require_subcommand(1);
  return command;
}

CLI::App* add_simulate(CLI::App& app, SimulateOptions& options) {
  CLI::App* command = app.add_subcommand(
      "simulate", "Simulate a recording: a motion as seen by gyros with a model's errors");
  command->add_option("--config", options.config, "configuration, e.g. vgyro.toml")->required();
  command->add_option("--model", options.model, "model file with the gyros' errors")->required();
  command
      ->add_option("--profile", options.profile,
                   "motion, CSV: t_s,rate_dps[,temperature_c][,acc_x_g,acc_y_g,acc_z_g][,supply_v]"
                   "[,rate_x_dps,rate_y_dps,rate_z_dps]")
      ->required();
  add_number(*command, "--seed", options.seed, {},
             "seed of the noise; the same seed gives the same bytes");
  command->add_option("-o,--output", options.output, "candump log; - is standard output")
      ->capture_default_str();
  const NumberRange<double> rates{0.1, 10'000.0};
  add_numbers(*command, "--gyro-rate", options.gyro_rates_hz, 2, rates,
              "samples per second, for both or as A,B");
  add_number(*command, "--reference-rate", options.reference_rate_hz, rates, "samples per second");
  add_number(*command, "--accelerometer-rate", options.accelerometer_rate_hz, rates,
             "samples per second");
  add_number(*command, "--jitter", options.jitter_s, {0.0, 1.0},
             "every frame is late by |N(0, jitter)| seconds");
  add_number(*command, "--start", options.start_s, {0.0, 4e9},
             "stamp at which the motion begins, seconds");
  command->add_flag("-q,--quiet", options.quiet, "no summary on stderr");
  command->footer(
      "vgyro(1) describes the files; `vgyro model list` shows what a model may hold.\n"
      "Example: vgyro simulate --config vgyro.toml --model model.toml --profile turns.csv -o "
      "out.log");
  return command;
}

void add_axis(CLI::App& command, std::string& axis) {
  command
      .add_option("--axis", axis,
                  "for whole units: only the pair about the vehicle's x, y or z;\n"
                  "default: all, one after the other")
      ->check(CLI::IsMember({"x", "y", "z"}));
}

CLI::App* add_allan(CLI::App& app, AllanOptions& options) {
  CLI::App* command =
      app.add_subcommand("allan", "Measure the gyros' noise (Allan deviation); recommend a window");
  command->add_option("--config", options.config, "configuration, e.g. vgyro.toml")->required();
  command->add_option("--json", options.json, "figures as JSON; - is standard output");
  command->add_option("--plot", options.plot,
                      "plot of the curves: .svg, .png or .pdf; one per axis for whole units,\n"
                      "allan-x.svg ... for allan.svg");
  command->add_option("--evidence", options.evidence,
                      "noise and biases, for vgyro fleet: one JSON line");
  add_axis(*command, options.axis);
  add_logs(*command, options.logs);
  command->footer(
      "Best on an hour or more at rest; see vgyro(1).\n"
      "Example: vgyro allan --config vgyro.toml --plot allan.svg rest.log.xz");
  return command;
}

void add_recording(CLI::App& command, std::string& config, std::vector<std::string>& measured,
                   std::string& axis) {
  command.add_option("--config", config, "configuration, e.g. vgyro.toml")->required();
  command
      .add_option(
          "--measured", measured,
          std::string(kLogHelp) + ";\nmay be repeated for further recordings of the same pair")
      ->required()
      ->allow_extra_args(false);
  add_axis(command, axis);
}

CLI::App* add_compare(CLI::App& app, CompareOptions& options) {
  CLI::App* command =
      app.add_subcommand("compare", "Measure how far a model and a recording disagree, and where");
  add_recording(*command, options.config, options.measured, options.axis);
  command->add_option("--model", options.model, "model file")->required();
  command->add_option("--json", options.json, "the same as JSON; - is standard output");
  add_number(*command, "--seed", options.seed, {}, "seed of the simulations");
  command->add_flag("-q,--quiet", options.quiet, "no table");
  command->footer(
      "Changes nothing; see vgyro(1).\n"
      "Example: vgyro compare --config vgyro.toml --model model.toml --measured drive.log.xz");
  return command;
}

// Longest time limit.
constexpr double kTimeLimitMax_s = 1e6;

// Empty for a valid word, as CLI11 requires.
std::string wrong_acceptance(const std::string& word) {
  const auto numbered = with_gyro_numbers(word, {.names = {}, .any = true});
  const auto acceptance = acceptance_from(numbered ? *numbered : word);
  if (acceptance) return {};
  return acceptance.error().what + "; " + acceptance.error().remedy;
}

// A configuration that cannot be read is left to the command, which reports it.
vgyro::Expected<void> number_gyros(GapOptions& options) {
  if (options.accept.empty()) return {};
  const auto loaded = vgyro::gateway::load_config(options.config);
  if (!loaded) return {};
  const auto& gyros = loaded->plan.gyros;
  for (std::string& word : options.accept) {
    const auto numbered = with_gyro_numbers(word, {.names = {gyros[0].name, gyros[1].name}});
    if (!numbered) return tl::unexpected(numbered.error());
    word = *numbered;
  }
  return {};
}

int number_and_run(GapOptions& options) {
  if (const auto numbered = number_gyros(options); !numbered) {
    report(numbered.error());
    return kWrongUsage;
  }
  return run_gap(options);
}

CLI::App* add_gap(CLI::App& app, GapOptions& options) {
  CLI::App* command =
      app.add_subcommand("gap", "Find the effects that a model lacks, and add them");
  add_recording(*command, options.config, options.measured, options.axis);
  command->add_option("--model", options.model,
                      "model file to start from; default: the configured one, or none");
  command->add_option("--out", options.out, "folder for report.html, gap.json and model.toml")
      ->required();
  command
      ->add_option("--accept", options.accept,
                   "explanation of an ambiguous effect to apply: gyro=N or gyro=NAME,\n"
                   "kind=KIND, both with a comma between, or likeliest; may be repeated")
      ->allow_extra_args(false)
      ->check(wrong_acceptance);
  command->add_option("--evidence", options.evidence,
                      "evidence of this recording, for vgyro fleet: one JSON line");
  add_number(*command, "--time-limit", options.time_limit_s, {0.0, kTimeLimitMax_s},
             "stop after this many seconds and write what is certain; 0: no limit");
  add_number(*command, "--seed", options.seed, {}, "seed of the simulations");
  command->add_flag("-q,--quiet", options.quiet, "no summary");
  command->footer(
      "The folder is written whole or not at all; an earlier result in it is replaced.\n"
      "vgyro(1) explains the result.\n"
      "Example: vgyro gap --config vgyro.toml --measured drive.log.xz --out found");
  return command;
}

CLI::App* add_fleet(CLI::App& app, FleetOptions& options) {
  CLI::App* command = app.add_subcommand(
      "fleet", "Pool the evidence of many drives: what types have, which units degrade");
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
      "What is computed, and what a name means, is in vgyro(1).\n"
      "Example: vgyro fleet evidence/ --out fleet");
  return command;
}

CLI::Option* add_which(CLI::App& command, WhichGateway& which) {
  CLI::Option* instance =
      command.add_option("--instance", which.instance, "of several gateways: vgyrod@NAME")
          ->type_name("NAME")
          ->check([](const std::string& name) {
            const auto good = vgyro::check_instance_name(name);
            return good ? std::string() : good.error().message();
          });
  return command.add_flag("--all", which.all, "every gateway that is on D-Bus")->excludes(instance);
}

CLI::App* add_status(CLI::App& app, StatusOptions& options) {
  CLI::App* command =
      app.add_subcommand("status", "Show the running gateway's state, gyros and buses");
  CLI::Option* json = command->add_flag("--json", options.json, "the same as JSON");
  command->add_flag("-w,--watch", options.watch, "live view; into a pipe: one line per update")
      ->excludes(json)
      ->excludes(add_which(*command, options.which));
  add_number(*command, "--interval", options.interval_s, {0.1, 3600.0},
             "seconds between updates with --watch");
  command->footer("Asks vgyrod over D-Bus; see vgyro(1).");
  return command;
}

CLI::App* add_recalibrate(CLI::App& app, WhichGateway& which) {
  CLI::App* command = app.add_subcommand(
      "recalibrate", "Make the running gateway discard its biases and calibrate again");
  add_which(*command, which);
  command->footer("For root only. Keep the platform at rest unless a reference is configured.");
  return command;
}

CLI::App* add_capture(CLI::App& app, WhichGateway& which) {
  CLI::App* command = app.add_subcommand(
      "capture", "Make the running gateway write the last minutes of its inputs");
  add_which(*command, which);
  command->footer(
      "For root only. Prints the folder with the recording. The gateway must run with --capture,\n"
      "see vgyrod(8).");
  return command;
}

// CLI11 would only report that a subcommand is missing.
std::optional<vgyro::Error> unknown_command(const CLI::App& app,
                                            const std::vector<std::string>& words) {
  if (words.empty() || words[0].starts_with('-')) return std::nullopt;
  std::vector<std::string> names{"help"};
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), words[0]) != names.end()) return std::nullopt;
  return vgyro::Error{"vgyro",
                      fmt::format("there is no command \"{}\"", vgyro::printable(words[0])),
                      vgyro::suggest_name(words[0], names)};
}

// `vgyro help replay` is `vgyro replay --help`.
std::vector<std::string> words_of(int argc, char** argv) {
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  if (words.empty() || words[0] != "help") return words;
  words.erase(words.begin());
  words.emplace_back("--help");
  return words;
}

// Parses the command line. Returns an exit code if nothing is left to do: help was printed, or the
// usage is wrong.
std::optional<int> parse_words(CLI::App& app, std::vector<std::string> words) {
  try {
    std::reverse(words.begin(), words.end());  // CLI11 takes them from the back
    app.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) {
      report(usage_error(app, error));
      return kWrongUsage;
    }
    std::ostringstream out;
    app.exit(error, out, out);
    put_text(stdout, out.str());
    return kDone;
  }
  return std::nullopt;
}

// Returns the exit code of the command, or of help or wrong usage.
int run(int argc, char** argv) {
  CLI::App app{"vgyro: two gyros on CAN in, one better gyro out", "vgyro"};
  app.set_version_flag("--version", "vgyro " VGYRO_VERSION);
  app.require_subcommand(1);
  app.footer(
      "`vgyro help COMMAND` explains a command; the manual is vgyro(1).\n"
      "Exit codes: 0 done, 1 bad input (see stderr), 2 wrong usage.");
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
  CLI::App* recalibrate = add_recalibrate(app, options.recalibrate);
  CLI::App* capture = add_capture(app, options.capture);
  std::vector<std::string> words = words_of(argc, argv);
  if (const auto unknown = unknown_command(app, words)) {
    report(*unknown);
    return kWrongUsage;
  }
  options.gap.command = command_text(words);
  if (const auto answered = parse_words(app, std::move(words))) return *answered;
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
  if (gap->parsed()) return number_and_run(options.gap);
  if (fleet->parsed()) return run_fleet(options.fleet);
  if (simulate->parsed()) return run_simulate(options.simulate);
  if (status->parsed()) return run_status(options.status);
  if (recalibrate->parsed()) return run_recalibrate(options.recalibrate);
  if (capture->parsed()) return run_capture(options.capture);
  // Frames are the main result: they go to standard output unless a summary or a table does.
  const bool output_given = replay->count("--output") > 0;
  const bool stdout_taken =
      options.replay.json == "-" || options.replay.csv == "-" || options.replay.html == "-";
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
