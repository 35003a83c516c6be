#include "gateway/output_frames.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace vgyro::gateway {

namespace {

constexpr double kRatePerDps = 20'000.0;       // 5e-5 deg/s
constexpr double kSigmaPerDps = 50'000.0;      // 2e-5 deg/s
constexpr double kBiasPerDps = 100'000.0;      // 1e-5 deg/s
constexpr double kSlopePerDpsS = 1'000'000.0;  // 1e-6 (deg/s)/s
constexpr double kFdRatePerDps = 1e6;
constexpr double kFdSigmaPerDps = 1e7;
constexpr std::size_t kFdRateBytes = 32;

std::uint64_t low_bits(std::int64_t value, unsigned bits) {
  return static_cast<std::uint64_t>(value) & (~0ULL >> (64U - bits));
}

// Two's complement in `bits`; NaN and values that do not fit become the most negative number.
std::uint64_t signed_field(double scaled, unsigned bits) {
  const double limit = std::ldexp(1.0, static_cast<int>(bits) - 1);
  if (!(std::abs(scaled) < limit - 0.5)) return 1ULL << (bits - 1);
  return low_bits(std::llrint(scaled), bits);
}

// NaN and values that do not fit become all ones, "not available".
std::uint64_t sigma_field(double scaled, unsigned bits) {
  const std::uint64_t none = ~0ULL >> (64U - bits);
  if (!(scaled >= 0.0 && scaled < static_cast<double>(none) - 0.5)) return none;
  return static_cast<std::uint64_t>(std::llrint(scaled));
}

void store_word(std::uint8_t* to, std::uint64_t word) {
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(to, &word, sizeof word);
    return;
  }
  for (unsigned i = 0; i < 8; ++i)
    to[i] = static_cast<std::uint8_t>(word >> (8U * i));
}

std::uint64_t age_field(Duration age) {
  constexpr std::int64_t kHalfMillisecond = 500'000;
  const std::int64_t steps = (age.count() + kHalfMillisecond / 2) / kHalfMillisecond;
  return static_cast<std::uint64_t>(std::clamp<std::int64_t>(steps, 0, 15));
}

can::Frame frame_of(std::uint32_t id, std::size_t bytes, std::uint8_t flags) {
  can::Frame frame;
  frame.id = id;
  frame.length = static_cast<std::uint8_t>(bytes);
  frame.flags = flags;
  return frame;
}

std::span<std::uint8_t, 8> classic_payload(can::Frame& frame) {
  return std::span<std::uint8_t, 8>(frame.data.data(), 8);
}

}  // namespace

OutputEncoder::OutputEncoder(const OutputPlan& plan)
    : fd_(plan.fd),
      rate_(fd_ ? frame_of(plan.rate_id, kFdRateBytes, can::kFd | can::kBitRateSwitch)
                : frame_of(plan.rate_id, can::kClassicBytesMax, 0)),
      bias_(frame_of(plan.bias_id, can::kClassicBytesMax, 0)),
      model_(frame_of(plan.model_id, can::kClassicBytesMax, 0)),
      rate_protection_(static_cast<std::uint16_t>(plan.rate_id)),
      fd_rate_protection_(static_cast<std::uint16_t>(plan.rate_id)),
      bias_protection_(static_cast<std::uint16_t>(plan.bias_id)),
      model_protection_(static_cast<std::uint16_t>(plan.model_id)) {}

void OutputEncoder::count_on_from(const OutputEncoder& before) {
  if (rate_.id == before.rate_.id) {
    rate_protection_ = before.rate_protection_;
    fd_rate_protection_ = before.fd_rate_protection_;
  }
  if (bias_.id == before.bias_.id) bias_protection_ = before.bias_protection_;
  if (model_.id == before.model_.id) model_protection_ = before.model_protection_;
}

bool OutputEncoder::can_carry(double rate_dps) const {
  const double limit = fd_ ? 2147483647.0 / kFdRatePerDps : 8388607.0 / kRatePerDps;
  return std::abs(rate_dps) <= limit;
}

const can::Frame& OutputEncoder::rate(const RateOutput& output) {
  if (fd_) {
    put_fd_rate(output);
    fd_rate_protection_.protect({rate_.data.data(), kFdRateBytes});
  } else {
    put_classic_rate(output);
    rate_protection_.protect(classic_payload(rate_));
  }
  return rate_;
}

void OutputEncoder::put_classic_rate(const RateOutput& output) {
  constexpr std::uint64_t kInvalid = 0x800000;
  const bool valid = output.valid && can_carry(output.rate_dps);
  const std::uint64_t rate = valid ? signed_field(output.rate_dps * kRatePerDps, 24) : kInvalid;
  const std::uint64_t sigma = valid ? sigma_field(output.sigma_dps * kSigmaPerDps, 12) : 0xFFF;
  const auto quality = static_cast<std::uint64_t>(valid ? output.quality : Quality::kUnusable);
  store_word(rate_.data.data(),
             rate << 16U | sigma << 40U | static_cast<std::uint64_t>(output.state) << 52U |
                 (valid ? 1ULL << 55U : 0) | quality << 56U | age_field(output.age) << 60U);
}

