#include "gateway/gyro_config.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "gateway/axes_plan.h"
#include "gateway/e2e_config.h"
#include "gateway/mount.h"
#include "gateway/valid_config.h"

namespace vgyro::gateway {

namespace {

// Gyros that read more than this at rest are broken rather than biased.
constexpr Limits kMaxBias_dps{0.0, 100.0, true};

}  // namespace

std::optional<double> number_within(TomlReader& reader, std::string_view key, const Limits& limits,
                                    std::string_view unit) {
  const auto value = reader.number(key);
  if (!value) return std::nullopt;
  const bool enough = limits.above_low ? *value > limits.low : *value >= limits.low;
  if (enough && *value <= limits.high) return value;
  reader.complain(reader.where(key), fmt::format("{} is {:g} {}", key, *value, unit),
                  limits.above_low
                      ? fmt::format("above {:g} and up to {:g}", limits.low, limits.high)
                      : fmt::format("{:g} to {:g}", limits.low, limits.high));
  return std::nullopt;
}

std::optional<double> sign_of(TomlReader& reader, std::string_view key) {
  const auto sign = reader.integer(key);
  if (!sign) return std::nullopt;
  if (*sign == 1 || *sign == -1) return static_cast<double>(*sign);
  reader.complain(reader.where(key), fmt::format("{} is {}", key, *sign),
                  "1, or -1 to flip the axis");
  return std::nullopt;
}

void read_source_address(TomlReader& reader, const dbc::Message& message, FrameMatch& match) {
  const auto address = reader.integer("source_address");
  if (!address) return;
  if (!message.is_j1939 || *address < 0 || *address > std::int64_t{kSourceMask}) {
    reader.complain(reader.where("source_address"),
                    "source_address is 0 to 255, for a J1939 message",
                    "a message is J1939 when its DBC attribute VFrameFormat is J1939PG");
    return;
  }
  match.id = (match.id & ~kSourceMask) | static_cast<std::uint32_t>(*address);
  match.mask |= kSourceMask;
  match.others.clear();
}

namespace {

// Rates about other axes of the unit, in its own message.
constexpr std::array<const char*, 3> kOtherAxisKeys{"rate_x", "rate_y", "rate_z"};
using OtherAxisSignals = std::array<const dbc::Signal*, kOtherAxisKeys.size()>;

OtherAxisSignals other_axis_signals(SignalResolver& resolver) {
  OtherAxisSignals signals{};
  for (std::size_t axis = 0; axis < signals.size(); ++axis)
    signals[axis] = resolver.signal(kOtherAxisKeys[axis], false);
  return signals;
}

void read_other_axes(SignalResolver& resolver, const OtherAxisSignals& signals, GyroPlan& gyro) {
  for (std::size_t axis = 0; axis < signals.size(); ++axis) {
    if (signals[axis] == nullptr) continue;
    gyro.*kOtherAxes[axis] =
        resolver.quantity(*signals[axis], kOtherAxisKeys[axis], Dimension::kRate);
  }
}

std::optional<GyroPlan> read_single(TomlReader& reader, SignalResolver& resolver,
                                    const std::string& name) {
  const dbc::Signal* rate_signal = resolver.signal("rate", true);
  const dbc::Signal* sign_signal = resolver.signal("sign_signal", false);
  const dbc::Signal* temperature_signal = resolver.signal("temperature", false);
  const dbc::Signal* supply_signal = resolver.signal("supply_voltage", false);
  const OtherAxisSignals other_axes = other_axis_signals(resolver);
  const auto unit = reader.text("unit");
  std::optional<GyroPlan> gyro;
  std::optional<Quantity> rate;
  if (rate_signal != nullptr)
    rate = resolver.quantity(*rate_signal, "rate", Dimension::kRate, unit);
  if (rate) {
    gyro.emplace(GyroPlan{.name = name,
                          .bus = resolver.bus(),
                          .message = resolver.message().name,
                          .match = resolver.match(),
                          .rate = *rate,
                          .sign = {},
                          .temperature = {},
                          .e2e = {},
                          .valid = {},
                          .saturation_dps = {}});
    gyro->rate.scale *= sign_of(reader).value_or(1.0);
    read_source_address(reader, resolver.message(), gyro->match);
    gyro->e2e = read_e2e(reader, resolver, *rate_signal);
    if (const auto valid = read_condition(reader, resolver, *rate_signal))
      gyro->valid = valid->condition;
    gyro->max_bias_dps = number_within(reader, "max_bias_dps", kMaxBias_dps, "deg/s");
    if (sign_signal != nullptr && resolver.shares_page("sign_signal", *sign_signal, *rate_signal)) {
      gyro->sign = resolver.codec(*sign_signal);
    }
    if (temperature_signal != nullptr) {
      gyro->temperature =
          resolver.quantity(*temperature_signal, "temperature", Dimension::kTemperature);
    }
    if (supply_signal != nullptr) {
      gyro->supply_voltage =
          resolver.quantity(*supply_signal, "supply_voltage", Dimension::kVoltage);
    }
    read_other_axes(resolver, other_axes, *gyro);
  } else {
    // Mark the other keys as known, so that they are not called unknown on top of the real error.
    reader.forgive({"sign", "source_address", "valid", "max_bias_dps"});
    forgive_e2e(reader);
  }
  return gyro;
}

// --- a whole unit --------------------------------------------------------------------------------

bool is_unit(const TomlReader& reader) {
  return !reader.has("rate") &&
         (reader.has("axis") || std::any_of(kOtherAxisKeys.begin(), kOtherAxisKeys.end(),
                                            [&](const char* key) { return reader.has(key); }));
}

// The settings of the message that a table reads, as far as they are the same as for a single gyro.
// `main` is a signal of the message.
GyroPlan read_message(TomlReader& reader, SignalResolver& resolver, const std::string& name,
                      const dbc::Signal& main, const Quantity& rate) {
  GyroPlan gyro{.name = name,
                .bus = resolver.bus(),
                .message = resolver.message().name,
                .match = resolver.match(),
                .rate = rate,
                .sign = {},
                .temperature = {},
                .e2e = {},
                .valid = {},
                .saturation_dps = {}};
  read_source_address(reader, resolver.message(), gyro.match);
  gyro.e2e = read_e2e(reader, resolver, main);
  if (const auto valid = read_condition(reader, resolver, main)) gyro.valid = valid->condition;
  const dbc::Signal* temperature = resolver.signal("temperature", false);
  if (temperature != nullptr)
    gyro.temperature = resolver.quantity(*temperature, "temperature", Dimension::kTemperature);
  const dbc::Signal* supply = resolver.signal("supply_voltage", false);
  if (supply != nullptr)
    gyro.supply_voltage = resolver.quantity(*supply, "supply_voltage", Dimension::kVoltage);
  return gyro;
}

void forgive_message(TomlReader& reader) {
  reader.forgive({"source_address", "valid", "temperature", "supply_voltage"});
  forgive_e2e(reader);
}

/// One axis on its way into the plan.
struct AxisEntry {
  const toml::table* own = nullptr;  ///< its [[gyro.axis]] table, if any
  bool named_above = false;          ///< rate_x, rate_y or rate_z stands in [[gyro]]
};
using AxisEntries = std::array<AxisEntry, kAxes>;

void take_axis_table(const toml::node& node, TomlReader& unit, TableContext context,
                     AxisEntries& entries) {
  const toml::table* table = node.as_table();
  if (table == nullptr) {
    unit.complain(unit.where("axis"), "axis must be written as [[gyro.axis]] tables");
    return;
  }
  TomlReader reader(*table, context.file, "[[gyro.axis]]", context.errors);
  const std::string name = reader.required_text("axis", "x");
  if (name.empty()) return;
  const auto* const found = std::find_if(kAxisNames.begin(), kAxisNames.end(), [&](char axis) {
    return name.size() == 1 && name[0] == axis;
  });
  if (found == kAxisNames.end()) {
    reader.complain(reader.where("axis"), fmt::format("there is no axis \"{}\"", name),
                    "\"x\", \"y\" or \"z\"");
    return;
  }
  AxisEntry& entry = entries[static_cast<std::size_t>(found - kAxisNames.begin())];
  if (entry.own != nullptr) {
    reader.complain(reader.where("axis"), fmt::format("axis {} is there twice", name),
                    "one [[gyro.axis]] for each axis");
    return;
  }
  entry.own = table;
}

AxisEntries entries_of(TomlReader& reader, TableContext context) {
  AxisEntries entries;
  for (std::size_t axis = 0; axis < kAxes; ++axis)
    entries[axis].named_above = reader.has(kOtherAxisKeys[axis]);
  const toml::array* tables = reader.array("axis", "a list of tables: [[gyro.axis]]");
  if (tables == nullptr) return entries;
  for (const toml::node& node : *tables)
    take_axis_table(node, reader, context, entries);
  return entries;
}

/// What all axes of a unit take from its own table.
struct UnitTable {
  TomlReader& reader;
  SignalResolver& resolver;
  const std::string& name;
  std::optional<std::string> unit;
  double sign = 1.0;
  std::optional<GyroPlan> message = {};  ///< everything but the rates in the unit's own message
};

const GyroPlan& message_of(UnitTable& unit, const dbc::Signal& main, const Quantity& rate) {
  if (!unit.message) unit.message = read_message(unit.reader, unit.resolver, unit.name, main, rate);
  return *unit.message;
}

GyroPlan finished_axis(GyroPlan gyro, const Quantity& rate, double sign, std::size_t axis) {
  gyro.rate = rate;
  gyro.rate.scale *= sign;
  gyro.rate.shift *= sign;
  gyro.sensor_axis = axis;
  return gyro;
}

std::optional<GyroPlan> read_plain_axis(UnitTable& unit, std::size_t axis) {
  const char* key = kOtherAxisKeys[axis];
  const dbc::Signal* signal = unit.resolver.signal(key, false);
  if (signal == nullptr) return std::nullopt;
  const auto rate = unit.resolver.quantity(*signal, key, Dimension::kRate, unit.unit);
  if (!rate) return std::nullopt;
  return finished_axis(message_of(unit, *signal, *rate), *rate, unit.sign, axis);
}

// Reads an axis with a table of its own, which may name a message of its own.
std::optional<GyroPlan> read_own_axis(UnitTable& unit, const AxisEntry& entry, std::size_t axis,
                                      TableContext context) {
  TomlReader reader(*entry.own, context.file, "[[gyro.axis]]", context.errors);
  reader.forgive({"axis"});
  const bool own_message = reader.has("message") || reader.has("bus") || reader.has("dbc");
  SignalResolver resolver(reader, context.cache, context.folder, context.buses, context.warnings,
                          unit.resolver.named());
  context.bus_files.insert({resolver.bus(), resolver.dbc_path()});
  const char* above = kOtherAxisKeys[axis];
  const dbc::Signal* signal = nullptr;
  if (reader.has("rate") || !entry.named_above) {
    signal = resolver.signal("rate", true);
  } else if (const auto name = unit.reader.text(above); name && resolver.usable()) {
    signal = resolver.signal_named(*name, "message");
  }
  if (reader.has("rate") && entry.named_above) {
    reader.complain(
        reader.where("rate"),
        fmt::format("rate and {} both name the signal of axis {}", above, kAxisNames[axis]),
        "keep one of them");
  }
  unit.reader.forgive({above});
  const auto spelling = reader.has("unit") ? reader.text("unit") : unit.unit;
  const double sign = sign_of(reader).value_or(unit.sign);
  std::optional<Quantity> rate;
  if (signal != nullptr) rate = resolver.quantity(*signal, "rate", Dimension::kRate, spelling);
  std::optional<GyroPlan> gyro;
  if (rate) {
    gyro = finished_axis(own_message ? read_message(reader, resolver, unit.name, *signal, *rate)
                                     : message_of(unit, *signal, *rate),
                         *rate, sign, axis);
  } else if (own_message) {
    forgive_message(reader);
  }
  reader.finish();
  return gyro;
}

// One signal for two axes is a mistake in one of the names.
void check_signals(const std::vector<GyroPlan>& axes, TomlReader& reader) {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    for (std::size_t k = i + 1; k < axes.size(); ++k) {
      const bool same = axes[i].match == axes[k].match &&
                        axes[i].rate.codec == axes[k].rate.codec &&
                        axes[i].rate.presence == axes[k].rate.presence;
      if (!same) continue;
      reader.complain(reader.where(),
                      fmt::format("axes {} and {} are read from the same signal: {} of {}",
                                  kAxisNames[axes[i].sensor_axis], kAxisNames[axes[k].sensor_axis],
                                  axes[i].rate.name, axes[i].message),
                      "a signal for each axis");
    }
  }
}

// Readings of two messages belong to two instants, and may come at two rates.
void warn_of_mixed_messages(const std::vector<GyroPlan>& axes, const Mount& mount,
                            TomlReader& reader, std::vector<Error>& warnings) {
  const auto needs = [&](std::size_t axis, const GyroPlan& sensor) {
    return std::abs(mount.at(axis, sensor.sensor_axis)) > kShareMissed;
  };
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto first = std::find_if(axes.begin(), axes.end(),
                                    [&](const GyroPlan& one) { return needs(axis, one); });
    if (first == axes.end()) continue;
    const auto other = std::find_if(first, axes.end(), [&](const GyroPlan& one) {
      return needs(axis, one) && !(one.match == first->match);
    });
    if (other == axes.end()) continue;
    warnings.push_back(
        {reader.where("mount"),
         fmt::format("mount mixes {} of {} and {} of {} about the vehicle's {}: they come at "
                     "instants of their own, so that while it turns the mixture is off by what "
                     "changes between the two",
                     first->rate.name, first->message, other->rate.name, other->message,
                     kAxisNames[axis]),
         "axes of one message, or a mount that only swaps axes and signs"});
    return;
  }
}

