#pragma once

// The frames of a log that have a role in the plan of a pair of gyros, one after the other, in the
// log's order. Several pairs, the axes of whole units, share one pass over the log. Checks no bits
// and no stamps.

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

  /// `plans` are of one configuration, and must outlive this.
  explicit RoleFrames(std::span<const gateway::Plan> plans);

  /// Several logs are merged by stamp. `doing` is the text of the progress line, before the logs'
  /// name.
  Expected<void> read(const std::vector<std::string>& logs, const std::string& doing,
                      const Take& take);

  /// After read(): the error if a gyro of the pair has no usable samples; `used` is their number.
  [[nodiscard]] std::optional<Error> missing_gyro(const std::string& name, std::size_t pair,
                                                  const std::array<std::uint64_t, 2>& used) const;

 private:
  struct Pair {
    const gateway::Plan* plan;
    gateway::Router router;
    std::array<std::uint64_t, 2> frames{};
  };
  /// Index in the plan; all pairs of a configuration have the same buses.
  [[nodiscard]] can::BusIndex bus_of(const canlog::LogRecord& record,
                                     const canlog::InterfaceTable& interfaces);

  std::vector<Pair> pairs_;
  std::vector<can::BusIndex> buses_;  ///< by the log's own index; beyond the plan's: foreign
  std::vector<std::string> interfaces_;
};

}  // namespace vgyro::cli
