#include "cli/replay/summary.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/log_notes.h"
#include "gateway/condition_text.h"
#include "gateway/config.h"
#include "gateway/model_plan.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kSecondsPerHour = 3600.0;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

double mean_of(double sum, std::uint64_t count) {
  return count == 0 ? std::nan("") : sum / static_cast<double>(count);
}

Json log_json(const LogSummary& log) {
  Json malformed = Json::array();
  for (const canlog::MalformedLine& bad : log.counts.first_malformed) {
    malformed.push_back({{"line", bad.line}, {"why", bad.why}});
  }
  return {{"lines", log.counts.lines},
          {"frames", log.counts.frames},
          {"xl_frames", log.counts.xl_frames},
          {"other_lines", log.counts.other_lines},
          {"malformed_lines", log.counts.malformed_lines},
          {"skipped_bytes", log.counts.skipped_bytes},
          {"cut_off_lines", log.counts.cut_off_lines},
          {"first_malformed", malformed}};
}

Json rejected_json(const gateway::GyroStatus& gyro) {
  Json rejected = Json::object();
  for (std::size_t i = 0; i < gateway::kRejectCount; ++i) {
    rejected[std::string(to_string(static_cast<gateway::Reject>(i)))] = gyro.rejected[i];
  }
  return rejected;
}

std::uint64_t times(const gateway::GyroStatus& gyro, gateway::Fault fault) {
  return gyro.faults[static_cast<std::size_t>(fault)].times;
}

// Only faults that occurred, because most gyros have none.
Json faults_json(const gateway::GyroStatus& gyro) {
  Json faults = Json::object();
  for (std::size_t i = 0; i < gateway::kFaultCount; ++i) {
    const gateway::FaultRecord& record = gyro.faults[i];
    if (record.times == 0) continue;
    faults[std::string(to_string(static_cast<gateway::Fault>(i)))] = {
        {"times", record.times}, {"last_s", to_seconds(record.last.time_since_epoch())}};
  }
  return faults;
}

std::uint64_t rejected_total(const gateway::GyroStatus& gyro) {
  std::uint64_t total = 0;
  for (const std::uint64_t count : gyro.rejected)
    total += count;
  return total;
}

Json gyro_json(const ReplaySummary& summary, const gateway::Plan& plan, std::size_t index) {
  const gateway::GyroStatus& gyro = summary.status.gyros[index];
  Json json{{"name", plan.gyros[index].name},
            {"frames", gyro.frames},
            {"samples", gyro.samples},
            {"rejected", rejected_json(gyro)},
            {"missing_by_counter", gyro.missing},
            {"unpaired", gyro.unpaired},
            {"time_outs", times(gyro, gateway::Fault::kSilent)},
            {"faults", faults_json(gyro)},
            {"mean_rate_dps", number(mean_of(summary.raw_sum_dps[index], summary.raws[index]))},
            {"bias_dps", number(gyro.bias_dps)},
            {"bias_sigma_dps", number(summary.bias_sigma_dps[index])},
            {"slope_dps_s", number(summary.slope_dps_s[index])},
            {"slope_sigma_dps_s", number(summary.slope_sigma_dps_s[index])},
            {"temperature_c", number(gyro.temperature_c)}};
  if (gyro.counter_turns_at) json["counter_turns_at"] = *gyro.counter_turns_at;
  if (plan.gyros[index].supply_voltage) json["supply_v"] = number(gyro.supply_v);
  return json;
}

// Null without a model. `waits_for` names inputs that were never received, so that their effects
// were not corrected.
Json model_json(const ReplaySummary& summary, const gateway::Plan& plan) {
  if (!plan.model) return nullptr;
  Json effects = Json::array();
  for (const model::Effect& effect : plan.model->effects) {
    effects.push_back({{"gyro", effect.gyro + 1},
                       {"kind", model::info(effect.kind).name},
                       {"treatment", gateway::treatment(effect.kind)}});
  }
  Json waits_for = Json::array();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    for (const std::string_view input : gateway::inputs_text(summary.status.gyros[gyro].waits_for))
      waits_for.push_back({{"gyro", gyro + 1}, {"input", input}});
  }
  return {{"file", plan.model->file}, {"effects", effects}, {"waits_for", waits_for}};
}

