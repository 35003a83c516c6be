#include "simulation/readings.h"

#include <fmt/core.h>

#include "simulation/curve.h"
#include "simulation/gyro_chain.h"
#include "simulation/low_pass.h"

namespace vgyro::simulation {

Expected<void> check_low_passes(const model::Equation& equation) {
  const std::size_t count = equation.cutoffs_hz().size();
  if (count <= LowPass::kStagesMax) return {};
  return fail("the model", fmt::format("a gyro has {} effects of kind bandwidth", count),
              fmt::format("at most {}", LowPass::kStagesMax));
}

Expected<std::vector<double>> readings(std::span<const model::Effect> effects,
                                       std::span<const Instant> instants, double interval_s,
                                       std::uint64_t seed) {
  const model::Equation equation(effects);
  if (const auto good = check_low_passes(equation); !good) return tl::unexpected(good.error());
  std::vector<double> result;
  if (instants.empty()) return result;
  const bool lagging = equation.delay_s() != 0.0 || !equation.cutoffs_hz().empty();
  std::vector<double> times_s;
  std::vector<double> rates_dps;
  for (const Instant& instant : instants) {
    if (!lagging) break;
    times_s.push_back(instant.surroundings.t_s);
    rates_dps.push_back(instant.rate_dps);
  }
  const Curve curve = lagging ? Curve(times_s, rates_dps) : Curve();
  LowPass low_pass(curve, equation.cutoffs_hz());
  const auto low_passed = [&](double t_s) { return low_pass.at(t_s); };
  GyroChain chain(effects, interval_s, seed);
  result.reserve(instants.size());
  for (const Instant& instant : instants) {
    const double late_dps =
        lagging ? equation.late_rate_dps(low_passed, instant.surroundings.t_s) : instant.rate_dps;
    result.push_back(chain.next(late_dps, instant.surroundings));
  }
  return result;
}

}  // namespace vgyro::simulation
