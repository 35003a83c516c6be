#include "simulation/noise_source.h"

#include <set>
#include <string>

#include <gtest/gtest.h>

#include "model/catalogue.h"

namespace vgyro::simulation {
namespace {

// effects_test.py checks that each is the stream that docs/simulate.md specifies.
TEST(NoiseSource, EveryNameHasAStreamOfItsOwn) {
  std::vector<std::string> purposes = model::kind_names();
  purposes.emplace_back("jitter");
  std::set<double> firsts;
  std::size_t count = 0;
  for (const std::uint64_t seed : {std::uint64_t{1}, std::uint64_t{1} << 32U}) {
    for (const std::string_view sender : {"gyro 1", "gyro 2", "reference", "accelerometer"}) {
      for (const std::string& purpose : purposes) {
        for (const std::uint32_t ordinal : {0U, 1U}) {
          firsts.insert(NoiseSource(seed, sender, purpose, ordinal).uniform());
          ++count;
        }
      }
    }
  }
  EXPECT_EQ(firsts.size(), count);
}

}  // namespace
}  // namespace vgyro::simulation
