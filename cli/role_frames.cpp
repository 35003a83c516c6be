#include "cli/role_frames.h"

#include <algorithm>

#include <fmt/core.h>

#include "canlog/merged_reader.h"
#include "cli/axis_choice.h"
#include "cli/log_notes.h"
#include "cli/log_progress.h"

namespace vgyro::cli {

RoleFrames::RoleFrames(std::span<const gateway::Plan> plans) {
  pairs_.reserve(plans.size());
  for (const gateway::Plan& plan : plans)
    pairs_.push_back({.plan = &plan, .router = gateway::Router(plan)});
}

Expected<void> RoleFrames::read(const std::vector<std::string>& logs, const std::string& doing,
                                const Take& take) {
  const auto opened = canlog::open_logs(logs);
  if (!opened) return tl::unexpected(opened.error());
  canlog::LogReader& reader = **opened;
  LogProgress progress(doing + " " + name_of(logs), reader);
  canlog::LogRecord record;
  while (reader.next(record)) {
    if (record.is_xl) continue;
    const can::BusIndex bus = bus_of(record, reader.interfaces());
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      Pair& pair = pairs_[i];
      const std::uint8_t found = pair.router.roles(bus, record.frame);
      if (found == 0) continue;
      if ((found & gateway::kGyro1) != 0) ++pair.frames[0];
      if ((found & gateway::kGyro2) != 0) ++pair.frames[1];
      take(i, found, record);
    }
    progress.add();
  }
  if (reader.error()) return tl::unexpected(*reader.error());
  interfaces_ = reader.interfaces().names();
  return {};
}

can::BusIndex RoleFrames::bus_of(const canlog::LogRecord& record,
                                 const canlog::InterfaceTable& interfaces) {
  const std::vector<std::string>& buses = pairs_.front().plan->buses;
  while (buses_.size() <= record.bus) {
    const std::string& name = interfaces.name(static_cast<can::BusIndex>(buses_.size()));
    const auto found = std::find(buses.begin(), buses.end(), name);
    buses_.push_back(static_cast<can::BusIndex>(found - buses.begin()));
  }
  return buses_[record.bus];
}

std::optional<Error> RoleFrames::missing_gyro(const std::string& name, std::size_t pair,
                                              const std::array<std::uint64_t, 2>& used) const {
  const auto& [plan, router, frames] = pairs_[pair];
  for (std::size_t i = 0; i < 2; ++i) {
    if (used[i] > 0) continue;
    const gateway::GyroPlan& gyro = plan->gyros[i];
    const std::string who = gyro.name + about_axis(*plan);
    if (frames[i] > 0) {
      return Error{name,
                   fmt::format("none of the {} frames of gyro {} could be used", frames[i], who),
                   "`vgyro replay` tells the causes, `vgyro check` which bits are read"};
    }
    std::string names;
    for (const std::string& bus : interfaces_)
      names += (names.empty() ? "" : ", ") + bus;
    return Error{
        name,
        fmt::format("no frame of gyro {} ({} {:X} on {})", who, gyro.message, gyro.match.id,
                    gyro.bus),
        names.empty() ? "the log holds no CAN frame" : "the log's interfaces are: " + names};
  }
  return std::nullopt;
}

}  // namespace vgyro::cli
