#include "cli/fleet/report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/output/json_text.h"
#include "fleet/figures.h"
#include "model/catalogue.h"
#include "model/edit.h"
#include "model/shape.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;
using fleet::PooledEffect;

constexpr int kFormat = 1;

double digits(double value) {
  return std::stod(fmt::format("{:.6g}", value));
}

const model::Shape& shape_of(const PooledEffect& effect) {
  return model::shapes()[effect.shape];
}

// The size as it is reported: a low-pass has its cut-off instead.
double told(const PooledEffect& effect) {
  const model::Shape& shape = shape_of(effect);
  return model::effect_of(shape, effect.size).parameters[shape.size];
}

double told_sigma(const PooledEffect& effect, double sigma) {
  return fleet_sigma(effect, sigma);
}

Json effect_json(const PooledEffect& effect) {
  const model::Shape& shape = shape_of(effect);
  const model::Effect model = model::effect_of(shape, effect.size);
  const auto parameters = model::info(shape.kind).parameters;
  Json json{{"kind", model::info(shape.kind).name}, {"type", effect.whose.type}};
  if (!effect.whose.unit.empty()) json["unit"] = effect.whose.unit;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const std::string name(parameters[i].name);
    if (parameters[i].form == model::Parameter::Form::kAxis) {
      json["parameters"][name] =
          std::string(1, "xyz"[static_cast<std::size_t>(model.parameters[i])]);
    } else {
      json["parameters"][name] = digits(model.parameters[i]);
    }
    if (i == shape.size) json["sigma"][name] = digits(told_sigma(effect, effect.sigma));
  }
  const double middle = told(effect);
  const double half = told_sigma(effect, effect.half_width95);
  json["interval95"] = {digits(middle - half), digits(middle + half)};
  json["p_value"] = effect.p_value;
  json["between_units"] =
      effect.units > 1 ? Json(digits(told_sigma(effect, effect.between_units))) : Json(nullptr);
  json["between_units_sigma"] = digits(told_sigma(effect, effect.between_sigma));
  json["statistic"] = digits(effect.statistic);
  json["drives"] = effect.drives;
  json["units"] = effect.units;
  json["varies"] = effect.varies;
  if (effect.per_year_sigma > 0.0)
    json["per_year"] = {digits(told_sigma(effect, effect.per_year)),
                        digits(told_sigma(effect, effect.per_year_sigma))};
  json["ambiguous_with"] = Json::array();
  for (const auto& [type, other] : effect.ambiguous_with)
    json["ambiguous_with"].push_back(
        {{"kind", model::info(model::shapes()[other].kind).name}, {"type", type}});
  return json;
}

Json trend_json(const fleet::TypeTrend& trend) {
  const bool is_bias = trend.shape == model::kShapeCount;
  return {{"of", is_bias ? "bias_dps" : model::shapes()[trend.shape].name},
          {"per_year", {digits(trend.per_year), digits(trend.sigma)}},
          {"between_units", digits(trend.between_units)},
          {"units", trend.units},
          {"varies", trend.varies}};
}

Json unit_json(const fleet::UnitJudgement& unit) {
  Json json{{"unit", unit.identity.unit},
            {"type", unit.identity.type},
            {"status", fleet::status_name(unit.status)},
            {"why", unit.why.empty() ? "" : fmt::format("{}", fmt::join(unit.why, "; "))},
            {"drives", unit.drives},
            {"white_dps_rthz", digits(unit.white_dps_rthz)},
            {"walk_dps_rts", digits(unit.walk_dps_rts)},
            {"bias_dps", digits(unit.bias_dps)},
            {"bias_scatter_dps", digits(unit.bias_scatter_dps)},
            {"effects", Json::array()}};
  for (const PooledEffect& effect : unit.effects)
    json["effects"].push_back(effect_json(effect));
  return json;
}

// --- models --------------------------------------------------------------------------------------

