#include "gateway/saved_state.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <lzma.h>
#include <numeric>
#include <span>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/toml_reader.h"
#include "gateway/status.h"

namespace vgyro::gateway {

namespace {

constexpr std::int64_t kFormat = 1;
// For a platform of several axes: the contents of format 1 are in [axis.x] … instead.
constexpr std::int64_t kFormatOfAxes = 2;
constexpr const char* kRemedy = "the gateway calibrates again; nothing has to be done";

// The text ends with this and eight digits, so that any cut also removes the checksum.
constexpr std::string_view kSealHead = "\n[checksum]\ncrc32 = \"";
constexpr std::string_view kSealTail = "\"\n";
constexpr std::size_t kSealBytes = kSealHead.size() + 8 + kSealTail.size();

// No gyro comes near this; beyond it arithmetic would not stay finite.
constexpr double kRateMax_dps = 1e5;
constexpr double kVarianceMax = kRateMax_dps * kRateMax_dps;
constexpr double kSkewMax_s = 10.0;
// No gyro changes by so much in a second, or with a kelvin, either.
constexpr double kChangeMax_dps = kRateMax_dps;
constexpr double kTemperatureMin_c = -273.15;
constexpr double kTemperatureMax_c = 1000.0;
constexpr double kWeightSumTolerance = 1e-6;
// A sum of probabilities may exceed 1 by rounding.
constexpr double kWeightMax = 1.0 + kWeightSumTolerance;

std::string seal(std::string_view content) {
  const std::uint32_t crc =
      ::lzma_crc32(reinterpret_cast<const std::uint8_t*>(content.data()), content.size(), 0);
  return fmt::format("{}{:08x}{}", kSealHead, crc, kSealTail);
}

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

bool is_printable(char c) {
  return c >= 0x20 && c < 0x7F;
}

// The shortest form that reads back as the same number; with a point, since TOML's integers have no
// -0.
std::string shortest(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_not_of("-0123456789") == std::string::npos) text += ".0";
  return text;
}

std::string listed(std::span<const double> values) {
  constexpr std::size_t kInLine = 7;
  std::string out = "[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) out += i % kInLine == 0 ? ",\n  " : ", ";
    out += shortest(values[i]);
  }
  return out + "]";
}

std::string temperature_key(std::size_t gyro) {
  return fmt::format("temperature_{}_c", gyro + 1);
}

double sum_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// Unknown values are left out, so that they read as in a text of an older version.
std::string kinds_and_slopes(const fusion::DriftMemory& drift) {
  std::string text;
  if (sum_of(drift.kind_weight) > 0.0)
    text += fmt::format("kind_weight = {}\n", listed(drift.kind_weight));
  if (sum_of(drift.slope_sigma_dps_s) > 0.0) {
    text += fmt::format("slope_dps_s = {}\nslope_sigma_dps_s = {}\n", listed(drift.slope_dps_s),
                        listed(drift.slope_sigma_dps_s));
  }
  if (!drift.has_temperature[0] && !drift.has_temperature[1]) return text;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!drift.has_temperature[gyro]) continue;
    text += fmt::format("{} = {}\n", temperature_key(gyro), shortest(drift.temperature_c[gyro]));
  }
  return text + fmt::format("coefficient_dps_k = {}\ncoefficient_sigma_dps_k = {}\n",
                            listed(drift.coefficient_dps_k), listed(drift.coefficient_sigma_dps_k));
}

// Written only if there is one, so that the text of a sound pair is unchanged.
std::string contradiction(const fusion::PairVerdict& pair) {
  if (pair.contradiction == fusion::Contradiction::kNone) return {};
  std::string text = fmt::format("contradiction = \"{}\"\n", to_string(pair.contradiction));
  if (std::isfinite(pair.slope))
    text += fmt::format("contradiction_slope = {}\n", shortest(pair.slope));
  if (pair.lag_s != 0.0) text += fmt::format("contradiction_lag_s = {}\n", shortest(pair.lag_s));
  if (pair.gyro < 2) text += fmt::format("contradiction_gyro = {}\n", pair.gyro + 1);
  return text;
}

// --- reading -------------------------------------------------------------------------------------

/// Reads the numbers of one table; keeps the first error.
class Numbers {
 public:
  Numbers(const toml::table& table, const std::string& where, std::string title)
      : reader_(table, where, std::move(title), errors_) {}

