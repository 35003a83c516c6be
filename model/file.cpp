#include "model/file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include <fmt/core.h>

#include "base/bounded_file.h"
#include "base/printable.h"
#include "base/spelling.h"
#include "base/toml_reader.h"
#include "model/catalogue.h"

namespace vgyro::model {

namespace {

// 256 effects with tables of temperatures take some 100 kB.
constexpr std::size_t kFileBytesMax = std::size_t{1} << 20U;

constexpr std::int64_t kFormat = 1;
constexpr std::array<std::string_view, 3> kAxes{"x", "y", "z"};

constexpr std::string_view kFromKey = "from";

std::optional<std::size_t> read_axis(TomlReader& reader, std::string_view key) {
  const auto name = reader.text(key);
  if (!name) return std::nullopt;
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    if (*name == kAxes[i]) return i;
  }
  reader.complain(reader.where(key), fmt::format("there is no axis \"{}\"", *name),
                  "\"x\", \"y\" or \"z\"");
  return std::nullopt;
}

std::optional<double> read_number(TomlReader& reader, const Parameter& parameter) {
  const auto value = reader.number(parameter.name);
  if (!value || parameter.allows(*value)) return value;
  reader.complain(reader.where(parameter.name), fmt::format("{} is {:g}", parameter.name, *value),
                  parameter.limits());
  return std::nullopt;
}

// Nothing after an error, which has been reported.
std::optional<double> read_parameter(TomlReader& reader, const KindInfo& kind,
                                     const Parameter& parameter, bool has_unit_axis) {
  if (parameter.form == Parameter::Form::kAxis && has_unit_axis) {
    const auto axis = read_axis(reader, key_of(parameter, true));
    return axis ? std::optional(static_cast<double>(*axis)) : std::nullopt;
  }
  if (!reader.has(parameter.name)) {
    reader.forgive({parameter.name});
    if (parameter.preset) return parameter.preset;
    reader.complain(reader.where(), fmt::format("{} needs {}", kind.name, parameter.name),
                    parameter.limits());
    return std::nullopt;
  }
  if (parameter.form != Parameter::Form::kAxis) return read_number(reader, parameter);
  const auto axis = read_axis(reader, parameter.name);
  return axis ? std::optional(static_cast<double>(*axis)) : std::nullopt;
}

// The key `axis` is the unit's, unless it is a parameter: in g_sensitivity it is the acceleration's
// axis unless `from` is present.
bool has_unit_axis(const TomlReader& reader, const KindInfo& kind) {
  const bool is_parameter =
      std::any_of(kind.parameters.begin(), kind.parameters.end(),
                  [](const Parameter& parameter) { return parameter.name == kAxisKey; });
  return reader.has(kAxisKey) && (!is_parameter || reader.has(kFromKey));
}

// Two values within the limits are no further apart than this.
std::optional<double> checked_sigma(TomlReader& reader, const Parameter& parameter,
                                    std::string_view key) {
  const auto sigma = reader.number(key);
  const double most = parameter.maximum - parameter.minimum;
  if (!sigma || (*sigma >= 0.0 && *sigma <= most)) return sigma;
  reader.complain(
      reader.where(key), fmt::format("{} is {:g}", key, *sigma),
      fmt::format("0 to {:g}{}{}", most, parameter.unit.empty() ? "" : " ", parameter.unit));
  return std::nullopt;
}

std::string sigma_example(const KindInfo& kind) {
  const Parameter* size = size_parameter(kind.kind);
  return size == nullptr ? std::string("leave it out: nothing of this kind is measured")
                         : fmt::format("sigma = 1e-3, or sigma = {{ {} = 1e-3 }}", size->name);
}

// A single number is the σ of the effect's size; a table names parameters.
void read_sigma_table(const toml::table& table, TomlReader& effect_reader, const std::string& file,
                      std::vector<Error>& errors, Effect& effect) {
  TomlReader reader(table, file, "sigma", errors);
  const KindInfo& kind = info(effect.kind);
  for (std::size_t i = 0; i < kind.parameters.size(); ++i) {
    const Parameter& parameter = kind.parameters[i];
    if (!reader.has(parameter.name)) {
      reader.forgive({parameter.name});
    } else if (parameter.form != Parameter::Form::kNumber) {
      effect_reader.complain(reader.where(parameter.name),
                             fmt::format("{} is chosen, and has no sigma", parameter.name),
                             sigma_example(kind));
      reader.forgive({parameter.name});
    } else {
      effect.sigma[i] = checked_sigma(reader, parameter, parameter.name).value_or(0.0);
    }
  }
  reader.finish();
}

void read_sigma(const toml::table& table, TomlReader& reader, const std::string& file,
                std::vector<Error>& errors, Effect& effect) {
  if (!reader.has("sigma")) {
    reader.forgive({"sigma"});
    return;
  }
  const KindInfo& kind = info(effect.kind);
  const Parameter* size = size_parameter(effect.kind);
  if (size == nullptr) {
    reader.forgive({"sigma"});
    reader.complain(reader.where("sigma"), fmt::format("{} has no sigma", kind.name),
                    sigma_example(kind));
  } else if (table["sigma"].is_table()) {
    read_sigma_table(*reader.table("sigma"), reader, file, errors, effect);
  } else if (table["sigma"].is_number()) {
    const auto place = static_cast<std::size_t>(size - kind.parameters.data());
    effect.sigma[place] = checked_sigma(reader, *size, "sigma").value_or(0.0);
  } else {
    reader.forgive({"sigma"});
    reader.complain(reader.where("sigma"), "sigma must be a number or a table",
                    sigma_example(kind));
  }
}

std::optional<std::size_t> read_gyro_name(TomlReader& reader, const GyroNames& gyros) {
  const auto name = reader.text("gyro");
  if (!name) return std::nullopt;
  if (gyros.any) return 0;
  const auto& [first, second] = gyros.names;
  const bool is_first = !name->empty() && *name == first;
  const bool is_second = !name->empty() && *name == second;
  if (is_first != is_second) return is_first ? 0 : 1;
  std::vector<std::string> known;
  std::copy_if(gyros.names.begin(), gyros.names.end(), std::back_inserter(known),
               [](const std::string& known_name) { return !known_name.empty(); });
  const bool is_both = is_first && is_second;
  const std::string what = is_both ? fmt::format("both gyros have the name \"{}\"", *name)
                                   : fmt::format("there is no gyro \"{}\"", printable(*name));
  reader.complain(reader.where("gyro"), what,
                  known.empty() || is_both ? "gyro = 1 or 2" : suggest_name(*name, known));
  return std::nullopt;
}

std::optional<std::size_t> read_gyro(const toml::table& table, TomlReader& reader,
                                     const GyroNames& gyros) {
  if (table["gyro"].is_string()) return read_gyro_name(reader, gyros);
  const auto number = reader.integer("gyro");
  if (number && (*number == 1 || *number == 2)) return static_cast<std::size_t>(*number - 1);
  if (number || !reader.has("gyro")) {
    reader.complain(
        number ? reader.where("gyro") : reader.where(),
        number ? fmt::format("there is no gyro {}", *number) : std::string("[[effect]] needs gyro"),
        "gyro = 1 or 2 in the order of the configuration, or the gyro's name");
  }
  return std::nullopt;
}

const KindInfo* read_kind(TomlReader& reader) {
  const std::string name = reader.required_text("kind", "scale_factor");
  if (name.empty()) return nullptr;
  const KindInfo* kind = find_kind(name);
  if (kind == nullptr) {
    reader.complain(reader.where("kind"), fmt::format("there is no kind \"{}\"", name),
                    suggest_name(name, kind_names()) + "; `vgyro model list` shows them all");
  }
  return kind;
}

void check_together(TomlReader& reader, const Effect& effect) {
  if (effect.kind == Kind::kStuck && !(effect.parameters[0] < effect.parameters[1])) {
    reader.complain(reader.where("to_s"), "to_s is not after from_s");
  }
}

// Without a valid kind the other keys cannot be checked.
std::optional<Effect> read_effect(const toml::table& table, const std::string& file,
                                  const GyroNames& gyros, std::vector<Error>& errors) {
  TomlReader reader(table, file, "[[effect]]", errors);
  const std::size_t errors_before = errors.size();
  const auto gyro = read_gyro(table, reader, gyros);
  const KindInfo* kind = read_kind(reader);
  if (kind == nullptr) return std::nullopt;
  Effect effect{.gyro = gyro.value_or(0),
                .kind = kind->kind,
                .line = static_cast<unsigned>(table.source().begin.line)};
  const bool of_axis = has_unit_axis(reader, *kind);
  if (of_axis) effect.of_axis = read_axis(reader, kAxisKey);
  if (of_axis && acts_on_unit(kind->kind)) {
    reader.complain(
        reader.where(kAxisKey),
        fmt::format("{} of one axis: it is of a unit, with all of its axes", kind->name),
        "leave `axis` out");
  }
  for (std::size_t i = 0; i < kind->parameters.size(); ++i) {
    effect.parameters[i] =
        read_parameter(reader, *kind, kind->parameters[i], of_axis).value_or(0.0);
  }
  read_sigma(table, reader, file, errors, effect);
  effect.ambiguous = reader.boolean("ambiguous").value_or(false);
  reader.finish();
  if (errors.size() > errors_before) return std::nullopt;
  check_together(reader, effect);
  return effect;
}

void read_format(TomlReader& root, const std::string& file) {
  const auto format = root.integer("format");
  if (!format && root.has("format")) return;
  if (format == kFormat) return;
  root.complain(format ? root.where("format") : file,
                format ? fmt::format("format is {}", *format) : std::string("format is missing"),
                "this version reads format = 1");
}

void check_count(TomlReader& root, Kind kind, std::size_t most, const Model& model) {
  for (std::size_t place = 0; place < 2 * kAxes.size(); ++place) {
    const std::size_t gyro = place / kAxes.size();
    const std::size_t axis = place % kAxes.size();
    std::size_t count = 0;
    for (const Effect& effect : model.effects) {
      // An effect of all axes is reported with the first axis only.
      const bool of_axis = effect.of_axis.value_or(axis) == axis;
      if (effect.gyro != gyro || effect.kind != kind || !of_axis || ++count != most + 1) continue;
      if (!effect.of_axis && axis > 0) continue;
      root.complain(at_line(model.file, effect.line),
                    fmt::format("gyro {} has more than {} effects of kind {}", gyro + 1, most,
                                info(kind).name));
    }
  }
}

// Flicker noise needs a free correlated drift: it is represented by at least one.
void check_flicker(TomlReader& root, const Model& model) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const auto of_kind = [&](Kind kind) {
      return [gyro, kind](const Effect& e) { return e.gyro == gyro && e.kind == kind; };
    };
    const auto flicker =
        std::find_if(model.effects.begin(), model.effects.end(), of_kind(Kind::kBiasInstability));
    const auto drifts = static_cast<std::size_t>(
        std::count_if(model.effects.begin(), model.effects.end(), of_kind(Kind::kGaussMarkov)));
    if (flicker == model.effects.end() || drifts < kGaussMarkovMax) continue;
    root.complain(at_line(model.file, flicker->line),
                  fmt::format("gyro {} has bias_instability beside {} effects of kind gauss_markov",
                              gyro + 1, drifts),
                  fmt::format("beside it there may be {}", kGaussMarkovMax - 1));
  }
}

}  // namespace

