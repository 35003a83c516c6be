#include "cli/fleet/evidence_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>
#include <variant>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/fnv1a.h"
#include "base/printable.h"
#include "cli/fleet/packed.h"
#include "model/catalogue.h"
#include "model/mirror.h"
#include "model/shape.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kFormat = 1;
// Lines that are understood side by side: enough to keep threads busy, few enough to be little
// memory.
constexpr std::size_t kBatch = 1024;
constexpr std::size_t kWorkersMost = 16;
// Longer words are no names that a configuration lets through.
constexpr std::size_t kWordMax = 200;
constexpr int kDigits = 9;

double short_number(double value) {
  return std::stod(fmt::format("{:.{}g}", value, kDigits));
}

// --- digests -------------------------------------------------------------------------------------

/// Sixteen hexadecimal digits: two passes of 32 bits with different beginnings.
class Digest {
 public:
  void add(std::string_view text) {
    first_ = fnv1a(text, first_);
    second_ = fnv1a(text, second_ ^ static_cast<std::uint32_t>(text.size()));
  }
  void add(const std::vector<double>& values) {
    add({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)});
  }
  [[nodiscard]] std::string text() const { return fmt::format("{:08x}{:08x}", first_, second_); }

 private:
  std::uint32_t first_ = kFnv1aBegin;
  std::uint32_t second_ = kFnv1aBegin ^ 0x9e3779b9U;
};

std::string digest_of(const std::vector<gap::Recording>& recordings, const std::string& axis) {
  Digest digest;
  digest.add(axis);
  for (const gap::Recording& recording : recordings) {
    for (const gap::GyroSeries& gyro : recording.gyros) {
      digest.add(gyro.t_s);
      digest.add(gyro.rate_dps);
    }
  }
  return digest.text();
}

std::string digest_of_files(const std::vector<std::string>& files) {
  Digest digest;
  for (const std::string& file : files)
    digest.add(read_file(file).value_or(""));
  return digest.text();
}

std::string digest_of(std::string_view text) {
  Digest digest;
  digest.add(text);
  return digest.text();
}

// --- a drive, written ----------------------------------------------------------------------------

// The sensor's own sign of a size in the readings' sign.
double sign_of(const model::Shape& shape, bool flipped) {
  if (!flipped || shape.is_low_pass) return 1.0;
  const model::Effect effect = model::effect_of(shape, 1.0);
  return model::mirrored(effect).parameters[shape.size] < 0.0 ? -1.0 : 1.0;
}

Json place_json(const gap::PlaceEvidence& place, const std::array<bool, 2>& flipped) {
  Json json{{"gyros", Json::array()}, {"gyro", Json::array()},        {"shapes", Json::array()},
            {"score", Json::array()}, {"information", Json::array()}, {"correlation", ""}};
  for (const std::size_t gyro : place.gyros)
    json["gyros"].push_back(gyro + 1);
  const std::size_t count = place.shape.size();
  std::vector<double> sign;
  std::vector<double> correlations;
  for (std::size_t i = 0; i < count; ++i) {
    const model::Shape& shape = model::shapes()[place.shape[i]];
    sign.push_back(sign_of(shape, flipped[place.gyro[i]]));
    json["gyro"].push_back(place.gyro[i] + 1);
    json["shapes"].push_back(shape.name);
    json["score"].push_back(short_number(sign[i] * place.score[i]));
    json["information"].push_back(short_number(place.information[i * count + i]));
    for (std::size_t k = 0; k < i; ++k) {
      const double squares = place.information[i * count + i] * place.information[k * count + k];
      const double cross = sign[i] * sign[k] * place.information[i * count + k];
      correlations.push_back(squares > 0.0 ? cross / std::sqrt(squares) : 0.0);
    }
  }
  json["correlation"] = packed_correlations(correlations);
  json["beside"] = place.beside;
  return json;
}