  double number(std::string_view key, double minimum, double maximum) {
    const std::optional<double> value = reader_.number(key);
    if (!value) missing(key);
    return checked(key, value.value_or(0.0), minimum, maximum);
  }
  std::optional<double> optional_number(std::string_view key, double minimum, double maximum) {
    if (!reader_.has(key)) return std::nullopt;
    return number(key, minimum, maximum);
  }
  std::int64_t integer(std::string_view key) {
    const std::optional<std::int64_t> value = reader_.integer(key);
    if (!value) missing(key);
    return value.value_or(0);
  }
  std::string text(std::string_view key) { return reader_.required_text(key, "gyro"); }

  template <std::size_t kCount>
  std::array<double, kCount> numbers(std::string_view key, double minimum, double maximum) {
    std::array<double, kCount> values{};
    const toml::array* list = reader_.array(key);
    if (list == nullptr || list->size() != kCount) {
      reader_.complain(reader_.where(key), fmt::format("{} is not a list of {}", key, kCount));
      return values;
    }
    for (std::size_t i = 0; i < kCount; ++i) {
      const std::optional<double> value =
          (*list)[i].is_number() ? (*list)[i].value<double>() : std::nullopt;
      values[i] = checked(key, value.value_or(NAN), minimum, maximum);
    }
    return values;
  }

  void require(bool holds, std::string_view key, const char* what) {
    if (!holds) reader_.complain(reader_.where(key), fmt::format("{} {}", key, what));
  }

  [[nodiscard]] bool has(std::string_view key) const { return reader_.has(key); }

  void pass_over(std::string_view key) { reader_.forgive({key}); }

  [[nodiscard]] std::optional<Error> finish() {
    reader_.finish();
    if (errors_.empty()) return std::nullopt;
    errors_.front().remedy = kRemedy;
    return errors_.front();
  }

 private:
  void missing(std::string_view key) {
    reader_.complain(reader_.where(), fmt::format("{} is missing", key));
  }
  double checked(std::string_view key, double value, double minimum, double maximum) {
    if (value >= minimum && value <= maximum) return value;  // NaN is not
    reader_.complain(reader_.where(key),
                     fmt::format("{} is {}, outside {} to {}", key, value, minimum, maximum));
    return 0.0;
  }

  std::vector<Error> errors_;
  TomlReader reader_;
};

/// Elements: gyro 1, both, gyro 2.
bool is_covariance(const std::array<double, 3>& m) {
  return m[0] >= 0.0 && m[2] >= 0.0 && m[1] * m[1] <= m[0] * m[2];
}
bool is_positive_definite(const std::array<double, 3>& m) {
  return m[0] > 0.0 && m[2] > 0.0 && m[1] * m[1] < m[0] * m[2];
}

// Older states lack these keys.
void add_kinds(Numbers& table, fusion::DriftMemory& drift) {
  if (!table.has("kind_weight")) return;
  drift.kind_weight = table.numbers<fusion::kDriftKinds>("kind_weight", 0.0, kWeightMax);
  table.require(sum_of(drift.kind_weight) > 0.0, "kind_weight", "adds up to nothing");
}

void add_slopes(Numbers& table, fusion::DriftMemory& drift) {
  if (!table.has("slope_dps_s") && !table.has("slope_sigma_dps_s")) return;
  drift.slope_dps_s = table.numbers<2>("slope_dps_s", -kChangeMax_dps, kChangeMax_dps);
  drift.slope_sigma_dps_s = table.numbers<2>("slope_sigma_dps_s", 0.0, kChangeMax_dps);
}

void add_temperatures(Numbers& table, fusion::DriftMemory& drift) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::optional<double> temperature_c =
        table.optional_number(temperature_key(gyro), kTemperatureMin_c, kTemperatureMax_c);
    drift.has_temperature[gyro] = temperature_c.has_value();
    drift.temperature_c[gyro] = temperature_c.value_or(0.0);
  }
  const bool any = drift.has_temperature[0] || drift.has_temperature[1];
  if (!any && !table.has("coefficient_dps_k") && !table.has("coefficient_sigma_dps_k")) return;
  drift.coefficient_dps_k = table.numbers<2>("coefficient_dps_k", -kChangeMax_dps, kChangeMax_dps);
  drift.coefficient_sigma_dps_k = table.numbers<2>("coefficient_sigma_dps_k", 0.0, kChangeMax_dps);
  table.require(any, "coefficient_dps_k", "needs a temperature");
}

