#include "fleet/pool.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

namespace vgyro::fleet {

namespace {

// Years count from 2020, so that sums of their squares stay small.
constexpr double kTimeZero_s = 1'577'836'800.0;
constexpr double kYear_s = 31'557'600.0;
// Floor of the walk, as a share of the white noise of one second: less than any gyro has, and what
// an unseen walk counts as.
constexpr double kWalkFloor = 1e-4;
// Bound on scores and information. No drive reaches it: a file that does is wrong, and is refused
// before.
constexpr double kMost = 1e12;

void add_each(std::vector<Whole>& sums, const std::vector<Whole>& more) {
  std::transform(sums.begin(), sums.end(), more.begin(), sums.begin(), std::plus<>());
}

double bounded(double value) {
  return std::clamp(value, -kMost, kMost);
}

UnitSums sums_of(const DriveGyro& gyro, const Drive& drive, double t_years) {
  UnitSums sums;
  const auto at = [&](Measure measure) -> Moments& {
    return sums.measures[static_cast<std::size_t>(measure)];
  };
  sums.drives = 1;
  sums.seconds = whole_of(drive.seconds);
  sums.began_least_s = sums.began_most_s = drive.began_s;
  if (gyro.white_dps_rthz > 0.0) {
    const double walk = std::max(gyro.walk_dps_rts, kWalkFloor * gyro.white_dps_rthz);
    at(Measure::kLogWhite).add(std::log(gyro.white_dps_rthz), t_years);
    at(Measure::kLogWalk).add(std::log(walk), t_years);
  }
  if (gyro.has_bias) at(Measure::kBias).add(bounded(gyro.bias_dps / kBiasUnit_dps), t_years);
  at(Measure::kLost).add(gyro.lost_share, t_years);
  at(Measure::kMasked).add(gyro.masked_share, t_years);
  sums.has_temperature = gyro.has_temperature;
  sums.temperature_c = gyro.temperature_c;
  for (const std::string& kind : gyro.named)
    sums.named[kind] = 1;
  return sums;
}

// Error if the recording is in the pool already, with whatever evidence.
Expected<void> check_free(const Pool& pool, const std::string& id) {
  const std::string recording = id.substr(0, id.find('-'));
  const auto at = pool.drives.lower_bound(recording);
  if (at == pool.drives.end() || at->compare(0, recording.size(), recording) != 0) return {};
  if (*at == id)
    return fail("", fmt::format("drive {} is in two merged files", id),
                "merge each drive once: a drive cannot be taken out of a sum");
  return fail("", fmt::format("recording {} has two different evidences", recording),
              "give one evidence file of each recording, all by the same model file and version");
}

}  // namespace

GroupSums::GroupSums(std::size_t slot_count)
    : slots(slot_count),
      count(columns()),
      score(columns()),
      heterogeneity(columns()),
      score_time(columns()),
      information_time(columns()),
      time_square(columns()),
      information(triangle(columns(), 0)) {}

void GroupSums::add(const DrivePlace& place, double t_years) {
  std::size_t at = 0;
  for (std::size_t i = 0; i < place.column.size(); ++i) {
    const std::size_t column = place.column[i];
    for (std::size_t k = 0; k <= i; ++k, ++at) {
      const auto [low, high] = std::minmax(column, place.column[k]);
      information[triangle(high, low)] += whole_of(bounded(place.information[at]));
    }
    const double own = bounded(place.information[at - 1]);
    if (own <= 0.0) continue;
    const double u = bounded(place.score[i]);
    count[column] += 1;
    score[column] += whole_of(u);
    heterogeneity[column] += whole_of(std::min(kMost, u * u / own));
    score_time[column] += whole_of(u * t_years);
    information_time[column] += whole_of(own * t_years);
    time_square[column] += whole_of(own * t_years * t_years);
  }
}

void GroupSums::add(const GroupSums& more) {
  add_each(count, more.count);
  add_each(score, more.score);
  add_each(heterogeneity, more.heterogeneity);
  add_each(score_time, more.score_time);
  add_each(information_time, more.information_time);
  add_each(time_square, more.time_square);
  add_each(information, more.information);
}

void UnitSums::add(const UnitSums& more) {
  if (more.drives == 0) return;
  began_least_s = drives == 0 ? more.began_least_s : std::min(began_least_s, more.began_least_s);
  began_most_s = drives == 0 ? more.began_most_s : std::max(began_most_s, more.began_most_s);
  if (more.has_temperature) {
    const auto [least, most] = more.temperature_c;
    temperature_c = has_temperature ? std::array{std::min(temperature_c[0], least),
                                                 std::max(temperature_c[1], most)}
                                    : more.temperature_c;
    has_temperature = true;
  }
  drives += more.drives;
  seconds += more.seconds;
  for (std::size_t i = 0; i < kMeasures; ++i)
    measures[i].add(more.measures[i]);
  for (const auto& [kind, count] : more.named)
    named[kind] += count;
}

Expected<bool> Pool::add(const Drive& drive) {
  if (drives.contains(drive.id)) return false;
  if (auto free = check_free(*this, drive.id); !free) return tl::unexpected(free.error());
  drives.insert(drive.id);
  models.insert(drive.model);
  pairs.emplace(drive.gyros[0].identity.type, drive.gyros[1].identity.type);
  const double t_years = drive.began_s > 0.0 ? (drive.began_s - kTimeZero_s) / kYear_s : 0.0;
  for (const DriveGyro& gyro : drive.gyros)
    units[gyro.identity].add(sums_of(gyro, drive, t_years));
  for (const DrivePlace& place : drive.places) {
    std::vector<Identity> who;
    for (const std::size_t gyro : place.gyros)
      who.push_back(drive.gyros[gyro].identity);
    groups.try_emplace(std::move(who), place.gyros.size()).first->second.add(place, t_years);
  }
  return true;
}

Expected<void> Pool::add(const Pool& more) {
  for (const std::string& id : more.drives) {
    if (auto free = check_free(*this, id); !free) return free;
  }
  drives.insert(more.drives.begin(), more.drives.end());
  models.insert(more.models.begin(), more.models.end());
  pairs.insert(more.pairs.begin(), more.pairs.end());
  for (const auto& [identity, sums] : more.units)
    units[identity].add(sums);
  for (const auto& [who, sums] : more.groups)
    groups.try_emplace(who, sums.slots).first->second.add(sums);
  return {};
}

}  // namespace vgyro::fleet
