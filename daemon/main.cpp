#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/gateway_loop.h"
#include "daemon/log.h"
#include "gateway/config.h"

namespace {

constexpr int kDone = 0;
constexpr int kBadInput = 1;
constexpr int kWrongUsage = 2;

int run(const std::string& config, const std::string& method, vgyro::daemon::Log& log) {
  const vgyro::gateway::ConfigResult loaded =
      vgyro::gateway::load_config(config, {vgyro::gateway::method_from(method)});
  if (!loaded) {
    for (const vgyro::Error& error : loaded.error())
      log.error("{}", error.message());
    return kBadInput;
  }
  for (const vgyro::Error& warning : loaded->warnings)
    log.warning("{}", warning.message());

  vgyro::daemon::GatewayLoop loop(loaded->plan, log);
  vgyro::Expected<void> result = loop.start();
  if (result) result = loop.run();
  if (!result) log.error("{}", result.error().message());
  return result ? kDone : kBadInput;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "vgyrod: a gateway that reads two gyros from CAN and sends one better gyro.\n"
      "Runs in the foreground until SIGTERM; as a service: systemctl start vgyrod.",
      "vgyrod");
  std::string config;
  std::string method;
  app.add_option("--config", config, "The gateway's configuration (vgyro.toml)")
      ->required()
      ->type_name("FILE");
  app.add_option("--method", method, "corrector instead of the configured one")
      ->check(CLI::IsMember({"optimal", "mutual", "mean"}));
  app.set_version_flag("--version", "vgyrod " VGYRO_VERSION);
  app.footer(
      "`vgyro check FILE` explains a configuration before it is trusted.\n"
      "Exit codes: 0 stopped by a signal, 1 configuration or interface unusable, 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongUsage;
  }

  std::signal(SIGPIPE, SIG_IGN);  // a reader of stderr that went away must not stop the gateway
  vgyro::daemon::Log log;
  try {
    return run(config, method, log);
  } catch (const std::exception& error) {
    log.error("{}", error.what());
    return kBadInput;
  }
}
