#pragma once

// Reads the configuration beside the loop: a file may be large, its disk slow or away, and the
// rates wait for nothing. A descriptor that the loop polls signals a result. Any
// error, lack of memory included, is a result too: a refusal. A thread that hangs is left
// behind.

#include <functional>
#include <memory>
#include <optional>

#include "base/error.h"
#include "daemon/log.h"
#include "daemon/loose_thread.h"
#include "gateway/config.h"

namespace vgyro::daemon {

/// Runs in a thread of its own, so it owns what it uses.
using LoadPlan = std::function<gateway::ConfigResult()>;

/// What `load` says; its exceptions as errors.
gateway::ConfigResult load_or_refuse(const LoadPlan& load);

/// The errors of a configuration that cannot be used; the warnings of one that can.
void tell_config(const gateway::ConfigResult& loaded, Log& log);

class PlanLoader {
 public:
  explicit PlanLoader(LoadPlan load);
  PlanLoader(const PlanLoader&) = delete;
  PlanLoader& operator=(const PlanLoader&) = delete;
  ~PlanLoader();

  Expected<void> open();
  /// Readable when take() has a result.
  [[nodiscard]] int fd() const;

  /// Begins to load; while that goes on, any number of further wishes make one further load.
  void ask();

  /// The result of one load, once. A load that was asked for meanwhile begins.
  std::optional<gateway::ConfigResult> take();

  [[nodiscard]] bool is_busy() const { return busy_; }

 private:
  struct Desk;
  void begin();

  LoadPlan load_;
  std::shared_ptr<Desk> desk_;  ///< what a thread and the loop share
  LooseThread thread_;
  bool busy_ = false;
  bool asked_again_ = false;
};

}  // namespace vgyro::daemon
