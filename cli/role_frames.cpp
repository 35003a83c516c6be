#include "cli/role_frames.h"

#include <algorithm>

#include <fmt/core.h>

#include "canlog/merged_reader.h"
#include "cli/log_notes.h"
#include "cli/log_progress.h"

namespace vgyro::cli {

Expected<void> RoleFrames::read(const std::vector<std::string>& logs, const std::string& doing,
                                const Take& take) {
  const auto opened = canlog::open_logs(logs);
  if (!opened) return tl::unexpected(opened.error());
  canlog::LogReader& reader = **opened;
  LogProgress progress(doing + " " + name_of(logs), reader);
  canlog::LogRecord record;
  while (reader.next(record)) {
    if (record.is_xl) continue;
    if (const std::uint8_t found = roles(record, reader.interfaces()); found != 0) {
      take(found, record);
    }
    progress.add();
  }
  if (reader.error()) return tl::unexpected(*reader.error());
  interfaces_ = reader.interfaces().names();
  return {};
}

std::uint8_t RoleFrames::roles(const canlog::LogRecord& record,
                               const canlog::InterfaceTable& interfaces) {
  while (buses_.size() <= record.bus) {
    const std::string& name = interfaces.name(static_cast<can::BusIndex>(buses_.size()));
    const auto found = std::find(plan_.buses.begin(), plan_.buses.end(), name);
    buses_.push_back(static_cast<can::BusIndex>(found - plan_.buses.begin()));
  }
  const std::uint8_t found = router_.roles(buses_[record.bus], record.frame);
  if ((found & gateway::kGyro1) != 0) ++frames_[0];
  if ((found & gateway::kGyro2) != 0) ++frames_[1];
  return found;
}

std::optional<Error> RoleFrames::missing_gyro(const std::string& name,
                                              const std::array<std::uint64_t, 2>& used) const {
  for (std::size_t i = 0; i < 2; ++i) {
    if (used[i] > 0) continue;
    const gateway::GyroPlan& gyro = plan_.gyros[i];
    if (frames_[i] > 0) {
      return Error{
          name,
          fmt::format("none of the {} frames of gyro {} could be used", frames_[i], gyro.name),
          "`vgyro replay` tells the causes, `vgyro check` which bits are read"};
    }
    std::string names;
    for (const std::string& bus : interfaces_)
      names += (names.empty() ? "" : ", ") + bus;
    return Error{
        name,
        fmt::format("no frame of gyro {} ({} {:X} on {})", gyro.name, gyro.message, gyro.match.id,
                    gyro.bus),
        names.empty() ? "the log holds no CAN frame" : "the log's interfaces are: " + names};
  }
  return std::nullopt;
}

std::optional<Error> several_axes(const std::string& config, const gateway::Plan& plan,
                                  const std::string& command) {
  if (plan.axes.empty()) return std::nullopt;
  return Error{config,
               fmt::format("has units of {} axes, and {} looks at one pair of gyros",
                           plan.axes.size(), command),
               "a configuration that names one of the axes: rate = \"SIGNAL\" instead of rate_x, "
               "rate_y, rate_z"};
}

}  // namespace vgyro::cli