Json gyro_json(const DriveOfPair& drive, std::size_t i) {
  const gap::GyroEvidence& gyro = drive.evidence.gyros[i];
  const GapSubject& subject = drive.subject;
  const auto or_name = [&](const std::string& word) {
    return word.empty() ? subject.gyros[i] : word;
  };
  const std::string axis =
      subject.axis.empty() ? "" : fmt::format(":{}", "xyz"[subject.sensor_axis[i]]);
  Json json{{"name", subject.gyros[i]},
            {"type", or_name(subject.types[i]) + axis},
            {"unit", or_name(subject.serials[i]) + axis},
            {"samples", gyro.samples},
            {"lost_share", short_number(gyro.lost_share)},
            {"masked_share", short_number(gyro.masked_share)}};
  if (gyro.bias_dps) {
    json["bias_dps"] = short_number(drive.flipped[i] ? -*gyro.bias_dps : *gyro.bias_dps);
    json["bias_sigma_dps"] = short_number(gyro.bias_sigma_dps);
  }
  json["white_dps_rthz"] = short_number(gyro.white_dps_rthz);
  json["walk_dps_rts"] = short_number(gyro.walk_dps_rts);
  Json covariance = Json::array();
  for (const double value : gyro.log_noise_covariance)
    covariance.push_back(short_number(value));
  json["log_noise_covariance"] = std::move(covariance);
  if (gyro.temperature_c) {
    for (const double value : *gyro.temperature_c)
      json["temperature_c"].push_back(short_number(value));
  }
  json["named"] = Json::array();
  for (const model::Effect& effect : gyro.named)
    json["named"].push_back(model::info(effect.kind).name);
  return json;
}

}  // namespace

std::string drive_text(const DriveOfPair& drive, const std::vector<std::string>& config_files,
                       const std::string& model_file) {
  double seconds = 0.0;
  for (const gap::Recording& recording : drive.recordings)
    seconds += recording.seconds;
  Json json{{"format", kFormat},
            {"evidence", "drive"},
            {"vgyro", VGYRO_VERSION},
            {"recording", digest_of(drive.recordings, drive.subject.axis)},
            {"began_s", drive.recordings.front().began_s},
            {"seconds", seconds},
            {"config", digest_of_files(config_files)},
            {"model", model_file.empty() ? "none" : digest_of_files({model_file})},
            {"verdict", drive.verdict},
            {"gyros", Json::array({gyro_json(drive, 0), gyro_json(drive, 1)})},
            {"places", Json::array()}};
  for (const gap::PlaceEvidence& place : drive.evidence.places)
    json["places"].push_back(place_json(place, drive.flipped));
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

// --- read ----------------------------------------------------------------------------------------

namespace {

using Plain = nlohmann::json;

/// What a file says wrongly; told with the file's name.
struct Fault {
  std::string what;
};

std::string word_of(const Plain& json, const char* key) {
  const std::string word = json.at(key).get<std::string>();
  if (word.empty() || word.size() > kWordMax || printable(word) != word)
    throw Fault{fmt::format("\"{}\" is no plain word", key)};
  return word;
}

double number_of(const Plain& json) {
  const double value = json.get<double>();
  if (!std::isfinite(value)) throw Fault{"a number is not finite"};
  return value;
}

double number_of(const Plain& json, const char* key) {
  const auto at = json.find(key);
  return at == json.end() ? 0.0 : number_of(*at);
}

double share_of(const Plain& json, const char* key) {
  return std::clamp(number_of(json, key), 0.0, 1.0);
}

// Densities that no gyro has are a mistake of whoever wrote the file.
double density_of(const Plain& json, const char* key) {
  constexpr double kMost = 1e6;
  const double value = number_of(json, key);
  if (value < 0.0 || value > kMost) throw Fault{fmt::format("{} is {:g}", key, value)};
  return value;
}

fleet::DriveGyro drive_gyro(const Plain& json) {
  fleet::DriveGyro gyro;
  gyro.identity = {word_of(json, "type"), word_of(json, "unit")};
  gyro.has_bias = json.contains("bias_dps");
  gyro.bias_dps = number_of(json, "bias_dps");
  gyro.white_dps_rthz = density_of(json, "white_dps_rthz");
  gyro.walk_dps_rts = density_of(json, "walk_dps_rts");
  gyro.lost_share = share_of(json, "lost_share");
  gyro.masked_share = share_of(json, "masked_share");
  if (const auto at = json.find("temperature_c"); at != json.end()) {
    gyro.has_temperature = true;
    gyro.temperature_c = {number_of(at->at(0)), number_of(at->at(2))};
  }
  for (const Plain& kind : json.at("named")) {
    if (model::find_kind(kind.get<std::string>()) == nullptr)
      throw Fault{fmt::format("\"{}\" is no kind of effect", printable(kind.get<std::string>()))};
    gyro.named.push_back(kind.get<std::string>());
  }
  return gyro;
}

// Shapes that a later version knows are passed over: `keep` says which entries stay.
void read_columns(const Plain& json, fleet::DrivePlace& place, std::vector<std::size_t>& keep) {
  for (const Plain& gyro : json.at("gyros")) {
    const auto number = gyro.get<std::size_t>();
    if (number != 1 && number != 2) throw Fault{"a gyro is 1 or 2"};
    place.gyros.push_back(number - 1);
  }
  if (place.gyros.empty() || place.gyros.size() > 2 ||
      (place.gyros.size() == 2 && place.gyros[0] == place.gyros[1]))
    throw Fault{"a place is of one gyro or of both"};
  const Plain& shapes = json.at("shapes");
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const std::size_t shape = model::shape_index(shapes[i].get_ref<const std::string&>());
    const auto gyro = json.at("gyro").at(i).get<std::size_t>() - 1;
    const auto slot = std::find(place.gyros.begin(), place.gyros.end(), gyro);
    if (slot == place.gyros.end()) throw Fault{"a shape is of a gyro that is not of its place"};
    if (shape == model::kShapeCount) continue;
    place.column.push_back(
        static_cast<std::size_t>(slot - place.gyros.begin()) * model::kShapeCount + shape);
    keep.push_back(i);
  }
  std::vector<std::size_t> sorted = place.column;
  std::sort(sorted.begin(), sorted.end());
  if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
    throw Fault{"a shape is there twice"};
}

fleet::DrivePlace drive_place(const Plain& json) {
  fleet::DrivePlace place;
  std::vector<std::size_t> keep;
  read_columns(json, place, keep);
  const Plain& own = json.at("information");
  const Plain& score = json.at("score");
  const std::size_t count = json.at("shapes").size();
  const auto correlations = correlations_of(json.at("correlation").get_ref<const std::string&>(),
                                            fleet::triangle(count, 0) - count);
  if (!correlations) throw Fault{"\"correlation\" does not fit to \"shapes\""};
  std::vector<double> root;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    const double unit = model::shapes()[place.column[i] % model::kShapeCount].unit;
    const double information = number_of(own.at(keep[i])) * unit * unit;
    if (information < 0.0) throw Fault{"information is below 0"};
    root.push_back(std::sqrt(information));
    place.score.push_back(number_of(score.at(keep[i])) * unit);
    for (std::size_t k = 0; k < i; ++k) {
      const std::size_t at = fleet::triangle(keep[i], keep[k]) - keep[i];
      place.information.push_back((*correlations)[at] * root[i] * root[k]);
    }
    place.information.push_back(information);
  }
  return place;
}

