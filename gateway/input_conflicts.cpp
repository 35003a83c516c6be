#include "gateway/input_conflicts.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>

namespace vgyro::gateway {

namespace {

struct Input {
  std::string name;
  std::string_view key;  ///< key of its table, for the place of an error
  const std::string& message;
  const FrameMatch& match;
  const Quantity* rate;  ///< null: the input reads no rate
};

std::vector<Input> inputs_of(const Plan& plan) {
  std::vector<Input> inputs;
  for (const GyroPlan& gyro : plan.gyros) {
    if (gyro.axes.empty())
      inputs.push_back({"gyro " + gyro.name, "gyro", gyro.message, gyro.match, &gyro.rate});
    for (const GyroPlan& axis : gyro.axes)
      inputs.push_back({"gyro " + gyro.name, "gyro", axis.message, axis.match, &axis.rate});
  }
  if (const auto& it = plan.reference)
    inputs.push_back({"reference", "reference", it->message, it->match, &it->rate});
  if (const auto& it = plan.accelerometer)
    inputs.push_back({"accelerometer", "accelerometer", it->message, it->match, nullptr});
  if (const auto& it = plan.speed)
    inputs.push_back({"speed", "speed", it->message, it->match, nullptr});
  return inputs;
}

// Two inputs may read different signals of the same frames. It is a mistake if frames of one sender
// match the input of another, or if two inputs read the same rate.
bool confused(const Input& a, const Input& b) {
  if (!may_share_frames(a.match, b.match)) return false;
  const bool same_bits = a.rate != nullptr && b.rate != nullptr && a.rate->codec == b.rate->codec &&
                         a.rate->presence == b.rate->presence;
  if (same_bits) return true;
  const bool other_sender =
      a.match.mask != b.match.mask || !dbc::same_sender(a.match.id, b.match.id);
  return a.match.extended && other_sender && a.message != b.message;
}

}  // namespace

bool may_share_frames(const FrameMatch& a, const FrameMatch& b) {
  const bool same_group =
      a.bus == b.bus && a.extended == b.extended && ((a.id ^ b.id) & a.mask & b.mask) == 0;
  if (!same_group) return false;
  // An input that takes any sender skips identifiers that the DBC file describes as other messages.
  const auto passes_over = [](const FrameMatch& any, const FrameMatch& one) {
    return (any.mask & kSourceMask) == 0 && (one.mask & kSourceMask) != 0 &&
           !any.carries(one.id, one.extended);
  };
  return !passes_over(a, b) && !passes_over(b, a);
}

void check_apart(TomlReader& root, const Plan& plan) {
  const std::vector<Input> inputs = inputs_of(plan);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    for (std::size_t k = i + 1; k < inputs.size(); ++k) {
      const Input& a = inputs[i];
      const Input& b = inputs[k];
      // config.cpp has compared the gyros with each other already.
      if (b.key == "gyro" || !confused(a, b)) continue;
      root.complain(root.where(b.key),
                    fmt::format("{} ({}) and {} ({}) cannot be told apart: a frame of one of them "
                                "on {} is taken for both",
                                a.name, a.message, b.name, b.message, plan.buses[b.match.bus]),
                    b.match.extended ? "source_address = N in each of them, or another signal"
                                     : "another signal for one of them");
    }
  }
}

namespace {

struct Own {
  std::string message;
  FrameId id;
  std::string remedy;
};

std::vector<Own> own_frames(const Plan& plan, const std::string& bus) {
  const OutputPlan& output = plan.output;
  std::vector<Own> own;
  const auto add = [&](const std::string& message, std::string_view key, std::uint32_t id) {
    own.push_back({message, {id, false}, fmt::format("[output] {} = another identifier", key)});
  };
  if (output.vgyro_frames && plan.buses[output.bus] == bus && output.axes.empty()) {
    add("VG_Rate", "rate_id", output.rate_id);
    add("VG_Bias", "bias_id", output.bias_id);
    add("VG_Model", "model_id", output.model_id);
  }
  if (output.vgyro_frames && plan.buses[output.bus] == bus) {
    for (const std::size_t axis : output.axes) {
      const auto step = static_cast<std::uint32_t>(axis) * kAxisIdStep;
      const char upper = static_cast<char>(kAxisNames[axis] - 'x' + 'X');
      if (output.rate_is_shared && axis == output.axes.front()) {
        add("VG_Rates", "rate_id", output.rate_id);
      } else if (!output.rate_is_shared) {
        add(fmt::format("VG_Rate_{}", upper), "rate_id", output.rate_id + step);
      }
      add(fmt::format("VG_Bias_{}", upper), "bias_id", output.bias_id + step);
      add(fmt::format("VG_Model_{}", upper), "model_id", output.model_id + step);
    }
  }
  for (const OutputLayout& layout : output.layouts) {
    if (plan.buses[layout.bus] != bus) continue;
    own.push_back({layout.message,
                   {layout.id, layout.extended},
                   "another id or bus for the [[output.layout]], if that message is sent there"});
  }
  return own;
}

void warn_of_others(const dbc::Database& database, const std::string& path, const std::string& bus,
                    const Own& ours, std::vector<Error>& warnings) {
  for (const dbc::Message& message : database.messages) {
    const bool taken = FrameId{message.id, message.extended} == ours.id;
    if (!taken || message.name == ours.message) continue;
    warnings.push_back(
        {at_line(path, message.line),
         fmt::format("message {} has the identifier {:#x}, with which {} is sent on {}",
                     message.name, ours.id.id, ours.message, bus),
         ours.remedy});
  }
}

}  // namespace

void warn_of_conflicts(TomlReader& root, const Plan& plan, const DatabaseCache& cache,
                       const std::set<BusFile>& files, std::vector<Error>& warnings) {
  if (plan.gyros[0].name == plan.gyros[1].name) {
    warnings.push_back({root.where("gyro"),
                        fmt::format("both gyros have the name \"{}\"", plan.gyros[0].name),
                        "a name for each: messages and summaries use it"});
  }
  for (const auto& [bus, path] : files) {
    const dbc::Database* database = cache.loaded(path);
    if (database == nullptr) continue;
    for (const Own& ours : own_frames(plan, bus))
      warn_of_others(*database, path, bus, ours, warnings);
  }
}

}  // namespace vgyro::gateway