// The known effects of one gyro: its type's, or its own where it differs.
std::vector<PooledEffect> effects_of(const fleet::TypeJudgement& type,
                                     const fleet::UnitJudgement* unit) {
  std::vector<PooledEffect> effects;
  for (const PooledEffect& effect : type.effects)
    if (!effect.varies && effect.ambiguous_with.empty()) effects.push_back(effect);
  if (unit == nullptr) return effects;
  for (const PooledEffect& own : unit->effects) {
    std::erase_if(effects, [&](const PooledEffect& e) { return e.shape == own.shape; });
    if (own.ambiguous_with.empty()) effects.push_back(own);
  }
  return effects;
}

Expected<std::string> with_gyro(Expected<std::string> text, const fleet::TypeJudgement& type,
                                const fleet::UnitJudgement* unit, std::size_t gyro) {
  const auto add = [&](const model::Effect& effect, const std::string& comment) {
    if (text) text = model::append_effect(*text, effect, comment);
  };
  for (const PooledEffect& pooled : effects_of(type, unit)) {
    const model::Shape& shape = shape_of(pooled);
    model::Effect effect = model::effect_of(shape, pooled.size);
    effect.gyro = gyro;
    // The spread between units is part of one unit's σ.
    effect.sigma =
        model::sigma_of(shape, pooled.size, std::hypot(pooled.sigma, pooled.between_units));
    add(effect, fmt::format("of {} {}: {} drives, {} units", pooled.whose.type, pooled.whose.unit,
                            pooled.drives, pooled.units));
  }
  const double white = unit != nullptr ? unit->white_dps_rthz : type.white_dps_rthz;
  const double walk = unit != nullptr ? unit->walk_dps_rts : type.walk_dps_rts;
  if (white > 0.0) add({gyro, model::Kind::kWhiteNoise, {white}, 0}, "the middle of its drives");
  if (walk > 0.0) add({gyro, model::Kind::kRateRandomWalk, {walk}, 0}, "");
  return text;
}

class Models {
 public:
  Models(const fleet::Pool& pool, const fleet::Judgement& judgement)
      : pool_(pool), judgement_(judgement) {}

  Expected<std::vector<ResultFile>> make() {
    for (const fleet::TypeJudgement& type : judgement_.types)
      add_type(fleet_file_word(type.type), type, nullptr);
    for (const fleet::UnitJudgement& unit : judgement_.units) {
      if (unit.why.empty()) continue;
      const auto& [type, name] = unit.identity;
      add_type(fleet_file_word(type) + "-" + fleet_file_word(name), type_of(type), &unit);
    }
    for (const auto& [first, second] : pool_.pairs) {
      auto text = with_gyro(std::string(), type_of(first), nullptr, 0);
      keep(fleet_file_word(first) + "+" + fleet_file_word(second),
           with_gyro(std::move(text), type_of(second), nullptr, 1));
    }
    if (failed_) return tl::unexpected(*failed_);
    return std::move(files_);
  }

 private:
  [[nodiscard]] const fleet::TypeJudgement& type_of(const std::string& name) const {
    return *std::find_if(judgement_.types.begin(), judgement_.types.end(),
                         [&](const fleet::TypeJudgement& type) { return type.type == name; });
  }

  // As gyro 1, gyro 2 or both, as its vehicles have it.
  void add_type(const std::string& name, const fleet::TypeJudgement& type,
                const fleet::UnitJudgement* unit) {
    const auto sits = [&](const auto& is_it) {
      return std::any_of(pool_.pairs.begin(), pool_.pairs.end(), is_it);
    };
    Expected<std::string> text;
    if (sits([&](const auto& pair) { return pair.first == type.type; }))
      text = with_gyro(std::move(text), type, unit, 0);
    if (sits([&](const auto& pair) { return pair.second == type.type; }))
      text = with_gyro(std::move(text), type, unit, 1);
    keep(name, std::move(text));
  }

  void keep(const std::string& name, Expected<std::string> text) {
    if (text && text->empty()) text = model::to_toml({});
    if (text) {
      files_.push_back({"models/" + name + ".toml", *std::move(text)});
    } else if (!failed_) {
      failed_ = text.error();
    }
  }

  const fleet::Pool& pool_;
  const fleet::Judgement& judgement_;
  std::vector<ResultFile> files_;
  std::optional<Error> failed_;
};

