#include "cli/status/view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <string_view>

#include <fmt/format.h>

#include "base/printable.h"
#include "gateway/condition_text.h"

namespace vgyro::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegPerHour = 3600.0;
constexpr const char* kNothing = "–";

Json at(const Json& object, const char* key) {
  return object.is_object() && object.contains(key) ? object.at(key) : Json();
}
std::string text_of(const Json& object, const char* key) {
  const Json value = at(object, key);
  return value.is_string() ? printable(value.get<std::string>()) : std::string(kNothing);
}
std::uint64_t count_of(const Json& object, const char* key) {
  const Json value = at(object, key);
  return value.is_number_unsigned() ? value.get<std::uint64_t>() : 0;
}
bool flag_of(const Json& object, const char* key) {
  const Json value = at(object, key);
  return value.is_boolean() && value.get<bool>();
}
double number_of(const Json& object, const char* key) {
  const Json value = at(object, key);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string number_text(double value, const char* form) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(form), value) : std::string(kNothing);
}

std::string with_sigma(double value, double sigma, const char* form, const char* sigma_form) {
  std::string text = number_text(value, form);
  if (std::isfinite(value) && std::isfinite(sigma)) text += " ± " + number_text(sigma, sigma_form);
  return text;
}

std::string duration_text(double seconds) {
  if (!std::isfinite(seconds)) return kNothing;
  const auto s = static_cast<std::uint64_t>(std::max(seconds, 0.0));
  if (s >= 86'400) return fmt::format("{} d {} h", s / 86'400, s % 86'400 / 3600);
  if (s >= 3600) return fmt::format("{} h {} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

/// "stale 3, overflow 1" of the counters above 0.
std::string counts_text(const Json& counts) {
  std::string text;
  if (!counts.is_object()) return kNothing;
  for (const auto& [name, count] : counts.items()) {
    if (!count.is_number_unsigned() || count.get<std::uint64_t>() == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", printable(name),
                        count.get<std::uint64_t>());
  }
  std::replace(text.begin(), text.end(), '_', ' ');
  return text.empty() ? std::string(kNothing) : text;
}

std::size_t columns_of(std::string_view text) {
  // Continuation bytes of UTF-8 take no column.
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
}

enum class Mood : std::uint8_t { kPlain, kGood, kDoubtful, kBad, kQuiet };

class Paint {
 public:
  explicit Paint(bool colour) : colour_(colour) {}
  [[nodiscard]] std::string operator()(Mood mood, const std::string& text) const {
    constexpr std::array<const char*, 5> kCodes{"", "32", "33", "31", "2"};
    if (!colour_ || mood == Mood::kPlain) return text;
    return fmt::format("\x1b[{}m{}\x1b[0m", kCodes[static_cast<std::size_t>(mood)], text);
  }

 private:
  bool colour_;
};

struct Cell {
  std::string text;
  Mood mood = Mood::kPlain;
  bool right = false;
};

std::string table(const std::vector<std::vector<Cell>>& rows, const Paint& paint) {
  std::vector<std::size_t> widths;
  for (const std::vector<Cell>& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i)
      widths[i] = std::max(widths[i], columns_of(row[i].text));
  }
  std::string text;
  for (const std::vector<Cell>& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string blanks(widths[i] - columns_of(row[i].text), ' ');
      const bool last = i + 1 == row.size();
      if (i > 0) line += "  ";
      if (row[i].right) line += blanks;
      line += paint(row[i].mood, row[i].text);
      if (!row[i].right && !last) line += blanks;
    }
    text += line + '\n';
  }
  return text;
}

std::vector<Cell> header(std::initializer_list<const char*> names) {
  std::vector<Cell> row;
  for (const char* name : names)
    row.push_back({name, Mood::kQuiet});
  return row;
}

Mood mood_of_state(const std::string& state) {
  if (state == "running") return Mood::kGood;
  return state == "lost" || state == "contradicted" ? Mood::kBad : Mood::kDoubtful;
}

std::string gyros_table(const Json& status, const Paint& paint) {
  std::vector<std::vector<Cell>> rows{
      header({"gyro", "bus", "health", "bias, deg/h", "reads, deg/s", "°C", "frames", "used",
              "lost", "not used"})};
  for (const Json& gyro : at(status, "gyros")) {
    const std::string health = text_of(gyro, "health");
    const std::uint64_t frames = count_of(gyro, "frames");
    const double used =
        100.0 * static_cast<double>(count_of(gyro, "samples")) / static_cast<double>(frames);
    rows.push_back(
        {{text_of(gyro, "name")},
         {text_of(gyro, "bus")},
         {health, health == "ok" ? Mood::kGood : Mood::kBad},
         {with_sigma(number_of(gyro, "bias_dps") * kDegPerHour,
                     number_of(gyro, "bias_sigma_dps") * kDegPerHour, "{:+.2f}", "{:.2f}"),
          Mood::kPlain, true},
         {number_text(number_of(gyro, "rate_dps"), "{:+.5f}"), Mood::kPlain, true},
         {number_text(number_of(gyro, "temperature_c"), "{:.1f}"), Mood::kPlain, true},
         {fmt::format("{}", frames), Mood::kPlain, true},
         {frames > 0 ? fmt::format("{:.1f} %", used) : kNothing, Mood::kPlain, true},
         {fmt::format("{}", count_of(gyro, "missing")), Mood::kPlain, true},
         {counts_text(at(gyro, "rejected"))}});
  }
  return table(rows, paint);
}

/// The axes of a platform with several; empty for two single gyros.
std::string axes_table(const Json& status, const Paint& paint) {
  const Json axes = at(status, "axes");
  if (!axes.is_array() || axes.empty()) return {};
  std::vector<std::vector<Cell>> rows{
      header({"axis", "state", "rate, deg/s", "bias 1, deg/h", "bias 2, deg/h", "health 1",
              "health 2", "misalignment, deg"})};
  for (const Json& axis : axes) {
    const std::string state = text_of(axis, "state");
    const auto health = [&](const char* key) {
      const std::string text = text_of(axis, key);
      return Cell{text, text == "ok" ? Mood::kGood : Mood::kBad};
    };
    const auto bias = [&](const char* key) {
      return Cell{number_text(number_of(axis, key) * kDegPerHour, "{:+.2f}"), Mood::kPlain, true};
    };
    rows.push_back({{text_of(axis, "axis")},
                    {state, mood_of_state(state)},
                    {with_sigma(number_of(axis, "rate_dps"), number_of(axis, "sigma_dps"),
                                "{:+.5f}", "{:.5f}"),
                     Mood::kPlain, true},
                    bias("bias_1_dps"),
                    bias("bias_2_dps"),
                    health("health_1"),
                    health("health_2"),
                    {with_sigma(number_of(axis, "misalignment_deg"),
                                number_of(axis, "misalignment_sigma_deg"), "{:+.3f}", "{:.3f}"),
                     Mood::kPlain, true}});
  }
  return table(rows, paint) + '\n';
}

std::string buses_table(const Json& status, const Paint& paint) {
  std::vector<std::vector<Cell>> rows{
      header({"bus", "link", "controller", "received", "lost", "downs", "errors"})};
  for (const Json& bus : at(status, "buses")) {
    const bool present = flag_of(bus, "present");
    const bool up = flag_of(bus, "link_up");
    const std::string controller = text_of(bus, "controller");
    const bool active = controller == "active";
    rows.push_back({{text_of(bus, "name")},
                    {up ? "up" : (present ? "down" : "not there"), up ? Mood::kGood : Mood::kBad},
                    {controller, active ? Mood::kGood
                                        : (controller == "bus_off" ? Mood::kBad : Mood::kDoubtful)},
                    {fmt::format("{}", count_of(bus, "received")), Mood::kPlain, true},
                    {fmt::format("{}", count_of(bus, "lost")), Mood::kPlain, true},
                    {fmt::format("{}", count_of(bus, "downs")), Mood::kPlain, true},
                    {counts_text(at(bus, "errors"))}});
  }
  return table(rows, paint);
}

// --- findings of the corrector ---

gateway::GyroNames names_of(const Json& status) {
  gateway::GyroNames names{kNothing, kNothing};
  std::size_t at_name = 0;
  for (const Json& gyro : at(status, "gyros")) {
    if (at_name < names.size()) names[at_name++] = text_of(gyro, "name");
  }
  return names;
}

std::array<double, 2> of_gyros(const Json& status, const char* key) {
  std::array<double, 2> values{};
  values.fill(std::numeric_limits<double>::quiet_NaN());
  std::size_t at_value = 0;
  for (const Json& gyro : at(status, "gyros")) {
    if (at_value < values.size()) values[at_value++] = number_of(gyro, key);
  }
  return values;
}

/// A hypothesis that is missing has the probability 0.
gateway::Probabilities probabilities_of(const Json& status) {
  const Json told = at(status, "hypotheses");
  gateway::Probabilities probability{};
  for (std::size_t i = 0; i < probability.size(); ++i) {
    const std::string name(gateway::to_string(static_cast<fusion::Hypothesis>(i)));
    const double value = number_of(told, name.c_str());
    if (value >= 0.0 && value <= 1.0) probability[i] = value;
  }
  return probability;
}

gateway::SteadyStretches stretches_of(const Json& status) {
  const Json counters = at(status, "counters");
  return {count_of(counters, "stops"), count_of(counters, "stops_refused"),
          count_of(counters, "stops_open")};
}

std::string opinion(const Json& status, const Paint& paint) {
  const gateway::GyroNames names = names_of(status);
  const gateway::Probabilities probability = probabilities_of(status);
  const gateway::SteadyStretches stretches = stretches_of(status);
  std::string text;
  const auto line = [&](Mood mood, const char* title, const std::string& words) {
    if (!words.empty()) text += paint(mood, title + words) + '\n';
  };
  if (flag_of(status, "ambiguous")) {
    line(Mood::kDoubtful, "", gateway::ambiguity_text(probability, names));
  } else {
    line(Mood::kPlain, "likely: ", gateway::hypotheses_text(probability, names));
  }
  const std::string kind = gateway::drift_kind_text(probability);
  line(Mood::kPlain, "the drifts: ", kind);
  if (!kind.empty()) {
    line(Mood::kPlain, "the biases move by ",
         gateway::slopes_text(of_gyros(status, "slope_dps_s"),
                              of_gyros(status, "slope_sigma_dps_s"), names));
  }
  line(Mood::kPlain, "", gateway::stretches_text(stretches));
  line(Mood::kDoubtful, "", gateway::stretches_advice(stretches));
  line(Mood::kDoubtful, "", gateway::innovation_text(number_of(status, "normalized_innovation")));
  return text;
}

/// Troubles of the gyros or of vgyro itself, with what to do about them.
std::string troubles(const Json& status, const Paint& paint) {
  std::string text;
  for (const Json& gyro : at(status, "gyros")) {
    if (text_of(gyro, "health") != gateway::to_string(gateway::Fault::kBlind)) continue;
    text += paint(Mood::kBad, "gyro " + text_of(gyro, "name") + ' ' + gateway::blind_text() + ": " +
                                  gateway::blind_advice()) +
            '\n';
  }
  if (flag_of(status, "rates_too_far_apart"))
    text += paint(Mood::kBad, gateway::rates_too_far_apart_text()) + '\n';
  const std::uint64_t restarts = count_of(at(status, "counters"), "estimate_restarts");
  if (restarts > 0) text += paint(Mood::kBad, gateway::restarts_text(restarts)) + '\n';
  return text;
}

std::string head(const Json& status, const ViewOptions& options, const Paint& paint) {
  const std::string state = text_of(status, "state");
  std::string text = paint(mood_of_state(state), state);
  if (state == "calibrating") {
    text += fmt::format(" {} of {} s", number_text(number_of(status, "calibrated_s"), "{:.1f}"),
                        number_text(number_of(status, "rest_s"), "{:g}"));
  }
  const double rate_dps = number_of(status, "rate_dps");
  if (std::isfinite(rate_dps)) {
    text +=
        "  " + with_sigma(rate_dps, number_of(status, "sigma_dps"), "{:+.5f}", "{:.5f}") + " deg/s";
    const std::string quality = text_of(status, "quality");
    text += "  " + paint(quality == "two_gyros" ? Mood::kGood : Mood::kDoubtful, quality);
  }
  text += '\n';
  if (options.rates_dps.size() > 1) text += sparkline(options.rates_dps) + '\n';
  const double bias_sigma_dps = number_of(status, "bias_sigma_dps");
  if (std::isfinite(bias_sigma_dps)) {
    text += fmt::format("its drift is known to ± {:.2f} deg/h\n", bias_sigma_dps * kDegPerHour);
  }
  text += opinion(status, paint);
  const auto remark = [&](bool applies, Mood mood, const char* words) {
    if (applies) text += paint(mood, words) + '\n';
  };
  remark(text_of(status, "restored") == "taken_up", Mood::kDoubtful,
         "on biases of an earlier run, which no stop has confirmed");
  const Json transmit = at(status, "transmit");
  remark(transmit.is_boolean() && !transmit.get<bool>(), Mood::kDoubtful,
         "shadow mode: nothing is sent ([output] transmit = false)");
  const std::string contradiction = text_of(status, "contradiction_text");
  const bool contradicted = !contradiction.empty() && contradiction != kNothing;
  remark(contradicted, Mood::kBad,
         (contradiction + "; " + gateway::contradiction_advice()).c_str());
  remark(!contradicted && flag_of(status, "disagree"), Mood::kBad,
         "the gyros disagree; it is not known which one is wrong");
  text += troubles(status, paint);
  remark(flag_of(status, "config_refused"), Mood::kBad,
         "the new configuration was refused; journalctl -u vgyrod says why");
  for (const Json& bus : at(status, "buses")) {
    remark(flag_of(bus, "contested"), Mood::kBad,
           ("another sender uses our identifiers on " + text_of(bus, "name")).c_str());
  }
  const std::uint64_t lines_lost = count_of(at(status, "counters"), "log_lines_lost");
  remark(lines_lost > 0, Mood::kDoubtful,
         fmt::format("{} lines of its log are lost: nothing reads the log", lines_lost).c_str());
  return text;
}

}  // namespace

