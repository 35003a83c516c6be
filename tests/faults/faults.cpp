// The pipeline and its transmit queue under faults, and for a long day; no bus, no clock.
//   vgyro_faults sequences COUNT FIRST_SEED    random faults; a failed seed goes to stderr
//   vgyro_faults shifted COUNT FIRST_SEED      the same at other times of day: the same rates
//   vgyro_faults drive HOURS                   a drive with stops
// All print JSON. Truth, noise and frames are made by hand here, and the output is decoded from its
// bits.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

#include "can/transmit.h"
#include "gateway/pipeline.h"
#include "tests/gateway/counting_new.h"

namespace {

using namespace vgyro;
using can::Frame;
using can::SendResult;

constexpr double kRate_hz = 100.0;
constexpr Duration kPeriod = std::chrono::milliseconds(10);
constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr std::array<std::uint32_t, 2> kIds{0x101, 0x102};
constexpr std::array<double, 2> kBias_dps{0.9, -0.6};
constexpr double kNoise_dps = 0.005;  // of one sample
constexpr double kLimit_dps = 300.0;
constexpr double kRest_s = 2.0;
constexpr double kMoving_s = 4.0;  // from here on the platform turns to and fro
constexpr double kAmplitude_dps = 10.0;
constexpr double kMotion_hz = 0.1;

double truth_dps(double t_s) {
  if (t_s < kMoving_s) return 0.0;
  return kAmplitude_dps * (1.0 - std::cos(2.0 * std::numbers::pi * kMotion_hz * (t_s - kMoving_s)));
}

dbc::SignalCodec codec(std::uint16_t start, std::uint16_t length, double factor, bool is_signed) {
  dbc::Signal signal;
  signal.name = "S";
  signal.start_bit = start;
  signal.length_bits = length;
  signal.factor = factor;
  signal.type = is_signed ? dbc::ValueType::kSigned : dbc::ValueType::kUnsigned;
  return dbc::SignalCodec::make(signal, 8, "bench").value();
}

// Rate 0|32 in 1e-6 deg/s, counter 48|4, status 52|4 (0: valid).
gateway::Plan plan() {
  gateway::Plan plan;
  plan.buses = {"can0", "can1"};
  for (std::size_t k = 0; k < 2; ++k) {
    plan.gyros.push_back(
        {.name = k == 0 ? "a" : "b",
         .bus = plan.buses[k],
         .message = "GYRO",
         .match = {static_cast<can::BusIndex>(k), kIds[k], 0x7FF, false},
         .rate = {.name = "Rate",
                  .unit = "deg/s",
                  .codec = codec(0, 32, 1e-6, true),
                  .presence = {},
                  .scale = 1.0,
                  .shift = 0.0,
                  .minimum = -kLimit_dps,
                  .maximum = kLimit_dps,
                  .layout = {},
                  .step = 1e-6},
         .sign = {},
         .temperature = {},
         .supply_voltage = {},
         .e2e = {.crc = {},
                 .counter = gateway::AliveCounter{"Counter", codec(48, 4, 1.0, false), 16}},
         .valid = gateway::ValidCondition{codec(52, 4, 1.0, false), gateway::Comparison::kEqual,
                                          0.0, "S == 0"},
         .saturation_dps = {}});
  }
  plan.calibration.rest_s = kRest_s;
  return plan;
}

Frame frame_of(std::size_t gyro, double rate_dps, unsigned counter, unsigned status = 0) {
  Frame frame;
  frame.id = kIds[gyro];
  frame.length = 8;
  const auto raw = static_cast<std::uint32_t>(
      static_cast<std::int32_t>(std::clamp(rate_dps * 1e6, -2147483647.0, 2147483647.0)));
  for (unsigned i = 0; i < 4; ++i)
    frame.data[i] = static_cast<std::uint8_t>(raw >> (8U * i));
  frame.data[6] = static_cast<std::uint8_t>((counter & 15U) | status << 4U);
  return frame;
}

/// VG_Rate as its DBC file describes it.
struct Rate {
  double rate_dps = 0.0;
  double sigma_dps = 0.0;
  bool valid = false;
  unsigned state = 0;
  unsigned counter = 0;
  std::optional<double> age_s;
};

Rate rate_of(const Frame& frame) {
  std::uint64_t word = 0;
  for (unsigned i = 0; i < 8; ++i)
    word |= static_cast<std::uint64_t>(frame.data[i]) << (8U * i);
  const auto raw = static_cast<std::int64_t>(word << 24U) >> 40U;
  const auto age = static_cast<unsigned>(word >> 60U);
  return {.rate_dps = static_cast<double>(raw) * 5e-5,
          .sigma_dps = static_cast<double>(word >> 40U & 0xFFFU) * 2e-5,
          .valid = (word >> 55U & 1U) != 0,
          .state = static_cast<unsigned>(word >> 52U & 7U),
          .counter = static_cast<unsigned>(word >> 8U & 15U),
          .age_s = age < 15 ? std::optional(age * 0.5e-3) : std::nullopt};
}

std::uint8_t crc8(const Frame& frame) {
  std::uint8_t crc = 0;
  const auto add = [&crc](std::uint8_t byte) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      crc = static_cast<std::uint8_t>((crc * 2U) ^ ((crc & 0x80U) != 0 ? 0x1DU : 0U));
  };
  add(static_cast<std::uint8_t>(frame.id));
  add(0);
  for (unsigned i = 1; i < 8; ++i)
    add(frame.data[i]);
  return crc;
}

