#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "base/instance_name.h"
#include "base/printable.h"
#include "base/spelling.h"
#include "daemon/capture.h"
#include "daemon/gateway_loop.h"
#include "daemon/log.h"
#include "daemon/metrics.h"
#include "daemon/plan_loader.h"
#include "daemon/state_keeper.h"
#include "gateway/config.h"

namespace {

constexpr int kDone = 0;
constexpr int kBadInput = 1;
constexpr int kWrongUsage = 2;
constexpr int kSystemTrouble = 3;

// Two gyros at 500 Hz fill 4 MB in ten minutes. Only a capture writes to a vehicle computer's
// memory card, which keeps some weeks of captures.
constexpr double kCaptureMinutes = 10.0;
constexpr double kCaptureMemory_mib = 16.0;
constexpr double kCaptureDisk_mib = 256.0;
constexpr int kCaptureKeep = 20;
// An intermittent fault makes 24 captures a day, not thousands.
constexpr double kCaptureInterval_min = 60.0;
// A number beyond these limits is taken for a typing error.
constexpr double kMinutesMost = 1440.0;
constexpr double kMemoryMost_mib = 4096.0;
constexpr double kDiskMost_mib = 1'048'576.0;
constexpr int kKeepMost = 10'000;
constexpr double kIntervalMost_min = 10'080.0;
constexpr double kMebibyte = 1'048'576.0;
constexpr double kSecondsPerMinute = 60.0;

struct CaptureOptions {
  std::string directory;  ///< empty: nothing is recorded
  double minutes = kCaptureMinutes;
  double memory_mib = kCaptureMemory_mib;
  double disk_mib = kCaptureDisk_mib;
  int keep = kCaptureKeep;
  double interval_min = kCaptureInterval_min;
};

struct Options {
  std::string config;
  std::string method;
  std::optional<std::string> model;
  std::string state;
  bool forget = false;
  std::string metrics;
  std::string instance;
  CaptureOptions capture;
};

// An unknown option is reported first: it is often the reason why another one is missing.
std::string usage_text(const CLI::App& app, const CLI::ParseError& error) {
  const std::string help = "; see `vgyrod --help`";
  std::vector<std::string> known;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames())
      known.push_back("--" + name);
  }
  if (const auto unknown = vgyro::unknown_option(app.remaining(), known)) {
    return "vgyrod: there is no option " + vgyro::printable(unknown->name) +
           (unknown->near ? "; did you mean " + *unknown->near + "?" : help);
  }
  return "vgyrod: " + vgyro::printable(error.what()) + help;
}

// systemd names the directories that it made for the service; the first one is used.
std::string in_directory(const char* variable, const char* file) {
  const char* directories = std::getenv(variable);  // NOLINT(concurrency-mt-unsafe): at start
  if (directories == nullptr || *directories == '\0') return {};
  const std::string_view all(directories);
  return std::string(all.substr(0, all.find(':'))) + '/' + file;
}

// A relative path is in the service's state directory, so that one line is right for every
// instance.
std::string capture_directory(const std::string& given) {
  if (given.empty() || given.front() == '/') return given;
  const std::string in_state = in_directory("STATE_DIRECTORY", given.c_str());
  return in_state.empty() ? given : in_state;
}

vgyro::daemon::Capture::Options capture_options(const Options& options) {
  const CaptureOptions& capture = options.capture;
  return {.directory = capture_directory(capture.directory),
          .instance = options.instance,
          .ring = {.seconds = static_cast<std::int64_t>(capture.minutes * kSecondsPerMinute),
                   .bytes = static_cast<std::size_t>(capture.memory_mib * kMebibyte)},
          .disk = {.count = static_cast<std::size_t>(capture.keep),
                   .bytes = static_cast<std::uint64_t>(capture.disk_mib * kMebibyte)},
          .interval_s = static_cast<int>(capture.interval_min * kSecondsPerMinute)};
}

vgyro::TimePoint wall_now() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return vgyro::TimePoint{std::chrono::duration_cast<vgyro::Duration>(now)};
}

int run(const Options& options, vgyro::daemon::Log& log) {
  const vgyro::daemon::LoadPlan load = [options] {
    return vgyro::daemon::load_with_fingerprint(
        options.config, {vgyro::gateway::method_from(options.method), options.model});
  };
  vgyro::daemon::LoadResult loaded = vgyro::daemon::load_or_refuse(load);
  if (loaded) {
    vgyro::daemon::set_log_level(*loaded, log);
    log.info("vgyrod {} starts with {}, fingerprint {}", VGYRO_VERSION,
             vgyro::printable(options.config), loaded->fingerprint);
  }
  vgyro::daemon::tell_config(loaded, log);
  if (!loaded) return kBadInput;
  std::optional<vgyro::daemon::StateKeeper> keeper;
  if (!options.state.empty()) keeper.emplace(options.state, log);
  if (keeper) {
    if (const vgyro::Expected<void> locked = keeper->lock(); !locked) {
      log.error("{}", locked.error().message());
      return kBadInput;
    }
    if (options.forget) keeper->forget();
  }
  std::optional<vgyro::daemon::MetricsFile> metrics;
  if (!options.metrics.empty()) metrics.emplace(options.metrics, log);
  std::optional<vgyro::daemon::Capture> capture;
  if (!options.capture.directory.empty()) {
    capture.emplace(capture_options(options), log);
    if (const vgyro::Expected<void> opened = capture->open(wall_now()); !opened) {
      log.error("{}", opened.error().message());
      return kBadInput;
    }
  }
  vgyro::daemon::GatewayLoop loop(std::move(*loaded), load, options.instance,
                                  {.keeper = keeper ? &*keeper : nullptr,
                                   .metrics = metrics ? &*metrics : nullptr,
                                   .capture = capture ? &*capture : nullptr},
                                  log);
  if (const vgyro::Expected<void> started = loop.start(); !started) {
    log.error("{}", started.error().message());
    return kBadInput;
  }
  const vgyro::Expected<void> result = loop.run();
  if (!result) log.error("{}", result.error().message());
  return result ? kDone : kSystemTrouble;
}