Json stops_json(const gateway::Status& status) {
  return {
      {"learned", status.stops}, {"refused", status.stops_refused}, {"open", status.stops_open}};
}

// Hypotheses at the end of the recording; leaves out those up to kWorthTelling.
Json hypotheses_json(const gateway::Status& status) {
  Json hypotheses = Json::object();
  for (std::size_t i = 0; i < status.probability.size(); ++i) {
    if (!(status.probability[i] > gateway::kWorthTelling)) continue;
    hypotheses[std::string(gateway::to_string(static_cast<fusion::Hypothesis>(i)))] =
        status.probability[i];
  }
  return hypotheses;
}

Json gaps_json(const ReplaySummary& summary) {
  Json gaps = Json::array();
  for (const Gap& gap : summary.longest_gaps) {
    gaps.push_back({{"from_s", gap.from_s}, {"length_s", gap.length_s}});
  }
  return {{"longer_than_s", ReplaySummary::kGap_s}, {"count", summary.gaps}, {"longest", gaps}};
}

// State at the end of the recording; `contradiction` is "none" if both gyros can be on one
// platform.
Json pair_json(const gateway::Status& status) {
  const fusion::PairVerdict& pair = status.pair;
  const bool any = pair.contradiction != fusion::Contradiction::kNone;
  return {{"contradiction", gateway::to_string(pair.contradiction)},
          {"contradictions", status.contradictions},
          {"probability", any ? number(pair.probability) : Json(nullptr)},
          {"slope", any ? number(pair.slope) : Json(nullptr)},
          {"slope_sigma", any ? number(pair.slope_sigma) : Json(nullptr)},
          {"lag_s", any ? number(pair.lag_s) : Json(nullptr)}};
}

const gateway::GyroPlan* gyro_of(const gateway::Plan& plan, const std::string& interface,
                                 const IdCounts::Row& row) {
  for (const gateway::GyroPlan& gyro : plan.gyros) {
    if (gyro.bus == interface && gyro.match.carries(row.id, row.extended)) return &gyro;
    for (const gateway::GyroPlan& axis : gyro.axes) {
      if (axis.bus == interface && axis.match.carries(row.id, row.extended)) return &gyro;
    }
  }
  return nullptr;
}

Json layouts_json(const gateway::Status& status, const gateway::Plan& plan) {
  Json layouts = Json::array();
  for (std::size_t i = 0; i < plan.output.layouts.size(); ++i) {
    const gateway::OutputLayout& layout = plan.output.layouts[i];
    const gateway::LayoutCounts& counts = status.layouts_out[i];
    layouts.push_back({{"bus", plan.buses[layout.bus]},
                       {"id", layout.id},
                       {"message", layout.message},
                       {"frames", counts.frames},
                       {"valid", counts.valid},
                       {"out_of_range", counts.out_of_range},
                       {"withheld", counts.withheld}});
  }
  return layouts;
}

Json axis_gyro_json(const gateway::GyroStatus& gyro) {
  return {{"samples", gyro.samples},
          {"rejected", rejected_json(gyro)},
          {"faults", faults_json(gyro)},
          {"bias_dps", number(gyro.bias_dps)}};
}

// The figures of each axis, on a platform with several.
Json axes_json(const ReplaySummary& summary) {
  Json axes = Json::array();
  for (const AxisSummary& axis : summary.axes) {
    const gateway::Status& status = axis.status;
    axes.push_back(
        {{"axis", std::string(1, axis.name)},
         {"final_state", to_string(status.state)},
         {"pairs", status.pairs},
         {"rates", status.rates_out},
         {"rates_valid", status.rates_out_valid},
         {"mean_rate_dps", number(mean_of(axis.rate_sum_dps, axis.rates))},
         {"gyros", {axis_gyro_json(status.gyros[0]), axis_gyro_json(status.gyros[1])}},
         {"windows", {{"completed", status.windows}, {"skipped", status.windows_skipped}}},
         {"stops", stops_json(status)},
         {"disagreements", status.disagreements},
         {"hypotheses", hypotheses_json(status)},
         {"normalized_innovation", number(status.normalized_innovation)},
         {"pair", pair_json(status)}});
  }
  return axes;
}

Json misalignment_json(const gateway::Status& status) {
  return {{"angle_deg", status.misalignment_deg},
          {"sigma_deg", status.misalignment_sigma_deg},
          {"segments", status.misalignment_segments}};
}

}  // namespace