fleet::Drive drive_of(const Plain& json, std::string_view line) {
  fleet::Drive drive;
  drive.id = word_of(json, "recording") + "-" + digest_of(line);
  drive.began_s = number_of(json, "began_s");
  drive.seconds = number_of(json, "seconds");
  drive.model = word_of(json, "model");
  for (std::size_t i = 0; i < 2; ++i)
    drive.gyros[i] = drive_gyro(json.at("gyros").at(i));
  for (const Plain& place : json.at("places"))
    drive.places.push_back(drive_place(place));
  return drive;
}

// --- a pool --------------------------------------------------------------------------------------

// The order in which a pool's sums stand in its text; once for both directions.
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

fleet::Identity identity_of(const Plain& json) {
  return {json.at(0).get<std::string>(), json.at(1).get<std::string>()};
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

void read_unit(const Plain& json, fleet::Pool& pool) {
  fleet::UnitSums sums;
  WholeReader reader(json.at("sums").get_ref<const std::string&>());
  visit_unit(sums, [&](fleet::Whole& value) { value = reader.get(); });
  if (!reader.good()) throw Fault{"the sums of a unit are not whole"};
  sums.began_least_s = number_of(json.at("began_s").at(0));
  sums.began_most_s = number_of(json.at("began_s").at(1));
  sums.named = json.at("named").get<std::map<std::string, std::uint64_t>>();
  if (const auto at = json.find("temperature_c"); at != json.end()) {
    sums.has_temperature = true;
    sums.temperature_c = {number_of(at->at(0)), number_of(at->at(1))};
  }
  pool.units[identity_of(json.at("unit"))].add(sums);
}

void read_group(const Plain& json, fleet::Pool& pool) {
  std::vector<fleet::Identity> who;
  for (const Plain& unit : json.at("units"))
    who.push_back(identity_of(unit));
  if (who.empty() || who.size() > 2) throw Fault{"a group is of one gyro or of two"};
  fleet::GroupSums sums(who.size());
  WholeReader reader(json.at("sums").get_ref<const std::string&>());
  visit_group(sums, [&](fleet::Whole& value) { value = reader.get(); });
  if (!reader.good()) throw Fault{"the sums of a group are not whole"};
  pool.groups.try_emplace(std::move(who), sums.slots).first->second.add(sums);
}

fleet::Pool pool_of(const Plain& json) {
  fleet::Pool pool;
  pool.drives = json.at("drives").get<std::set<std::string>>();
  pool.models = json.at("models").get<std::set<std::string>>();
  pool.pairs = json.at("pairs").get<std::set<std::pair<std::string, std::string>>>();
  for (const Plain& unit : json.at("units"))
    read_unit(unit, pool);
  for (const Plain& group : json.at("groups")) {
    read_group(group, pool);
    for (const Plain& unit : group.at("units"))
      if (!pool.units.contains(identity_of(unit)))
        throw Fault{"a group is of a unit that is not there"};
  }
  return pool;
}

/// A line as it was understood.
using Understood = std::variant<std::monostate, fleet::Drive, fleet::Pool, Fault>;

Understood understood(const std::string& line) {
  if (line.empty()) return {};
  try {
    const Plain json = Plain::parse(line);
    if (json.at("format").get<int>() != kFormat)
      return Fault{fmt::format("its format is {}, and this version reads {}",
                               json.at("format").get<int>(), kFormat)};
    const auto what = json.at("evidence").get<std::string>();
    if (what == "drive") return drive_of(json, line);
    if (what == "pool") return pool_of(json);
    return Fault{"\"evidence\" is neither \"drive\" nor \"pool\""};
  } catch (const Fault& fault) {
    return fault;
  } catch (const nlohmann::json::exception& error) {
    return Fault{printable(error.what())};
  }
}

// Lines of a batch are understood side by side, and added one after the other.
std::vector<Understood> understood(const std::vector<std::string>& lines) {
  std::vector<Understood> all(lines.size());
  const std::size_t workers =
      std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kWorkersMost);
  std::vector<std::future<void>> running;
  for (std::size_t worker = 0; worker < workers; ++worker) {
    const auto work = [&, worker] {
      for (std::size_t i = worker; i < lines.size(); i += workers)
        all[i] = understood(lines[i]);
    };
    const bool is_last = worker + 1 == workers || lines.size() <= worker + 1;
    if (is_last) {
      work();
      break;
    }
    running.push_back(std::async(std::launch::async, work));
  }
  for (std::future<void>& one : running)
    one.get();
  return all;
}