void OutputEncoder::put_fd_rate(const RateOutput& output) {
  const bool valid = output.valid && can_carry(output.rate_dps);
  const auto quality = static_cast<std::uint64_t>(valid ? output.quality : Quality::kUnusable);
  const std::uint64_t rate =
      valid ? signed_field(output.rate_dps * kFdRatePerDps, 32) : 0x80000000U;
  const std::uint64_t sigma = valid ? sigma_field(output.sigma_dps * kFdSigmaPerDps, 32) : ~0U;
  const auto corrected = [&](std::size_t gyro) {
    return valid ? signed_field(output.corrected_dps[gyro] * kFdRatePerDps, 32) : 0x80000000U;
  };
  // In a log that starts at zero, readings that are dated back may lie before it.
  const auto instant_us =
      static_cast<std::uint64_t>(std::max<std::int64_t>(to_ns(output.instant), 0) / 1000);
  const auto age_us = static_cast<std::uint64_t>(
      std::clamp<std::int64_t>((output.age.count() + 500) / 1000, 0, 65535));
  std::uint8_t* data = rate_.data.data();
  store_word(data, static_cast<std::uint64_t>(output.state) << 24U | (valid ? 1ULL << 27U : 0) |
                       quality << 28U | rate << 32U);
  store_word(data + 8, sigma | instant_us << 32U);
  store_word(data + 16, instant_us >> 32U | corrected(0) << 32U);
  store_word(data + 24,
             corrected(1) | age_us << 32U | static_cast<std::uint64_t>(output.health) << 48U);
}

const can::Frame& OutputEncoder::bias(const BiasOutput& output) {
  store_word(bias_.data.data(), signed_field(output.bias_dps[0] * kBiasPerDps, 20) << 16U |
                                    signed_field(output.bias_dps[1] * kBiasPerDps, 20) << 36U |
                                    static_cast<std::uint64_t>(output.mode) << 56U |
                                    static_cast<std::uint64_t>(output.health) << 59U);
  bias_protection_.protect(classic_payload(bias_));
  return bias_;
}

const can::Frame& OutputEncoder::model(const ModelOutput& output) {
  store_word(model_.data.data(), signed_field(output.slope_dps_s * kSlopePerDpsS, 24) << 16U |
                                     sigma_field(output.bias_sigma_dps * kBiasPerDps, 12) << 40U |
                                     sigma_field(output.slope_sigma_dps_s * kSlopePerDpsS, 12)
                                         << 52U);
  model_protection_.protect(classic_payload(model_));
  return model_;
}

// --- all axes ------------------------------------------------------------------------------------

namespace {

constexpr std::size_t kAxesRateBytes = 48;
constexpr std::size_t kAxesState = 3;    ///< a byte for each axis: state, validity, quality
constexpr std::size_t kAxesHealth = 6;   ///< a byte for each axis
constexpr std::size_t kAxesAge = 9;      ///< two bytes
constexpr std::size_t kAxesTime = 12;    ///< eight bytes
constexpr std::size_t kAxesRates = 20;   ///< four bytes for each axis
constexpr std::size_t kAxesSigmas = 32;  ///< four bytes for each axis

void store_bytes(std::uint8_t* to, std::uint64_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i)
    to[i] = static_cast<std::uint8_t>(value >> (8U * i));
}

}  // namespace

AxesEncoder::AxesEncoder(const OutputPlan& plan)
    : frame_(frame_of(plan.rate_id, kAxesRateBytes, can::kFd | can::kBitRateSwitch)),
      protection_(static_cast<std::uint16_t>(plan.rate_id)) {}

void AxesEncoder::count_on_from(const AxesEncoder& before) {
  if (frame_.id == before.frame_.id) protection_ = before.protection_;
}

const can::Frame& AxesEncoder::rates(const std::array<const RateOutput*, kAxes>& axes) {
  std::uint8_t* data = frame_.data.data();
  std::fill_n(data, kAxesRateBytes, std::uint8_t{0});
  Duration age{0};
  TimePoint instant;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const RateOutput* output = axes[axis];
    const bool valid = output != nullptr && output->valid &&
                       std::abs(output->rate_dps) <= 2147483647.0 / kFdRatePerDps;
    store_bytes(data + kAxesRates + 4 * axis,
                valid ? signed_field(output->rate_dps * kFdRatePerDps, 32) : 0x80000000U, 4);
    store_bytes(data + kAxesSigmas + 4 * axis,
                valid ? sigma_field(output->sigma_dps * kFdSigmaPerDps, 32) : ~0U, 4);
    if (output == nullptr) continue;
    const auto quality = static_cast<unsigned>(valid ? output->quality : Quality::kUnusable);
    data[kAxesState + axis] = static_cast<std::uint8_t>(static_cast<unsigned>(output->state) |
                                                        (valid ? 8U : 0U) | quality << 4U);
    data[kAxesHealth + axis] = output->health;
    age = std::max(age, output->age);
    instant = output->instant;
  }
  store_bytes(
      data + kAxesAge,
      static_cast<std::uint64_t>(std::clamp<std::int64_t>((age.count() + 500) / 1000, 0, 65535)),
      2);
  store_bytes(data + kAxesTime,
              static_cast<std::uint64_t>(std::max<std::int64_t>(to_ns(instant), 0) / 1000), 8);
  protection_.protect({data, kAxesRateBytes});
  return frame_;
}

}  // namespace vgyro::gateway
