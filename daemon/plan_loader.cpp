#include "daemon/plan_loader.h"

#include <cerrno>
#include <chrono>
#include <exception>
#include <mutex>
#include <new>
#include <sys/eventfd.h>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

#include <malloc.h>

namespace vgyro::daemon {
namespace {

// Wait at the end of the process; a load that does not hang takes milliseconds.
constexpr std::chrono::milliseconds kLastPatience{1000};

std::vector<Error> refusal(std::string what, std::string remedy) {
  return {{{}, std::move(what), std::move(remedy)}};
}

}  // namespace

LoadResult load_with_fingerprint(const std::string& path,
                                 const gateway::ConfigOverrides& overrides) {
  gateway::ConfigResult loaded = gateway::load_config(path, overrides);
  if (!loaded) return tl::unexpected(std::move(loaded.error()));
  std::string fingerprint = gateway::fingerprint_of(*loaded, overrides);
  return LoadedConfig{std::move(loaded->plan), std::move(fingerprint), loaded->log_level,
                      std::move(loaded->warnings)};
}

LoadResult load_or_refuse(const LoadPlan& load) {
  // Made in advance, because later there may be no memory for it.
  std::vector<Error> no_memory =
      refusal("there is not enough memory to read the configuration",
              "name a DBC file that holds only the messages that are needed");
  try {
    return load();
  } catch (const std::bad_alloc&) {
    return tl::unexpected(std::move(no_memory));
  } catch (const std::exception& error) {
    return tl::unexpected(refusal(error.what(), {}));
  }
}

void set_log_level(const LoadedConfig& config, Log& log) {
  log.set_level(static_cast<Severity>(config.log_level));  // both are syslog's numbers
}

void tell_config(const LoadResult& loaded, Log& log) {
  const auto tell = [&](Severity severity, const std::vector<Error>& errors) {
    for (const Error& error : errors)
      log.tell(severity, {.cause = "config"}, "{}", error.message());
  };
  if (loaded) {
    tell(Severity::kWarning, loaded->warnings);
  } else {
    tell(Severity::kError, loaded.error());
  }
}

struct PlanLoader::Desk {
  Desk() = default;
  Desk(const Desk&) = delete;
  Desk& operator=(const Desk&) = delete;
  ~Desk() {
    if (fd >= 0) ::close(fd);
  }
  void hand_over(LoadResult what) {
    const std::scoped_lock lock(mutex);
    result = std::move(what);
    ::eventfd_write(fd, 1);
  }

  int fd = -1;
  std::mutex mutex;  ///< guards what follows
  std::optional<LoadResult> result;
};

PlanLoader::PlanLoader(LoadPlan load) : load_(std::move(load)), desk_(std::make_shared<Desk>()) {}

PlanLoader::~PlanLoader() {
  thread_.finish(kLastPatience);
}

Expected<void> PlanLoader::open() {
  desk_->fd = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (desk_->fd < 0) return fail("eventfd", system_reason(errno));
  return {};
}

int PlanLoader::fd() const {
  return desk_->fd;
}

void PlanLoader::ask() {
  asked_again_ = busy_;
  if (!busy_) begin();
}

void PlanLoader::begin() {
  busy_ = true;
  try {
    thread_.start([desk = desk_, load = load_] {
      desk->hand_over(load_or_refuse(load));
      // A large file grows this thread's own heap, which would otherwise never be given back.
      ::malloc_trim(0);
    });
  } catch (const std::system_error& error) {
    desk_->hand_over(tl::unexpected(
        refusal(std::string("no thread to read the configuration: ") + error.what(), {})));
  } catch (const std::bad_alloc&) {
    desk_->hand_over(tl::unexpected(std::vector<Error>{}));
  }
}

std::optional<LoadResult> PlanLoader::take() {
  std::optional<LoadResult> result;
  {
    const std::scoped_lock lock(desk_->mutex);
    eventfd_t count = 0;
    ::eventfd_read(desk_->fd, &count);
    result = std::exchange(desk_->result, std::nullopt);
  }
  if (!result) return result;
  busy_ = false;
  if (std::exchange(asked_again_, false)) begin();
  return result;
}

}  // namespace vgyro::daemon