void IdCounts::add_extended(can::BusIndex bus, const can::Frame& frame) {
  if (frame.has(can::kError)) {
    ++error_frames_;
    return;
  }
  const std::uint64_t key = static_cast<std::uint64_t>(bus) << 32U | frame.id;
  if (extended_.empty()) extended_.resize(kPlaces);
  // Identifiers differ in any of their bits; the product's top bits depend on all of them.
  constexpr std::uint64_t kScatter = 0x9E3779B97F4A7C15U;
  std::size_t at = (key * kScatter) >> (64U - std::bit_width(kPlaces - 1));
  while (extended_[at].frames > 0 && extended_[at].key != key)
    at = (at + 1) % kPlaces;
  Place& place = extended_[at];
  if (place.frames == 0) {
    if (extended_count_ == kExtendedMax) return;
    ++extended_count_;
    place.key = key;
  }
  ++place.frames;
}

std::vector<IdCounts::Row> IdCounts::rows() const {
  std::vector<Row> rows;
  for (std::size_t bus = 0; bus < standard_.size(); ++bus) {
    for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
      const std::uint64_t frames = standard_[bus][id];
      if (frames > 0) rows.push_back({static_cast<can::BusIndex>(bus), id, false, frames});
    }
  }
  for (const auto& [key, frames] : extended_) {
    if (frames == 0) continue;
    rows.push_back(
        {static_cast<can::BusIndex>(key >> 32U), static_cast<std::uint32_t>(key), true, frames});
  }
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
    return std::tuple(a.bus, a.extended, a.id) < std::tuple(b.bus, b.extended, b.id);
  });
  return rows;
}

void ReplaySummary::add_gap(const Gap& gap) {
  ++gaps;
  longest_gaps.push_back(gap);
  std::stable_sort(longest_gaps.begin(), longest_gaps.end(),
                   [](const Gap& a, const Gap& b) { return a.length_s > b.length_s; });
  if (longest_gaps.size() > kGapsShown) longest_gaps.resize(kGapsShown);
}

Json to_json(const ReplaySummary& summary, const gateway::Plan& plan) {
  const gateway::Status& status = summary.status;
  Json logs = Json::array();
  for (const LogSummary& log : summary.logs)
    logs.push_back(log_json(log));
  Json ids = Json::array();
  for (const IdCounts::Row& row : summary.ids.rows()) {
    const std::string& interface = summary.interfaces[row.bus];
    const gateway::GyroPlan* gyro = gyro_of(plan, interface, row);
    ids.push_back({{"bus", interface},
                   {"id", row.id},
                   {"extended", row.extended},
                   {"frames", row.frames},
                   {"gyro", gyro == nullptr ? Json(nullptr) : Json(gyro->name)}});
  }
  Json all = {
      {"format", 1},
      {"method", gateway::to_string(plan.corrector.method)},
      {"model", model_json(summary, plan)},
      {"logs", logs},
      {"first_s", summary.first_s},
      {"last_s", summary.last_s},
      {"frames_by_id", ids},
      {"error_frames", summary.ids.error_frames()},
      {"gyros", {gyro_json(summary, plan, 0), gyro_json(summary, plan, 1)}},
      {"reference", {{"frames", status.reference_frames}, {"rejected", status.reference_rejected}}},
      {"accelerometer",
       {{"frames", status.accelerometer_frames}, {"rejected", status.accelerometer_rejected}}},
      {"speed", {{"frames", status.speed_frames}, {"rejected", status.speed_rejected}}},
      {"pairs", status.pairs},
      {"clock_steps", status.clock_steps},
      {"gaps", gaps_json(summary)},
      {"windows", {{"completed", status.windows}, {"skipped", status.windows_skipped}}},
      {"stops", stops_json(status)},
      {"hypotheses", hypotheses_json(status)},
      {"ambiguous", status.ambiguous},
      {"normalized_innovation", number(status.normalized_innovation)},
      {"estimate_restarts", status.estimate_restarts},
      {"rates_too_far_apart", status.rates_too_far_apart},
      {"disagreements", status.disagreements},
      {"pair", pair_json(status)},
      {"calibration",
       {{"covered_s", status.calibrated_s},
        {"restarts", status.calibration_restarts},
        {"platform_moved", status.moved_in_calibration}}},
      {"out",
       {{"frames", summary.frames_out},
        {"rates", status.rates_out},
        {"rates_valid", status.rates_out_valid},
        {"rates_out_of_range", status.rates_out_of_range},
        {"biases", status.biases_out},
        {"mean_rate_dps", number(mean_of(summary.rate_sum_dps, summary.rates))}}},
      {"final_state", to_string(status.state)}};
  if (!plan.output.layouts.empty()) all["out"]["layouts"] = layouts_json(status, plan);
  if (!summary.axes.empty()) {
    all["axes"] = axes_json(summary);
    all["misalignment"] = misalignment_json(status);
  }
  return all;
}

