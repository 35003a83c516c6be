// Input: arbitrary text instead of a state file. Without a right checksum it must be refused. With
// one, it must be refused with a reason, or read as a sane state that is the same after it is
// written and read again.

#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <lzma.h>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "gateway/saved_state.h"

using vgyro::gateway::saved_state_from;
using vgyro::gateway::SavedState;

namespace {

std::string sealed(const std::string& content) {
  const std::uint32_t crc =
      ::lzma_crc32(reinterpret_cast<const std::uint8_t*>(content.data()), content.size(), 0);
  return content + fmt::format("\n[checksum]\ncrc32 = \"{:08x}\"\n", crc);
}

void check(const SavedState& state) {
  const vgyro::fusion::DriftMemory& drift = state.drift;
  double sum = 0.0;
  for (const double weight : drift.walk_weight)
    sum += weight;
  assert(std::abs(sum - 1.0) < 1e-5);
  for (const double bias_dps : drift.bias_dps)
    assert(std::isfinite(bias_dps));
  assert(drift.bias_covariance[0] > 0.0 && drift.bias_covariance[2] > 0.0);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    assert(std::isfinite(drift.slope_dps_s[gyro]) && drift.slope_sigma_dps_s[gyro] >= 0.0);
    assert(std::isfinite(drift.coefficient_dps_k[gyro]));
    assert(drift.coefficient_sigma_dps_k[gyro] >= 0.0);
    assert(std::isfinite(drift.temperature_c[gyro]));
  }
  for (const double weight : drift.kind_weight)
    assert(weight >= 0.0);
  const std::string text = to_text(state);
  const auto again = saved_state_from(text, "again");
  assert(again && to_text(*again) == text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const std::string& candidate : {text, sealed(text)}) {
    const auto state = saved_state_from(candidate, "fuzzer");
    if (state) {
      check(*state);
    } else {
      assert(!state.error().where.empty() && !state.error().what.empty());
    }
  }
  return 0;
}
