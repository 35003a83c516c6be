#include "cli/init/config_text.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/core.h>

#include "base/printable.h"
#include "gateway/units.h"

namespace vgyro::cli {

namespace {

/// A TOML string. Names of DBC files and buses come from elsewhere.
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

std::string gyro_text(const Proposal& proposal, const Candidate& candidate, const char* name,
                      bool flipped) {
  const Companions with = find_companions(candidate.found, *candidate.signal);
  std::string text = fmt::format("[[gyro]]\nname = \"{}\"\n", name);
  text += head_text(proposal, candidate.found);
  const std::string step = candidate.series.step > 0.0
                               ? fmt::format("step {:.3g} deg/s", candidate.series.step)
                               : "a float";
  text += fmt::format("rate = {:<24} # {:.0f} Hz, {}, noise {:.2g} deg/s\n",
                      toml_string(candidate.signal->name), 1.0 / candidate.figures.interval_s, step,
                      candidate.figures.noise);
  if (!candidate.assumed_unit.empty()) {
    text += fmt::format("unit = {}                 # CHECK: the DBC file gives no unit; assumed\n",
                        toml_string(candidate.assumed_unit));
  }
  if (flipped) text += "sign = -1                      # moves against the other gyro\n";
  if (!candidate.sign_signal.empty())
    text += fmt::format("sign_signal = {:<17} # CHECK: by its name\n",
                        toml_string(candidate.sign_signal));
  if (candidate.found.message->is_j1939) {
    text += fmt::format("source_address = {:<14} # the sender in this log\n",
                        candidate.found.stream->id & 0xFFU);
  }
  if (!with.counter.empty())
    text +=
        fmt::format("counter = {:<21} # one more with every frame\n", toml_string(with.counter));
  if (!with.temperature.empty())
    text += fmt::format("temperature = {}\n", toml_string(with.temperature));
  if (!with.valid.empty())
    text += fmt::format("valid = {:<23} # CHECK: by its label in the DBC file\n",
                        toml_string(with.valid));
  if (with.e2e && !with.e2e->signal.empty()) {
    text += fmt::format("crc = {:<25} # agrees with the log's frames\ne2e = {}\n",
                        toml_string(with.e2e->signal), toml_string(with.e2e->kind));
    if (!with.e2e->data_id.empty()) text += fmt::format("data_id = {}\n", with.e2e->data_id);
  }
  for (const std::string& remark : with.remarks)
    text += fmt::format("# CHECK: {}\n", printable(remark));
  return text + "\n";
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
    text += fmt::format(
        "# {} follows the same rotation. If it can be trusted more than a gyro (rate "
        "table,\n# dual-antenna GNSS), it may be the reference:\n",
        printable(other.place()));
    text += commented(fmt::format("[reference]\n{}rate = {}\n\n", head_text(proposal, other.found),
                                  toml_string(other.signal->name)));
  }
  return text;
}

std::string speed_text(const Proposal& proposal) {
  const Found* best = nullptr;
  const dbc::Signal* signal = nullptr;
  for (const Found& found : proposal.messages) {
    for (const dbc::Signal& other : found.message->signals) {
      if (!gateway::convert_unit(gateway::Dimension::kSpeed, other.unit) || other.condition)
        continue;
      if (found.stream->frames_per_s() < 2.0) continue;
      if (best != nullptr) continue;
      best = &found;
      signal = &other;
    }
  }
  if (best == nullptr) return "";
  return fmt::format(
      "[speed]                        # CHECK: 0 when the vehicle stands?\n{}signal = "
      "{}\n\n",
      head_text(proposal, *best), toml_string(signal->name));
}

std::string output_text(const Proposal& proposal, const std::string& bus) {
  unsigned base = 0x610;
  const auto taken = [&](unsigned first) {
    return proposal.traffic.has(bus, first) || proposal.traffic.has(bus, first + 1) ||
           proposal.traffic.has(bus, first + 2);
  };
  while (taken(base) && base < 0x7F0)
    base += 0x10;
  std::string text = fmt::format("[output]\nbus = {}\n", toml_string(bus));
  if (base == 0x610) return text;
  return text + fmt::format(
                    "rate_id = {:#x}                # 0x610 to 0x612 are in use in this "
                    "log\nbias_id = {:#x}\nmodel_id = {:#x}\n",
                    base, base + 1, base + 2);
}

}  // namespace

std::string config_text(const Proposal& proposal) {
  const Choice& choice = proposal.choice;
  std::string text =
      "# Proposed by `vgyro init`. Lines with CHECK are for a person to confirm.\n\n";
  const Candidate& first =
      proposal.candidates[choice.pair ? choice.pair->first : choice.alone.value_or(0)];
  if (choice.pair) {
    const analysis::Likeness& alike = choice.pair->likeness;
    text += fmt::format("# b against a: correlation {:+.3f}, scale {:+.4f}, {:.0f} ms {}.\n",
                        alike.correlation, alike.scale, 1e3 * std::abs(alike.lag_s),
                        alike.lag_s >= 0.0 ? "later" : "earlier");
    text +=
        "# CHECK: which way is positive. If the turn to the left must be positive and is not, "
        "swap the\n# signs of both.\n";
    if (std::abs(std::log(std::abs(alike.scale))) > 0.1)
      text += "# CHECK: the scales differ: is the unit of one of them wrong in its DBC file?\n";
  }
  text += gyro_text(proposal, first, "a", false);
  if (choice.pair) {
    text += gyro_text(proposal, proposal.candidates[choice.pair->second], "b",
                      choice.pair->likeness.scale < 0.0);
  } else {
    text += "# No second gyro was found in the log: this file does not work before it has one.\n";
    text += commented(
        "[[gyro]]\nname = \"b\"\nbus = \"can0\"\ndbc = \"FILE.dbc\"\nmessage = \"MESSAGE\"\n"
        "rate = \"SIGNAL\"\n\n");
  }
  text += followers_text(proposal) + speed_text(proposal);
  text +=
      "[calibration]\nrest_s = 60                    # CHECK: the platform must rest so long "
      "first\n# latitude_deg = 50.45         # of the place, for the Earth's rotation\n\n"
      "[corrector]\nmethod = \"optimal\"\n\n";
  return text + output_text(proposal, first.found.stream->bus);
}

}  // namespace vgyro::cli
