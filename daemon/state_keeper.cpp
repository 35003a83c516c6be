#include "daemon/state_keeper.h"

#include <utility>

namespace vgyro::daemon {

StateKeeper::StateKeeper(std::string path, Log& log)
    : file_(std::move(path), gateway::kSavedStateBytesMax),
      lock_(file_.path()),
      log_(log),
      writer_([this](const std::string& text) { return file_.write(text); }) {}

// If the lock file cannot be made, the state cannot be written either, and load() reports that.
Expected<void> StateKeeper::lock() {
  if (lock_.take() != FileLock::Outcome::kHeld) return {};
  return fail(file_.path(), "another gateway keeps its biases there (" + lock_.holder() + ")",
              "stop that one (`systemctl stop vgyrod`), or give this one a file of its own with "
              "--state FILE");
}

std::optional<gateway::SavedState> StateKeeper::load(const gateway::Plan& plan) {
  file_.clean_up();
  if (const Expected<void> writable = file_.check_writable(); !writable) tell(writable);
  const Expected<std::optional<std::string>> text = file_.read();
  if (!text) {
    log_.warning("{}", text.error().message());
    return std::nullopt;
  }
  if (!*text) {
    log_.info("{}: does not exist yet; the biases will be saved there", file_.path());
    return std::nullopt;
  }
  Expected<gateway::SavedState> state = gateway::saved_state_from(**text, file_.path());
  if (!state) {
    refuse(state.error());
    return std::nullopt;
  }
  if (const Expected<void> same = gateway::check_devices(*state, plan); !same) {
    refuse(same.error());
    return std::nullopt;
  }
  return std::move(*state);
}

// The file is kept: it may belong to another pair, or show what damages files here.
void StateKeeper::refuse(Error error) {
  if (error.where.empty()) error.where = file_.path();
  const bool kept = file_.set_aside().has_value();
  log_.warning("{}{}", error.message(), kept ? "; it was renamed to " + file_.aside_path() : "");
}

void StateKeeper::forget() {
  if (const Expected<void> removed = file_.remove(); !removed) {
    log_.warning("{}", removed.error().message());
  } else {
    log_.notice("{}: discarded; calibrating again", file_.path());
  }
}

bool StateKeeper::second_passed() {
  const std::optional<Expected<void>> result = writer_.take_result();
  if (result) tell(*result);
  if (seconds_left_ > 0) --seconds_left_;
  return seconds_left_ == 0;
}

void StateKeeper::keep(const std::optional<gateway::SavedState>& state) {
  if (!state) return;
  std::string text = gateway::to_text(*state);
  if (text == latest_) return;  // nothing was learned
  // A state that would be refused must not replace a good one.
  if (const auto readable = gateway::saved_state_from(text, file_.path()); !readable) {
    tell(tl::unexpected(Error{file_.path(), "not written: " + readable.error().what, {}}));
    return;
  }
  latest_ = text;
  seconds_left_ = kPeriod_s;
  writer_.put(std::move(text));
}

void StateKeeper::finish(const std::optional<gateway::SavedState>& state) {
  keep(state);
  writer_.finish();
  if (const std::optional<Expected<void>> result = writer_.take_result()) tell(*result);
}

void StateKeeper::tell(const Expected<void>& written) {
  const bool failed_before = std::exchange(failed_, !written);
  if (!written) latest_.clear();
  if (!written && !failed_before) log_.warning("{}", written.error().message());
  if (written && failed_before) log_.notice("{}: written again", file_.path());
}

}  // namespace vgyro::daemon