std::string sparkline(const std::vector<double>& values) {
  constexpr std::array<const char*, 8> kBlocks{"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  std::string text;
  for (const double value : values) {
    if (!std::isfinite(value)) {
      text += ' ';
      continue;
    }
    const double share = high > low ? (value - low) / (high - low) : 0.0;
    text += kBlocks[static_cast<std::size_t>(std::lround(share * (kBlocks.size() - 1)))];
  }
  return text;
}

/// Unused frames of the inputs other than gyros; empty if all were used.
std::string unused_inputs(const Json& counters) {
  Json counts = Json::object();
  for (const std::string name : {"reference", "accelerometer", "speed"})
    counts[name] = count_of(counters, (name + "_rejected").c_str());
  const std::string text = counts_text(counts);
  return text == kNothing ? std::string() : "frames not used: " + text + '\n';
}

/// Frames sent in foreign layouts; empty without any.
std::string layouts_line(const Json& counters) {
  const std::uint64_t frames = count_of(counters, "layout_frames");
  const std::uint64_t withheld = count_of(counters, "layout_withheld");
  if (frames == 0 && withheld == 0) return {};
  std::string text = fmt::format("layouts: {} frames, {} with a valid rate", frames,
                                 count_of(counters, "layout_frames_valid"));
  if (const auto beyond = count_of(counters, "layout_out_of_range"); beyond > 0)
    text += fmt::format(", {} rates beyond what they can carry", beyond);
  if (withheld > 0) text += fmt::format(", {} withheld while no rate was valid", withheld);
  return text + '\n';
}

/// The recording of the last minutes, and the captures written of it; empty if there is none.
std::string captures_line(const Json& status, const Paint& paint) {
  const Json captures = at(status, "captures");
  if (!captures.is_object() || captures.empty()) return {};
  std::uint64_t written = 0;
  for (const Json& count : at(captures, "written"))
    written += count.is_number_unsigned() ? count.get<std::uint64_t>() : 0;
  constexpr double kMegabyte = 1e6;
  std::string text =
      fmt::format("recorded: {} of the inputs, {} frames, {:.1f} MB; {} written",
                  duration_text(number_of(captures, "held_s")), count_of(captures, "held_frames"),
                  static_cast<double>(count_of(captures, "held_bytes")) / kMegabyte, written);
  const std::string last = text_of(captures, "last");
  if (!last.empty() && last != kNothing) text += ", the last one is " + last;
  text += '\n';
  if (const auto failed = count_of(captures, "failed"); failed > 0) {
    text += paint(Mood::kBad, fmt::format("{} recordings could not be written; journalctl -u "
                                          "vgyrod VGYRO_CAUSE=capture says why",
                                          failed)) +
            '\n';
  }
  if (const auto dropped = count_of(captures, "frames_dropped"); dropped > 0) {
    text += paint(Mood::kDoubtful,
                  fmt::format("{} frames are missing in the recording: too little processor time",
                              dropped)) +
            '\n';
  }
  return text;
}

std::string status_table(const Json& status, const ViewOptions& options) {
  const Paint paint(options.colour);
  const Json counters = at(status, "counters");
  std::string text = head(status, options, paint);
  text += '\n' + axes_table(status, paint) + gyros_table(status, paint) + '\n' +
          buses_table(status, paint) + '\n';
  text += fmt::format(
      "sent {} frames, {} valid rates of {}; dropped: stale {}, overflow {}, refused {}\n",
      count_of(counters, "frames_sent"), count_of(counters, "rates_valid"),
      count_of(counters, "rates"), count_of(counters, "frames_stale"),
      count_of(counters, "frames_overflowed"), count_of(counters, "frames_refused"));
  text += layouts_line(counters);
  text += unused_inputs(counters);
  text += captures_line(status, paint);
  text += paint(Mood::kQuiet, fmt::format("vgyrod {}, method {}, configuration {}, up {}",
                                          text_of(status, "version"), text_of(status, "method"),
                                          text_of(status, "fingerprint"),
                                          duration_text(number_of(status, "uptime_s")))) +
          '\n';
  return text;
}

std::string status_line(const Json& status) {
  std::string text = text_of(status, "state");
  const double rate_dps = number_of(status, "rate_dps");
  if (std::isfinite(rate_dps)) {
    text += fmt::format(" {} deg/s, {}",
                        with_sigma(rate_dps, number_of(status, "sigma_dps"), "{:+.5f}", "{:.5f}"),
                        text_of(status, "quality"));
  }
  for (const Json& gyro : at(status, "gyros")) {
    text += fmt::format("; {} {}, bias {} deg/h", text_of(gyro, "name"), text_of(gyro, "health"),
                        number_text(number_of(gyro, "bias_dps") * kDegPerHour, "{:+.2f}"));
  }
  const Json transmit = at(status, "transmit");
  if (transmit.is_boolean() && !transmit.get<bool>()) text += "; shadow mode";
  return text;
}

}  // namespace vgyro::cli
