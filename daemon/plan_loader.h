#pragma once

// Reads the configuration in a separate thread: a file may be large and its disk slow or gone, and
// no rate may wait for it. A descriptor that the loop polls signals a result. Any error, lack of
// memory included, is a result too: a refusal. A thread that hangs is left behind.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "daemon/log.h"
#include "daemon/loose_thread.h"
#include "gateway/config.h"

namespace vgyro::daemon {

/// What the gateway needs of a configuration.
struct LoadedConfig {
  gateway::Plan plan;
  std::string fingerprint;  ///< gateway::fingerprint_of(), computed outside the loop
  gateway::LogLevel log_level = gateway::LogLevel::kInfo;
  std::vector<Error> warnings;  ///< usable, but the user should know
};

using LoadResult = tl::expected<LoadedConfig, std::vector<Error>>;

/// gateway::load_config() and the fingerprint of what it read.
LoadResult load_with_fingerprint(const std::string& path,
                                 const gateway::ConfigOverrides& overrides = {});

/// Runs in a thread of its own, so it owns what it uses.
using LoadPlan = std::function<LoadResult()>;

/// The result of `load`, with exceptions as errors.
LoadResult load_or_refuse(const LoadPlan& load);

/// Sets the configured log level.
void set_log_level(const LoadedConfig& config, Log& log);

/// Logs the errors of a configuration that cannot be used, or the warnings of one that can.
void tell_config(const LoadResult& loaded, Log& log);

class PlanLoader {
 public:
  explicit PlanLoader(LoadPlan load);
  PlanLoader(const PlanLoader&) = delete;
  PlanLoader& operator=(const PlanLoader&) = delete;
  ~PlanLoader();

  Expected<void> open();
  /// Readable when take() has a result.
  [[nodiscard]] int fd() const;

  /// Starts a load. Any number of calls during a load cause one further load.
  void ask();

  /// The result of a load, once. Then starts the load that was asked for meanwhile, if any.
  std::optional<LoadResult> take();

  [[nodiscard]] bool is_busy() const { return busy_; }

 private:
  struct Desk;
  void begin();

  LoadPlan load_;
  std::shared_ptr<Desk> desk_;  ///< shared by the thread and the loop
  LooseThread thread_;
  bool busy_ = false;
  bool asked_again_ = false;
};

}  // namespace vgyro::daemon
