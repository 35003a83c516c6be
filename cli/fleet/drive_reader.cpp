#include "cli/fleet/drive_reader.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "cli/fleet/digest.h"
#include "cli/fleet/packed.h"
#include "fleet/pool.h"
#include "model/catalogue.h"
#include "model/shape.h"

namespace vgyro::cli {

namespace {

// A configuration accepts no longer names.
constexpr std::size_t kWordMax = 200;

std::string word_of(JsonValue json, std::string_view key) {
  const std::string word(text_of(member(json, key), key));
  if (word.empty() || word.size() > kWordMax || printable(word) != word)
    throw Fault{fmt::format("\"{}\" is not a plain name", key)};
  return word;
}

// 0 if it is missing.
double optional_number(JsonValue json, std::string_view key) {
  const auto found = find_member(json, key);
  return found ? number_of(*found, key) : 0.0;
}

double share_of(JsonValue json, std::string_view key) {
  return std::clamp(optional_number(json, key), 0.0, 1.0);
}

// No gyro has a density beyond kMost: the file is wrong.
double density_of(JsonValue json, std::string_view key) {
  constexpr double kMost = 1e6;
  const double value = optional_number(json, key);
  if (value < 0.0 || value > kMost) throw Fault{fmt::format("\"{}\" is {:g}", key, value)};
  return value;
}

std::string kind_of(JsonValue json) {
  std::string kind(text_of(json, "named"));
  if (model::find_kind(kind) == nullptr)
    throw Fault{fmt::format("\"{}\" is not a known kind of effect", printable(kind)),
                suggest_name(kind, model::kind_names())};
  return kind;
}

fleet::DriveGyro drive_gyro(JsonValue json) {
  fleet::DriveGyro gyro;
  gyro.identity = {word_of(json, "type"), word_of(json, "unit")};
  gyro.has_bias = find_member(json, "bias_dps").has_value();
  gyro.bias_dps = optional_number(json, "bias_dps");
  gyro.white_dps_rthz = density_of(json, "white_dps_rthz");
  gyro.walk_dps_rts = density_of(json, "walk_dps_rts");
  gyro.lost_share = share_of(json, "lost_share");
  gyro.masked_share = share_of(json, "masked_share");
  if (find_member(json, "temperature_c")) {
    constexpr std::string_view kKey = "temperature_c";
    const simdjson::dom::array three = list_of(json, kKey);
    gyro.has_temperature = true;
    gyro.temperature_c = {number_of(entry(three, 0, kKey), kKey),
                          number_of(entry(three, 2, kKey), kKey)};
  }
  for (const JsonValue kind : list_of(json, "named"))
    gyro.named.push_back(kind_of(kind));
  return gyro;
}

std::vector<double> numbers_of(JsonValue json, std::string_view key, std::size_t count) {
  std::vector<double> numbers;
  numbers.reserve(count);
  for (const JsonValue number : list_of(json, key))
    numbers.push_back(number_of(number, key));
  if (numbers.size() != count)
    throw Fault{
        fmt::format("\"{}\" has {} entries, and \"shapes\" {}", key, numbers.size(), count)};
  return numbers;
}

void read_gyros(JsonValue json, fleet::DrivePlace& place) {
  for (const JsonValue gyro : list_of(json, "gyros")) {
    const std::uint64_t number = count_of(gyro, "gyros");
    if (number != 1 && number != 2) throw Fault{"a gyro must be 1 or 2"};
    place.gyros.push_back(number - 1);
  }
  if (place.gyros.empty() || place.gyros.size() > 2 ||
      (place.gyros.size() == 2 && place.gyros[0] == place.gyros[1]))
    throw Fault{"a place must have one gyro or both"};
}

// Most files list shapes in the order of the catalogue, so the one after `last` is tried first.
std::size_t shape_after(std::size_t last, std::string_view name) {
  const auto shapes = model::shapes();
  if (last + 1 < shapes.size() && shapes[last + 1].name == name) return last + 1;
  return model::shape_index(name);
}

// Skips shapes that only a later version knows; `keep` gets the indices of the others. Returns the
// number of all shapes.
std::size_t read_columns(JsonValue json, fleet::DrivePlace& place, std::vector<std::size_t>& keep) {
  const simdjson::dom::array shapes = list_of(json, "shapes");
  const simdjson::dom::array gyros = list_of(json, "gyro");
  auto gyro = gyros.begin();
  std::size_t last = model::kShapeCount;
  std::size_t i = 0;
  std::array<bool, 2 * model::kShapeCount> is_there{};
  for (const JsonValue name : shapes) {
    if (gyro == gyros.end()) throw Fault{"\"gyro\" has fewer entries than \"shapes\""};
    const std::size_t shape = shape_after(last, text_of(name, "shapes"));
    const auto slot =
        std::find(place.gyros.begin(), place.gyros.end(), count_of(*gyro, "gyro") - 1);
    if (slot == place.gyros.end()) throw Fault{"a shape names a gyro outside its place"};
    ++gyro;
    const std::size_t at = i++;
    if (shape == model::kShapeCount) continue;
    last = shape;
    const std::size_t column =
        static_cast<std::size_t>(slot - place.gyros.begin()) * model::kShapeCount + shape;
    if (is_there[column]) throw Fault{"a shape appears twice"};
    is_there[column] = true;
    place.column.push_back(column);
    keep.push_back(at);
  }
  return i;
}

fleet::DrivePlace drive_place(JsonValue json) {
  fleet::DrivePlace place;
  std::vector<std::size_t> keep;
  read_gyros(json, place);
  const std::size_t count = read_columns(json, place, keep);
  const std::vector<double> own = numbers_of(json, "information", count);
  const std::vector<double> score = numbers_of(json, "score", count);
  const auto correlations = correlations_of(text_of(member(json, "correlation"), "correlation"),
                                            fleet::triangle(count, 0) - count);
  if (!correlations) throw Fault{"\"correlation\" does not match \"shapes\""};
  std::vector<double> root;
  place.information.reserve(fleet::triangle(keep.size(), 0));
  for (std::size_t i = 0; i < keep.size(); ++i) {
    const double unit = model::shapes()[place.column[i] % model::kShapeCount].unit;
    const double information = own[keep[i]] * unit * unit;
    if (information < 0.0) throw Fault{"information is below 0"};
    root.push_back(std::sqrt(information));
    place.score.push_back(score[keep[i]] * unit);
    for (std::size_t k = 0; k < i; ++k) {
      const std::size_t at = fleet::triangle(keep[i], keep[k]) - keep[i];
      place.information.push_back((*correlations)[at] * root[i] * root[k]);
    }
    place.information.push_back(information);
  }
  return place;
}

}  // namespace

fleet::Drive drive_of(JsonValue json, std::string_view line) {
  Digest digest;
  digest.add(line);
  fleet::Drive drive;
  drive.id = word_of(json, "recording") + "-" + digest.text();
  drive.began_s = optional_number(json, "began_s");
  drive.seconds = optional_number(json, "seconds");
  drive.model = word_of(json, "model");
  const simdjson::dom::array gyros = list_of(json, "gyros");
  for (std::size_t i = 0; i < 2; ++i)
    drive.gyros[i] = drive_gyro(entry(gyros, i, "gyros"));
  for (const JsonValue place : list_of(json, "places"))
    drive.places.push_back(drive_place(place));
  return drive;
}

}  // namespace vgyro::cli