struct Dice {
  std::mt19937_64 engine;
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  }
  unsigned below(unsigned n) { return static_cast<unsigned>(engine() % n); }
  double normal() { return std::normal_distribution<double>()(engine); }
};

// ---- random faults ------------------------------------------------------------------------------

enum class Kind : unsigned {
  kSilent,
  kBothSilent,
  kFlagged,
  kOutOfRange,
  kFrozenFrame,
  kOddFrame,
  kDropped,
  kRepeated,
  kSaturated,
  kWildStamp,
  kClockStep,
  kLate,
  kGarbage,
  kNoBuffer,
  kWouldBlock,
  kLinkDown,
  kSendFails,
  kRestart
};
constexpr unsigned kKinds = 18;

struct Fault {
  Kind kind = Kind::kSilent;
  std::size_t gyro = 0;
  double from_s = 0.0;
  double to_s = 0.0;
  double size = 0.0;
};

constexpr double kFaultsFrom_s = 5.0;
constexpr double kFaultsTo_s = 15.0;
// Two windows of the default length.
constexpr double kRecovery_s = 20.0;
// Six of the frame's own sigma, and an allowance for VG_Age's step and an interpolated gap in a
// turn; a fault changes a reading a hundred times as much.
constexpr double kSigmas = 6.0;
constexpr double kErrorMost_dps = 0.05;
constexpr double kLateMost_s = 0.02;

class Sequence final : public gateway::FrameSink, public can::Transmitter {
 public:
  explicit Sequence(std::uint64_t seed, Duration later = Duration{0})
      : dice_{std::mt19937_64(seed)},
        send_dice_{std::mt19937_64(~seed)},
        plan_(plan()),
        start_(time_from_ns(kStart_ns) + later) {
    pipeline_.emplace(plan_);
    const unsigned count = 3 + dice_.below(6);
    for (unsigned i = 0; i < count; ++i) {
      const double from_s = dice_.uniform(kFaultsFrom_s, kFaultsTo_s - 0.05);
      faults_.push_back({static_cast<Kind>(dice_.below(kKinds)), dice_.below(2), from_s,
                         std::min(kFaultsTo_s, from_s + std::exp(dice_.uniform(-3.0, 1.5))),
                         dice_.uniform(-1.0, 1.0)});
    }
  }