fusion::DriftMemory drift_from(Numbers& table) {
  fusion::DriftMemory drift;
  drift.bias_dps = table.numbers<2>("bias_dps", -kRateMax_dps, kRateMax_dps);
  drift.bias_covariance = table.numbers<3>("bias_covariance", -kVarianceMax, kVarianceMax);
  table.require(is_positive_definite(drift.bias_covariance), "bias_covariance",
                "is not positive definite");
  drift.white_density = table.numbers<3>("white_density", -kVarianceMax, kVarianceMax);
  table.require(is_covariance(drift.white_density), "white_density", "is not a covariance");
  drift.sample_variance = table.numbers<2>("sample_variance", 0.0, kVarianceMax);
  const auto ratios = table.numbers<fusion::kWalkRatios_per_s.size()>("walk_ratio_per_s", 0.0, 1e9);
  table.require(ratios == fusion::kWalkRatios_per_s, "walk_ratio_per_s", "are of another version");
  drift.walk_weight = table.numbers<fusion::kWalkPairs>("walk_weight", 0.0, kWeightMax);
  table.require(std::abs(sum_of(drift.walk_weight) - 1.0) <= kWeightSumTolerance, "walk_weight",
                "does not add up to 1");
  drift.scale_difference = table.number("scale_difference", -1.0, 1.0);
  drift.scale_difference_sigma = table.number("scale_difference_sigma", 0.0, kRateMax_dps);
  drift.skew_s = table.number("skew_s", -kSkewMax_s, kSkewMax_s);
  drift.skew_sigma_s = table.number("skew_sigma_s", 0.0, kRateMax_dps);
  add_kinds(table, drift);
  add_slopes(table, drift);
  add_temperatures(table, drift);
  return drift;
}

fusion::PairVerdict contradiction_from(Numbers& table) {
  fusion::PairVerdict pair;
  if (!table.has("contradiction")) return pair;
  const std::string name = table.text("contradiction");
  for (std::size_t i = 1; i < fusion::kContradictions; ++i) {
    const auto one = static_cast<fusion::Contradiction>(i);
    if (to_string(one) == name) pair.contradiction = one;
  }
  table.require(pair.contradiction != fusion::Contradiction::kNone, "contradiction", "is unknown");
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  pair.slope = table
                   .optional_number("contradiction_slope", -kRateMax_dps * kRateMax_dps,
                                    kRateMax_dps * kRateMax_dps)
                   .value_or(kUnknown);
  pair.slope_sigma = kUnknown;
  pair.lag_s = table.optional_number("contradiction_lag_s", -kSkewMax_s * 1e3, kSkewMax_s * 1e3)
                   .value_or(0.0);
  if (table.has("contradiction_gyro"))
    pair.gyro = table.number("contradiction_gyro", 1.0, 2.0) > 1.5 ? 1 : 0;
  pair.probability = 1.0;
  return pair;
}

Expected<std::string_view> unsealed(std::string_view text, const std::string& where) {
  if (text.size() > kSavedStateBytesMax) {
    return fail(
        where,
        fmt::format("is longer than {} bytes, so it is not a saved state", kSavedStateBytesMax),
        kRemedy);
  }
  const std::string_view content = text.substr(0, text.size() - std::min(text.size(), kSealBytes));
  if (text.substr(content.size()) != seal(content)) {
    return fail(where, "is damaged, cut, or no saved state: its checksum does not fit", kRemedy);
  }
  return content;
}

}  // namespace

std::string device_of(const GyroPlan& gyro) {
  std::string device = fmt::format("{}: {} {:#x}{} {} {}{}, {}, scale {}{:+}", gyro.name, gyro.bus,
                                   gyro.match.id, gyro.match.extended ? "x" : "", gyro.message,
                                   gyro.rate.name, gyro.sign ? " with a sign signal" : "",
                                   gyro.rate.layout, gyro.rate.scale, gyro.rate.shift);
  if (!gyro.taken_back.empty()) device += ", less model " + gyro.taken_back;
  if (gyro.mount.turns())
    device += fmt::format(", mount {:.6f}", fmt::join(gyro.mount.matrix, " "));
  std::string plain;
  for (const char c : device) {
    plain +=
        is_printable(c) ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return plain;
}

Expected<void> check_devices(const SavedState& state, const Plan& plan) {
  if (!state.axes.empty() && plan.axes.empty()) {
    return fail({}, "is of units of several axes, but the gyros of the configuration have one",
                kRemedy);
  }
  if (state.axes.empty() && !plan.axes.empty()) {
    return fail({}, "is of two single gyros, but the configuration has units of several axes",
                kRemedy);
  }
  for (const SavedState& one : state.axes) {
    const auto pair = std::find_if(plan.axes.begin(), plan.axes.end(),
                                   [&](const Plan& each) { return each.axis == one.axis; });
    if (pair == plan.axes.end()) {
      return fail({},
                  fmt::format("is of an axis {} that the configuration does not have",
                              kAxisNames[one.axis]),
                  kRemedy);
    }
    if (auto same = check_devices(one, *pair); !same) return same;
  }
  if (!state.axes.empty()) return {};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::string device = device_of(plan.gyros[gyro]);
    if (state.devices[gyro] == device) continue;
    return fail({},
                fmt::format("is of other gyros: of `{}`, but the configuration has `{}`",
                            state.devices[gyro], device),
                kRemedy);
  }
  if (state.rest_rate_dps != plan.calibration.rate_dps) {
    return fail({},
                fmt::format("was learned with {} deg/s as the true rate at rest, but the "
                            "configuration has {} deg/s",
                            state.rest_rate_dps, plan.calibration.rate_dps),
                kRemedy);
  }
  return {};
}

