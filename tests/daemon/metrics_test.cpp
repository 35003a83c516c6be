// Metrics that cannot be written.

#include "daemon/metrics.h"

#include <chrono>
#include <csignal>
#include <set>
#include <sstream>
#include <string>
#include <sys/resource.h>
#include <thread>

#include <gtest/gtest.h>

#include "tests/daemon/scratch.h"
#include "tests/gateway/rig.h"

namespace vgyro::daemon {
namespace {

std::string& told() {
  static std::string message;
  return message;
}

int keep(const iovec* fields, int count) {
  if (count > 0) told().assign(static_cast<const char*>(fields[0].iov_base), fields[0].iov_len);
  return 0;
}

/// Limits files to 64 bytes, like a disk that fills up in the middle of one.
class SmallFiles {
 public:
  SmallFiles() {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit small{64, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
  }
  SmallFiles(const SmallFiles&) = delete;
  SmallFiles& operator=(const SmallFiles&) = delete;
  ~SmallFiles() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int) = SIG_DFL;
};

// The first write is cut short without an error; only the next one says why.
TEST(MetricsFile, TellsWhyAFileWasCutShort) {
  const Scratch scratch;
  const SmallFiles small;
  Log log(&keep);
  told().clear();
  MetricsFile metrics(scratch.path("metrics.prom"), log);
  const gateway::Plan plan = gateway::rig::two_gyros();
  Snapshot now;
  now.plan = &plan;
  metrics.write(now);
  while (told().empty()) {
    metrics.second_passed();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_NE(told().find("metrics cannot be written: File too large"), std::string::npos) << told();
}

// Prometheus refuses a file in which two samples have the same name and labels.
TEST(Metrics, EveryLayoutHasASampleOfItsOwn) {
  gateway::Plan plan = gateway::rig::two_gyros();
  plan.buses = {"can0", "can1"};
  using gateway::rig::codec_of;
  using gateway::rig::signal_of;
  const gateway::OutputLayout layout{
      .bus = 0,
      .message = "ARI",
      .id = 0x0CF02A31,
      .extended = true,
      .rates = {{.rate = {.name = "Rate", .codec = codec_of(signal_of(0, 16, 0.01))}}}};
  plan.output.layouts = {layout, layout, layout};
  plan.output.layouts[1].bus = 1;
  plan.output.layouts[2].id = 0x0CF02A32;
  Snapshot now;
  now.plan = &plan;
  now.status.layouts_out[1].withheld = 7;
  const std::string text = metrics_text(now);
  std::istringstream lines(text);
  std::set<std::string> seen;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    EXPECT_TRUE(seen.insert(line.substr(0, line.rfind(' '))).second) << line;
  }
  EXPECT_TRUE(
      seen.contains(R"(vgyro_layout_withheld_total{message="ARI",bus="can1",id="0CF02A31"})"))
      << text;
}

}  // namespace
}  // namespace vgyro::daemon
