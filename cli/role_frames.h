#pragma once

// A log's frames that play a role in the plan of a pair of gyros, one after the other, in the log's
// order. Several pairs, the axes of whole units, see the log in one reading. Judges no bits and no
// stamps.

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "canlog/record.h"
#include "gateway/plan.h"
#include "gateway/router.h"

namespace vgyro::cli {

class RoleFrames {
 public:
  /// `roles`: a mask of gateway::Role in the plan with the index `pair`.
  using Take =
      std::function<void(std::size_t pair, std::uint8_t roles, const canlog::LogRecord& record)>;

  /// Of one configuration; they outlive this.
  explicit RoleFrames(std::span<const gateway::Plan> plans);

  /// Several logs are merged by stamp. `doing` stands on the terminal's line of progress, before
  /// the logs' name.
  Expected<void> read(const std::vector<std::string>& logs, const std::string& doing,
                      const Take& take);

  /// After read(): what is wrong with logs of which so many samples of each gyro of the pair could
  /// be used.
  [[nodiscard]] std::optional<Error> missing_gyro(const std::string& name, std::size_t pair,
                                                  const std::array<std::uint64_t, 2>& used) const;

 private:
  struct Pair {
    const gateway::Plan* plan;
    gateway::Router router;
    std::array<std::uint64_t, 2> frames{};
  };
  /// In the plan: the configuration's buses are those of all its pairs.
  [[nodiscard]] can::BusIndex bus_of(const canlog::LogRecord& record,
                                     const canlog::InterfaceTable& interfaces);

  std::vector<Pair> pairs_;
  std::vector<can::BusIndex> buses_;  ///< by the log's own index; beyond the plan's: foreign
  std::vector<std::string> interfaces_;
};

}  // namespace vgyro::cli