std::optional<GyroPlan> read_unit(TomlReader& reader, SignalResolver& resolver,
                                  const std::string& name, TableContext context) {
  const AxisEntries entries = entries_of(reader, context);
  UnitTable unit{reader, resolver, name, reader.text("unit"), sign_of(reader).value_or(1.0)};
  const auto max_bias_dps = number_within(reader, "max_bias_dps", kMaxBias_dps, "deg/s");
  const Mount mount = read_mount(reader).value_or(Mount{});
  std::vector<GyroPlan> axes;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const AxisEntry& entry = entries[axis];
    std::optional<GyroPlan> one;
    if (entry.own != nullptr) {
      one = read_own_axis(unit, entry, axis, context);
    } else if (entry.named_above) {
      one = read_plain_axis(unit, axis);
    }
    if (one) axes.push_back(std::move(*one));
  }
  if (!unit.message) forgive_message(reader);
  const auto wanted = std::count_if(entries.begin(), entries.end(), [](const AxisEntry& entry) {
    return entry.own != nullptr || entry.named_above;
  });
  if (wanted < 2) {
    reader.complain(reader.where(),
                    "a unit of one axis: rate_x, rate_y, rate_z are two or three of them",
                    "rate = \"SIGNAL\" where the gyro has one axis only");
  }
  check_signals(axes, reader);
  warn_of_mixed_messages(axes, mount, reader, context.warnings);
  if (axes.empty()) return std::nullopt;
  GyroPlan gyro = axes.front();
  gyro.max_bias_dps = max_bias_dps;
  gyro.mount = mount;
  for (GyroPlan& axis : axes)
    axis.max_bias_dps = max_bias_dps;
  gyro.axes = std::move(axes);
  return gyro;
}