namespace {

// A drift beyond this is shown in deg/s, because in deg/h it would have too many digits to read.
constexpr double kReadableInDegPerHour_dps = 0.3;

// Decimals that leave σ two significant digits.
int digits_for(double sigma) {
  constexpr int kDigitsMost = 9;
  return std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, kDigitsMost);
}

// "+0.033032 ± 0.000042 deg/s = +118.92 ± 0.15 deg/h"; without σ if it is unknown.
std::string drift_text(double bias_dps, double sigma_dps) {
  const bool known = sigma_dps > 0.0 && std::isfinite(sigma_dps);
  const auto text = [&](double scale, const char* unit, int digits) {
    return known ? fmt::format("{:+.{}f} ± {:.{}f} {}", scale * bias_dps,
                               digits_for(scale * sigma_dps), scale * sigma_dps,
                               digits_for(scale * sigma_dps), unit)
                 : fmt::format("{:+.{}f} {}", scale * bias_dps, digits, unit);
  };
  std::string all = text(1.0, "deg/s", 6);
  if (std::abs(bias_dps) <= kReadableInDegPerHour_dps)
    all += " = " + text(kSecondsPerHour, "deg/h", 3);
  return all;
}

// "8 stops: 7 learned, 1 refused (moving together)".
std::string stops_text(const gateway::SteadyStretches& stretches) {
  const std::uint64_t all = stretches.learned + stretches.refused;
  if (all == 0) return {};
  std::string text = fmt::format("{}: {} learned", count_of(all, "stop"), stretches.learned);
  if (stretches.refused > 0)
    text += fmt::format(", {} refused (moving together)", stretches.refused);
  if (stretches.open > 0) {
    text +=
        fmt::format("; {} left open: standing or turning could not be told apart", stretches.open);
  }
  return text;
}

std::string how_often(std::uint64_t times) {
  return times == 1 ? "once" : fmt::format("{} times", times);
}

void put_faults(fmt::memory_buffer& text, const gateway::GyroStatus& gyro, double first_s) {
  const char* separator = "\n  faults:";
  for (std::size_t i = 0; i < gateway::kFaultCount; ++i) {
    const gateway::FaultRecord& record = gyro.faults[i];
    if (record.times == 0) continue;
    fmt::format_to(std::back_inserter(text), "{} {} {}, last at {:.2f} s", separator,
                   to_string(static_cast<gateway::Fault>(i)), how_often(record.times),
                   to_seconds(record.last.time_since_epoch()) - first_s);
    separator = ";";
  }
}

// The result of the plain mean of both gyros over the same instants.
void put_plain_mean(fmt::memory_buffer& text, const ReplaySummary& summary) {
  if (summary.rates == 0 || summary.raws[0] != summary.rates || summary.raws[1] != summary.rates) {
    return;
  }
  const auto count = static_cast<double>(summary.rates);
  const double mean_dps = 0.5 * (summary.raw_sum_dps[0] + summary.raw_sum_dps[1]) / count;
  const double excess_dps = mean_dps - summary.rate_sum_dps / count;
  const double valid_s = (summary.last_s - summary.first_s) * count /
                         static_cast<double>(std::max<std::uint64_t>(summary.status.pairs, 1));
  fmt::format_to(
      std::back_inserter(text),
      "\nplain mean    {:+.6f} deg/s, {:+.3f} deg/h off the virtual gyro: {:+.4f} deg of "
      "heading over {:.0f} s",
      mean_dps, excess_dps * kSecondsPerHour, excess_dps * valid_s, valid_s);
}

