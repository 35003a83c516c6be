#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/instance_name.h"
#include "base/printable.h"
#include "base/spelling.h"
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

struct Options {
  std::string config;
  std::string method;
  std::optional<std::string> model;
  std::string state;
  bool forget = false;
  std::string metrics;
  std::string instance;
};

// An unknown option comes first: it is often the reason why another one is missing.
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

// systemd names the directory that it made for the service; of several the first.
std::string in_directory(const char* variable, const char* file) {
  const char* directories = std::getenv(variable);  // NOLINT(concurrency-mt-unsafe): at start
  if (directories == nullptr || *directories == '\0') return {};
  const std::string_view all(directories);
  return std::string(all.substr(0, all.find(':'))) + '/' + file;
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
  vgyro::daemon::GatewayLoop loop(std::move(*loaded), load, options.instance,
                                  keeper ? &*keeper : nullptr, metrics ? &*metrics : nullptr, log);
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
                  .instance = {}};
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
  app.set_version_flag("--version", "vgyrod " VGYRO_VERSION);
  app.footer(
      "`vgyro check FILE` explains a configuration before it is trusted.\n"
      "SIGHUP reads the configuration again; one that cannot be used is refused.\n"
      "SIGUSR1 begins debug messages, and ends them.\n"
      "Exit codes: 0 stopped by a signal, 1 configuration unusable, or another gateway has the "
      "state "
      "file, 2 wrong usage, 3 the system failed.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fprintf(stderr, "error: %s\n", usage_text(app, error).c_str());
    return kWrongUsage;
  }

  std::signal(SIGPIPE, SIG_IGN);  // a reader of stderr that went away must not stop the gateway
  try {
    return run_with_log(options);
  } catch (const std::exception& error) {  // no thread for the log
    std::fprintf(stderr, "vgyrod: %s\n", error.what());
    return kSystemTrouble;
  }
}