Expected<bool> add(const Understood& line, fleet::Pool& pool) {
  if (const auto* drive = std::get_if<fleet::Drive>(&line)) return pool.add(*drive);
  if (const auto* more = std::get_if<fleet::Pool>(&line)) {
    if (const auto added = pool.add(*more); !added) return tl::unexpected(added.error());
  }
  if (const auto* fault = std::get_if<Fault>(&line))
    return fail("", "no evidence: " + fault->what,
                "a file that vgyro gap --evidence or vgyro fleet wrote");
  return true;
}

// The next lines, some MB at the most where none is longer.
std::vector<std::string> next_lines(std::istream& file) {
  std::vector<std::string> lines;
  std::string line;
  while (lines.size() < kBatch && std::getline(file, line))
    lines.push_back(std::move(line));
  return lines;
}

}  // namespace

Expected<std::size_t> add_evidence(const std::string& path, fleet::Pool& pool) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code))
    return fail(path, code ? "cannot be read: " + code.message() : "is no file",
                "a file that vgyro gap --evidence or vgyro fleet wrote");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(path, "cannot be read: " + system_reason());
  std::size_t again = 0;
  unsigned number = 0;
  while (true) {
    const std::vector<std::string> lines = next_lines(file);
    if (lines.empty()) break;
    for (const Understood& line : understood(lines)) {
      ++number;
      auto added = add(line, pool);
      if (!added) {
        added.error().where = at_line(path, number);
        return tl::unexpected(added.error());
      }
      if (!*added) ++again;
    }
  }
  if (file.bad()) return fail(path, "cannot be read: " + system_reason());
  if (number == 0) return fail(path, "holds nothing", "a file that vgyro gap --evidence wrote");
  return again;
}

std::string pool_text(const fleet::Pool& pool) {
  Json json{{"format", kFormat},      {"evidence", "pool"},  {"drives", pool.drives},
            {"models", pool.models},  {"pairs", pool.pairs}, {"units", Json::array()},
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