std::string_view key_of(const Parameter& parameter, bool has_unit_axis) {
  return has_unit_axis && parameter.name == kAxisKey ? kFromKey : parameter.name;
}

ModelResult parse_model(std::string_view text, const std::string& file, const GyroNames& gyros) {
  const auto parsed = parse_toml(text, file, "write strings in quotes and effects in [[effect]]");
  if (!parsed) return tl::unexpected(std::vector<Error>{parsed.error()});
  std::vector<Error> errors;
  Model model{.file = file, .effects = {}};
  TomlReader root(*parsed, file, "the file", errors);
  read_format(root, file);
  const toml::array* tables = root.array("effect");
  const std::size_t count = tables == nullptr ? 0 : tables->size();
  if (count > kEffectsMax) {
    root.complain(root.where("effect"), fmt::format("there are {} effects", count),
                  fmt::format("at most {}", kEffectsMax));
  }
  bool is_named = false;  // by a name that may belong to either gyro
  for (std::size_t i = 0; i < std::min(count, kEffectsMax); ++i) {
    const toml::table* table = tables->get(i)->as_table();
    if (table == nullptr) {
      root.complain(root.where("effect"), "effects must be written as [[effect]] tables");
      break;
    }
    if (const auto effect = read_effect(*table, file, gyros, errors))
      model.effects.push_back(*effect);
  }
  root.finish();
  if (!is_named) {
    check_count(root, Kind::kGaussMarkov, kGaussMarkovMax, model);
    check_flicker(root, model);
  }
  if (!errors.empty()) return tl::unexpected(std::move(errors));
  return model;
}

ModelResult load_model(const std::string& path, const GyroNames& names) {
  const auto text = read_regular_file(path, kFileBytesMax);
  if (!text) return tl::unexpected(std::vector<Error>{text.error()});
  return parse_model(*text, path, names);
}

}  // namespace vgyro::model
