#pragma once

// A log's frames that play a role in the plan, one after the other, in the log's order. Judges no
// bits and no stamps.

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "canlog/record.h"
#include "gateway/plan.h"
#include "gateway/router.h"

namespace vgyro::cli {

class RoleFrames {
 public:
  /// `roles`: a mask of gateway::Role.
  using Take = std::function<void(std::uint8_t roles, const canlog::LogRecord& record)>;

  explicit RoleFrames(const gateway::Plan& plan) : plan_(plan), router_(plan) {}

  /// Several logs are merged by stamp. `doing` stands on the terminal's line of progress, before
  /// the logs' name.
  Expected<void> read(const std::vector<std::string>& logs, const std::string& doing,
                      const Take& take);

  /// After read(): what is wrong with logs of which so many samples of each gyro could be used.
  [[nodiscard]] std::optional<Error> missing_gyro(const std::string& name,
                                                  const std::array<std::uint64_t, 2>& used) const;

 private:
  [[nodiscard]] std::uint8_t roles(const canlog::LogRecord& record,
                                   const canlog::InterfaceTable& interfaces);

  const gateway::Plan& plan_;
  gateway::Router router_;
  std::vector<can::BusIndex> buses_;  ///< by the log's own index; beyond the plan's: foreign
  std::vector<std::string> interfaces_;
  std::array<std::uint64_t, 2> frames_{};
};

/// Of a configuration of whole units for a command that looks at one pair of gyros; nothing of two
/// single ones. `command`: as it is called.
std::optional<Error> several_axes(const std::string& config, const gateway::Plan& plan,
                                  const std::string& command);

}  // namespace vgyro::cli