  /// Runs the sequence; returns the failure, or an empty string.
  std::string run() {
    struct Arrival {
      double t_s;
      std::size_t gyro;
    };
    std::vector<Arrival> order;
    const double end_s = kFaultsTo_s + kRecovery_s;
    for (double t = 0.0; t < end_s; t += 1.0 / kRate_hz) {
      order.push_back({t, 0});
      order.push_back({t + 0.003, 1});
    }
    for (const Arrival& arrival : order) {
      step(arrival.t_s, arrival.gyro);
      if (!failure_.empty()) return failure_;
    }
    if (recovered_s_ < 0.0 || recovered_s_ > end_s - 1.0) {
      const gateway::Status& status = pipeline_->status();
      return "not recovered within two windows: " + std::string(to_string(status.state)) +
             ", good since " + std::to_string(recovered_s_);
    }
    if (good_in_a_row_ < 90) return "rates are missing at the end";
    return {};
  }

  [[nodiscard]] double recovery_s() const { return std::max(0.0, recovered_s_ - kFaultsTo_s); }
  [[nodiscard]] std::uint64_t valid() const { return valid_; }
  [[nodiscard]] std::uint64_t stale() const { return queue_.counts().dropped_stale; }
  [[nodiscard]] double worst_dps() const { return worst_dps_; }
  [[nodiscard]] const std::vector<Fault>& faults() const { return faults_; }
  /// The contents of all VG_Rate frames, without check value and counter, and their times.
  [[nodiscard]] const std::vector<std::uint8_t>& said() const { return said_; }

  void put(const Frame& frame, TimePoint /*stamp*/) override {
    queue_.push(frame, steady_ + std::chrono::milliseconds(20));
    if (frame.id != 0x610) return;
    note(frame);
    made_.emplace_back(t_s_, frame);
    if (made_.size() > 200) made_.erase(made_.begin(), made_.begin() + 100);
    check_rate(rate_of(frame));
  }

  SendResult send(const Frame& frame) override {
    for (const Fault& fault : faults_) {
      if (!active(fault)) continue;
      if (fault.kind == Kind::kLinkDown) return SendResult::kLinkDown;
      if (send_dice_.below(3) == 0) continue;
      if (fault.kind == Kind::kNoBuffer) return SendResult::kNoBuffer;
      if (fault.kind == Kind::kWouldBlock) return SendResult::kWouldBlock;
      if (fault.kind == Kind::kSendFails) return SendResult::kFailed;
    }
    if (crc8(frame) != frame.data[0]) failure_ = "a frame with a wrong checksum";
    if (frame.id == 0x610) {
      // Finds which rate this is: rates are sent in the order in which they were made.
      const double made_s = made_at(frame);
      if (t_s_ - made_s > kLateMost_s + 1e-9)
        failure_ = "a rate was sent " + std::to_string(t_s_ - made_s) + " s late at " +
                   std::to_string(t_s_);
    }
    return SendResult::kSent;
  }

 private:
  struct Held {
    Frame frame;
    TimePoint stamp;
    double t_s = 0.0;
  };

  [[nodiscard]] bool active(const Fault& fault) const {
    return t_s_ >= fault.from_s && t_s_ < fault.to_s;
  }
  [[nodiscard]] bool active(Kind kind, std::size_t gyro) const {
    return std::any_of(faults_.begin(), faults_.end(), [&](const Fault& fault) {
      return fault.kind == kind && active(fault) && fault.gyro == gyro;
    });
  }
  [[nodiscard]] bool active(Kind kind) const { return active(kind, 0) || active(kind, 1); }

  void step(double t_s, std::size_t gyro) {
    t_s_ = cause_s_ = t_s;
    begin_faults();
    now_ = stamp_of(t_s);
    steady_ = TimePoint{std::chrono::nanoseconds(std::llround(t_s * 1e9))};
    while (pipeline_->next_deadline() < now_ && pipeline_->next_deadline() > TimePoint{})
      pipeline_->advance(now_, *this);
    const unsigned counter = counters_[gyro]++;
    const double reading = truth_dps(t_s) + kBias_dps[gyro] + kNoise_dps * dice_.normal();
    hand_on(gyro, reading, counter);
    if (queue_.wants_writable() && !active(Kind::kWouldBlock)) queue_.on_writable();
    queue_.drain(steady_, *this);
  }

