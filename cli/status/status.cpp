// vgyro status, vgyro recalibrate and vgyro capture: commands to the running gateway.

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <limits>
#include <string>
#include <unistd.h>
#include <vector>

#include <fmt/core.h>

#include "base/instance_name.h"
#include "base/printable.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/output/errors.h"
#include "cli/output/terminal.h"
#include "cli/status/gateway_client.h"
#include "cli/status/view.h"

namespace vgyro::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kRatesShown = 60;

volatile std::sig_atomic_t interrupted = 0;

void on_interrupt(int) {
  interrupted = 1;
}

void sleep_s(double seconds) {
  timespec left{
      static_cast<time_t>(seconds),
      static_cast<long>((seconds - static_cast<double>(static_cast<time_t>(seconds))) * 1e9)};
  while (interrupted == 0 && ::nanosleep(&left, &left) != 0 && errno == EINTR) {
  }
}

std::string time_of_day() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::localtime_r(&now, &parts);
  return fmt::format("{:02}:{:02}:{:02}", parts.tm_hour, parts.tm_min, parts.tm_sec);
}

bool wants_colour() {
  return ::isatty(STDOUT_FILENO) == 1 &&
         std::getenv("NO_COLOR") == nullptr;  // NOLINT(concurrency-mt-unsafe): one thread
}

Expected<Json> ask(const std::string& instance) {
  Expected<GatewayClient> client = GatewayClient::connect(instance);
  if (!client) return tl::unexpected(client.error());
  return client->status();
}

/// A live view: redraws the screen or, into a pipe, adds a line.
class Watch {
 public:
  Watch() : screen_(::isatty(STDOUT_FILENO) == 1) {
    if (screen_) vgyro::cli::draw(stdout, "\x1b[?25l\x1b[2J");  // no cursor, a clean screen
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;
  ~Watch() {
    if (screen_) vgyro::cli::draw(stdout, "\x1b[?25h");
    flush_output();
  }

  void show(const Expected<Json>& status) {
    if (status) note_rate(*status);
    if (screen_) {
      draw(status ? status_table(*status, {wants_colour(), {rates_.begin(), rates_.end()}})
                  : status.error().message() + "\n");
    } else {
      say("{} {}\n", time_of_day(), status ? status_line(*status) : status.error().message());
    }
  }

 private:
  void note_rate(const Json& status) {
    const auto rate = status.find("rate_dps");
    const bool known = rate != status.end() && rate->is_number();
    rates_.push_back(known ? rate->get<double>() : std::numeric_limits<double>::quiet_NaN());
    if (rates_.size() > kRatesShown) rates_.pop_front();
  }

  // Draws line by line over the old picture, so that nothing flickers.
  static void draw(const std::string& text) {
    std::string picture = "\x1b[H";
    for (const char c : text) {
      if (c == '\n') picture += "\x1b[K";
      picture += c;
    }
    vgyro::cli::draw(stdout,
                     fmt::format("{}\x1b[J\x1b[K\n{}, Ctrl-C ends\x1b[K", picture, time_of_day()));
  }

  bool screen_;
  std::deque<double> rates_;
};

int watch(const StatusOptions& options) {
  struct sigaction action {};
  action.sa_handler = &on_interrupt;
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  Watch view;
  while (interrupted == 0) {
    view.show(ask(options.which.instance));
    if (!flush_output()) return kDone;  // reported at the end
    sleep_s(options.interval_s);
  }
  return kDone;
}

/// The chosen instances; error if all are wanted and there is none.
Expected<std::vector<std::string>> chosen(const WhichGateway& which) {
  if (!which.all) return std::vector{which.instance};
  Expected<GatewayClient> client = GatewayClient::connect();
  if (!client) return tl::unexpected(client.error());
  Expected<std::vector<std::string>> found = client->instances();
  if (found && found->empty()) {
    return fail("vgyrod", "no gateway is on D-Bus",
                "`systemctl list-units 'vgyrod*'` says which run");
  }
  return found;
}

// A gateway that does not answer does not keep the others from being shown.
int show_all(const std::vector<std::string>& instances, bool json) {
  int code = kDone;
  Json gateways = Json::array();
  for (const std::string& instance : instances) {
    const Expected<Json> status = ask(instance);
    if (!status) {
      code = report(status.error());
    } else if (json) {
      gateways.push_back(*status);
    } else {
      const std::string title = printable(unit_of(instance));
      draw(stdout, title + '\n' + status_table(*status, {wants_colour(), {}}) + '\n');
    }
  }
  if (json) draw(stdout, Json{{"format", 1}, {"gateways", gateways}}.dump(2) + "\n");
  return code;
}

}  // namespace

int run_status(const StatusOptions& options) {
  if (options.watch) return watch(options);
  if (options.which.all) {
    const Expected<std::vector<std::string>> instances = chosen(options.which);
    return instances ? show_all(*instances, options.json) : report(instances.error());
  }
  const Expected<Json> status = ask(options.which.instance);
  if (!status) return report(status.error());
  if (options.json) {
    draw(stdout, status->dump(2) + "\n");
  } else {
    draw(stdout, status_table(*status, {wants_colour(), {}}));
  }
  return kDone;
}

int run_recalibrate(const WhichGateway& which) {
  const Expected<std::vector<std::string>> instances = chosen(which);
  if (!instances) return report(instances.error());
  int code = kDone;
  for (const std::string& instance : *instances) {
    Expected<GatewayClient> client = GatewayClient::connect(instance);
    if (!client) return report(client.error());
    if (const Expected<void> done = client->recalibrate(); !done) {
      code = report(done.error());
      continue;
    }
    const std::string who = instance.empty() ? "the gateway" : "the gateway " + instance;
    say("{} discarded its biases and is calibrating; `vgyro status` shows how far it is\n", who);
  }
  return code;
}

int run_capture(const WhichGateway& which) {
  const Expected<std::vector<std::string>> instances = chosen(which);
  if (!instances) return report(instances.error());
  int code = kDone;
  for (const std::string& instance : *instances) {
    Expected<GatewayClient> client = GatewayClient::connect(instance);
    if (!client) return report(client.error());
    const Expected<std::string> folder = client->capture();
    if (folder) {
      say("{}\n", *folder);
    } else {
      code = report(folder.error());
    }
  }
  return code;
}

}  // namespace vgyro::cli
