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
// Finer than any gyro's noise in one sample, and than the steps of VG_Rate.
constexpr int kRateDigits = 7;
constexpr int kHeadingDigits = 6;

struct Line {
  char* at;

  void put(std::string_view text) { at = std::copy(text.begin(), text.end(), at); }
  /// Writes nothing if the value is not finite.
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

RateTable::RateTable(OutputFile file, const gateway::Plan& plan)
    : file_(std::move(file)), axes_(plan.output.axes) {
  if (axes_.empty()) {
    file_.write(kHeader);
    return;
  }
  std::string header = "t_s";
  for (const std::size_t axis : axes_) {
    header +=
        fmt::format(",rate_{0}_dps,sigma_{0}_dps,valid_{0},state_{0},bias1_{0}_dps,bias2_{0}_dps",
                    gateway::kAxisNames[axis]);
  }
  file_.write(header + ",heading_deg\n");
}

Expected<RateTable> RateTable::open(const std::string& path, const gateway::Plan& plan) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  return RateTable(std::move(*file), plan);
}

Expected<void> RateTable::close() {
  if (any_) write_line();
  return file_.close();
}

// Instants may differ: an axis that goes on with one unit has rates between those of the pairs.
void RateTable::gather(std::size_t place, const gateway::RateOutput& output,
                       const std::array<double, 2>& bias_dps) {
  const bool other_instant =
      std::any_of(entries_.begin(), entries_.end(), [&](const std::optional<Entry>& entry) {
        return entry && entry->output.instant != output.instant;
      });
  if (other_instant || entries_[place]) write_line();
  entries_[place] = {output, bias_dps};
  any_ = true;
}

void RateTable::write_line() {
  // Four numbers, a state and a flag for each axis, and two more numbers.
  constexpr std::size_t kLineBytesMax = 640;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  char* const begin = file_.room(kLineBytesMax);
  Line line{begin};
  TimePoint instant;
  for (const std::optional<Entry>& entry : entries_)
    instant = entry ? entry->output.instant : instant;
  line.seconds(instant);
  double heading_deg = kNone;
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    const std::optional<Entry>& entry = entries_[place];
    const bool valid = entry && entry->output.valid;
    line.number(valid ? entry->output.rate_dps : kNone, kRateDigits);
    line.number(valid ? entry->output.sigma_dps : kNone, kRateDigits);
    line.put(valid ? ",1," : ",0,");
    if (entry) line.put(to_string(entry->output.state));
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      line.number(entry ? entry->bias_dps[gyro] : kNone, kRateDigits);
    if (axes_[place] != 2 || !valid) continue;
    turn(instant, entry->output.rate_dps);
    heading_deg = heading_deg_;
  }
  line.number(heading_deg, kHeadingDigits);
  *line.at++ = '\n';
  file_.commit(static_cast<std::size_t>(line.at - begin));
  entries_ = {};
  any_ = false;
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
