#pragma once

// Two gyros on a test bench: plans made by hand, frames made from rates, and the pipeline's output
// read back bit by bit from the layout in dbc/vgyro.dbc, without the product's encoder or decoder.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "gateway/pipeline.h"

namespace vgyro::gateway::rig {

inline constexpr std::uint32_t kIdA = 0x101;
inline constexpr std::uint32_t kIdB = 0x102;
inline constexpr std::uint32_t kIdReference = 0x103;
inline constexpr double kInputStep_dps = 1e-6;
inline constexpr double kRateStep_dps = 5e-5;

constexpr Duration ms(std::int64_t count) {
  return std::chrono::milliseconds(count);
}
constexpr TimePoint at_ms(std::int64_t count) {
  return TimePoint{ms(count)};
}

inline dbc::Signal signal_of(std::uint16_t start, std::uint16_t length, double factor = 1.0,
                             double offset = 0.0, dbc::ValueType type = dbc::ValueType::kSigned,
                             dbc::ByteOrder order = dbc::ByteOrder::kIntel) {
  dbc::Signal signal;
  signal.name = "S";
  signal.start_bit = start;
  signal.length_bits = length;
  signal.factor = factor;
  signal.offset = offset;
  signal.type = type;
  signal.byte_order = order;
  return signal;
}

inline dbc::SignalCodec codec_of(const dbc::Signal& signal, std::size_t message_bytes = 8) {
  return dbc::SignalCodec::make(signal, message_bytes, "rig").value();
}

inline Quantity quantity_of(const dbc::Signal& signal, double limit = 1e5,
                            std::size_t message_bytes = 8) {
  return Quantity{.name = signal.name,
                  .unit = "deg/s",
                  .codec = codec_of(signal, message_bytes),
                  .presence = {},
                  .scale = 1.0,
                  .shift = 0.0,
                  .minimum = -limit,
                  .maximum = limit,
                  .layout = {}};
}

/// Rate: 32 bits from bit 0, Intel, signed, 1e-6 deg/s.
inline GyroPlan gyro_plan(can::BusIndex bus, std::uint32_t id, const std::string& name) {
  return GyroPlan{.name = name,
                  .bus = "can" + std::to_string(bus),
                  .message = "GYRO",
                  .match = {bus, id, can::kStandardIdMax, false},
                  .rate = quantity_of(signal_of(0, 32, kInputStep_dps)),
                  .sign = {},
                  .temperature = {},
                  .e2e = {},
                  .valid = {},
                  .saturation_dps = {}};
}

/// One second of calibration at rest, windows of one second, order 1.
inline Plan two_gyros() {
  Plan plan;
  plan.buses = {"can0", "can1"};
  plan.gyros = {gyro_plan(0, kIdA, "a"), gyro_plan(1, kIdB, "b")};
  plan.calibration.rest_s = 1.0;
  plan.corrector.window_s = 1.0;
  return plan;
}

inline Plan with_reference() {
  Plan plan = two_gyros();
  plan.reference = ReferencePlan{"can0",
                                 "TABLE",
                                 {0, kIdReference, can::kStandardIdMax, false},
                                 quantity_of(signal_of(0, 32, kInputStep_dps))};
  plan.calibration.from_reference = true;
  plan.calibration.when_moving = fusion::WhenMoving::kKnown;
  return plan;
}

inline can::Frame frame_of(std::uint32_t id, std::vector<std::uint8_t> bytes,
                           std::uint8_t flags = 0) {
  can::Frame frame;
  frame.id = id;
  frame.flags = flags;
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

inline can::Frame rate_frame(std::uint32_t id, double rate_dps) {
  const auto raw = static_cast<std::uint32_t>(std::llround(rate_dps / kInputStep_dps));
  return frame_of(id, {static_cast<std::uint8_t>(raw), static_cast<std::uint8_t>(raw >> 8U),
                       static_cast<std::uint8_t>(raw >> 16U), static_cast<std::uint8_t>(raw >> 24U),
                       0, 0, 0, 0});
}

struct Event {
  can::BusIndex bus = 0;
  can::Frame frame;
  TimePoint stamp;
};
using Recording = std::vector<Event>;
using RateOf = std::function<double(double t_s)>;

inline Recording stream(can::BusIndex bus, std::uint32_t id, Duration from, Duration to,
                        Duration period, const RateOf& rate_dps) {
  Recording events;
  for (Duration t = from; t < to; t += period) {
    events.push_back({bus, rate_frame(id, rate_dps(to_seconds(t))), TimePoint{t}});
  }
  return events;
}
inline Recording stream_a(Duration from, Duration to, const RateOf& rate_dps) {
  return stream(0, kIdA, from, to, ms(10), rate_dps);
}
/// 3 ms after gyro a.
inline Recording stream_b(Duration from, Duration to, const RateOf& rate_dps) {
  return stream(1, kIdB, from + ms(3), to, ms(10), rate_dps);
}

inline Recording merge(std::vector<Recording> parts) {
  Recording all;
  for (Recording& part : parts)
    all.insert(all.end(), part.begin(), part.end());
  std::stable_sort(all.begin(), all.end(),
                   [](const Event& a, const Event& b) { return a.stamp < b.stamp; });
  return all;
}

inline RateOf constant(double rate_dps) {
  return [rate_dps](double) { return rate_dps; };
}

struct Output {
  can::Frame frame;
  TimePoint stamp;
  friend bool operator==(const Output&, const Output&) = default;
};

class Collector final : public FrameSink {
 public:
  void put(const can::Frame& frame, TimePoint stamp) override { frames.push_back({frame, stamp}); }
  [[nodiscard]] std::vector<Output> with_id(std::uint32_t id) const {
    std::vector<Output> found;
    std::copy_if(frames.begin(), frames.end(), std::back_inserter(found),
                 [id](const Output& output) { return output.frame.id == id; });
    return found;
  }
  std::vector<Output> frames;
};

/// Drives the pipeline like the daemon: the timer first, whenever it is due before the next frame.
inline void receive_with_timer(Pipeline& pipeline, const Event& event, FrameSink& sink) {
  while (pipeline.next_deadline() < event.stamp && pipeline.next_deadline() > TimePoint{}) {
    pipeline.advance(pipeline.next_deadline(), sink);
  }
  pipeline.receive(event.bus, event.frame, event.stamp, sink);
}

inline void play(Pipeline& pipeline, const Recording& recording, FrameSink& sink) {
  for (const Event& event : recording)
    pipeline.receive(event.bus, event.frame, event.stamp, sink);
}

inline std::uint64_t bits(const can::Frame& frame, unsigned start, unsigned length) {
  std::uint64_t value = 0;
  for (unsigned i = 0; i < length; ++i) {
    const unsigned bit = start + i;
    const unsigned byte = frame.data[bit / 8];
    value |= static_cast<std::uint64_t>(byte >> bit % 8 & 1U) << i;
  }
  return value;
}

inline std::int64_t signed_bits(const can::Frame& frame, unsigned start, unsigned length) {
  const auto value = static_cast<std::int64_t>(bits(frame, start, length));
  return value >> (length - 1) != 0 ? value - (std::int64_t{1} << length) : value;
}

/// VG_Rate, classic.
struct RateSeen {
  TimePoint stamp;
  std::int64_t raw = 0;
  double rate_dps = 0.0;
  bool valid = false;
  State state = State::kWaiting;
  unsigned quality = 0;
  double age_ms = 0.0;
};

inline RateSeen rate_seen(const Output& output) {
  const can::Frame& frame = output.frame;
  RateSeen seen;
  seen.stamp = output.stamp;
  seen.raw = signed_bits(frame, 16, 24);
  seen.rate_dps = static_cast<double>(seen.raw) * kRateStep_dps;
  seen.valid = bits(frame, 55, 1) != 0;
  seen.state = static_cast<State>(bits(frame, 52, 3));
  seen.quality = static_cast<unsigned>(bits(frame, 56, 4));
  seen.age_ms = 0.5 * static_cast<double>(bits(frame, 60, 4));
  return seen;
}

inline std::vector<RateSeen> rates_seen(const Collector& collector) {
  std::vector<RateSeen> seen;
  for (const Output& output : collector.with_id(0x610))
    seen.push_back(rate_seen(output));
  return seen;
}

/// Random numbers that are the same on every machine.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : rng_(seed) {}
  std::uint32_t below(std::uint32_t end) { return static_cast<std::uint32_t>(rng_() % end); }
  std::uint64_t bits() { return rng_(); }
  bool one_in(std::uint32_t n) { return below(n) == 0; }

 private:
  std::mt19937_64 rng_;
};

inline std::uint64_t rejected(const Pipeline& pipeline, std::size_t gyro, Reject why) {
  return pipeline.status().gyros[gyro].rejected[static_cast<std::size_t>(why)];
}

inline std::uint64_t times(const Pipeline& pipeline, std::size_t gyro, Fault fault) {
  return pipeline.status().gyros[gyro].faults[static_cast<std::size_t>(fault)].times;
}

inline std::uint64_t rejected_total(const GyroStatus& gyro) {
  std::uint64_t total = 0;
  for (const std::uint64_t count : gyro.rejected)
    total += count;
  return total;
}

}  // namespace vgyro::gateway::rig
