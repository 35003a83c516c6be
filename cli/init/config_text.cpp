#include "cli/init/config_text.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include <fmt/core.h>

#include "base/printable.h"
#include "gateway/surroundings.h"

namespace vgyro::cli {

namespace {

/// A TOML string. Names of DBC files and buses are not under our control.
std::string toml_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : printable(text)) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

std::string dbc_path(const Proposal& proposal, const Found& found) {
  namespace fs = std::filesystem;
  std::error_code failed;
  const fs::path file = fs::absolute(found.database->path, failed);
  const fs::path folder = fs::absolute(proposal.folder.empty() ? "." : proposal.folder, failed);
  const fs::path relative = file.lexically_relative(folder.lexically_normal());
  return relative.empty() ? file.string() : relative.string();
}

std::string head_text(const Proposal& proposal, const Found& found) {
  return fmt::format("bus = {}\ndbc = {}\nmessage = {}\n", toml_string(found.stream->bus),
                     toml_string(dbc_path(proposal, found)), toml_string(found.message->name));
}

/// A key with its value, and the reason as a comment in a column of its own.
std::string line(std::string_view key, const std::string& value, std::string_view why = {}) {
  const std::string text = fmt::format("{} = {}", key, value);
  if (why.empty()) return text + "\n";
  return fmt::format("{:<31} # {}\n", text, printable(why));
}

/// A comment, folded; lines that begin with a blank are not folded.
std::string comment(std::string_view text) {
  constexpr std::size_t kColumns = 98;
  std::string result;
  while (!text.empty()) {
    std::string_view one = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), one.size() + 1));
    while (one.size() > kColumns && !one.starts_with(' ')) {
      const std::size_t blank = one.substr(0, kColumns).rfind(' ');
      if (blank == one.npos) break;
      result += "# " + printable(one.substr(0, blank)) + "\n";
      one.remove_prefix(blank + 1);
    }
    result += "# " + printable(one) + "\n";
  }
  return result;
}

/// Counter and check value of any input.
std::string e2e_text(const Companions& with) {
  std::string text;
  if (!with.counter.empty())
    text += line("counter", toml_string(with.counter), "one more with every frame");
  if (with.counter_max)
    text += line("counter_max", std::to_string(*with.counter_max), "its highest value in the log");
  if (with.e2e && !with.e2e->signal.empty()) {
    text += line("crc", toml_string(with.e2e->signal), "agrees with the log's frames");
    text += line("e2e", toml_string(with.e2e->kind));
    if (!with.e2e->data_id.empty())
      text += line("data_id", with.e2e->data_id, "found by trial: the first of those that agree");
  }
  for (const std::string& remark : with.remarks)
    text += comment("CHECK: " + remark);
  return text;
}

std::string sender_text(const Found& found) {
  if (!found.message->is_j1939) return "";
  return line("source_address", std::to_string(found.stream->id & 0xFFU), "the sender in this log");
}

/// `flipped` is the reason for sign = -1; empty: the sign is 1.
std::string gyro_text(const Proposal& proposal, const Candidate& candidate, const char* name,
                      const std::string& flipped) {
  const Companions with = find_companions(candidate.found, *candidate.signal);
  std::string text = fmt::format("[[gyro]]\nname = \"{}\"\n", name);
  text += head_text(proposal, candidate.found);
  const std::string step = candidate.series.step > 0.0
                               ? fmt::format("step {:.3g} deg/s", candidate.series.step)
                               : "a float";
  text += line("rate", toml_string(candidate.signal->name),
               fmt::format("{:.0f} Hz, {}, noise {:.2g} deg/s", 1.0 / candidate.figures.interval_s,
                           step, candidate.figures.noise));
  if (!candidate.assumed_unit.empty()) {
    text += line("unit", toml_string(candidate.assumed_unit),
                 "CHECK: the DBC file gives no unit; assumed");
  }
  if (!flipped.empty()) text += line("sign", "-1", flipped);
  if (!candidate.sign_signal.empty())
    text += line("sign_signal", toml_string(candidate.sign_signal), "CHECK: by its name");
  text += sender_text(candidate.found);
  if (!with.temperature.empty()) text += line("temperature", toml_string(with.temperature));
  if (!with.valid.empty())
    text += line("valid", toml_string(with.valid), "CHECK: by its label in the DBC file");
  return text + e2e_text(with) + "\n";
}

std::string commented(const std::string& text) {
  std::string result;
  bool fresh = true;
  for (const char c : text) {
    if (fresh && c != '\n') result += "# ";
    fresh = c == '\n';
    result += c;
  }
  return result;
}