  void begin_faults() {
    for (Fault& fault : faults_) {
      if (!active(fault) || fault.size == 0.0) continue;
      if (fault.kind == Kind::kClockStep)
        offset_s_ += fault.size * 100.0 + std::copysign(1.0, fault.size);
      if (fault.kind == Kind::kRestart) restart();
      if (fault.kind == Kind::kClockStep || fault.kind == Kind::kRestart) fault.size = 0.0;
    }
  }

  void restart() {
    // The state file keeps the memory of an earlier run until there is a newer one.
    if (auto memory = pipeline_->memory()) kept_ = std::move(memory);
    pipeline_.emplace(plan_);
    if (kept_ && !pipeline_->resume(*kept_)) failure_ = "the state was refused";
    queue_ = can::TransmitQueue();
    made_.clear();
    // A new process accepts the first frame that it receives as new.
    for (Fault& fault : faults_) {
      if (fault.kind == Kind::kFrozenFrame) fault.to_s = std::min(fault.to_s, t_s_);
    }
  }

  TimePoint stamp_of(double t_s) const {
    return start_ + std::chrono::nanoseconds(std::llround((t_s + offset_s_) * 1e9));
  }

  void note(const Frame& frame) {
    constexpr std::ptrdiff_t kHeader = 2;
    said_.insert(said_.end(), frame.data.begin() + kHeader, frame.data.begin() + frame.length);
    const auto when_us = static_cast<std::uint64_t>(std::llround(t_s_ * 1e6));
    for (unsigned i = 0; i < 4; ++i)
      said_.push_back(static_cast<std::uint8_t>(when_us >> (8U * i)));
  }