namespace {

constexpr const char* kHead =
    "# Biases of two gyros, kept by vgyrod so that a restart need not calibrate again.\n"
    "# Without this file the gateway calibrates anew. A file changed by hand is refused.\n";

std::string pair_text(const SavedState& state) {
  std::string text = fmt::format("rate_stamp_ns = {}\nrest_rate_dps = {}\n",
                                 to_ns(state.rate_stamp), shortest(state.rest_rate_dps));
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    text += fmt::format("device_{} = {}\n", gyro + 1, quoted(state.devices[gyro]));
    if (state.temperature_c[gyro]) {
      text += fmt::format("{} = {}\n", temperature_key(gyro), shortest(*state.temperature_c[gyro]));
    }
  }
  return text + contradiction(state.pair);
}

std::string drift_text(const fusion::DriftMemory& drift, std::string_view table) {
  return fmt::format(
             "\n[{}]  # covariances: of gyro 1, of both, of gyro 2\n"
             "bias_dps = {}\nbias_covariance = {}\nwhite_density = {}\nsample_variance = {}\n"
             "walk_ratio_per_s = {}\nwalk_weight = {}\n"
             "scale_difference = {}\nscale_difference_sigma = {}\nskew_s = {}\nskew_sigma_s = {}\n",
             table, listed(drift.bias_dps), listed(drift.bias_covariance),
             listed(drift.white_density), listed(drift.sample_variance),
             listed(fusion::kWalkRatios_per_s), listed(drift.walk_weight),
             shortest(drift.scale_difference), shortest(drift.scale_difference_sigma),
             shortest(drift.skew_s), shortest(drift.skew_sigma_s)) +
         kinds_and_slopes(drift);
}

std::string axes_text(const SavedState& state) {
  std::string text = fmt::format("{}format = {}\n", kHead, kFormatOfAxes);
  if (state.misalignment) {
    text += fmt::format(
        "\n[misalignment]  # from unit 1 to unit 2; covariances xx, xy, xz, yy, yz, zz\n"
        "angle_rad = {}\ncovariance = {}\n",
        listed(state.misalignment->angle_rad), listed(state.misalignment->covariance));
  }
  if (state.heading) {
    text +=
        fmt::format("\n[heading]  # of x, clockwise from north\nheading_rad = {}\nsigma_rad = {}\n",
                    shortest(state.heading->heading_rad), shortest(state.heading->sigma_rad));
  }
  for (const SavedState& one : state.axes) {
    const char axis = kAxisNames[one.axis];
    text += fmt::format("\n[axis.{}]\n{}", axis, pair_text(one));
    if (one.earth_doubt_dps)
      text += fmt::format("earth_doubt_dps = {}\n", shortest(*one.earth_doubt_dps));
    text += drift_text(one.drift, fmt::format("axis.{}.drift", axis));
  }
  return text;
}

}  // namespace

std::string to_text(const SavedState& state) {
  std::string text = axes_text(state);
  if (state.axes.empty()) {
    text = fmt::format("{}format = {}\n{}", kHead, kFormat, pair_text(state));
    text += drift_text(state.drift, "drift");
  }
  return text + seal(text);
}

