#pragma once

// One line on a terminal that says how far a long command is. Silent where stderr is no terminal.

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
  /// Of work that knows its share, 0 to 1; `doing` says what is done now. What is left is as long
  /// as what is done was, in proportion.
  void update(std::string_view doing, double share);
  void clear();

 private:
  /// False when the last line is too young.
  bool due();

  std::string what_;
  bool enabled_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point begin_;
  std::chrono::steady_clock::time_point last_;
};

/// ", some 40 s left", of work that has taken `elapsed_s` for this share; empty as long as that
/// would be a guess.
std::string remaining_text(double elapsed_s, double share);

/// "1.2 M"
std::string human_count(double count);

}  // namespace vgyro::cli
