// Input: arbitrary frames at arbitrary times on any bus. The pipeline must stay inside its memory
// and the range of its numbers, its counters must be consistent, its deadline must not be in the
// past, and it must send no rate as valid that is not.

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "dbc/parser.h"
#include "gateway/model_plan.h"
#include "gateway/pipeline.h"

namespace {

using namespace vgyro;

constexpr const char* kBench = R"(BO_ 257 GYRO_A: 8 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temp : 32|16@1- (0.01,0) [-40|125] "degC" RIG
 SG_ Counter : 48|4@1+ (1,0) [0|14] "" RIG
 SG_ Status : 52|4@1+ (1,0) [0|15] "" RIG
BO_ 258 GYRO_B: 8 RIG
 SG_ Page M : 56|8@1+ (1,0) [0|255] "" RIG
 SG_ Rate m1 : 7|32@0- (1,0) [-1000|1000] "deg/s" RIG
 SG_ Negative : 40|1@1+ (1,0) [0|1] "" RIG
BO_ 259 TABLE: 4 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [0|0] "deg/s" RIG
BO_ 260 ACCEL: 6 RIG
 SG_ X : 0|16@1- (0.001,0) [0|0] "g" RIG
 SG_ Y : 16|16@1- (0.001,0) [0|0] "g" RIG
 SG_ Z : 32|16@1- (0.001,0) [0|0] "g" RIG
BO_ 261 WHEEL: 8 RIG
 SG_ Speed : 0|64@1- (1,0) [0|100] "m/s" RIG
SIG_VALTYPE_ 258 Rate : 1;
SIG_VALTYPE_ 261 Speed : 2;
)";

constexpr const char* kModel = R"(format = 1
[[effect]]
gyro = 1
kind = "temperature_rate_bias"
coefficient_dps_s_k = 0.5
[[effect]]
gyro = 1
kind = "g_sensitivity"
axis = "y"
coefficient_dps_g = 0.1
[[effect]]
gyro = 1
kind = "delay"
seconds = 0.02
[[effect]]
gyro = 2
kind = "scale_factor_cubic"
coefficient_per_dps2 = 1e-8
[[effect]]
gyro = 2
kind = "vibration_rectification"
coefficient_dps_g2 = 0.1
[[effect]]
gyro = 2
kind = "angle_harmonic"
harmonic = 4
amplitude_dps = 0.1
phase_rad = 1.0
[[effect]]
gyro = 2
kind = "saturation"
limit_dps = 900.0
[[effect]]
gyro = 2
kind = "dead_band"
width_dps = 0.01
)";

class Input {
 public:
  explicit Input(std::span<const std::uint8_t> bytes) : left_(bytes) {}
  [[nodiscard]] bool empty() const { return left_.empty(); }
  template <class T>
  T take() {
    T value{};
    const std::size_t size = std::min(sizeof value, left_.size());
    std::memcpy(&value, left_.data(), size);
    left_ = left_.subspan(size);
    return value;
  }

 private:
  std::span<const std::uint8_t> left_;
};

gateway::Quantity quantity(const dbc::Message& message, const char* name, double limit) {
  const dbc::Signal& signal = *message.find_signal(name);
  return {.name = name,
          .unit = signal.unit,
          .codec = dbc::SignalCodec::make(signal, message.size_bytes, "fuzzer").value(),
          .presence = dbc::Presence::make(message, signal, "fuzzer").value(),
          .scale = 1.0,
          .shift = 0.0,
          .minimum = -limit,
          .maximum = limit,
          .layout = {}};
}

gateway::GyroPlan gyro(const dbc::Message& message, can::BusIndex bus) {
  return {.name = message.name,
          .bus = "can0",
          .message = message.name,
          .match = {bus, message.id, message.id_mask(), message.extended},
          .rate = quantity(message, "Rate", 1000.0),
          .sign = {},
          .temperature = {},
          .e2e = {},
          .valid = {}};
}

void add_surroundings(gateway::Plan& plan, const dbc::Database& database) {
  const dbc::Message& accel = *database.find_message("ACCEL");
  const dbc::Message& wheel = *database.find_message("WHEEL");
  plan.accelerometer = gateway::AccelerometerPlan{
      "can1",
      "ACCEL",
      {1, accel.id, accel.id_mask(), false},
      {quantity(accel, "X", 1e5), quantity(accel, "Y", 1e5), quantity(accel, "Z", 1e5)}};
  plan.speed = gateway::SpeedPlan{
      "can0", "WHEEL", {0, wheel.id, wheel.id_mask(), false}, quantity(wheel, "Speed", 100.0)};
  plan.speed->e2e.crc =
      gateway::CheckValue{"Sum", "toyota",
                          dbc::E2eProtection({.kind = dbc::E2eKind::kToyota,
                                              .crc_byte = std::size_t{wheel.size_bytes} - 1,
                                              .bytes = wheel.size_bytes,
                                              .can_id = wheel.id})};
}

void add_model(gateway::Plan& plan) {
  plan.model = model::parse_model(kModel, "model.toml").value();
  std::vector<Error> errors;
  gateway::apply_model(model::Model(*plan.model), plan, errors);
  assert(errors.empty());
}

