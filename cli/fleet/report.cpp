#include "cli/fleet/report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/output/json_text.h"
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
  const model::Shape& shape = shape_of(effect);
  return model::sigma_of(shape, effect.size, sigma)[shape.size];
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

std::string trend_text(const fleet::TypeTrend& trend) {
  const bool is_bias = trend.shape == model::kShapeCount;
  return fmt::format("{} {} by {:.3g} ± {:.1g}{} a year, ± {:.2g} between units{}",
                     is_bias ? "the bias" : model::shapes()[trend.shape].name,
                     is_bias ? "moves" : "changes", trend.per_year, trend.sigma,
                     is_bias ? " deg/s" : "", trend.between_units,
                     trend.varies ? ": each unit its own way" : "");
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

std::string size_text(const PooledEffect& effect) {
  return fmt::format("{:.4g} ± {:.1g}", told(effect), told_sigma(effect, effect.sigma));
}

// --- models --------------------------------------------------------------------------------------

// Replaces characters that do not belong into a file's name, such as the colon before an axis.
std::string file_word(std::string_view text) {
  std::string word(text);
  for (char& c : word) {
    const bool good = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                      c == '-' || c == '_' || c == '.';
    if (!good) c = '_';
  }
  return word;
}

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
      add_type(file_word(type.type), type, nullptr);
    for (const fleet::UnitJudgement& unit : judgement_.units) {
      if (unit.why.empty()) continue;
      const auto& [type, name] = unit.identity;
      add_type(file_word(type) + "-" + file_word(name), type_of(type), &unit);
    }
    for (const auto& [first, second] : pool_.pairs) {
      auto text = with_gyro(std::string(), type_of(first), nullptr, 0);
      keep(file_word(first) + "+" + file_word(second),
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

// --- page ----------------------------------------------------------------------------------------

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '&':
        safe += "&amp;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

constexpr std::string_view kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,"><title>vgyro fleet report</title>
<style>
:root { --ink: #1c2430; --soft: #5b6675; --line: #d9dee5; --bad: #c2410c; --good: #0f766e; --paper: #fff; }
@media (prefers-color-scheme: dark) { :root { --paper: #12171e; --ink: #e4e9ef; --soft: #9aa7b5; --line: #2c3540; --bad: #fb923c; --good: #2dd4bf; } }
body { margin: 0 auto; max-width: 68rem; padding: 0 1.25rem 2rem; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2rem; border-top: 1px solid var(--line); padding-top: .6rem; }
table { border-collapse: collapse; width: 100%; font-size: .93rem; } th, td { text-align: left; vertical-align: top; padding: .35rem 1rem .35rem 0; border-bottom: 1px solid var(--line); }
th, .soft { color: var(--soft); } .bad { color: var(--bad); font-weight: 600; } .good { color: var(--good); }
details { border-bottom: 1px solid var(--line); padding: .35rem 0; } summary { cursor: pointer; } .wide { overflow-x: auto; }
</style></head><body><h1>Fleet</h1>
)";

std::string effects_table(const std::vector<PooledEffect>& effects) {
  if (effects.empty()) return "<p class=\"soft\">No effect beyond chance.</p>";
  std::string html =
      "<div class=\"wide\"><table><tr><th>effect</th><th>size ± σ</th><th>between units</th>"
      "<th>a year</th><th>drives</th><th>units</th><th>standard errors</th><th></th></tr>";
  for (const PooledEffect& effect : effects) {
    std::string note;
    if (effect.varies) note = "differs from unit to unit; no common size to correct";
    for (const auto& [type, shape] : effect.ambiguous_with)
      note += fmt::format("{}may also be {} of {}", note.empty() ? "" : "; ",
                          model::info(model::shapes()[shape].kind).name, type);
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1f}</td>"
        "<td>{}</td></tr>",
        shape_of(effect).name, size_text(effect),
        effect.units > 1 ? fmt::format("{:.2g}", told_sigma(effect, effect.between_units)) : "–",
        effect.per_year_sigma > 0.0
            ? fmt::format("{:+.2g} ± {:.1g}", told_sigma(effect, effect.per_year),
                          told_sigma(effect, effect.per_year_sigma))
            : "–",
        effect.drives, effect.units, std::abs(effect.statistic), escaped(note));
  }
  return html + "</table></div>";
}

std::string unit_html(const fleet::UnitJudgement& unit, const fleet::UnitSums& sums) {
  const bool bad = !unit.why.empty();
  std::string html = fmt::format(
      "<details{}><summary><b>{}</b> <span class=\"soft\">{}</span> <span class=\"{}\">{}</span> "
      "<span class=\"soft\">{} drives</span></summary>",
      bad ? " open" : "", escaped(unit.identity.unit), escaped(unit.identity.type),
      bad ? "bad" : "good", fleet::status_name(unit.status), unit.drives);
  for (const std::string& why : unit.why)
    html += fmt::format("<p>{}</p>", escaped(why));
  html += fmt::format(
      "<p class=\"soft\">white noise {:.3g} deg/s/√Hz, random walk {:.2g} deg/s/√s, bias {:.3g} "
      "deg/s, from drive to drive ± {:.2g} deg/s, {:.1f} h recorded",
      unit.white_dps_rthz, unit.walk_dps_rts, unit.bias_dps, unit.bias_scatter_dps,
      fleet::value_of(sums.seconds) / 3600.0);
  if (sums.has_temperature)
    html += fmt::format(", {:.0f} to {:.0f} °C", sums.temperature_c[0], sums.temperature_c[1]);
  html += "</p>";
  for (const auto& [kind, count] : sums.named)
    html += fmt::format("<p class=\"soft\">{} drives alone named {}</p>", count, escaped(kind));
  return html + "</details>";
}

// Advice for a unit of this status.
std::string_view advice(fleet::Status status) {
  switch (status) {
    case fleet::Status::kNoisy:
    case fleet::Status::kWandering:
      return "replace it, or give its own model file to its vehicle";
    case fleet::Status::kTrend:
      return "watch it: run vgyro fleet again in a month";
    case fleet::Status::kLossy:
      return "look at its cable and its bus";
    case fleet::Status::kApart:
      return "give its own model file to its vehicle; look at how it is mounted";
    case fleet::Status::kFewDrives:
    case fleet::Status::kAsItsType:
      break;
  }
  return "";
}

std::string todo_html(const fleet::Judgement& judgement) {
  std::string html = "<h2>What to do next</h2><ul>";
  bool any = false;
  for (const fleet::UnitJudgement& unit : judgement.units) {
    if (unit.why.empty()) continue;
    any = true;
    html +=
        fmt::format("<li><b>{}</b> ({}): {}; {}</li>", escaped(unit.identity.unit),
                    escaped(unit.identity.type), escaped(unit.why.front()), advice(unit.status));
  }
  for (const fleet::TypeJudgement& type : judgement.types) {
    for (const fleet::TypeTrend& trend : type.trends) {
      any = true;
      html += fmt::format(
          "<li>type <b>{}</b>: {}; calibrate again within the time in which that matters, and ask "
          "again in a month</li>",
          escaped(type.type), escaped(trend_text(trend)));
    }
    if (type.effects.empty()) continue;
    any = true;
    html += fmt::format(
        "<li>type <b>{}</b>: name models/{}.toml, or that of its pair, as the model "
        "of its vehicles</li>",
        escaped(type.type), escaped(file_word(type.type)));
  }
  if (!any)
    html +=
        "<li>Nothing: all units are as their types, and the types have no effect beyond "
        "chance.</li>";
  return html + "</ul>";
}

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

std::string promise(const fleet::Judgement& judgement) {
  return fmt::format(
      "Of all names at most {:g} % are false on average (Benjamini-Yekutieli over {:.0f} tests).",
      100.0 * judgement.false_names, judgement.tests);
}

}  // namespace

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

std::string fleet_page(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  std::string html(kHead);
  html += fmt::format("<p><b>{}</b></p><p class=\"soft\">{}</p>", summary(pool, judgement),
                      promise(judgement));
  if (pool.models.size() > 1)
    html += fmt::format(
        "<p class=\"bad\">Drives were judged with {} different model files: what a "
        "file knows counts to the sizes, but not where its form is another.</p>",
        pool.models.size());
  html += todo_html(judgement);
  for (const fleet::TypeJudgement& type : judgement.types) {
    html += fmt::format(
        "<h2>Type {}</h2><p class=\"soft\">{} units, {} drives; white noise {:.3g} "
        "deg/s/√Hz, random walk {:.2g} deg/s/√s</p>",
        escaped(type.type), type.units, type.drives, type.white_dps_rthz, type.walk_dps_rts);
    html += effects_table(type.effects);
    for (const fleet::TypeTrend& trend : type.trends)
      html += fmt::format("<p>Over the months {}.</p>", escaped(trend_text(trend)));
  }
  html += "<h2>Units</h2>";
  for (const bool bad : {true, false}) {
    for (const fleet::UnitJudgement& unit : judgement.units)
      if (unit.why.empty() != bad) html += unit_html(unit, pool.units.at(unit.identity));
  }
  return html +
         "<p class=\"soft\">Made by vgyro fleet; fleet.json has the same "
         "figures.</p></body></html>\n";
}

std::string fleet_text(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  std::string text = summary(pool, judgement) + "\n" + promise(judgement) + "\n";
  for (const fleet::TypeJudgement& type : judgement.types) {
    for (const PooledEffect& effect : type.effects)
      text += fmt::format("  type {}: {} {}{}, {} drives\n", type.type, shape_of(effect).name,
                          size_text(effect), effect.varies ? ", differs from unit to unit" : "",
                          effect.drives);
    for (const fleet::TypeTrend& trend : type.trends)
      text += fmt::format("  type {}: {}\n", type.type, trend_text(trend));
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
