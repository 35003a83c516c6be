#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "cli/fleet/digest.h"
#include "cli/fleet/evidence_file.h"
#include "cli/fleet/packed.h"
#include "model/catalogue.h"
#include "model/mirror.h"
#include "model/shape.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kDigits = 9;

double short_number(double value) {
  return std::stod(fmt::format("{:.{}g}", value, kDigits));
}

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

// Factor from a size in the sign of the readings to the sensor's own sign.
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
  Json json{{"format", kEvidenceFormat},
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

}  // namespace vgyro::cli