namespace {

Expected<SavedState> pair_from(const toml::table& root, const std::string& where) {
  const toml::table* drift = root["drift"].as_table();
  if (drift == nullptr) return fail(where, "holds no [drift]", kRemedy);
  SavedState state;
  Numbers top(root, where, "saved state");
  top.pass_over("format");
  state.rate_stamp = time_from_ns(top.integer("rate_stamp_ns"));
  top.require(state.rate_stamp >= TimePoint{}, "rate_stamp_ns", "is negative");
  state.rest_rate_dps = top.number("rest_rate_dps", -kRateMax_dps, kRateMax_dps);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    state.devices[gyro] = top.text(fmt::format("device_{}", gyro + 1));
    state.temperature_c[gyro] =
        top.optional_number(temperature_key(gyro), kTemperatureMin_c, kTemperatureMax_c);
  }
  state.pair = contradiction_from(top);
  state.earth_doubt_dps = top.optional_number("earth_doubt_dps", 0.0, kRateMax_dps);
  top.pass_over("drift");
  if (const std::optional<Error> error = top.finish()) return tl::unexpected(*error);
  Numbers table(*drift, where, "[drift]");
  state.drift = drift_from(table);
  if (const std::optional<Error> error = table.finish()) return tl::unexpected(*error);
  return state;
}

// A larger angle is not a misalignment: the units face each other.
constexpr double kAngleMax_rad = 3.2;
// A configured heading may be any number that people call a direction.
constexpr double kHeadingMax_rad = 100.0;

Expected<fusion::MisalignmentMemory> misalignment_from(const toml::table& root,
                                                       const std::string& where) {
  Numbers table(root, where, "[misalignment]");
  fusion::MisalignmentMemory memory;
  memory.angle_rad = table.numbers<3>("angle_rad", -kAngleMax_rad, kAngleMax_rad);
  memory.covariance =
      table.numbers<6>("covariance", -kAngleMax_rad * kAngleMax_rad, kAngleMax_rad * kAngleMax_rad);
  if (const std::optional<Error> error = table.finish()) return tl::unexpected(*error);
  return memory;
}

Expected<HeadingMemory> heading_from(const toml::table& root, const std::string& where) {
  Numbers table(root, where, "[heading]");
  HeadingMemory memory;
  memory.heading_rad = table.number("heading_rad", -kHeadingMax_rad, kHeadingMax_rad);
  memory.sigma_rad = table.number("sigma_rad", 0.0, Heading::kSigmaMost_rad);
  if (const std::optional<Error> error = table.finish()) return tl::unexpected(*error);
  return memory;
}

Expected<SavedState> axes_from(const toml::table& root, const std::string& where) {
  Numbers top(root, where, "saved state");
  for (const char* key : {"format", "axis", "misalignment", "heading"})
    top.pass_over(key);
  if (const std::optional<Error> error = top.finish()) return tl::unexpected(*error);
  const toml::table* tables = root["axis"].as_table();
  if (tables == nullptr) return fail(where, "holds no [axis]", kRemedy);
  std::vector<SavedState> axes;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const toml::table* table = (*tables)[std::string_view(&kAxisNames[axis], 1)].as_table();
    if (table == nullptr) continue;
    auto one = pair_from(*table, where);
    if (!one) return one;
    one->axis = axis;
    axes.push_back(std::move(*one));
  }
  if (axes.empty() || axes.size() != tables->size())
    return fail(where, "holds no axes, or unknown ones", kRemedy);
  SavedState state = axes.front();
  state.axes = std::move(axes);
  if (const toml::table* table = root["misalignment"].as_table()) {
    const auto misalignment = misalignment_from(*table, where);
    if (!misalignment) return tl::unexpected(misalignment.error());
    state.misalignment = *misalignment;
  }
  if (const toml::table* table = root["heading"].as_table()) {
    const auto heading = heading_from(*table, where);
    if (!heading) return tl::unexpected(heading.error());
    state.heading = *heading;
  }
  return state;
}

}  // namespace

Expected<SavedState> saved_state_from(std::string_view text, const std::string& where) {
  const Expected<std::string_view> content = unsealed(text, where);
  if (!content) return tl::unexpected(content.error());
  const Expected<toml::table> parsed = parse_toml(*content, where, kRemedy);
  if (!parsed) return tl::unexpected(parsed.error());
  const toml::table& root = *parsed;
  // Not by value<>(): the library casts a number with a fraction before it checks that it fits.
  const toml::value<std::int64_t>* format = root["format"].as_integer();
  if (format != nullptr && format->get() == kFormatOfAxes) return axes_from(root, where);
  if (format != nullptr && format->get() == kFormat && root["drift"].is_table())
    return pair_from(root, where);
  if (format != nullptr && format->get() > kFormatOfAxes) {
    return fail(
        where,
        fmt::format("is of format {}, so a newer release has written it: only format {} and "
                    "{} are known",
                    format->get(), kFormat, kFormatOfAxes),
        kRemedy);
  }
  return fail(
      where,
      fmt::format("is of another version: only format {} and {} are known", kFormat, kFormatOfAxes),
      kRemedy);
}

}  // namespace vgyro::gateway
