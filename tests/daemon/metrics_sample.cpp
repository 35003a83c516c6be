// For monitoring_test.py: prints the metrics of a gateway with a name, buses, layouts, supply
// voltages and several axes, so that every family and every label of metrics.cpp is written.

#include <string>

#include <fmt/core.h>

#include "daemon/metrics.h"
#include "tests/gateway/rig.h"

int main() {
  using namespace vgyro;
  using gateway::rig::codec_of;
  using gateway::rig::signal_of;
  gateway::Plan plan = gateway::rig::two_gyros();
  for (gateway::GyroPlan& gyro : plan.gyros)
    gyro.supply_voltage = gateway::rig::quantity_of(signal_of(32, 16, 0.001));
  plan.output.layouts = {
      {.bus = 1,
       .message = "ARI",
       .id = 0x123,
       .rates = {{.rate = {.name = "Rate", .codec = codec_of(signal_of(0, 16, 0.01))}}}}};
  gateway::Plan of_one_axis = gateway::rig::two_gyros();
  daemon::Snapshot now;
  now.instance = "front";
  for (std::size_t axis = 0; axis < gateway::kAxes; ++axis) {
    of_one_axis.axis = axis;
    plan.axes.push_back(of_one_axis);
    now.axes.emplace_back();
  }
  now.plan = &plan;
  now.capture.emplace();
  now.traffic.buses = {{.name = "can0"}, {.name = "can1"}};
  fmt::print("{}", daemon::metrics_text(now));
}