// --- text ---------------------------------------------------------------------------------------

std::size_t bad_units(const fleet::Judgement& judgement) {
  return static_cast<std::size_t>(
      std::count_if(judgement.units.begin(), judgement.units.end(),
                    [](const fleet::UnitJudgement& unit) { return !unit.why.empty(); }));
}

std::string summary(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  return fmt::format("{} drives of {} gyros of {} types; {} differ from their type",
                     pool.drives.size(), judgement.units.size(), judgement.types.size(),
                     bad_units(judgement));
}

}  // namespace

double fleet_sigma(const PooledEffect& effect, double sigma) {
  const model::Shape& shape = shape_of(effect);
  return model::sigma_of(shape, effect.size, sigma)[shape.size];
}

std::string fleet_size_text(const PooledEffect& effect) {
  return fleet::figure(told(effect), fleet_sigma(effect, effect.sigma));
}

std::string fleet_trend_text(const fleet::TypeTrend& trend) {
  const bool is_bias = trend.shape == model::kShapeCount;
  return fmt::format("{} {} by {}{} a year, ± {} between units{}",
                     is_bias ? "the bias" : model::shapes()[trend.shape].name,
                     is_bias ? "moves" : "changes", fleet::figure(trend.per_year, trend.sigma),
                     is_bias ? " deg/s" : "", fleet::figure(trend.between_units),
                     trend.varies ? ": each unit its own way" : "");
}

std::string fleet_file_word(std::string_view text) {
  std::string word(text);
  for (char& c : word) {
    const bool good = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                      c == '-' || c == '_' || c == '.';
    if (!good) c = '_';
  }
  return word;
}

std::string fleet_promise(const fleet::Judgement& judgement) {
  return fmt::format(
      "Of all names at most {:g} % are false on average (Benjamini-Yekutieli over {:.0f} tests).",
      100.0 * judgement.false_names, judgement.tests);
}

std::string fleet_json(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  Json json{{"format", kFormat},        {"drives", pool.drives.size()},
            {"tests", judgement.tests}, {"false_names", judgement.false_names},
            {"models", pool.models},    {"types", Json::array()},
            {"effects", Json::array()}, {"units", Json::array()}};
  for (const fleet::TypeJudgement& type : judgement.types) {
    json["types"].push_back({{"type", type.type},
                             {"units", type.units},
                             {"drives", type.drives},
                             {"white_dps_rthz", digits(type.white_dps_rthz)},
                             {"walk_dps_rts", digits(type.walk_dps_rts)},
                             {"trends", Json::array()}});
    for (const fleet::TypeTrend& trend : type.trends)
      json["types"].back()["trends"].push_back(trend_json(trend));
    for (const PooledEffect& effect : type.effects)
      json["effects"].push_back(effect_json(effect));
  }
  for (const fleet::UnitJudgement& unit : judgement.units)
    json["units"].push_back(unit_json(unit));
  return json_text(json);
}

std::string fleet_text(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  std::string text = summary(pool, judgement) + "\n" + fleet_promise(judgement) + "\n";
  for (const fleet::TypeJudgement& type : judgement.types) {
    for (const PooledEffect& effect : type.effects)
      text += fmt::format("  type {}: {} {}{}, {} drives\n", type.type, shape_of(effect).name,
                          fleet_size_text(effect),
                          effect.varies ? ", differs from unit to unit" : "", effect.drives);
    for (const fleet::TypeTrend& trend : type.trends)
      text += fmt::format("  type {}: {}\n", type.type, fleet_trend_text(trend));
  }
  for (const fleet::UnitJudgement& unit : judgement.units) {
    for (const std::string& why : unit.why)
      text += fmt::format("  unit {} ({}): {}\n", unit.identity.unit, unit.identity.type, why);
  }
  return text;
}

Expected<std::vector<ResultFile>> fleet_models(const fleet::Pool& pool,
                                               const fleet::Judgement& judgement) {
  return Models(pool, judgement).make();
}

}  // namespace vgyro::cli
