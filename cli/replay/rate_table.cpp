#include "cli/replay/rate_table.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>

#include <fmt/format.h>

namespace vgyro::cli {

namespace {

constexpr std::string_view kHeader =
    "t_s,rate_dps,sigma_dps,valid,state,bias1_dps,bias2_dps,heading_deg\n";
// Finer than any gyro's noise of one sample, and than VG_Rate's own steps.
constexpr int kRateDigits = 7;
constexpr int kHeadingDigits = 6;

struct Line {
  char* at;

  void put(std::string_view text) { at = std::copy(text.begin(), text.end(), at); }
  /// Nothing for what is not known.
  void number(double value, int digits) {
    *at++ = ',';
    if (std::isfinite(value)) at = fmt::format_to(at, "{:.{}f}", value, digits);
  }
  void seconds(TimePoint instant) {
    const std::int64_t us = to_ns(instant) / 1000;
    at = fmt::format_to(at, "{}.{:06}", us / 1'000'000, us % 1'000'000);
  }
};

}  // namespace

RateTable::RateTable(OutputFile file) : file_(std::move(file)) {
  file_.write(kHeader);
}

Expected<RateTable> RateTable::open(const std::string& path) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  return RateTable(std::move(*file));
}

void RateTable::turn(TimePoint instant, double rate_dps) {
  if (last_) {
    heading_deg_ += 0.5 * (last_->rate_dps + rate_dps) * to_seconds(instant - last_->instant);
  }
  last_ = {instant, rate_dps};
}

void RateTable::on_output(const gateway::RateOutput& output,
                          const std::array<double, 2>& bias_dps) {
  // Five numbers below 1e6, a state and a time.
  constexpr std::size_t kLineBytesMax = 256;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (output.valid) turn(output.instant, output.rate_dps);
  char* const begin = file_.room(kLineBytesMax);
  Line line{begin};
  line.seconds(output.instant);
  line.number(output.valid ? output.rate_dps : kNone, kRateDigits);
  line.number(output.valid ? output.sigma_dps : kNone, kRateDigits);
  line.put(output.valid ? ",1," : ",0,");
  line.put(to_string(output.state));
  for (const double bias : bias_dps)
    line.number(bias, kRateDigits);
  line.number(output.valid ? heading_deg_ : kNone, kHeadingDigits);
  *line.at++ = '\n';
  file_.commit(static_cast<std::size_t>(line.at - begin));
}

}  // namespace vgyro::cli