// The corrector's findings at the end of the recording.
void put_opinion(fmt::memory_buffer& text, const ReplaySummary& summary,
                 const gateway::Plan& plan) {
  const gateway::Status& status = summary.status;
  const gateway::GyroNames names{plan.gyros[0].name, plan.gyros[1].name};
  auto to = std::back_inserter(text);
  const auto line = [&](const char* title, const std::string& words) {
    if (!words.empty()) fmt::format_to(to, "\n{:<13} {}", title, words);
  };
  line("pair", gateway::contradiction_text(status.pair, names));
  line("stops", stops_text(gateway::steady_stretches(status)));
  line("at the end", status.ambiguous ? gateway::ambiguity_text(status.probability, names)
                                      : gateway::hypotheses_text(status.probability, names));
  line("scatter", gateway::innovation_text(status.normalized_innovation));
  const std::string kind = gateway::drift_kind_text(status.probability);
  line("drifts", kind);
  if (!kind.empty()) {
    const std::string slopes =
        gateway::slopes_text(summary.slope_dps_s, summary.slope_sigma_dps_s, names);
    if (!slopes.empty()) fmt::format_to(to, "; the biases move by {}", slopes);
  }
}

void put_gyro(fmt::memory_buffer& text, const ReplaySummary& summary, const gateway::Plan& plan,
              std::size_t i) {
  auto to = std::back_inserter(text);
  const gateway::GyroStatus& gyro = summary.status.gyros[i];
  fmt::format_to(to, "gyro {:<8} {} samples", plan.gyros[i].name, gyro.samples);
  if (summary.raws[i] > 0) {
    fmt::format_to(to, ", raw mean {:+.6f} deg/s",
                   summary.raw_sum_dps[i] / static_cast<double>(summary.raws[i]));
  }
  if (std::isfinite(gyro.bias_dps)) {
    fmt::format_to(to, ", drift now {}", drift_text(gyro.bias_dps, summary.bias_sigma_dps[i]));
  }
  if (gyro.missing > 0) fmt::format_to(to, ", {} missing by its counter", gyro.missing);
  if (rejected_total(gyro) > 0) {
    fmt::format_to(to, "\n  not used:");
    for (std::size_t k = 0; k < gateway::kRejectCount; ++k) {
      if (gyro.rejected[k] == 0) continue;
      fmt::format_to(to, " {} {}", gyro.rejected[k], to_string(static_cast<gateway::Reject>(k)));
    }
  }
  if (const std::string counter = gateway::counter_text(gyro); !counter.empty()) {
    fmt::format_to(to, "\n  {}", counter);
  }
  put_faults(text, gyro, summary.first_s);
  fmt::format_to(to, "\n");
}

// The reference, and which effects of the model file were corrected.
void put_other_inputs(fmt::memory_buffer& text, const gateway::Status& status,
                      const gateway::Plan& plan) {
  auto to = std::back_inserter(text);
  if (status.reference_frames > 0) {
    fmt::format_to(to, "reference     {} frames, {} not used\n", status.reference_frames,
                   status.reference_rejected);
  }
  if (plan.model) {
    fmt::format_to(to, "model         {}, {} effects\n", plan.model->file,
                   plan.model->effects.size());
  }
  for (std::size_t i = 0; i < 2; ++i) {
    for (const std::string_view input : gateway::inputs_text(status.gyros[i].waits_for)) {
      fmt::format_to(to, "  gyro {}: effects of {} not taken back, it was never heard\n",
                     plan.gyros[i].name, input);
    }
  }
}

void put_virtual_gyro(fmt::memory_buffer& text, const ReplaySummary& summary) {
  auto to = std::back_inserter(text);
  const gateway::Status& status = summary.status;
  fmt::format_to(to, "virtual gyro  {} pairs, {} valid rates", status.pairs,
                 status.rates_out_valid);
  if (summary.rates > 0) {
    fmt::format_to(to, ", mean {:+.6f} deg/s",
                   summary.rate_sum_dps / static_cast<double>(summary.rates));
  }
  if (status.rates_out_of_range > 0) {
    fmt::format_to(to, ", {} beyond what VG_Rate can carry (sent as invalid)",
                   status.rates_out_of_range);
  }
  put_plain_mean(text, summary);
}