std::string followers_text(const Proposal& proposal) {
  std::string text;
  for (const std::size_t i : proposal.choice.followers) {
    const Candidate& other = proposal.candidates[i];
    if (other.guessed) continue;  // listed above
    text += comment(
        fmt::format("{} follows the same rotation. If it can be trusted more than a gyro (rate "
                    "table, dual-antenna GNSS), it may be the reference:",
                    other.place()));
    text += commented(fmt::format("[reference]\n{}rate = {}\n\n", head_text(proposal, other.found),
                                  toml_string(other.signal->name)));
  }
  return text;
}

std::string speed_text(const Proposal& proposal) {
  if (!proposal.circumstances.speed) return "";
  const SpeedFound& speed = *proposal.circumstances.speed;
  constexpr double kStanding_m_s = gateway::Surroundings::kStandingBelow_m_s;
  std::string why = "CHECK: is it 0 while the vehicle stands still? This log has no rest";
  if (speed.resting_m_s && *speed.resting_m_s < kStanding_m_s) {
    why = "0 while the gyros rest in this log";
  } else if (speed.resting_m_s) {
    why = fmt::format("CHECK: {:.2f} m/s while the gyros rest in this log", *speed.resting_m_s);
  }
  std::string text = "[speed]\n" + head_text(proposal, *speed.found);
  text += line("signal", toml_string(speed.signal->name), why);
  text += sender_text(*speed.found) + e2e_text(find_companions(*speed.found, *speed.signal));
  // A speed above zero during the rest would make the corrector assume that the vehicle rolls.
  const bool wrong = speed.resting_m_s && *speed.resting_m_s >= kStanding_m_s;
  return (wrong ? commented(text) : text) + "\n";
}

std::string accelerometer_text(const Proposal& proposal) {
  if (!proposal.circumstances.accelerometer) return "";
  const AccelerometerFound& with = *proposal.circumstances.accelerometer;
  constexpr double kGravityOff = 0.15;
  const bool good = std::abs(with.magnitude_g - 1.0) < kGravityOff;
  std::string text = "[accelerometer]\n" + head_text(proposal, *with.found);
  text += line("x", toml_string(with.axes[0]->name),
               fmt::format("{}the three together are {:.2f} g, {}", good ? "" : "CHECK: ",
                           with.magnitude_g, good ? "as gravity" : "which is not gravity"));
  text += line("y", toml_string(with.axes[1]->name)) + line("z", toml_string(with.axes[2]->name));
  text += sender_text(*with.found) + e2e_text(find_companions(*with.found, *with.axes[0]));
  return (good ? text : commented(text)) + "\n";
}

std::string calibration_text(const Proposal& proposal) {
  constexpr double kRest_s = 60.0;
  constexpr double kMargin_s = 2.0;  // up to a second at each end may be cut
  const auto& rest = proposal.circumstances.rest;
  const bool paired = proposal.choice.pair.has_value();
  std::string seconds = "60";
  std::string why = "CHECK: the platform must rest so long first";
  if (rest && rest->seconds() >= kRest_s + kMargin_s) {
    why =
        fmt::format("of rest; this log has it from {:.0f} s to {:.0f} s", rest->from_s, rest->to_s);
  } else if (rest) {
    seconds = fmt::format("{:.0f}", std::floor(rest->seconds() - kMargin_s));
    why = fmt::format("CHECK: all that this log has, from {:.0f} s to {:.0f} s; 60 is better",
                      rest->from_s, rest->to_s);
  } else if (paired) {
    why = "CHECK: of rest, and this log has no 30 s of it";
  }
  std::string text = "[calibration]\n" + line("rest_s", seconds, why);
  if (paired && !rest) {
    text += comment(
        "A replay of this log would wait for rest to its end, with no valid rate. Take a log that "
        "begins at rest, or name a [reference] and set source = \"reference\".");
  }
  return text + commented(line("latitude_deg", "50.45", "of the place, for the Earth's rotation")) +
         "\n";
}

std::string turn_text(const Turn& turn) {
  constexpr double kScaleOff = 0.03;
  if (!turn.seen_deg) {
    return comment(
        "CHECK: --turned was not used: samples of gyro a are missing, so that its angle is not "
        "known.");
  }
  const double seen_deg = turn.is_backward() ? -*turn.seen_deg : *turn.seen_deg;
  const bool off = std::abs(seen_deg - turn.told_deg) > kScaleOff * std::abs(turn.told_deg);
  return comment(fmt::format(
      "{}Gyro a turned by {:+.1f} deg where --turned says {:+g}.{}", off ? "CHECK: " : "", seen_deg,
      turn.told_deg, off ? " Is the log's beginning a rest of 3 s, and the unit right?" : ""));
}

