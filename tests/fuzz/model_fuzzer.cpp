// Input: the text of a model file. Reading it must give effects whose compensation keeps every rate
// finite, or errors with texts.

#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "fusion/compensation.h"
#include "model/catalogue.h"
#include "model/file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace vgyro;
  const auto loaded =
      model::parse_model({reinterpret_cast<const char*>(data), size}, "fuzzer.toml");
  if (!loaded) {
    assert(!loaded.error().empty());
    for (const Error& error : loaded.error())
      assert(!error.where.empty() && !error.what.empty());
    return 0;
  }
  const fusion::Compensation compensation(loaded->effects);
  for (const double told : {std::nan(""), -40.0, 85.0}) {
    const model::Surroundings surroundings{.t_s = 1e6,
                                           .temperature_c = told,
                                           .temperature_slope_c_s = 0.1,
                                           .acceleration_g = {1.0, -1.0, 0.5},
                                           .vibration_g2 = 0.1,
                                           .supply_v = told,
                                           .angle_rad = 2.0};
    for (const double reading_dps : {-1e5, -1.0, 0.0, 1e-6, 300.0})
      assert(std::isfinite(compensation.correct(reading_dps, surroundings)));
  }
  for (const model::Effect& effect : loaded->effects)
    assert(!model::parameters_text(effect).empty());
  return 0;
}
