#include "cli/output/progress.h"

#include <cmath>
#include <cstdio>
#include <unistd.h>

#include <fmt/core.h>

#include "base/printable.h"
#include "cli/output/terminal.h"

namespace vgyro::cli {

std::string human_count(double count) {
  if (count >= 1e6) return fmt::format("{:.1f} M", count * 1e-6);
  if (count >= 1e4) return fmt::format("{:.0f} k", count * 1e-3);
  return fmt::format("{:.0f}", count);
}

std::string remaining_text(double elapsed_s, double share) {
  constexpr double kElapsedMin_s = 3.0;
  constexpr double kShareMin = 0.05;
  constexpr double kMinute_s = 60.0;
  if (elapsed_s < kElapsedMin_s || share < kShareMin || share >= 1.0) return {};
  const double left_s = elapsed_s * (1.0 - share) / share;
  if (left_s < 2.0 * kMinute_s) return fmt::format(", some {:.0f} s left", std::ceil(left_s));
  return fmt::format(", some {:.0f} min left", std::ceil(left_s / kMinute_s));
}

Progress::Progress(const std::string& what)
    : what_(printable(what)),
      enabled_(::isatty(STDERR_FILENO) == 1),
      begin_(std::chrono::steady_clock::now()),
      last_(begin_) {}

bool Progress::due() {
  if (!enabled_) return false;
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < std::chrono::milliseconds(100)) return false;
  last_ = now;
  return true;
}

void Progress::update(std::string_view doing, double share) {
  if (!due()) return;
  const double elapsed_s = std::chrono::duration<double>(last_ - begin_).count();
  draw(stderr, fmt::format("\r\x1b[K{} {:3.0f} %  {}{}", what_, 100.0 * share, printable(doing),
                           remaining_text(elapsed_s, share)));
  std::fflush(stderr);
  drawn_ = true;
}

void Progress::update(std::uint64_t done, std::uint64_t total, std::uint64_t frames) {
  if (!due()) return;
  const double elapsed_s = std::chrono::duration<double>(last_ - begin_).count();
  const std::string share = total == 0
                                ? std::string()
                                : fmt::format(" {:3.0f} %", 100.0 * static_cast<double>(done) /
                                                                static_cast<double>(total));
  draw(stderr, fmt::format("\r\x1b[K{}{}  {} frames, {} frames/s", what_, share,
                           human_count(static_cast<double>(frames)),
                           human_count(static_cast<double>(frames) / elapsed_s)));
  std::fflush(stderr);
  drawn_ = true;
}

void Progress::clear() {
  if (!drawn_) return;
  draw(stderr, "\r\x1b[K");
  std::fflush(stderr);
  drawn_ = false;
}

}  // namespace vgyro::cli