int run_with_log(const Options& options) {
  vgyro::daemon::Log log;
  try {
    return run(options, log);
  } catch (const std::exception& error) {
    log.error("{}", error.what());
    return kSystemTrouble;
  }
}

void add_capture_options(CLI::App& app, CaptureOptions& capture) {
  CLI::Option* directory =
      app.add_option("--capture", capture.directory,
                     "keeps the last minutes of the inputs in memory and writes them into this "
                     "directory when the gyros contradict each other, when most stops are refused, "
                     "and for `vgyro capture`; a relative path is below $STATE_DIRECTORY")
          ->type_name("DIR");
  const auto add = [&](const char* name, auto& value, double least, double most,
                       const std::string& text) {
    app.add_option(name, value, text)
        ->check(CLI::Range(least, most))
        ->needs(directory)
        ->capture_default_str();
  };
  add("--capture-minutes", capture.minutes, 1.0, kMinutesMost, "minutes kept in memory");
  add("--capture-memory", capture.memory_mib, 1.0, kMemoryMost_mib, "MiB of memory for them");
  add("--capture-disk", capture.disk_mib, 1.0, kDiskMost_mib,
      "MiB of captures in the directory; the oldest are removed");
  add("--capture-keep", capture.keep, 1.0, kKeepMost,
      "captures in the directory; the oldest are removed");
  add("--capture-interval", capture.interval_min, 0.0, kIntervalMost_min,
      "minutes at least between two captures of the same cause");
}

void add_options(CLI::App& app, Options& options) {
  app.add_option("--config", options.config, "The gateway's configuration (vgyro.toml)")
      ->required()
      ->type_name("FILE");
  app.add_option("--method", options.method, "corrector instead of the configured one")
      ->check(CLI::IsMember({"optimal", "mutual", "mean"}));
  app.add_option("--model", options.model, "model file instead of the configured one")
      ->type_name("FILE");
  app.add_option("--state", options.state,
                 "keeps the biases across a restart; default: state.toml in $STATE_DIRECTORY")
      ->type_name("FILE");
  app.add_flag("--forget", options.forget,
               "discard the state kept by --state, and calibrate again");
  app.add_option(
         "--metrics", options.metrics,
         "writes Prometheus metrics into this file every 5 seconds; default: vgyrod.prom in "
         "$RUNTIME_DIRECTORY")
      ->type_name("FILE");
  app.add_option("--instance", options.instance,
                 "which of several gateways on this host: its name on D-Bus and in the metrics")
      ->type_name("NAME")
      ->check([](const std::string& name) {
        const auto good = vgyro::check_instance_name(name);
        return good ? std::string() : good.error().message();
      });
  add_capture_options(app, options.capture);
  app.set_version_flag("--version", "vgyrod " VGYRO_VERSION);
  app.footer(
      "`vgyro check FILE` explains a configuration before it is trusted.\n"
      "SIGHUP reads the configuration again; one that cannot be used is refused.\n"
      "SIGUSR1 toggles debug messages.\n"
      "Exit codes: 0 stopped by a signal, 1 configuration unusable, or another gateway has the "
      "state "
      "file or the captures, 2 wrong usage, 3 the system failed.");
}

// Checks the options against each other; empty: no conflict.
std::string capture_conflict(const CaptureOptions& capture) {
  if (capture.disk_mib >= capture.memory_mib) return {};
  return fmt::format(
      "--capture-disk is {:g} MiB, less than the {:g} MiB of --capture-memory, which one capture "
      "may take; raise --capture-disk or lower --capture-memory",
      capture.disk_mib, capture.memory_mib);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "vgyrod: a gateway that reads two gyros from CAN and sends one better gyro.\n"
      "Runs in the foreground until SIGTERM; as a service: systemctl start vgyrod.",
      "vgyrod");
  Options options{.config = {},
                  .method = {},
                  .model = {},
                  .state = in_directory("STATE_DIRECTORY", "state.toml"),
                  .forget = false,
                  .metrics = in_directory("RUNTIME_DIRECTORY", "vgyrod.prom"),
                  .instance = {},
                  .capture = {}};
  add_options(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fprintf(stderr, "error: %s\n", usage_text(app, error).c_str());
    return kWrongUsage;
  }

  if (const std::string conflict = capture_conflict(options.capture); !conflict.empty()) {
    std::fprintf(stderr, "error: vgyrod: %s\n", conflict.c_str());
    return kWrongUsage;
  }

  std::signal(SIGPIPE, SIG_IGN);  // a closed stderr must not stop the gateway
  try {
    return run_with_log(options);
  } catch (const std::exception& error) {  // no thread for the log
    std::fprintf(stderr, "vgyrod: %s\n", error.what());
    return kSystemTrouble;
  }
}