/// For guessed layouts: other fields that may be the gyros, and how to choose them.
std::string others_text(const Proposal& proposal) {
  constexpr std::size_t kTold = 4;
  std::string text;
  std::size_t told = 0;
  std::set<std::pair<const Stream*, const Stream*>> streams;
  for (const PairFigures& pair : proposal.choice.others) {
    const Candidate& a = proposal.candidates[pair.first];
    const Candidate& b = proposal.candidates[pair.second];
    const bool again = !streams.insert({a.found.stream, b.found.stream}).second;
    if (!a.guessed || !b.guessed || again || told == kTold) continue;
    ++told;
    text +=
        fmt::format("   --id {:X} --id {:X}: {} and {}, correlation {:+.3f}\n", a.found.stream->id,
                    b.found.stream->id, a.place(), b.place(), pair.likeness.correlation);
  }
  if (text.empty()) return "";
  return comment(
      "Others move alike too. Where the gyros are among them, run `vgyro init` again with\n" +
      text);
}

/// What is known of the pair, and what a log cannot show.
std::string pair_text(const Proposal& proposal) {
  const analysis::Likeness& alike = proposal.choice.pair->likeness;
  std::string text;
  for (const std::string& remark : proposal.remarks)
    text += comment("CHECK: " + remark);
  if (!proposal.remarks.empty()) text += others_text(proposal);
  text += fmt::format("# b against a: correlation {:+.3f}, scale {:+.4f}, {:.0f} ms {}.\n",
                      alike.correlation, alike.scale, 1e3 * std::abs(alike.lag_s),
                      alike.lag_s >= 0.0 ? "later" : "earlier");
  if (proposal.turn) text += turn_text(*proposal.turn);
  if (!proposal.turn || !proposal.turn->seen_deg) {
    text += comment(
        "CHECK: which way is positive. If the turn to the left must be positive and is not, swap "
        "the signs of both.");
  }
  if (std::abs(std::log(std::abs(alike.scale))) > 0.1)
    text += "# CHECK: the scales differ: is the unit of one of them wrong in its DBC file?\n";
  return text;
}

std::string output_text(const Proposal& proposal, const std::string& bus) {
  unsigned base = 0x610;
  const auto taken = [&](unsigned first) {
    return proposal.traffic.has(bus, first) || proposal.traffic.has(bus, first + 1) ||
           proposal.traffic.has(bus, first + 2);
  };
  while (taken(base) && base < 0x7F0)
    base += 0x10;
  std::string text = "[output]\n" + line("bus", toml_string(bus));
  if (base == 0x610) return text;
  text += line("rate_id", fmt::format("{:#x}", base), "0x610 to 0x612 are in use in this log");
  text += line("bias_id", fmt::format("{:#x}", base + 1));
  return text + line("model_id", fmt::format("{:#x}", base + 2));
}

}  // namespace

std::string config_text(const Proposal& proposal) {
  const Choice& choice = proposal.choice;
  std::string text =
      "# Proposed by `vgyro init`. Lines with CHECK are for a person to confirm.\n\n";
  const Candidate& first =
      proposal.candidates[choice.pair ? choice.pair->first : choice.alone.value_or(0)];
  const bool backward = proposal.turn && proposal.turn->is_backward();
  if (choice.pair) text += pair_text(proposal);
  text += gyro_text(proposal, first, "a", backward ? "turns to the right are positive in it" : "");
  if (choice.pair) {
    const bool against = choice.pair->likeness.scale < 0.0;
    const std::string why = against ? "moves against the other gyro" : "as the other gyro";
    text += gyro_text(proposal, proposal.candidates[choice.pair->second], "b",
                      against != backward ? why : "");
  } else {
    text += "# No second gyro was found in the log: this file does not work before it has one.\n";
    text += commented(
        "[[gyro]]\nname = \"b\"\nbus = \"can0\"\ndbc = \"FILE.dbc\"\nmessage = \"MESSAGE\"\n"
        "rate = \"SIGNAL\"\n\n");
  }
  text += followers_text(proposal) + accelerometer_text(proposal) + speed_text(proposal);
  for (const std::string& remark : proposal.circumstances.remarks)
    text += comment(remark + ".") + "\n";
  text += calibration_text(proposal) + "[corrector]\nmethod = \"optimal\"\n\n";
  return text + output_text(proposal, first.found.stream->bus);
}

}  // namespace vgyro::cli
