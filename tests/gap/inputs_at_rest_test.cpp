#include <algorithm>

#include <gtest/gtest.h>

#include "gap/identifiable.h"
#include "gap/kinds.h"
#include "model/catalogue.h"
#include "tests/gap/made_recording.h"

namespace vgyro::gap {
namespace {

// A platform at rest in a climate chamber, fed by a good supply: nothing moves.
Recording where_all_stands_still() {
  Making making{.seconds = 60.0, .rest_s = 60.0};
  Recording recording = make_recording(making);
  for (GyroSeries& gyro : recording.gyros) {
    gyro.temperature_c.assign(gyro.t_s.size(), 25.0);
    gyro.supply_v.assign(gyro.t_s.size(), 5.0);
    for (std::vector<double>& axis : gyro.other_rate_dps)
      axis.assign(gyro.t_s.size(), 0.0);
  }
  recording.has_acceleration = true;
  recording.acceleration.t_s = recording.gyros[0].t_s;
  for (std::size_t axis = 0; axis < 3; ++axis)
    recording.acceleration.g[axis].assign(recording.acceleration.t_s.size(), axis == 2 ? 1.0 : 0.0);
  return recording;
}

// A new row, or a new input, is tried here without being named.
TEST(Identifiable, EveryKindThatSpeaksForAnInputIsNamedWhereAllStandStill) {
  const Recording recording = where_all_stands_still();
  const auto study = Study::begin(recording, noise_effects({}));
  ASSERT_TRUE(study) << study.error().message();
  const Excitation& seen = (*study)->observations_of(0).excitation[0];
  for (const InputRow& input : inputs()) {
    EXPECT_TRUE(seen.knows(input.input)) << "input " << static_cast<int>(input.input);
    EXPECT_FALSE(seen.moves(bit(input.input))) << "input " << static_cast<int>(input.input);
  }
  const std::vector<NotIdentifiable> said = not_identifiable(**study);
  for (const KindRow& its : kinds()) {
    if (!its.speaks_for_input) continue;
    const auto count = std::count_if(said.begin(), said.end(), [&](const NotIdentifiable& lack) {
      return lack.kind == its.kind;
    });
    EXPECT_GE(count, 2) << model::info(its.kind).name << ", of both gyros";
  }
}

}  // namespace
}  // namespace vgyro::gap