  void hand_on(std::size_t gyro, double reading, unsigned counter) {
    if (active(Kind::kBothSilent) || active(Kind::kSilent, gyro)) {
      held_[gyro].clear();
      return;
    }
    if (active(Kind::kDropped, gyro) && dice_.below(3) == 0) return;
    Frame frame = frame_of(gyro, reading, counter);
    TimePoint stamp = now_;
    if (active(Kind::kFlagged, gyro))
      frame = frame_of(gyro, dice_.uniform(-100.0, 100.0), counter, 1 + dice_.below(15));
    if (active(Kind::kOutOfRange, gyro))
      frame = frame_of(gyro, dice_.below(2) == 0 ? 2000.0 : -301.0, counter);
    if (active(Kind::kSaturated, gyro)) frame = frame_of(gyro, kLimit_dps, counter);
    if (active(Kind::kFrozenFrame, gyro)) {
      frame = last_[gyro];
    } else if (!active(Kind::kOddFrame, gyro)) {
      last_[gyro] = frame;  // which was received as it is
    }
    if (active(Kind::kOddFrame, gyro)) make_odd(frame);
    if (active(Kind::kWildStamp, gyro) && dice_.below(4) == 0) {
      const int jump_ms = static_cast<int>(dice_.uniform(1500.0, 20'000.0));
      stamp += std::chrono::milliseconds(dice_.below(2) == 0 ? jump_ms : -jump_ms);
    }
    if (active(Kind::kGarbage)) garbage();
    // The frame is read late, but its stamp is still the kernel's.
    if (active(Kind::kLate, gyro)) {
      late_until_s_ = t_s_ + 0.2;
      held_[gyro].push_back({frame, stamp, t_s_});
      if (held_[gyro].size() < 5) return;
    }
    for (const Held& held : held_[gyro])
      receive(gyro, held.frame, held.stamp, held.t_s);
    const bool is_held = !held_[gyro].empty() && active(Kind::kLate, gyro);
    held_[gyro].clear();
    if (is_held) return;
    receive(gyro, frame, stamp, t_s_);
    if (active(Kind::kRepeated, gyro))
      receive(gyro, frame, stamp + std::chrono::microseconds(dice_.below(500)), t_s_);
  }

  void receive(std::size_t gyro, const Frame& frame, TimePoint stamp, double t_s) {
    cause_s_ = t_s;
    pipeline_->receive(static_cast<can::BusIndex>(gyro), frame, stamp, *this);
  }

  void make_odd(Frame& frame) {
    switch (dice_.below(4)) {
      case 0:
        frame.length = static_cast<std::uint8_t>(dice_.below(7));
        break;
      case 1:
        frame.flags = can::kRemote;
        break;
      case 2:
        frame.flags = can::kError;
        break;
      default:
        frame.flags = can::kExtended;
        break;
    }
  }

  void garbage() {
    Frame frame;
    frame.id = dice_.below(4) == 0 ? 0x610 : dice_.below(0x800);
    if (frame.id == kIds[0] || frame.id == kIds[1]) return;
    frame.length = static_cast<std::uint8_t>(dice_.below(65));
    frame.flags = static_cast<std::uint8_t>(dice_.below(64));
    for (std::uint8_t& byte : frame.data)
      byte = static_cast<std::uint8_t>(dice_.below(256));
    pipeline_->receive(static_cast<can::BusIndex>(dice_.below(3)), frame, now_, *this);
  }

  void check_rate(const Rate& rate) {
    const bool good = rate.valid && rate.state == 2;
    if (good && good_in_a_row_++ == 0) recovered_s_ = t_s_;
    if (!good) {
      good_in_a_row_ = 0;
      recovered_s_ = -1.0;
    }
    if (!rate.valid) return;
    ++valid_;
    const double error = error_of(rate);
    worst_dps_ = std::max(worst_dps_, error);
    if (error > kErrorMost_dps + kSigmas * rate.sigma_dps) {
      failure_ = "a valid rate of " + std::to_string(rate.rate_dps) + " deg/s at " +
                 std::to_string(t_s_) + " s is wrong by " + std::to_string(error) + ", state " +
                 std::to_string(rate.state);
    }
  }

  // The rate's instant is that of the causing frame less the age; with an age beyond the field it
  // is anywhere in the last second.
  [[nodiscard]] double error_of(const Rate& rate) const {
    const bool late = t_s_ < late_until_s_;
    if (rate.age_s && !late) return std::abs(rate.rate_dps - truth_dps(cause_s_ - *rate.age_s));
    const double oldest_s = late ? t_s_ - 0.15 : cause_s_ - 1.0;
    double best = 1e9;
    for (double instant_s = oldest_s; instant_s <= t_s_; instant_s += 1e-3)
      best = std::min(best, std::abs(rate.rate_dps - truth_dps(instant_s)));
    return best;
  }

  // A fault on a frame's way can only delay it, so the newest frame with the same bytes is the one.
  [[nodiscard]] double made_at(const Frame& frame) {
    const auto same = [&frame](const auto& one) { return one.second.data == frame.data; };
    const auto found = std::find_if(made_.rbegin(), made_.rend(), same);
    return found == made_.rend() ? -1.0 : found->first;
  }

  Dice dice_;
  Dice send_dice_;  ///< separate, so that the bus's faults do not change the gyros' noise
  gateway::Plan plan_;
  TimePoint start_;
  std::vector<std::uint8_t> said_;
  std::optional<gateway::Pipeline> pipeline_;
  std::optional<gateway::SavedState> kept_;
  can::TransmitQueue queue_;
  std::vector<Fault> faults_;
  std::array<unsigned, 2> counters_{};
  std::array<Frame, 2> last_{};
  std::array<std::vector<Held>, 2> held_;
  std::vector<std::pair<double, Frame>> made_;  ///< time at which each was made
  double t_s_ = 0.0;
  double offset_s_ = 0.0;  ///< of the clock behind the stamps
  TimePoint now_;          ///< of the clock behind the stamps
  TimePoint steady_;       ///< of a clock that is never set
  double late_until_s_ = 0.0;
  double cause_s_ = 0.0;  ///< time to which the frame being received refers
  double recovered_s_ = -1.0;
  std::uint64_t good_in_a_row_ = 0;
  std::uint64_t valid_ = 0;
  double worst_dps_ = 0.0;
  std::string failure_;
};

int run_sequences(unsigned count, std::uint64_t first_seed) {
  std::vector<double> recoveries;
  std::uint64_t valid = 0;
  std::uint64_t stale = 0;
  std::uint64_t faults = 0;
  unsigned failed = 0;
  double worst = 0.0;
  for (std::uint64_t seed = first_seed; seed < first_seed + count; ++seed) {
    Sequence sequence(seed);
    const std::string failure = sequence.run();
    if (!failure.empty()) {
      ++failed;
      std::fprintf(stderr, "seed %llu: %s\n", static_cast<unsigned long long>(seed),
                   failure.c_str());
      for (const Fault& fault : sequence.faults())
        std::fprintf(stderr, "  kind %u, gyro %zu, %.3f to %.3f s\n",
                     static_cast<unsigned>(fault.kind), fault.gyro, fault.from_s, fault.to_s);
      continue;
    }
    recoveries.push_back(sequence.recovery_s());
    valid += sequence.valid();
    stale += sequence.stale();
    faults += sequence.faults().size();
    worst = std::max(worst, sequence.worst_dps());
  }
  std::sort(recoveries.begin(), recoveries.end());
  const auto at = [&](double share) {
    return recoveries.empty() ? -1.0
                              : recoveries[static_cast<std::size_t>(
                                    share * static_cast<double>(recoveries.size() - 1))];
  };
  std::printf(
      "{\"sequences\": %u, \"first_seed\": %llu, \"failed\": %u, \"faults\": %llu, "
      "\"valid_rates\": %llu, "
      "\"stale\": %llu, \"worst_error_dps\": %.4f, \"recovery_s\": {\"p50\": %.3f, \"p99\": %.3f, "
      "\"max\": %.3f}}\n",
      count, static_cast<unsigned long long>(first_seed), failed,
      static_cast<unsigned long long>(faults), static_cast<unsigned long long>(valid),
      static_cast<unsigned long long>(stale), worst, at(0.5), at(0.99), at(1.0));
  return failed == 0 ? 0 : 1;
}

// VG_Bias follows the bus's time, so its frames may come at other places between the rates; the
// rates may not change.
int run_shifted(unsigned count, std::uint64_t first_seed) {
  constexpr std::array kLater{std::chrono::milliseconds(37), std::chrono::milliseconds(12'345'678),
                              std::chrono::milliseconds(-499)};
  unsigned failed = 0;
  std::size_t compared = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + count; ++seed) {
    Sequence sequence(seed);
    sequence.run();
    for (const auto later : kLater) {
      Sequence shifted(seed, later);
      shifted.run();
      compared += shifted.said().size();
      if (shifted.said() == sequence.said()) continue;
      ++failed;
      std::fprintf(stderr, "seed %llu: other rates when it is %lld ms later\n",
                   static_cast<unsigned long long>(seed), static_cast<long long>(later.count()));
    }
  }
  std::printf("{\"sequences\": %u, \"first_seed\": %llu, \"failed\": %u, \"bytes\": %zu}\n", count,
              static_cast<unsigned long long>(first_seed), failed, compared);
  return failed == 0 ? 0 : 1;
}

// ---- a long day ---------------------------------------------------------------------------------

std::uint64_t resident_kb() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t size = 0;
  std::uint64_t resident = 0;
  file >> size >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) / 1024;
}

