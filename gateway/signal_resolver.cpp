#include "gateway/signal_resolver.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "dbc/parser.h"

namespace vgyro::gateway {

namespace {

constexpr std::size_t kInterfaceNameMax = 15;  // IFNAMSIZ less the closing zero
constexpr std::size_t kDiagnosticsShown = 5;
// Larger values are bit patterns, not measurements: no gyro turns faster, no part that measures
// gets hotter, no vehicle survives such a shock, no sensor has a higher supply voltage.
double widest_of(Dimension dimension) {
  switch (dimension) {
    case Dimension::kRate:
      return 100'000.0;
    case Dimension::kTemperature:
      return 1'000.0;
    case Dimension::kAcceleration:
      return 10'000.0;
    case Dimension::kSpeed:
    case Dimension::kVoltage:
      break;
  }
  return 1'000.0;
}

std::string layout_of(const dbc::Signal& signal) {
  const char* type = "unsigned";
  if (signal.type == dbc::ValueType::kSigned) type = "signed";
  if (signal.type == dbc::ValueType::kFloat32) type = "float";
  if (signal.type == dbc::ValueType::kFloat64) type = "double";
  std::string text = fmt::format(
      "bit {}, {} bits, {} {}, x {:g}", signal.start_bit, signal.length_bits,
      signal.byte_order == dbc::ByteOrder::kIntel ? "Intel" : "Motorola", type, signal.factor);
  if (signal.offset != 0.0) text += fmt::format(" {:+g}", signal.offset);
  return text;
}

}  // namespace

can::BusIndex bus_index(std::vector<std::string>& buses, const std::string& name) {
  const auto found = std::find(buses.begin(), buses.end(), name);
  if (found != buses.end()) return static_cast<can::BusIndex>(found - buses.begin());
  buses.push_back(name);
  return static_cast<can::BusIndex>(buses.size() - 1);
}

std::string required_bus(TomlReader& reader) {
  std::string name = reader.required_text("bus", "can0");
  if (name.size() > kInterfaceNameMax || printable(name) != name) {
    reader.complain(reader.where("bus"), fmt::format("\"{}\" is not an interface name", name),
                    "at most 15 characters, as `ip link` shows them");
  }
  return name;
}

const dbc::Database* DatabaseCache::get(const std::string& path, TomlReader& reader) {
  const auto known = files_.find(path);
  if (known != files_.end()) return known->second.get();
  auto loaded = dbc::load(path);
  if (!loaded) {
    reader.complain(reader.where("dbc"), loaded.error().message(),
                    "dbc is a path relative to the configuration file");
    return (files_[path] = nullptr).get();
  }
  for (std::size_t i = 0; i < std::min(loaded->diagnostics.size(), kDiagnosticsShown); ++i) {
    const dbc::Diagnostic& odd = loaded->diagnostics[i];
    warnings_.push_back({at_line(path, odd.line), odd.what, {}});
  }
  if (loaded->diagnostics.size() > kDiagnosticsShown) {
    warnings_.push_back({path,
                         fmt::format("{} more odd lines, the rest of the file is used",
                                     loaded->diagnostics.size() - kDiagnosticsShown),
                         {}});
  }
  return (files_[path] = std::make_unique<dbc::Database>(std::move(*loaded))).get();
}

const dbc::Database* DatabaseCache::loaded(const std::string& path) const {
  const auto found = files_.find(path);
  return found == files_.end() ? nullptr : found->second.get();
}

std::vector<std::string> DatabaseCache::paths() const {
  std::vector<std::string> paths;
  for (const auto& [path, database] : files_)
    paths.push_back(path);
  return paths;
}

namespace {

// Reads a key that may be absent if there is a default.
std::string text_or(TomlReader& reader, std::string_view key, const std::string& fallback,
                    std::string_view example) {
  if (fallback.empty() || reader.has(key)) return reader.required_text(key, example);
  reader.forgive({key});
  return fallback;
}

}  // namespace

SignalResolver::SignalResolver(TomlReader& reader, DatabaseCache& cache,
                               const std::string& config_folder, std::vector<std::string>& buses,
                               std::vector<Error>& warnings, const SignalDefaults& defaults)
    : reader_(reader), warnings_(warnings) {
  const bool is_default = !defaults.bus.empty() && !reader.has("bus");
  bus_ = is_default ? defaults.bus : required_bus(reader);
  if (is_default) reader.forgive({"bus"});
  const std::string dbc = text_or(reader, "dbc", defaults.dbc, "bench.dbc");
  const std::string message = text_or(reader, "message", defaults.message, "GYRO_A");
  named_ = {bus_, dbc, message};
  const auto codes = read_code_rules();
  if (bus_.empty() || dbc.empty() || message.empty()) return;
  bus_index_ = bus_index(buses, bus_);
  dbc_path_ = (std::filesystem::path(config_folder) / dbc).lexically_normal().string();
  find_message(message, cache);
  if (message_ != nullptr) rules_ = codes.value_or(message_->codes);
}

void SignalResolver::find_message(std::string_view name, DatabaseCache& cache) {
  database_ = cache.get(dbc_path_, reader_);
  if (database_ == nullptr) return;
  message_ = database_->find_message(name);
  if (message_ == nullptr) {
    reader_.complain(reader_.where("message"),
                     fmt::format("{} has no message \"{}\"", dbc_path_, name),
                     suggest_name(name, database_->message_names()));
  }
}

std::optional<dbc::CodeRules> SignalResolver::read_code_rules() {
  const auto name = reader_.text("codes");
  if (!name) return std::nullopt;
  const auto rules = dbc::code_rules_from(*name);
  if (!rules) {
    reader_.complain(reader_.where("codes"), fmt::format("codes is \"{}\"", *name),
                     suggest_name(*name, {"j1939", "nmea2000", "none"}));
  }
  return rules;
}

FrameMatch SignalResolver::match() const {
  const auto bytes = std::min<std::size_t>(message_->size_bytes, can::kFdBytesMax);
  FrameMatch match{bus_index_, message_->id, message_->id_mask(), message_->extended,
                   static_cast<std::uint8_t>(bytes)};
  if (!message_->is_j1939) return match;
  for (const dbc::Message& other : database_->messages) {
    const bool same_group = other.matches(message_->id, true) && message_->matches(other.id, true);
    if (same_group && !dbc::same_sender(other.id, message_->id)) match.others.push_back(other.id);
  }
  return match;
}

const dbc::Signal* SignalResolver::signal(std::string_view key, bool required) {
  const auto name =
      required ? std::optional(reader_.required_text(key, "RateZ")) : reader_.text(key);
  if (!name || name->empty() || !usable()) return nullptr;
  return signal_named(*name, key);
}

const dbc::Signal* SignalResolver::signal_named(std::string_view name, std::string_view key) {
  const dbc::Signal* found = message_->find_signal(name);
  if (found == nullptr) {
    reader_.complain(reader_.where(key),
                     fmt::format("message {} in {} has no signal \"{}\"", message_->name,
                                 at_line(dbc_path_, message_->line), name),
                     suggest_name(name, message_->signal_names()));
  }
  return found;
}

std::string SignalResolver::signal_place(const dbc::Signal& signal) const {
  return at_line(dbc_path_, signal.line);
}

bool SignalResolver::shares_page(std::string_view key, const dbc::Signal& helper,
                                 const dbc::Signal& main) {
  if (!helper.condition || main.condition) return true;
  reader_.complain(reader_.where(key),
                   fmt::format("{} is multiplexed and {} is not", helper.name, main.name));
  return false;
}

std::optional<dbc::SignalCodec> SignalResolver::codec(const dbc::Signal& signal) {
  auto made = dbc::SignalCodec::make(signal, message_->size_bytes, signal_place(signal));
  if (made) return *made;
  reader_.complain(made.error().where, made.error().what, made.error().remedy);
  return std::nullopt;
}

std::optional<dbc::Presence> SignalResolver::presence(const dbc::Signal& signal) {
  auto made = dbc::Presence::make(*message_, signal, signal_place(signal));
  if (made) return *made;
  reader_.complain(made.error().where, made.error().what, made.error().remedy);
  return std::nullopt;
}

std::optional<Quantity> SignalResolver::quantity(const dbc::Signal& signal, std::string_view key,
                                                 Dimension dimension,
                                                 const std::optional<std::string>& unit) {
  auto bits = codec(signal);
  auto pages = presence(signal);
  const std::string& spelling = unit ? *unit : signal.unit;
  const auto conversion = convert_unit(dimension, spelling);
  if (!conversion) {
    const std::string remedy =
        fmt::format("units that are: {}{}", recommended_units(dimension),
                    dimension == Dimension::kRate && !unit
                        ? "; where the DBC file is wrong, set unit = \"deg/s\" here"
                        : "");
    reader_.complain(
        reader_.where(unit ? "unit" : key),
        unit ? fmt::format("unit = \"{}\" is none that {} can have", spelling, signal.name)
             : fmt::format("{} ({}) has the unit \"{}\", which this quantity cannot have",
                           signal.name, signal_place(signal), spelling),
        remedy);
  }
  if (!bits || !pages || !conversion) return std::nullopt;
  Quantity quantity{
      .name = signal.name,
      .unit = spelling,
      .codec = *bits,
      .presence = *pages,
      .scale = conversion->scale,
      .shift = conversion->shift,
      .layout = layout_of(signal),
      .step = signal.is_integer() ? std::abs(signal.factor) * conversion->scale : 0.0};
  set_limits(quantity, signal, dimension);
  exclude_codes(quantity, signal);
  return quantity;
}

// Excludes codes whatever range the file gives. If that range already excludes them, they count as
// out of range.
void SignalResolver::exclude_codes(Quantity& quantity, const dbc::Signal& signal) const {
  quantity.codes = dbc::codes_of(signal, rules_);
  if (quantity.codes.empty()) return;
  const double first = quantity.codec.value_of(static_cast<std::int64_t>(quantity.codes.first));
  quantity.codes_in_range = first >= quantity.minimum && first <= quantity.maximum;
  quantity.minimum = std::max(quantity.minimum, quantity.sendable_lowest());
  quantity.maximum = std::min(quantity.maximum, quantity.sendable_highest());
}

// The DBC's range is used only if the signal can reach it, and for a rate only if it spans both
// directions: real files contain ranges that contradict their own scale, and using those would
// discard good samples.
void SignalResolver::set_limits(Quantity& quantity, const dbc::Signal& signal,
                                Dimension dimension) {
  const double widest = widest_of(dimension) / quantity.scale;
  quantity.minimum = -widest;
  quantity.maximum = widest;
  if (signal.minimum == signal.maximum) return;
  const double lowest = quantity.codec.representable_min();
  const double highest = quantity.codec.representable_max();
  const bool plausible = dbc::has_reachable_range(signal, quantity.codec);
  // A gyro turns both ways: [0|100] is what its author considered, not a limit of the sensor.
  const bool one_direction = dimension == Dimension::kRate && lowest < 0.0 && highest > 0.0 &&
                             (signal.minimum >= 0.0 || signal.maximum <= 0.0);
  if (plausible && !one_direction) {
    quantity.minimum = std::max(-widest, signal.minimum);
    quantity.maximum = std::min(widest, signal.maximum);
    return;
  }
  warnings_.push_back(
      {signal_place(signal),
       plausible
           ? fmt::format("the range [{:g}|{:g}] of {} leaves out one direction of a rate that goes "
                         "from {:g} to {:g}: not used as a limit",
                         signal.minimum, signal.maximum, signal.name, lowest, highest)
           : fmt::format("the range [{:g}|{:g}] of {} does not fit its scale, which gives "
                         "{:g} to {:g}: not used as a limit",
                         signal.minimum, signal.maximum, signal.name, lowest, highest),
       {}});
}

}  // namespace vgyro::gateway
