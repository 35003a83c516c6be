#include "cli/fleet/pool_text.h"

#include <nlohmann/json.hpp>

#include "cli/fleet/evidence_file.h"
#include "cli/fleet/packed.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

// The order of a pool's sums in its text, for reading and writing alike.
template <class Sums, class Visit>
void visit_group(Sums& sums, const Visit& visit) {
  for (auto* list : {&sums.count, &sums.score, &sums.heterogeneity, &sums.score_time,
                     &sums.information_time, &sums.time_square, &sums.information})
    for (auto& value : *list)
      visit(value);
}

template <class Sums, class Visit>
void visit_unit(Sums& sums, const Visit& visit) {
  visit(sums.drives);
  visit(sums.seconds);
  for (auto& moments : sums.measures)
    for (auto* value :
         {&moments.count, &moments.x, &moments.xx, &moments.t, &moments.tt, &moments.xt})
      visit(*value);
}

Json identity_json(const fleet::Identity& identity) {
  return Json::array({identity.type, identity.unit});
}

Json unit_json(const fleet::Identity& identity, const fleet::UnitSums& sums) {
  WholeWriter writer;
  visit_unit(sums, [&](fleet::Whole value) { writer.put(value); });
  Json json{{"unit", identity_json(identity)},
            {"began_s", {sums.began_least_s, sums.began_most_s}},
            {"named", sums.named},
            {"sums", writer.text()}};
  if (sums.has_temperature) json["temperature_c"] = sums.temperature_c;
  return json;
}

fleet::Identity identity_of(simdjson::dom::array words, std::string_view key) {
  return {std::string(text_of(entry(words, 0, key), key)),
          std::string(text_of(entry(words, 1, key), key))};
}

std::array<double, 2> range_of(JsonValue json, std::string_view key) {
  const simdjson::dom::array ends = list_of(json, key);
  return {number_of(entry(ends, 0, key), key), number_of(entry(ends, 1, key), key)};
}

std::set<std::string> words_of(JsonValue json, std::string_view key) {
  std::set<std::string> words;
  for (const JsonValue word : list_of(json, key))
    words.emplace_hint(words.end(), text_of(word, key));
  return words;
}

void read_unit(JsonValue json, fleet::Pool& pool) {
  fleet::UnitSums sums;
  WholeReader reader(text_of(member(json, "sums"), "sums"));
  visit_unit(sums, [&](fleet::Whole& value) { value = reader.get(); });
  if (!reader.good()) throw Fault{"the sums of a unit are not whole"};
  const auto [least_s, most_s] = range_of(json, "began_s");
  sums.began_least_s = least_s;
  sums.began_most_s = most_s;
  simdjson::dom::object named;
  if (member(json, "named").get(named) != simdjson::SUCCESS)
    throw Fault{"\"named\" of a unit is not an object"};
  for (const auto [kind, count] : named)
    sums.named.emplace(kind, count_of(count, "named"));
  if (find_member(json, "temperature_c")) {
    sums.has_temperature = true;
    sums.temperature_c = range_of(json, "temperature_c");
  }
  pool.units[identity_of(list_of(json, "unit"), "unit")].add(sums);
}

void read_group(JsonValue json, fleet::Pool& pool) {
  std::vector<fleet::Identity> who;
  for (const JsonValue unit : list_of(json, "units")) {
    simdjson::dom::array words;
    if (unit.get(words) != simdjson::SUCCESS) throw Fault{"a unit of a group is not a list"};
    who.push_back(identity_of(words, "units"));
    if (!pool.units.contains(who.back())) throw Fault{"a group names an unknown unit"};
  }
  if (who.empty() || who.size() > 2) throw Fault{"a group must have one or two gyros"};
  fleet::GroupSums sums(who.size());
  WholeReader reader(text_of(member(json, "sums"), "sums"));
  visit_group(sums, [&](fleet::Whole& value) { value = reader.get(); });
  if (!reader.good()) throw Fault{"the sums of a group are not whole"};
  pool.groups.try_emplace(std::move(who), sums.slots).first->second.add(sums);
}

}  // namespace

fleet::Pool pool_of(JsonValue json) {
  fleet::Pool pool;
  pool.drives = words_of(json, "drives");
  pool.models = words_of(json, "models");
  for (const JsonValue pair : list_of(json, "pairs")) {
    simdjson::dom::array types;
    if (pair.get(types) != simdjson::SUCCESS) throw Fault{"an entry of \"pairs\" is not a list"};
    auto [first, second] = identity_of(types, "pairs");
    pool.pairs.emplace(std::move(first), std::move(second));
  }
  for (const JsonValue unit : list_of(json, "units"))
    read_unit(unit, pool);
  for (const JsonValue group : list_of(json, "groups"))
    read_group(group, pool);
  return pool;
}

std::string pool_text(const fleet::Pool& pool) {
  Json json{{"format", kEvidenceFormat}, {"evidence", "pool"},  {"drives", pool.drives},
            {"models", pool.models},     {"pairs", pool.pairs}, {"units", Json::array()},
            {"groups", Json::array()}};
  for (const auto& [identity, sums] : pool.units)
    json["units"].push_back(unit_json(identity, sums));
  for (const auto& [who, sums] : pool.groups) {
    WholeWriter writer;
    visit_group(sums, [&](fleet::Whole value) { writer.put(value); });
    Json units = Json::array();
    for (const fleet::Identity& identity : who)
      units.push_back(identity_json(identity));
    json["groups"].push_back({{"units", std::move(units)}, {"sums", writer.text()}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace vgyro::cli