// One line for each axis, and the misalignment of the units.
void put_axes(fmt::memory_buffer& text, const ReplaySummary& summary, const gateway::Plan& plan) {
  auto to = std::back_inserter(text);
  for (const AxisSummary& axis : summary.axes) {
    const gateway::Status& status = axis.status;
    fmt::format_to(to, "\naxis {}        {}, {} pairs, {} valid rates", axis.name,
                   to_string(status.state), status.pairs, status.rates_out_valid);
    if (axis.rates > 0)
      fmt::format_to(to, ", mean {:+.6f} deg/s", mean_of(axis.rate_sum_dps, axis.rates));
    for (std::size_t i = 0; i < 2; ++i) {
      if (!std::isfinite(status.gyros[i].bias_dps)) continue;
      fmt::format_to(to, "\n  drift of {} now {}", plan.gyros[i].name,
                     drift_text(status.gyros[i].bias_dps, axis.bias_sigma_dps[i]));
    }
    if (const std::string stops = stops_text(gateway::steady_stretches(status)); !stops.empty())
      fmt::format_to(to, "\n  {}", stops);
    for (std::size_t i = 0; i < 2; ++i)
      put_faults(text, status.gyros[i], summary.first_s);
  }
  const gateway::Status& status = summary.status;
  if (summary.axes.empty() || status.misalignment_segments == 0) return;
  fmt::format_to(to, "\nmisalignment  of {} against {}:", plan.gyros[1].name, plan.gyros[0].name);
  for (std::size_t axis = 0; axis < gateway::kAxes; ++axis) {
    fmt::format_to(to, "{} {:+.4f} ± {:.4f} deg about {}", axis == 0 ? "" : ",",
                   status.misalignment_deg[axis], status.misalignment_sigma_deg[axis],
                   gateway::kAxisNames[axis]);
  }
}

void put_layouts(fmt::memory_buffer& text, const gateway::Status& status,
                 const gateway::Plan& plan) {
  auto to = std::back_inserter(text);
  for (std::size_t i = 0; i < plan.output.layouts.size(); ++i) {
    const gateway::LayoutCounts& counts = status.layouts_out[i];
    fmt::format_to(to, "\nlayout        {}: {} frames, {} with a valid rate",
                   plan.output.layouts[i].message, counts.frames, counts.valid);
    if (counts.out_of_range > 0)
      fmt::format_to(to, ", {} rates beyond what it can carry", counts.out_of_range);
    if (counts.withheld > 0)
      fmt::format_to(to, ", {} times silent: it cannot say \"not valid\"", counts.withheld);
  }
}

void put_method(fmt::memory_buffer& text, const ReplaySummary& summary, const gateway::Plan& plan) {
  auto to = std::back_inserter(text);
  const gateway::Status& status = summary.status;
  fmt::format_to(to, "\nmethod        {}", gateway::to_string(plan.corrector.method));
  if (status.windows + status.windows_skipped > 0) {
    fmt::format_to(to, ", {} windows, {} skipped for want of pairs", status.windows,
                   status.windows_skipped);
  }
  if (status.disagreements > 0)
    fmt::format_to(to, "; the gyros disagreed {}", how_often(status.disagreements));
  if (status.clock_steps > 0)
    fmt::format_to(to, "; the clock was set back {}", how_often(status.clock_steps));
  if (summary.gaps > 0) {
    fmt::format_to(to, "; {} gaps, the longest {:.2f} s", summary.gaps,
                   summary.longest_gaps.front().length_s);
  }
  put_opinion(text, summary, plan);
}

}  // namespace

std::string to_text(const ReplaySummary& summary, const gateway::Plan& plan) {
  fmt::memory_buffer text;
  for (const LogSummary& log : summary.logs)
    fmt::format_to(std::back_inserter(text), "{}", log_text(log.path, log.counts, false));
  for (std::size_t i = 0; i < 2; ++i)
    put_gyro(text, summary, plan, i);
  put_other_inputs(text, summary.status, plan);
  put_virtual_gyro(text, summary);
  put_axes(text, summary, plan);
  put_layouts(text, summary.status, plan);
  put_method(text, summary, plan);
  fmt::format_to(std::back_inserter(text), "\nended in state {}\n",
                 to_string(summary.status.state));
  return fmt::to_string(text);
}

}  // namespace vgyro::cli