// The text appears in file names, tables and pages.
constexpr std::size_t kIdentityMax = 64;

// `type` or `serial`; empty if the key is absent, or after an error.
std::string identity_of(TomlReader& reader, std::string_view key) {
  std::string text = reader.text(key).value_or("");
  const auto is_good = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  if (text.size() <= kIdentityMax && std::all_of(text.begin(), text.end(), is_good)) return text;
  reader.complain(reader.where(key),
                  fmt::format("the {} \"{}\" is not a plain word", key, printable(text)),
                  fmt::format("up to {} letters, digits, \"-\", \"_\" and \".\"", kIdentityMax));
  return {};
}

}  // namespace

std::optional<GyroPlan> read_gyro(const toml::table& table, std::size_t index,
                                  TableContext context) {
  TomlReader reader(table, context.file, "[[gyro]]", context.errors);
  const std::size_t errors_before = context.errors.size();
  const std::string name = reader.text("name").value_or(index == 0 ? "a" : "b");
  if (printable(name) != name) {
    reader.complain(reader.where("name"), fmt::format("the name \"{}\" is not printable", name),
                    "letters, digits, blanks: it stands in tables and pictures");
  }
  SignalResolver resolver(reader, context.cache, context.folder, context.buses, context.warnings);
  context.bus_files.insert({resolver.bus(), resolver.dbc_path()});
  auto gyro = is_unit(reader) ? read_unit(reader, resolver, name, context)
                              : read_single(reader, resolver, name);
  if (!is_unit(reader) && reader.has("mount")) {
    reader.forgive({"mount"});
    reader.complain(reader.where("mount"), "mount is of a gyro with one axis",
                    "rate_x, rate_y, rate_z instead of rate; one axis is turned by sign = -1");
  }
  const std::string type = identity_of(reader, "type");
  const std::string serial = identity_of(reader, "serial");
  reader.finish();
  if (context.errors.size() > errors_before || !gyro) return std::nullopt;
  gyro->type = type;
  gyro->serial = serial;
  for (GyroPlan& axis : gyro->axes) {
    axis.type = type;
    axis.serial = serial;
  }
  return gyro;
}

}  // namespace vgyro::gateway