// Each bit of `choice` is one option of the configuration.
gateway::Plan plan_of(std::uint8_t choice) {
  static const dbc::Database database = dbc::parse(kBench, "fuzzer.dbc");
  const dbc::Message& a = *database.find_message("GYRO_A");
  const dbc::Message& b = *database.find_message("GYRO_B");
  const dbc::Message& table = *database.find_message("TABLE");
  const auto codec = [](const dbc::Message& message, const char* name) {
    return dbc::SignalCodec::make(*message.find_signal(name), message.size_bytes, "fuzzer").value();
  };
  gateway::Plan plan;
  plan.buses = {"can0", "can1"};
  plan.gyros = {gyro(a, 0), gyro(b, 1)};
  plan.gyros[0].temperature = quantity(a, "Temp", 200.0);
  plan.gyros[0].e2e.counter = gateway::AliveCounter{"Counter", codec(a, "Counter"), 15};
  plan.gyros[0].valid =
      gateway::ValidCondition{codec(a, "Status"), gateway::Comparison::kLess, 9.0, "Status < 9"};
  plan.gyros[1].sign = codec(b, "Negative");
  plan.reference = gateway::ReferencePlan{
      "can0", "TABLE", {0, table.id, table.id_mask(), false}, quantity(table, "Rate", 1e5)};
  plan.calibration.from_reference = (choice & 1U) != 0;
  plan.calibration.when_moving = plan.calibration.from_reference ? fusion::WhenMoving::kKnown
                                 : (choice & 2U) != 0            ? fusion::WhenMoving::kAccept
                                                                 : fusion::WhenMoving::kWait;
  plan.calibration.rest_s = 0.1;
  plan.corrector.method = (choice & 64U) != 0  ? gateway::Method::kOptimal
                          : (choice & 4U) != 0 ? gateway::Method::kMean
                                               : gateway::Method::kMutual;
  plan.corrector.window_s = 0.2;
  plan.corrector.order = (choice >> 3U) & 3U;
  plan.output.fd = (choice & 32U) != 0;
  add_surroundings(plan, database);
  if ((choice & 128U) != 0) add_model(plan);
  return plan;
}

class Counter final : public gateway::FrameSink {
 public:
  void put(const can::Frame& frame, TimePoint /*stamp*/) override {
    if (frame.id == 0x610) check_rate(frame);
    rates += frame.id == 0x610 ? 1U : 0U;
    biases += frame.id == 0x611 ? 1U : 0U;
  }
  std::uint64_t rates = 0;
  std::uint64_t biases = 0;
  std::uint64_t valid = 0;

 private:
  // A rate flagged valid has a value, and one flagged invalid has none.
  void check_rate(const can::Frame& frame) {
    if (frame.length != 8) return;  // the FD variant keeps both elsewhere
    const auto raw =
        static_cast<std::uint32_t>(frame.data[2] | frame.data[3] << 8U | frame.data[4] << 16U);
    const bool is_valid = (frame.data[6] & 0x80U) != 0;
    assert(is_valid == (raw != 0x800000));
    valid += is_valid ? 1U : 0U;
  }
};

// Stamps usually advance by milliseconds; one kind of step goes to any stamp that a log can hold.
TimePoint next_stamp(Input& input, TimePoint now, std::uint8_t kind) {
  constexpr std::uint64_t kStampEnd = 9'000'000'000'000'000'001;
  if (kind % 16 == 15) {
    return time_from_ns(static_cast<std::int64_t>(input.take<std::uint64_t>() % kStampEnd));
  }
  const Duration step = kind % 16 == 14 ? std::chrono::milliseconds(input.take<std::int16_t>())
                                        : std::chrono::microseconds(input.take<std::uint16_t>());
  const std::int64_t ns = to_ns(now) + step.count();
  return time_from_ns(std::clamp<std::int64_t>(ns, 0, static_cast<std::int64_t>(kStampEnd) - 1));
}

can::Frame next_frame(Input& input, std::uint8_t kind) {
  constexpr std::uint32_t kIds[] = {257, 258, 257, 258, 259, 0x7FF, 260, 261};
  can::Frame frame;
  frame.id = kIds[kind / 16 % std::size(kIds)];
  const auto payload = input.take<std::array<std::uint8_t, 8>>();
  std::copy(payload.begin(), payload.end(), frame.data.begin());
  frame.length = 8;
  if (frame.id != 0x7FF) return frame;
  frame.flags = payload[0] % 64;
  frame.length = payload[1] % 65;
  frame.id = payload[2] % 2 == 0 ? 257 : 258;
  return frame;
}

void check_books(const gateway::Status& status, const Counter& out) {
  for (const gateway::GyroStatus& gyro : status.gyros) {
    std::uint64_t sum = gyro.samples;
    for (const std::uint64_t count : gyro.rejected)
      sum += count;
    assert(sum == gyro.frames);
  }
  assert(status.rates_out == out.rates && status.biases_out == out.biases);
  assert(status.rates_out_valid + status.rates_out_of_range <= status.rates_out);
  assert(out.valid == 0 || out.valid == status.rates_out_valid);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input({data, size});
  gateway::Pipeline pipeline(plan_of(input.take<std::uint8_t>()));
  Counter out;
  TimePoint now = time_from_ns(1'700'000'000'000'000'000);
  bool wild = false;
  while (!input.empty()) {
    const auto kind = input.take<std::uint8_t>();
    now = next_stamp(input, now, kind);
    const can::Frame frame = next_frame(input, kind);
    pipeline.receive(frame.id == 258 || frame.id == 260 ? 1 : 0, frame, now, out);
    wild = wild || kind % 16 == 15;
    if (kind % 8 != 3) continue;
    pipeline.advance(now, out);
    // Centuries of backward steps exhaust the range of 64 bits; after that, no deadline is due.
    assert(wild || pipeline.next_deadline() > now);
  }
  check_books(pipeline.status(), out);
  return 0;
}
