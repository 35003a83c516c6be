#include "gap/figures.h"

namespace vgyro::gap {
std::array<GyroFigures, 2> gyro_figures(const Study&, const std::vector<model::Effect>&,
                                        const std::vector<model::Effect>&, std::uint64_t) {
  return {};
}
void describe_effects(const Study&, const std::vector<model::Effect>&, Result&) {}
std::vector<Difference> differences(const Study&, const std::vector<model::Effect>&) {
  return {};
}
}  // namespace vgyro::gap
