// A gateway without buses, for control_test.py: its D-Bus interface and its metrics, for a status
// that changes by itself. Prints a line a second, which a loop that waits for the bus would not.

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <systemd/sd-event.h>
#include <utility>

#include <fmt/core.h>

#include "base/instance_name.h"
#include "daemon/control.h"
#include "daemon/metrics.h"
#include "tests/gateway/rig.h"

namespace {

using namespace vgyro;

struct SampleGateway {
  gateway::Plan plan = gateway::rig::two_gyros();
  daemon::Snapshot now;
  daemon::Log log;
  daemon::Control* control = nullptr;
  daemon::MetricsFile* metrics = nullptr;
  int seconds = 0;
  std::function<void(const Expected<std::string>&)> asked;  ///< for a capture

  SampleGateway() {
    plan.gyros[0].name = "left \"one\" \\";
    plan.gyros[1].name = "right";
    now.plan = &plan;
    now.fingerprint = "0123456789abcdef";
    now.last_stop_age_s = 75.0;
    now.status.normalized_innovation = 4.5;
    now.status.state = gateway::State::kRunning;
    now.status.quality = gateway::Quality::kTwoGyros;
    now.status.rate_dps = 50.25;
    now.status.sigma_dps = 0.0005;
    now.status.bias_sigma_dps = 0.0001;
    now.status.pairs = 1ULL << 40U;
    now.status.accelerometer_rejected = 4;
    now.status.speed_rejected = 2;
    now.status.layouts_out[0] = {.frames = 900, .valid = 800, .out_of_range = 3};
    now.status.layouts_out[1] = {.frames = 100, .valid = 100, .withheld = 5};
    now.status.ambiguous = true;
    now.status.probability[static_cast<std::size_t>(fusion::Hypothesis::kStanding)] = 0.75;
    now.status.probability[static_cast<std::size_t>(fusion::Hypothesis::kTurning)] = 0.25;
    now.status.probability[static_cast<std::size_t>(fusion::Hypothesis::kGyro1Stepped)] = 0.04;
    now.status.probability[static_cast<std::size_t>(fusion::Hypothesis::kWarmingUp)] = 0.5;
    now.status.stops = 2;
    now.status.stops_refused = 5;
    now.status.stops_open = 1;
    now.status.estimate_restarts = 3;
    now.status.pair.contradiction = fusion::Contradiction::kSign;
    now.status.pair.slope = -1.0;
    now.status.contradictions = 6;
    now.status.rates_too_far_apart = true;
    gateway::GyroStatus& left = now.status.gyros[0];
    left.heard = true;
    left.frames = 1000;
    left.samples = 990;
    left.bias_dps = 0.033;
    left.last_rate_dps = 50.283;
    left.temperature_c = 21.5;
    left.rejected[static_cast<std::size_t>(gateway::Reject::kCounterRepeated)] = 10;
    left.rejected[static_cast<std::size_t>(gateway::Reject::kCrcWrong)] = 7;
    gateway::GyroStatus& right = now.status.gyros[1];
    right.fault = gateway::Fault::kStuck;
    right.faults[static_cast<std::size_t>(gateway::Fault::kStuck)].times = 2;
    right.bias_dps = right.temperature_c = std::nan("");
    now.bias_sigma_dps = {0.0002, std::nan("")};
    now.slope_dps_s = {1e-6, std::nan("")};
    now.slope_sigma_dps_s = {2e-7, std::nan("")};
    now.traffic.transmitted.sent = 12'345;
    now.traffic.transmitted.dropped_stale = 7;
    now.log_lines_lost = 41;
    now.service_messages_lost = 3;
    daemon::BusStatus bus{.name = "can0", .present = true, .link_up = true};
    bus.errors[static_cast<std::size_t>(can::ErrorCause::kBusOff)] = 3;
    bus.received = 4321;
    bus.restamped = 23;
    bus.foreign = 17;
    bus.contested = true;
    now.traffic.buses = {bus, {.name = "can1"}};
    now.capture = {.directory = "/captures",
                   .ring = {.frames = 600'000, .bytes = 4'000'000, .dropped = 8, .seconds = 600.0},
                   .written = {2, 0, 1, 0},
                   .failed = 1,
                   .held_back = 5,
                   .is_writing = false,
                   .last = "/captures/20261130T204835Z-contradicted"};
  }

  // In shadow mode like a gateway without --capture; otherwise answers a second later.
  Expected<void> capture(std::function<void(const Expected<std::string>&)> answer) {
    if (!now.capture) return fail({}, "the gateway keeps no recording", "start it with --capture");
    if (asked) return fail({}, "a capture that was asked for is still being written");
    asked = std::move(answer);
    return {};
  }
  void answer_asked() {
    const auto answer = std::exchange(asked, nullptr);
    if (!answer) return;
    ++now.capture->written[static_cast<std::size_t>(daemon::CaptureCause::kAsked)];
    answer(std::string("/captures/20261130T205000Z-asked"));
  }

  void begin_shadow() {
    plan.output.transmit = false;
    now.capture.reset();
    now.traffic.shadowed = 99;
  }
  Expected<void> save_state() {
    if (now.status.state == gateway::State::kRunning) return {};
    return fail({}, "nothing was learned yet that is worth keeping");
  }
  void recalibrate() {
    now.status.state = gateway::State::kCalibrating;
    now.status.quality = gateway::Quality::kUnusable;
    now.status.rate_dps = now.status.sigma_dps = std::nan("");
  }
  void second_passed() {
    ++seconds;
    if (std::isfinite(now.status.rate_dps)) now.status.rate_dps += 0.5;
    now.uptime_s = seconds;
    answer_asked();
    control->second_passed();
    if (metrics != nullptr && metrics->second_passed()) metrics->write(now);
    fmt::print("second {}\n", seconds);
    std::fflush(stdout);
  }
};

int on_second(sd_event_source* source, std::uint64_t, void* self) {
  static_cast<SampleGateway*>(self)->second_passed();
  sd_event_source_set_time_relative(source, 1'000'000);
  return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

}  // namespace

int main(int argc, char** argv) {
  SampleGateway sample;
  if (argc > 3) sample.now.instance = argv[3];
  sd_event* events = nullptr;
  if (sd_event_new(&events) < 0) return 1;
  daemon::Control control(
      events,
      {.snapshot = [&]() -> const daemon::Snapshot& { return sample.now; },
       .recalibrate = [&] { sample.recalibrate(); },
       .save_state = [&] { return sample.save_state(); },
       .capture = [&](auto answer) { return sample.capture(std::move(answer)); }},
      bus_name_of(sample.now.instance), sample.log);
  sample.control = &control;
  std::optional<daemon::MetricsFile> metrics;
  if (argc > 1) sample.metrics = &metrics.emplace(argv[1], sample.log);
  if (argc > 2 && std::string(argv[2]) == "shadow") sample.begin_shadow();
  sd_event_add_time_relative(events, nullptr, CLOCK_MONOTONIC, 1'000'000, 0, &on_second, &sample);
  return sd_event_loop(events) < 0 ? 1 : 0;
}
