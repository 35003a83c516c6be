#pragma once

// Shows the progress of a long command in one line on a terminal. Silent if stderr is not a
// terminal.

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace vgyro::cli {

class Progress {
 public:
  explicit Progress(const std::string& what);
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() { clear(); }

  /// Draws at most ten times a second. `total` 0: unknown.
  void update(std::uint64_t done, std::uint64_t total, std::uint64_t frames);
  /// For work with a known share, 0 to 1; `doing` names the present step. The remaining time is
  /// extrapolated from the elapsed one.
  void update(std::string_view doing, double share);
  void clear();

 private:
  /// False if the last line is too recent.
  bool due();

  std::string what_;
  bool enabled_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point begin_;
  std::chrono::steady_clock::time_point last_;
};

/// ", some 40 s left", for work that took `elapsed_s` for this share; empty while it would be a
/// guess.
std::string remaining_text(double elapsed_s, double share);

/// "1.2 M"
std::string human_count(double count);

}  // namespace vgyro::cli
