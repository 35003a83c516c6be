#include "cli/fleet/page.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "cli/fleet/report.h"
#include "fleet/figures.h"
#include "model/catalogue.h"
#include "model/shape.h"

namespace vgyro::cli {

namespace {

using fleet::PooledEffect;

// Units that are as their type: more of them would be a page that no one reads and no browser
// shows.
constexpr std::size_t kGoodUnitsMost = 1000;

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
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 68rem; padding: 0 1.25rem 2rem; background: var(--paper); color: var(--ink); font: 1rem/1.5 system-ui, "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: 1.6rem 0 .2rem; } h2 { font-size: 1.2rem; margin-top: 2rem; border-top: 1px solid var(--line); padding-top: .6rem; }
p { margin: .4rem 0; } a { color: inherit; } li { margin: .25rem 0; }
.headline { font-size: 1.25rem; font-weight: 600; border-left: .3rem solid var(--good); padding: .3rem 0 .3rem .8rem; } .headline.bad { border-color: var(--bad); color: inherit; }
table { border-collapse: collapse; width: 100%; font-size: .93rem; } th, td { text-align: left; vertical-align: top; padding: .35rem 1rem .35rem 0; border-bottom: 1px solid var(--line); }
th { font-weight: 600; overflow-wrap: normal; } td { overflow-wrap: break-word; } .figure { white-space: nowrap; }
th, .soft { color: var(--soft); } .bad { color: var(--bad); font-weight: 600; } .good { color: var(--good); }
details { border-bottom: 1px solid var(--line); padding: .35rem 0; } details:target { outline: 2px solid var(--bad); outline-offset: 4px; } summary { cursor: pointer; }
/* Too narrow for columns: each row a card, each cell with its column's name. */
@media screen and (max-width: 50rem) {
  thead { display: none; } table, tbody, tr, td { display: block; } tr { padding: .4rem 0; border-bottom: 1px solid var(--line); } td { border: 0; padding: .1rem 0; } td:empty { display: none; }
  td[data-label]::before { content: attr(data-label) ": "; color: var(--soft); }
}
@page { margin: 10mm; }
@media print { html { font-size: 11px; } body { max-width: none; } li, tr, details { break-inside: avoid; } h2 { break-after: avoid; } }
</style></head><body><h1>Fleet</h1>
)";

std::string cell(std::string_view label, const std::string& html, bool is_figure = false) {
  return fmt::format("<td data-label=\"{}\"{}>{}</td>", label, is_figure ? " class=\"figure\"" : "",
                     html);
}

std::string table(const std::vector<std::string_view>& columns, const std::string& rows) {
  std::string head;
  for (const std::string_view column : columns)
    head += fmt::format("<th>{}</th>", column);
  return fmt::format("<table><thead><tr>{}</tr></thead><tbody>{}</tbody></table>", head, rows);
}

std::string words(std::string_view name) {
  std::string text(name);
  std::replace(text.begin(), text.end(), '_', ' ');
  return text;
}

// What a link leads to: a name may hold any character, its place in the list none that is odd.
std::string anchor(const fleet::Judgement& judgement, const fleet::UnitJudgement& unit) {
  return fmt::format("unit{}", &unit - judgement.units.data());
}

std::size_t bad_units(const fleet::Judgement& judgement, std::string_view type = {}) {
  return static_cast<std::size_t>(std::count_if(
      judgement.units.begin(), judgement.units.end(), [&](const fleet::UnitJudgement& unit) {
        return !unit.why.empty() && (type.empty() || unit.identity.type == type);
      }));
}

// --- at a glance ---------------------------------------------------------------------------------

std::string headline(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  const std::size_t bad = bad_units(judgement);
  const std::string units =
      bad == 0 ? fmt::format("All {} gyros are as their types", judgement.units.size())
               : fmt::format("{} of {} gyros {} not as {} type", bad, judgement.units.size(),
                             bad == 1 ? "is" : "are", bad == 1 ? "its" : "their");
  return fmt::format("<p class=\"headline{}\">{}</p><p>{} drives. {}</p>", bad > 0 ? " bad" : "",
                     units, pool.drives.size(), fleet_promise(judgement));
}

std::string type_row(const fleet::Judgement& judgement, const fleet::TypeJudgement& type) {
  std::map<fleet::Status, std::size_t> counts;
  for (const fleet::UnitJudgement& unit : judgement.units)
    if (unit.identity.type == type.type) ++counts[unit.status];
  std::string status;
  for (const auto& [which, count] : counts)
    status +=
        fmt::format("{}{} {}", status.empty() ? "" : ", ", count, words(fleet::status_name(which)));
  std::string effects;
  for (const PooledEffect& effect : type.effects)
    effects += (effects.empty() ? "" : ", ") + std::string(model::shapes()[effect.shape].name);
  const bool bad = bad_units(judgement, type.type) > 0;
  return fmt::format(
      "<tr>{}{}{}{}{}{}</tr>", cell("type", fmt::format("<b>{}</b>", escaped(type.type))),
      cell("units", std::to_string(type.units)), cell("drives", std::to_string(type.drives)),
      cell("units are", fmt::format("<span class=\"{}\">{}</span>", bad ? "bad" : "good", status)),
      cell("effects of the type", effects.empty() ? "none beyond chance" : effects),
      cell("white noise, deg/s/√Hz", fleet::figure(type.white_dps_rthz), true));
}

std::string glance(const fleet::Judgement& judgement) {
  std::string rows;
  for (const fleet::TypeJudgement& type : judgement.types)
    rows += type_row(judgement, type);
  return "<h2>At a glance</h2>" + table({"type", "units", "drives", "units are",
                                         "effects of the type", "white noise, deg/s/√Hz"},
                                        rows);
}

// What to do with a unit of this status.
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

std::string todo(const fleet::Judgement& judgement) {
  std::string items;
  for (const fleet::UnitJudgement& unit : judgement.units) {
    if (unit.why.empty()) continue;
    items +=
        fmt::format("<li><a href=\"#{}\"><b>{}</b></a> ({}): {}. <b>Do:</b> {}.</li>",
                    anchor(judgement, unit), escaped(unit.identity.unit),
                    escaped(unit.identity.type), escaped(unit.why.front()), advice(unit.status));
  }
  for (const fleet::TypeJudgement& type : judgement.types) {
    for (const fleet::TypeTrend& trend : type.trends)
      items += fmt::format(
          "<li>Type <b>{}</b>: {}. <b>Do:</b> calibrate again before that matters, and ask again "
          "in "
          "a month.</li>",
          escaped(type.type), escaped(fleet_trend_text(trend)));
    if (type.effects.empty()) continue;
    items += fmt::format(
        "<li>Type <b>{}</b> has effects beyond chance. <b>Do:</b> name models/{}.toml, or the file "
        "of its pair, as the model of its vehicles.</li>",
        escaped(type.type), escaped(fleet_file_word(type.type)));
  }
  if (items.empty())
    items =
        "<li>Nothing: all units are as their types, and the types have no effect beyond "
        "chance.</li>";
  return "<h2>What to do next</h2><ul>" + items + "</ul>";
}

// --- types ---------------------------------------------------------------------------------------

std::string effect_row(const PooledEffect& effect) {
  const model::Shape& shape = model::shapes()[effect.shape];
  const auto told = [&](double sigma) { return fleet_sigma(effect, sigma); };
  std::string note;
  if (effect.varies) note = "differs from unit to unit; no common size to correct";
  for (const auto& [type, other] : effect.ambiguous_with)
    note += fmt::format("{}may also be {} of {}", note.empty() ? "" : "; ",
                        model::info(model::shapes()[other].kind).name, type);
  const auto parameters = model::info(shape.kind).parameters;
  const std::string parameter(shape.size < parameters.size() ? parameters[shape.size].name : "");
  return fmt::format(
      "<tr>{}{}{}{}{}{}{}{}</tr>",
      cell("effect",
           fmt::format("{} <span class=\"soft\">{}</span>", shape.name, escaped(parameter))),
      cell("size ± σ", fleet_size_text(effect), true),
      cell("between units",
           effect.units > 1 ? "± " + fleet::figure(told(effect.between_units)) : "–", true),
      cell("a year",
           effect.per_year_sigma > 0.0
               ? fleet::figure(told(effect.per_year), told(effect.per_year_sigma))
               : "–",
           true),
      cell("drives", std::to_string(effect.drives)), cell("units", std::to_string(effect.units)),
      cell("standard errors", fmt::format("{:.1f}", std::abs(effect.statistic))),
      cell("note", escaped(note)));
}

std::string type_section(const fleet::TypeJudgement& type) {
  std::string html = fmt::format(
      "<h2>Type {}</h2><p class=\"soft\">{} units, {} drives; white noise {} deg/s/√Hz, random "
      "walk {} deg/s/√s</p>",
      escaped(type.type), type.units, type.drives, fleet::figure(type.white_dps_rthz),
      fleet::figure(type.walk_dps_rts));
  if (type.effects.empty()) html += "<p>No effect that is beyond chance.</p>";
  std::string rows;
  for (const PooledEffect& effect : type.effects)
    rows += effect_row(effect);
  if (!rows.empty())
    html += table(
        {"effect", "size ± σ", "between units", "a year", "drives", "units", "standard errors", ""},
        rows);
  for (const fleet::TypeTrend& trend : type.trends)
    html += fmt::format("<p>Over the months {}.</p>", escaped(fleet_trend_text(trend)));
  return html;
}

// --- units ---------------------------------------------------------------------------------------

std::string unit_html(const std::string& id, const fleet::UnitJudgement& unit,
                      const fleet::UnitSums& sums) {
  const bool bad = !unit.why.empty();
  std::string html = fmt::format(
      "<details id=\"{}\"{}><summary><b>{}</b> <span class=\"soft\">{}</span> <span "
      "class=\"{}\">{}</span> <span class=\"soft\">{} drives</span></summary>",
      id, bad ? " open" : "", escaped(unit.identity.unit), escaped(unit.identity.type),
      bad ? "bad" : "good", words(fleet::status_name(unit.status)), unit.drives);
  for (const std::string& why : unit.why)
    html += fmt::format("<p>{}</p>", escaped(why));
  html += fmt::format(
      "<p class=\"soft\">white noise {} deg/s/√Hz, random walk {} deg/s/√s, bias {} deg/s from "
      "drive to drive, {:.1f} h recorded",
      fleet::figure(unit.white_dps_rthz), fleet::figure(unit.walk_dps_rts),
      fleet::figure(unit.bias_dps, unit.bias_scatter_dps), fleet::value_of(sums.seconds) / 3600.0);
  if (sums.has_temperature)
    html += fmt::format(", {:.0f} to {:.0f} °C", sums.temperature_c[0], sums.temperature_c[1]);
  html += "</p>";
  for (const auto& [kind, count] : sums.named)
    html += fmt::format("<p class=\"soft\">{} drives alone named {}</p>", count, escaped(kind));
  return html + "</details>";
}

std::string units_section(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  std::string html = "<h2>Units</h2>";
  std::size_t left_out = judgement.units.size() - bad_units(judgement);
  std::size_t room = kGoodUnitsMost;
  for (const bool bad : {true, false}) {
    for (const fleet::UnitJudgement& unit : judgement.units) {
      if (unit.why.empty() == bad || (!bad && room == 0)) continue;
      html += unit_html(anchor(judgement, unit), unit, pool.units.at(unit.identity));
      if (bad) continue;
      --room;
      --left_out;
    }
  }
  if (left_out > 0)
    html += fmt::format("<p>{} more units, with nothing to tell, are in fleet.json.</p>", left_out);
  return html;
}

}  // namespace

std::string fleet_page(const fleet::Pool& pool, const fleet::Judgement& judgement) {
  std::string html(kHead);
  html += headline(pool, judgement);
  if (pool.models.size() > 1)
    html += fmt::format(
        "<p class=\"bad\">Drives were judged with {} different model files: what a "
        "file knows counts to the sizes, but not where its form is another.</p>",
        pool.models.size());
  html += todo(judgement) + glance(judgement);
  for (const fleet::TypeJudgement& type : judgement.types)
    html += type_section(type);
  return html + units_section(pool, judgement) +
         "<p class=\"soft\">Made by vgyro fleet; fleet.json has the same "
         "figures.</p></body></html>\n";
}

}  // namespace vgyro::cli
