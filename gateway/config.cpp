#include "gateway/config.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <span>

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "base/toml_reader.h"
#include "fusion/polynomial.h"
#include "gateway/axes_plan.h"
#include "gateway/config_files.h"
#include "gateway/e2e_config.h"
#include "gateway/gyro_config.h"
#include "gateway/input_conflicts.h"
#include "gateway/model_plan.h"
#include "gateway/output_layout_config.h"
#include "gateway/signal_resolver.h"
#include "gateway/valid_config.h"

namespace vgyro::gateway {

namespace {

struct Context {
  std::string file;
  std::string folder;
  std::vector<Error> errors;
  Resolved resolved;
  DatabaseCache cache{resolved.warnings};
  std::set<BusFile> bus_files = {};
};

TableContext tables_of(Context& context) {
  return {context.file,
          context.folder,
          context.cache,
          context.resolved.plan.buses,
          context.bus_files,
          context.errors,
          context.resolved.warnings};
}

// A bias from less than a second is mostly noise; nobody waits for more than a day.
constexpr Limits kRest_s{1.0, 86'400.0};
// A window needs several samples of each gyro; within an hour every drift has changed.
constexpr Limits kWindow_s{0.1, 3'600.0};

// The message of `a` that `b` reads as well; null if there is none.
const GyroPlan* sharing_frames(const GyroPlan& a, const GyroPlan& b) {
  const auto messages_of = [](const GyroPlan& gyro) {
    return gyro.axes.empty() ? std::span(&gyro, 1) : std::span(gyro.axes);
  };
  for (const GyroPlan& one : messages_of(a)) {
    for (const GyroPlan& other : messages_of(b)) {
      if (may_share_frames(one.match, other.match)) return &one;
    }
  }
  return nullptr;
}

void read_gyros(TomlReader& root, Context& context) {
  const toml::array* tables = root.array("gyro");
  if (tables == nullptr && root.has("gyro")) return;
  const std::size_t count = tables == nullptr ? 0 : tables->size();
  if (count != 2) {
    root.complain(count == 0 ? context.file : root.where("gyro"),
                  fmt::format("there are {} [[gyro]] tables", count),
                  count < 2 ? "exactly two are needed"
                            : "exactly two are needed; several axes of one unit stand in its own "
                              "table: rate_x, rate_y, rate_z");
    return;
  }
  std::vector<GyroPlan> gyros;
  for (std::size_t i = 0; i < count; ++i) {
    const toml::table* table = tables->get(i)->as_table();
    if (table == nullptr) {
      root.complain(root.where("gyro"), "gyro must be written as [[gyro]] tables");
      return;
    }
    if (auto gyro = read_gyro(*table, i, tables_of(context))) gyros.push_back(std::move(*gyro));
  }
  if (gyros.size() != 2) return;
  if (const GyroPlan* shared = sharing_frames(gyros[0], gyros[1])) {
    root.complain(root.where("gyro"),
                  fmt::format("both gyros are read from the same frame: {} on {}", shared->message,
                              shared->bus),
                  "two different gyros are needed; J1939 gyros with one PGN are distinguished by "
                  "source_address = N");
    return;
  }
  context.resolved.plan.gyros.assign(gyros.begin(), gyros.end());
  find_axes(root, context.resolved.plan);
}

template <class Read>
void read_optional(TomlReader& root, std::string_view key, Context& context, Read read) {
  const toml::table* table = root.table(key);
  if (table == nullptr) return;
  TomlReader reader(*table, context.file, fmt::format("[{}]", key), context.errors);
  SignalResolver resolver(reader, context.cache, context.folder, context.resolved.plan.buses,
                          context.resolved.warnings);
  context.bus_files.insert({resolver.bus(), resolver.dbc_path()});
  read(reader, resolver);
  reader.finish();
}

constexpr std::array<const char*, kAxes> kReferenceAxes{"rate_x", "rate_y", "rate_z"};

// Reads the rates that a reference table names: one, or with several axes one for each. A single
// one is then about z, the axis about which a vehicle turns.
std::array<std::optional<Quantity>, kAxes> read_reference_rates(TomlReader& reader,
                                                                SignalResolver& resolver,
                                                                bool of_axes,
                                                                const dbc::Signal*& main) {
  std::array<std::optional<Quantity>, kAxes> rates;
  const auto unit = reader.text("unit");
  const auto read = [&](const char* key, std::size_t axis, bool required) {
    const dbc::Signal* signal = resolver.signal(key, required);
    if (signal == nullptr) return;
    rates[axis] = resolver.quantity(*signal, key, Dimension::kRate, unit);
    main = signal;
  };
  const bool named = std::any_of(kReferenceAxes.begin(), kReferenceAxes.end(),
                                 [&](const char* key) { return reader.has(key); });
  if (!of_axes && named) {
    reader.forgive({"rate", "rate_x", "rate_y", "rate_z"});
    reader.complain(reader.where(), "rate_x, rate_y, rate_z are of a reference of whole units",
                    "rate = \"SIGNAL\" beside gyros of one axis each");
  } else if (!of_axes || !named) {
    read("rate", kAxes - 1, true);
  } else {
    for (std::size_t axis = 0; axis < kAxes; ++axis)
      read(kReferenceAxes[axis], axis, false);
  }
  return rates;
}

void read_reference(TomlReader& reader, SignalResolver& resolver, Plan& plan) {
  const bool of_axes = !plan.output.axes.empty();
  const dbc::Signal* main = nullptr;
  auto rates = read_reference_rates(reader, resolver, of_axes, main);
  const auto last =
      std::find_if(rates.rbegin(), rates.rend(), [](const auto& rate) { return rate.has_value(); });
  if (main == nullptr || last == rates.rend()) {
    reader.forgive({"sign", "source_address"});
    forgive_e2e(reader);
    return;
  }
  const double sign = sign_of(reader).value_or(1.0);
  for (auto& rate : rates) {
    if (rate) rate->scale *= sign;
  }
  plan.reference = ReferencePlan{resolver.bus(), resolver.message().name, resolver.match(), **last,
                                 read_e2e(reader, resolver, *main)};
  if (of_axes) plan.reference->axes = rates;
  read_source_address(reader, resolver.message(), plan.reference->match);
}

void read_accelerometer(TomlReader& reader, SignalResolver& resolver, Plan& plan) {
  std::vector<Quantity> axes;
  const dbc::Signal* last = nullptr;
  for (const char* key : {"x", "y", "z"}) {
    const dbc::Signal* signal = resolver.signal(key, true);
    if (signal == nullptr) continue;
    if (auto axis = resolver.quantity(*signal, key, Dimension::kAcceleration))
      axes.push_back(*axis);
    last = signal;
  }
  if (axes.size() != 3 || last == nullptr) {
    reader.forgive({"source_address"});
    forgive_e2e(reader);
    return;
  }
  plan.accelerometer = AccelerometerPlan{resolver.bus(),
                                         resolver.message().name,
                                         resolver.match(),
                                         {axes[0], axes[1], axes[2]},
                                         read_e2e(reader, resolver, *last)};
  read_source_address(reader, resolver.message(), plan.accelerometer->match);
}

void read_speed(TomlReader& reader, SignalResolver& resolver, Plan& plan) {
  const dbc::Signal* signal = resolver.signal("signal", true);
  const auto speed =
      signal == nullptr ? std::nullopt : resolver.quantity(*signal, "signal", Dimension::kSpeed);
  if (!speed) {
    reader.forgive({"source_address"});
    forgive_e2e(reader);
    return;
  }
  plan.speed = SpeedPlan{resolver.bus(), resolver.message().name, resolver.match(), *speed,
                         read_e2e(reader, resolver, *signal)};
  read_source_address(reader, resolver.message(), plan.speed->match);
}

void read_when_moving(TomlReader& reader, CalibrationPlan& plan) {
  const std::string word = reader.text("when_moving").value_or("wait");
  if (plan.from_reference) {
    plan.when_moving = fusion::WhenMoving::kKnown;
  } else if (word == "accept") {
    plan.when_moving = fusion::WhenMoving::kAccept;
  }
  if (word == "wait" || word == "accept") return;
  reader.complain(reader.where("when_moving"), fmt::format("when_moving is \"{}\"", word),
                  suggest_name(word, {"wait", "accept"}));
}

// With several axes, rate_dps is a list with a number for each.
void read_axis_rates(TomlReader& reader, const Plan& plan, CalibrationPlan& calibration) {
  const std::size_t axes = plan.output.axes.size();
  if (axes == 0 || !reader.has("rate_dps")) return;
  const std::string shape = fmt::format("a list of {} numbers, one for each axis", axes);
  const toml::array* list = reader.array("rate_dps", shape);
  if (list == nullptr) return;
  for (const toml::node& node : *list) {
    const auto rate = node.is_number() ? node.value<double>() : std::nullopt;
    if (rate && std::abs(*rate) < 1e5) calibration.axis_rate_dps.push_back(*rate);
  }
  if (calibration.axis_rate_dps.size() == axes && list->size() == axes) return;
  calibration.axis_rate_dps.assign(axes, 0.0);
  reader.complain(reader.where("rate_dps"), "rate_dps is not " + shape,
                  "the platform's true rate about each axis while calibrating, in deg/s");
}

// The Earth's rate about the vehicle's horizontal axes depends on its heading.
void read_heading(TomlReader& reader, const Plan& plan, CalibrationPlan& calibration) {
  const auto heading = reader.number("heading_deg");
  if (!heading) return;
  calibration.heading_deg = heading;
  if (plan.gyros.empty()) return;
  if (plan.output.axes.empty()) {
    reader.complain(reader.where("heading_deg"), "heading_deg has no effect for a single axis",
                    "leave it out: only the Earth's rate about horizontal axes depends on it");
  } else if (!(std::abs(*heading) <= 360.0)) {
    reader.complain(reader.where("heading_deg"), fmt::format("heading_deg is {:g}", *heading),
                    "0 to 360, clockwise from north: where x points while calibrating");
  } else if (!reader.has("latitude_deg")) {
    reader.complain(reader.where("heading_deg"), "heading_deg needs latitude_deg",
                    "latitude_deg beside it");
  }
}

// The platform's true rate about its axis, or axes, while it rests.
void read_true_rate(TomlReader& reader, const toml::table& table, const Plan& platform,
                    CalibrationPlan& plan) {
  read_axis_rates(reader, platform, plan);
  // After an error in the units the number of axes is unknown.
  const bool any_unit = std::any_of(platform.gyros.begin(), platform.gyros.end(),
                                    [](const GyroPlan& gyro) { return !gyro.axes.empty(); });
  const bool troubled = platform.gyros.empty() || (any_unit && platform.output.axes.empty());
  if (troubled && table["rate_dps"].is_array()) {
    reader.forgive({"rate_dps", "latitude_deg", "heading_deg"});
    return;
  }
  if (platform.output.axes.empty()) {
    if (const auto rate = reader.number("rate_dps")) {
      plan.rate_dps = *rate;
      if (!(std::abs(*rate) < 1e5)) {
        reader.complain(reader.where("rate_dps"), fmt::format("rate_dps is {:g}", *rate),
                        "the platform's true rate while calibrating, in deg/s");
      }
    }
  }
  plan.latitude_deg = reader.number("latitude_deg");
  read_heading(reader, platform, plan);
  if (!plan.latitude_deg) return;
  if (reader.has("rate_dps")) {
    reader.complain(reader.where("latitude_deg"),
                    "rate_dps and latitude_deg both set the true rate", "keep one of them");
  }
  if (!(std::abs(*plan.latitude_deg) <= 90.0)) {
    reader.complain(reader.where("latitude_deg"),
                    fmt::format("latitude_deg is {:g}", *plan.latitude_deg), "-90 to 90");
  }
  plan.rate_dps = kEarthRate_dps * std::sin(*plan.latitude_deg * std::numbers::pi / 180.0);
}

// A reference that calibrates a platform must have a rate about each of its axes.
void check_reference(TomlReader& root, TomlReader& reader, const Plan& plan) {
  if (!root.has("reference")) {
    reader.complain(reader.where("source"), "source = \"reference\" needs a [reference] table");
    return;
  }
  if (!plan.reference) return;  // it has been complained of
  for (const std::size_t axis : plan.output.axes) {
    if (plan.reference->axes[axis]) continue;
    reader.complain(
        reader.where("source"),
        fmt::format("the reference does not give the rate about {}", kAxisNames[axis]),
        "rate_x, rate_y, rate_z in [reference], as many as the units have; or source = \"rest\"");
    return;
  }
}

void read_calibration(TomlReader& root, Context& context) {
  CalibrationPlan& plan = context.resolved.plan.calibration;
  const toml::table* table = root.table("calibration");
  if (table == nullptr) return;
  TomlReader reader(*table, context.file, "[calibration]", context.errors);
  plan.rest_s = number_within(reader, "rest_s", kRest_s, "s").value_or(plan.rest_s);
  read_true_rate(reader, *table, context.resolved.plan, plan);
  const std::string source = reader.text("source").value_or("rest");
  plan.from_reference = source == "reference";
  if (source != "rest" && source != "reference") {
    reader.complain(reader.where("source"), fmt::format("source is \"{}\"", source),
                    suggest_name(source, {"rest", "reference"}));
  }
  // The reference gives the rate during the calibration, not at later stops.
  plan.stop_rate_dps = plan.rate_dps;
  const bool is_told = reader.has("rate_dps") || reader.has("latitude_deg");
  if (plan.from_reference && !is_told) plan.stop_rate_dps = std::nullopt;
  read_when_moving(reader, plan);
  if (plan.from_reference) check_reference(root, reader, context.resolved.plan);
  reader.finish();
}

// A model file that cannot be opened is reported at the line that names it.
void read_model(const std::string& path, const std::string& named_at, Context& context) {
  const std::vector<GyroPlan>& gyros = context.resolved.plan.gyros;
  model::GyroNames names{.names = {}, .any = gyros.size() != 2};
  if (!names.any) names.names = {gyros[0].name, gyros[1].name};
  auto loaded = model::load_model(path, names);
  if (loaded) {
    context.resolved.plan.model = std::move(*loaded);
    return;
  }
  for (Error& error : loaded.error()) {
    if (error.where == path && !named_at.empty()) {
      error = {named_at, error.message(), "model is a path relative to the configuration file"};
    }
    context.errors.push_back(std::move(error));
  }
}

void read_corrector(TomlReader& root, Context& context, const ConfigOverrides& overrides) {
  CorrectorPlan& plan = context.resolved.plan.corrector;
  if (overrides.method) plan.method = *overrides.method;
  if (overrides.model) read_model(*overrides.model, {}, context);
  const toml::table* table = root.table("corrector");
  if (table == nullptr) return;
  TomlReader reader(*table, context.file, "[corrector]", context.errors);
  if (const auto name = reader.text("method")) {
    const auto method = method_from(*name);
    if (method && !overrides.method) plan.method = *method;
    if (!method) {
      reader.complain(reader.where("method"), fmt::format("there is no method \"{}\"", *name),
                      suggest_name(*name, {"optimal", "mutual", "mean"}));
    }
  }
  if (const auto name = reader.text("model"); name && !overrides.model) {
    const auto path = (std::filesystem::path(context.folder) / *name).lexically_normal();
    read_model(path.string(), reader.where("model"), context);
  }
  plan.window_s = number_within(reader, "window_s", kWindow_s, "s").value_or(plan.window_s);
  if (const auto order = reader.integer("order")) {
    if (*order < 0 || *order > fusion::kOrderMax) {
      reader.complain(reader.where("order"), fmt::format("order is {}", *order),
                      "0 (constant drift), 1 (linear), 2 or 3");
    } else {
      plan.order = static_cast<int>(*order);
    }
  }
  reader.finish();
}

// Precondition: no errors so far.
void apply_knowledge(Context& context) {
  Plan& plan = context.resolved.plan;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    plan.corrector.gyros[gyro].resolution_dps = plan.gyros[gyro].rate.step;
    plan.corrector.gyros[gyro].max_bias_dps = plan.gyros[gyro].max_bias_dps;
    plan.corrector.gyros[gyro].learns_temperature = plan.gyros[gyro].temperature.has_value();
  }
  if (!plan.output.axes.empty()) {
    build_axes(plan, context.errors);
    return;
  }
  if (plan.model) apply_model(model::Model(*plan.model), plan, context.errors);
}

std::uint32_t read_output_id(TomlReader& reader, std::string_view key, std::uint32_t fallback) {
  const auto id = reader.integer(key);
  if (!id) return fallback;
  if (*id >= 1 && *id <= static_cast<std::int64_t>(can::kStandardIdMax)) {
    return static_cast<std::uint32_t>(*id);
  }
  reader.complain(reader.where(key), fmt::format("{} is {:#x}", key, *id),
                  "an 11-bit identifier, 0x001 to 0x7FF");
  return fallback;
}

void read_output(TomlReader& root, Context& context) {
  Plan& plan = context.resolved.plan;
  const toml::table* table = root.table("output");
  if (table == nullptr) {
    if (!root.has("output")) {
      root.complain(context.file, "there is no [output] table",
                    "for example [output] with bus = \"can0\"");
    }
    return;
  }
  TomlReader reader(*table, context.file, "[output]", context.errors);
  const std::string bus = required_bus(reader);
  if (!bus.empty()) plan.output.bus = bus_index(plan.buses, bus);
  plan.output.rate_id = read_output_id(reader, "rate_id", plan.output.rate_id);
  plan.output.bias_id = read_output_id(reader, "bias_id", plan.output.bias_id);
  plan.output.model_id = read_output_id(reader, "model_id", plan.output.model_id);
  plan.output.fd = reader.boolean("fd").value_or(false);
  plan.output.rate_is_shared = plan.output.fd && !plan.output.axes.empty();
  plan.output.vgyro_frames = reader.boolean("vgyro_frames").value_or(true);
  plan.output.transmit = reader.boolean("transmit").value_or(true);
  if (bus.empty()) {
    reader.forgive({"layout"});
  } else {
    read_output_layouts(reader, tables_of(context), plan);
  }
  check_output_ids(reader, plan);
  const bool failed = !context.errors.empty();
  if (!plan.output.vgyro_frames && plan.output.layouts.empty() && !failed) {
    reader.complain(reader.where("vgyro_frames"), "nothing would be sent",
                    "vgyro_frames = false needs an [[output.layout]]");
  }
  reader.finish();
}

std::optional<LogLevel> log_level_from(std::string_view name) {
  if (name == "error") return LogLevel::kError;
  if (name == "warning") return LogLevel::kWarning;
  if (name == "notice") return LogLevel::kNotice;
  if (name == "info") return LogLevel::kInfo;
  if (name == "debug") return LogLevel::kDebug;
  return std::nullopt;
}

void read_log(TomlReader& root, Context& context) {
  const toml::table* table = root.table("log");
  if (table == nullptr) return;
  TomlReader reader(*table, context.file, "[log]", context.errors);
  if (const auto name = reader.text("level")) {
    const std::optional<LogLevel> level = log_level_from(*name);
    if (level) context.resolved.log_level = *level;
    if (!level) {
      reader.complain(reader.where("level"), fmt::format("there is no level \"{}\"", *name),
                      suggest_name(*name, {"error", "warning", "notice", "info", "debug"}));
    }
  }
  reader.finish();
}

}  // namespace

std::optional<Method> method_from(std::string_view name) {
  if (name == "mean") return Method::kMean;
  if (name == "mutual") return Method::kMutual;
  if (name == "optimal") return Method::kOptimal;
  return std::nullopt;
}

std::string_view to_string(Method method) {
  switch (method) {
    case Method::kMean:
      return "mean";
    case Method::kMutual:
      return "mutual";
    case Method::kOptimal:
      break;
  }
  return "optimal";
}

ConfigResult load_config(const std::string& path, const ConfigOverrides& overrides) {
  Expected<ConfigText> read = read_config_files(path);
  if (!read) return tl::unexpected(std::vector<Error>{read.error()});
  Context context{.file = path,
                  .folder = std::filesystem::path(path).parent_path().string(),
                  .errors = {},
                  .resolved = {}};
  Plan& plan = context.resolved.plan;
  TomlReader root(read->table, path, "the file", context.errors);
  read_gyros(root, context);
  read_optional(root, "reference", context, [&](TomlReader& reader, SignalResolver& resolver) {
    read_reference(reader, resolver, plan);
  });
  read_optional(root, "accelerometer", context, [&](TomlReader& reader, SignalResolver& resolver) {
    read_accelerometer(reader, resolver, plan);
  });
  read_optional(root, "speed", context, [&](TomlReader& reader, SignalResolver& resolver) {
    read_speed(reader, resolver, plan);
  });
  read_calibration(root, context);
  read_corrector(root, context, overrides);
  read_output(root, context);
  read_log(root, context);
  root.finish();
  if (context.errors.empty()) check_apart(root, plan);
  if (context.errors.empty()) apply_knowledge(context);
  if (context.errors.empty())
    warn_of_conflicts(root, plan, context.cache, context.bus_files, context.resolved.warnings);
  if (!context.errors.empty()) return tl::unexpected(std::move(context.errors));
  context.resolved.files = context.cache.paths();
  if (plan.model) context.resolved.files.push_back(plan.model->file);
  context.resolved.files.insert(context.resolved.files.end(), read->files.begin(),
                                read->files.end());
  context.resolved.text = std::move(*read);
  return std::move(context.resolved);
}

std::string fingerprint_of(const Resolved& loaded, const ConfigOverrides& overrides) {
  const std::string method(overrides.method ? to_string(*overrides.method) : "");
  const std::size_t named = loaded.files.size() - loaded.text.files.size();
  return config_fingerprint(loaded.text.table, method, std::span(loaded.files).first(named));
}

}  // namespace vgyro::gateway