/// Periods of five minutes, with a stop in the last twenty seconds.
double drive_dps(double t_s) {
  const double phase_s = std::fmod(t_s, 300.0);
  if (t_s < 60.0 || phase_s > 280.0) return 0.0;
  const double envelope = std::sin(std::numbers::pi * phase_s / 280.0);
  return 20.0 * envelope * std::sin(2.0 * std::numbers::pi * phase_s / 17.0);
}

class Watcher final : public gateway::FrameSink {
 public:
  void put(const Frame& frame, TimePoint /*stamp*/) override {
    if (crc8(frame) != frame.data[0]) ++wrong;
    if (frame.id != 0x610) return;
    const Rate rate = rate_of(frame);
    if (rate.counter != rates % 15) ++wrong;
    ++rates;
    last = rate;
  }
  std::uint64_t rates = 0;
  std::uint64_t wrong = 0;  ///< checksums and counters
  Rate last;
};

int run_drive(double hours) {
  gateway::Plan drive = plan();
  drive.calibration.rest_s = 30.0;
  gateway::Pipeline pipeline(drive);
  Watcher out;
  Dice dice{std::mt19937_64(24)};
  const auto samples = static_cast<std::uint64_t>(hours * 3600.0 * kRate_hz);
  const auto settled =
      std::min<std::uint64_t>(samples / 2, static_cast<std::uint64_t>(600.0 * kRate_hz));
  std::array<double, 2> drift_dps = kBias_dps;
  std::uint64_t allocated = 0;
  std::uint64_t resident = resident_kb();
  double worst = 0.0;
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < samples; ++i) {
    if (i == settled) {
      resident = resident_kb();
      allocated = allocations_so_far();
    }
    for (std::size_t k = 0; k < 2; ++k) {
      const double t_s = static_cast<double>(i) / kRate_hz + 0.003 * static_cast<double>(k);
      drift_dps[k] += 1e-5 * dice.normal();
      const double reading = drive_dps(t_s) + drift_dps[k] + kNoise_dps * dice.normal();
      const TimePoint stamp =
          time_from_ns(kStart_ns + static_cast<std::int64_t>(std::llround(t_s * 1e9)));
      while (pipeline.next_deadline() < stamp && pipeline.next_deadline() > TimePoint{})
        pipeline.advance(pipeline.next_deadline(), out);
      pipeline.receive(static_cast<can::BusIndex>(k),
                       frame_of(k, reading, static_cast<unsigned>(i)), stamp, out);
      if (out.last.valid && i > settled)
        worst = std::max(
            worst, std::abs(out.last.rate_dps - drive_dps(t_s - out.last.age_s.value_or(0.0))));
    }
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const std::uint64_t allocated_later = allocations_so_far() - allocated;
  const gateway::Status& status = pipeline.status();
  std::uint64_t unpaired = 0;
  std::uint64_t astray =
      out.wrong + status.clock_steps + status.disagreements + status.rates_out_of_range;
  for (const gateway::GyroStatus& gyro : status.gyros) {
    astray += samples - gyro.samples + gyro.missing;
    unpaired += gyro.unpaired;
  }
  // The first sample may come before the other gyro's, the last one waits for a partner.
  const std::uint64_t without_rate = samples - out.rates;
  std::printf(
      "{\"hours\": %g, \"frames\": %llu, \"seconds\": %.1f, \"rates\": %llu, \"without_rate\": "
      "%llu, \"astray\": %llu, "
      "\"stops\": %llu, \"worst_error_dps\": %.4f, \"allocations\": %llu, \"resident_kb\": [%llu, "
      "%llu]}\n",
      hours, static_cast<unsigned long long>(2 * samples), seconds,
      static_cast<unsigned long long>(out.rates), static_cast<unsigned long long>(without_rate),
      static_cast<unsigned long long>(astray), static_cast<unsigned long long>(status.stops), worst,
      static_cast<unsigned long long>(allocated_later), static_cast<unsigned long long>(resident),
      static_cast<unsigned long long>(resident_kb()));
  return astray == 0 && unpaired < 2 && without_rate < 3 && allocated_later == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "sequences" && argc == 4)
    return run_sequences(static_cast<unsigned>(std::atoi(argv[2])),
                         std::strtoull(argv[3], nullptr, 10));
  if (mode == "shifted" && argc == 4)
    return run_shifted(static_cast<unsigned>(std::atoi(argv[2])),
                       std::strtoull(argv[3], nullptr, 10));
  if (mode == "drive" && argc == 3) return run_drive(std::atof(argv[2]));
  std::fputs("usage: vgyro_faults sequences|shifted COUNT FIRST_SEED | drive HOURS\n", stderr);
  return 2;
}
