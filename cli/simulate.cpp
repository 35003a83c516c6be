// `vgyro simulate`: the simulator's samples as frames of the configured messages, in one log.
// Quantities of one message share its frames and are taken at the same instants.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include <fmt/core.h>

#include "canlog/candump.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/output/errors.h"
#include "cli/output/output_file.h"
#include "cli/output/overwrite.h"
#include "cli/output/progress.h"
#include "cli/output/terminal.h"
#include "gateway/config.h"
#include "gateway/input_frames.h"
#include "simulation/simulator.h"

namespace vgyro::cli {

namespace {

using gateway::FrameMatch;
using gateway::Plan;

// Offsets of the first samples, in intervals of their own stream: frames on a bus do not come at
// the same time.
constexpr std::array<double, 2> kGyroOffsets{0.0, 0.23};
constexpr double kReferenceOffset = 0.22;
constexpr double kAccelerometerOffset = 0.06;
// A quantity on a page of its own is sent with every tenth sample, a little later.
constexpr std::size_t kPageEvery = 10;
constexpr double kPageAfter_s = 1e-4;
// A unit that has several messages sends one after the other.
constexpr double kMessageAfter_s = 2e-4;
// Each axis of a unit has random numbers of its own.
constexpr std::uint64_t kAxisSeed = 0x9E3779B97F4A7C15;
constexpr double kMicro = 1e6;

enum Part : std::uint8_t { kGyroA = 0, kGyroB = 1, kReference = 2, kAccelerometer = 3 };

/// A quantity in a gyro's message besides its rate, and its value in the simulator.
struct Beside {
  std::optional<gateway::Quantity> gateway::GyroPlan::*quantity;
  double (*value)(const simulation::Simulator& simulator, const simulation::GyroSample& sample);
};
template <std::size_t axis>
double other_rate_dps(const simulation::Simulator& /*simulator*/,
                      const simulation::GyroSample& sample) {
  return sample.other_rate_dps[axis];
}
constexpr std::array kBesides{
    Beside{&gateway::GyroPlan::temperature,
           [](const simulation::Simulator& simulator, const simulation::GyroSample& sample) {
             return simulator.temperature_c(sample.t_s);
           }},
    Beside{&gateway::GyroPlan::supply_voltage,
           [](const simulation::Simulator& simulator, const simulation::GyroSample& sample) {
             return simulator.supply_v(sample.t_s);
           }},
    Beside{&gateway::GyroPlan::rate_x, other_rate_dps<0>},
    Beside{&gateway::GyroPlan::rate_y, other_rate_dps<1>},
    Beside{&gateway::GyroPlan::rate_z, other_rate_dps<2>}};
constexpr bool all_besides_are_played() {
  if (kBesides.size() != gateway::kBesides.size()) return false;
  for (std::size_t i = 0; i < kBesides.size(); ++i) {
    if (kBesides[i].quantity != gateway::kBesides[i]) return false;
  }
  return true;
}
static_assert(all_besides_are_played());

/// One message: its parts, and the next of its samples to be sent.
struct SimulatedMessage {
  const FrameMatch* match = nullptr;
  std::vector<Part> parts{};
  const gateway::Quantity* page = nullptr;  ///< if set: only this, and the others on its page
  double after_s = 0.0;                     ///< delay after the first message of its unit
  std::size_t next = 0;
  double stamp_s = 0.0;
};

/// A gyro, or one axis of a unit: its signal and its readings.
struct Sensor {
  const gateway::GyroPlan* plan = nullptr;
  std::vector<simulation::GyroSample> samples{};
  std::uint64_t beyond = 0;  ///< readings that the signal cannot carry
};
using Sensors = std::array<std::vector<Sensor>, 2>;

std::span<const gateway::GyroPlan> sensors_of(const gateway::GyroPlan& gyro) {
  return gyro.axes.empty() ? std::span(&gyro, 1) : std::span(gyro.axes);
}

bool same_message(const FrameMatch& a, const FrameMatch& b) {
  return a.bus == b.bus && a.id == b.id && a.extended == b.extended;
}

std::vector<SimulatedMessage> messages_of(const Plan& plan, bool has_acceleration) {
  std::vector<SimulatedMessage> messages;
  const auto add = [&](const FrameMatch& match, Part part) {
    for (SimulatedMessage& message : messages) {
      if (!same_message(*message.match, match)) continue;
      if (message.parts.back() != part) message.parts.push_back(part);
      return;
    }
    const auto before = std::count_if(messages.begin(), messages.end(), [&](const auto& message) {
      return message.parts.front() == part;
    });
    messages.push_back({.match = &match,
                        .parts = {part},
                        .after_s = static_cast<double>(before) * kMessageAfter_s});
  };
  for (const Part part : {kGyroA, kGyroB}) {
    for (const gateway::GyroPlan& sensor : sensors_of(plan.gyros[part]))
      add(sensor.match, part);
  }
  if (plan.reference) add(plan.reference->match, kReference);
  if (plan.accelerometer && has_acceleration) add(plan.accelerometer->match, kAccelerometer);
  return messages;
}

simulation::Timing& timing_of(simulation::Settings& settings, Part part) {
  if (part == kReference) return settings.reference;
  if (part == kAccelerometer) return settings.accelerometer;
  return settings.gyros[part];
}

simulation::Settings settings_of(const SimulateOptions& options,
                                 const std::vector<SimulatedMessage>& messages) {
  simulation::Settings settings{.jitter_s = options.jitter_s, .seed = options.seed};
  for (std::size_t i = 0; i < 2; ++i) {
    const double rate_hz = i == 0 ? options.gyro_rates_hz.front() : options.gyro_rates_hz.back();
    settings.gyros[i] = {rate_hz, kGyroOffsets[i] / rate_hz};
  }
  settings.reference = {options.reference_rate_hz, kReferenceOffset / options.reference_rate_hz};
  settings.accelerometer = {options.accelerometer_rate_hz,
                            kAccelerometerOffset / options.accelerometer_rate_hz};
  for (const SimulatedMessage& message : messages) {
    for (const Part part : message.parts)
      timing_of(settings, part) = timing_of(settings, message.parts.front());
  }
  return settings;
}

class Recording {
 public:
  /// `simulator` supplies everything except the gyros.
  Recording(const Plan& plan, const simulation::Simulator& simulator, Sensors sensors,
            std::vector<SimulatedMessage> messages);

  /// Writes all frames in the order of their stamps.
  void write(OutputFile& output, double start_s);
  void summarize(const SimulateOptions& options) const;
  void warn_of_limits() const;

 private:
  [[nodiscard]] std::size_t count(Part part) const;
  [[nodiscard]] double stamp_s(Part part, std::size_t n) const;
  [[nodiscard]] bool lost(const SimulatedMessage& message) const;
  [[nodiscard]] can::Frame frame(const SimulatedMessage& message);
  void put(Part part, const FrameMatch& match, std::size_t n, can::Frame& frame);
  void put_reference(std::size_t n, can::Frame& frame);
  void put_sensors(Part part, const FrameMatch& match, std::size_t n, can::Frame& frame);
  [[nodiscard]] const gateway::E2ePlan& e2e_of(Part part, const FrameMatch& match) const;
  /// The first sensor in this message; its plan has the message's other quantities.
  [[nodiscard]] const Sensor& sensor_in(Part part, const FrameMatch& match) const;
  void put_besides(const Sensor& sensor, std::size_t n, can::Frame& frame) const;
  void put_page(Part part, std::size_t n, const gateway::Quantity& page, can::Frame& frame) const;
  void add_pages(Part part);
  void say_constants() const;
  bool find_next(SimulatedMessage& message) const;

  const Plan& plan_;
  const simulation::Simulator& simulator_;
  std::vector<SimulatedMessage> messages_;
  Sensors sensors_;
  std::vector<simulation::RateSample> reference_;
  /// With several axes: the reference about each axis of the vehicle, at the same instants.
  std::array<std::vector<simulation::RateSample>, gateway::kAxes> reference_axes_;
  std::vector<simulation::AccelerationSample> acceleration_;
  std::uint64_t frames_ = 0;
};

Recording::Recording(const Plan& plan, const simulation::Simulator& simulator, Sensors sensors,
                     std::vector<SimulatedMessage> messages)
    : plan_(plan),
      simulator_(simulator),
      messages_(std::move(messages)),
      sensors_(std::move(sensors)) {
  for (const SimulatedMessage& message : messages_) {
    for (const Part part : message.parts) {
      if (part == kReference) reference_ = simulator.reference();
      if (part == kAccelerometer) acceleration_ = simulator.acceleration();
    }
  }
  for (std::size_t axis = 0; !reference_.empty() && axis < gateway::kAxes; ++axis) {
    if (plan_.reference->axes[axis]) reference_axes_[axis] = simulator.reference(axis);
  }
  add_pages(kGyroA);
  add_pages(kGyroB);
}

// Adds one message for each page, with all quantities on it.
void Recording::add_pages(Part part) {
  const gateway::GyroPlan& gyro = plan_.gyros[part];
  can::Frame with_rate = gateway::empty_frame(gyro.match);
  gateway::put_gyro(gyro, 0.0, 0, with_rate);
  std::vector<can::Frame> pages;
  for (const Beside& beside : kBesides) {
    const auto& quantity = gyro.*beside.quantity;
    if (!quantity || gateway::carries(gyro, *quantity, with_rate)) continue;
    const bool has_one = std::any_of(pages.begin(), pages.end(), [&](const can::Frame& page) {
      return quantity->presence.holds(page.payload());
    });
    if (has_one) continue;
    can::Frame page = gateway::empty_frame(gyro.match);
    gateway::put_quantity(*quantity, 0.0, page);
    pages.push_back(page);
    messages_.push_back({.match = &gyro.match, .parts = {part}, .page = &*quantity});
  }
}

std::size_t Recording::count(Part part) const {
  if (part == kReference) return reference_.size();
  if (part == kAccelerometer) return acceleration_.size();
  return sensors_[part].front().samples.size();
}

double Recording::stamp_s(Part part, std::size_t n) const {
  if (part == kReference) return reference_[n].stamp_s;
  if (part == kAccelerometer) return acceleration_[n].stamp_s;
  return sensors_[part].front().samples[n].stamp_s;
}

bool Recording::lost(const SimulatedMessage& message) const {
  return std::any_of(message.parts.begin(), message.parts.end(), [&](Part part) {
    return part <= kGyroB && sensors_[part].front().samples[message.next].lost;
  });
}

// Finds the next sample to send from message.next on; false if there is none.
bool Recording::find_next(SimulatedMessage& message) const {
  const Part leader = message.parts.front();
  const std::size_t step = message.page != nullptr ? kPageEvery : 1;
  while (message.next < count(leader) && lost(message))
    message.next += step;
  if (message.next >= count(leader)) return false;
  message.stamp_s = stamp_s(leader, message.next) + message.after_s +
                    (message.page != nullptr ? kPageAfter_s : 0.0);
  return true;
}

void Recording::put(Part part, const FrameMatch& match, std::size_t n, can::Frame& frame) {
  if (part == kReference) {
    put_reference(n, frame);
    gateway::put_counter(plan_.reference->e2e, n, frame);
    return;
  }
  if (part == kAccelerometer) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      gateway::put_quantity(plan_.accelerometer->axes[axis], acceleration_[n].acceleration_g[axis],
                            frame);
    }
    gateway::put_counter(plan_.accelerometer->e2e, n, frame);
    return;
  }
  put_sensors(part, match, n, frame);
}

void Recording::put_reference(std::size_t n, can::Frame& frame) {
  if (plan_.axes.empty()) {
    gateway::put_quantity(plan_.reference->rate, reference_[n].rate_dps, frame);
    return;
  }
  for (std::size_t axis = 0; axis < gateway::kAxes; ++axis) {
    const auto& rate = plan_.reference->axes[axis];
    if (rate) gateway::put_quantity(*rate, reference_axes_[axis][n].rate_dps, frame);
  }
}

void Recording::put_sensors(Part part, const FrameMatch& match, std::size_t n, can::Frame& frame) {
  for (Sensor& sensor : sensors_[part]) {
    if (!same_message(sensor.plan->match, match)) continue;
    const double reading_dps = sensor.samples[n].reading_dps;
    if (std::abs(reading_dps) > gateway::carried_dps(*sensor.plan)) ++sensor.beyond;
    gateway::put_gyro(*sensor.plan, reading_dps, n, frame);
  }
  put_besides(sensor_in(part, match), n, frame);
}

const Sensor& Recording::sensor_in(Part part, const FrameMatch& match) const {
  return *std::find_if(sensors_[part].begin(), sensors_[part].end(), [&](const Sensor& sensor) {
    return same_message(sensor.plan->match, match);
  });
}

// If the rate is on every page, the quantities on different pages take turns.
void Recording::put_besides(const Sensor& sensor, std::size_t n, can::Frame& frame) const {
  const gateway::GyroPlan& gyro = *sensor.plan;
  bool page_is_chosen = false;
  for (std::size_t i = 0; i < kBesides.size(); ++i) {
    const Beside& beside = kBesides[(n + i) % kBesides.size()];
    const auto& quantity = gyro.*beside.quantity;
    if (!quantity || !gateway::carries(gyro, *quantity, frame)) continue;
    if (page_is_chosen && !quantity->presence.holds(frame.payload())) continue;
    gateway::put_quantity(*quantity, beside.value(simulator_, sensor.samples[n]), frame);
    page_is_chosen = page_is_chosen || !quantity->presence.always();
  }
}

void Recording::put_page(Part part, std::size_t n, const gateway::Quantity& page,
                         can::Frame& frame) const {
  page.presence.arrange({frame.data.data(), frame.length});
  for (const Beside& beside : kBesides) {
    const auto& quantity = plan_.gyros[part].*beside.quantity;
    if (!quantity || !quantity->presence.holds(frame.payload())) continue;
    gateway::put_quantity(*quantity, beside.value(simulator_, sensors_[part].front().samples[n]),
                          frame);
  }
}

const gateway::E2ePlan& Recording::e2e_of(Part part, const FrameMatch& match) const {
  if (part == kReference) return plan_.reference->e2e;
  return part == kAccelerometer ? plan_.accelerometer->e2e : sensor_in(part, match).plan->e2e;
}

can::Frame Recording::frame(const SimulatedMessage& message) {
  can::Frame frame = gateway::empty_frame(*message.match);
  if (message.page != nullptr) {
    put_page(message.parts.front(), message.next, *message.page, frame);
  } else {
    for (const Part part : message.parts)
      put(part, *message.match, message.next, frame);
  }
  for (const Part part : message.parts)
    gateway::seal(e2e_of(part, *message.match), frame);
  return frame;
}

void Recording::write(OutputFile& output, double start_s) {
  std::vector<canlog::LineFormatter> formatters;
  formatters.reserve(plan_.buses.size());
  for (const std::string& bus : plan_.buses)
    formatters.emplace_back(bus);
  std::vector<SimulatedMessage*> alive;
  for (SimulatedMessage& message : messages_) {
    if (find_next(message)) alive.push_back(&message);
  }
  const auto start_ns = static_cast<std::int64_t>(std::llround(start_s * kMicro)) * 1000;
  Progress progress("simulate");
  while (!alive.empty()) {
    const auto first =
        std::min_element(alive.begin(), alive.end(),
                         [](const auto* a, const auto* b) { return a->stamp_s < b->stamp_s; });
    SimulatedMessage& message = **first;
    // A log's stamps have microseconds.
    const auto since_ns = static_cast<std::int64_t>(std::llround(message.stamp_s * kMicro)) * 1000;
    output.commit(formatters[message.match->bus].format(
        output.room(canlog::kLineBytesMax), time_from_ns(start_ns + since_ns), frame(message), 6));
    progress.update(static_cast<std::uint64_t>(message.stamp_s * 1e3),
                    static_cast<std::uint64_t>(simulator_.profile().length_s * 1e3), ++frames_);
    message.next += message.page != nullptr ? kPageEvery : 1;
    if (!find_next(message)) alive.erase(first);
  }
}

void Recording::summarize(const SimulateOptions& options) const {
  tell("{:g} s of {}, {} frames, seed {}\n", simulator_.profile().length_s, options.profile,
       frames_, options.seed);
  for (const Part part : {kGyroA, kGyroB}) {
    const auto& samples = sensors_[part].front().samples;
    const auto lost = std::count_if(samples.begin(), samples.end(),
                                    [](const simulation::GyroSample& s) { return s.lost; });
    tell("  gyro {}: {} samples{}\n", plan_.gyros[part].name, samples.size(),
         lost == 0 ? "" : fmt::format(", {} of them lost", lost));
  }
  if (plan_.reference) tell("  reference: {} samples\n", reference_.size());
  if (plan_.accelerometer) {
    tell("  accelerometer: {}\n",
         acceleration_.empty() ? "no frames; the profile has no column acc_x_g, acc_y_g, acc_z_g"
                               : fmt::format("{} samples", acceleration_.size()));
  }
  say_constants();
}

void Recording::say_constants() const {
  const bool tells_temperature = plan_.gyros[0].temperature || plan_.gyros[1].temperature;
  if (tells_temperature && !simulator_.profile().temperature_c) {
    tell("  temperature: {:g} degC throughout; the profile has no column temperature_c\n",
         simulation::Simulator::kTemperature_c);
  }
  const bool tells_supply = plan_.gyros[0].supply_voltage || plan_.gyros[1].supply_voltage;
  if (tells_supply && !simulator_.profile().supply_v) {
    tell("  supply voltage: {:g} V throughout; the profile has no column supply_v\n",
         simulation::Simulator::kSupply_v);
  }
  for (std::size_t axis = 0; axis < gateway::kOtherAxes.size(); ++axis) {
    const bool tells =
        plan_.gyros[0].*gateway::kOtherAxes[axis] || plan_.gyros[1].*gateway::kOtherAxes[axis];
    if (!tells || simulator_.profile().other_rate_dps[axis]) continue;
    tell("  rate about {0}: 0 throughout; the profile has no column rate_{0}_dps\n", "xyz"[axis]);
  }
}

void Recording::warn_of_limits() const {
  for (const std::vector<Sensor>& sensors : sensors_) {
    for (const Sensor& sensor : sensors) {
      if (sensor.beyond == 0) continue;
      warn({"gyro " + sensor.plan->name,
            fmt::format("{} readings are beyond the {:g} deg/s that its signal {} can carry; they "
                        "were sent as that",
                        sensor.beyond, gateway::carried_dps(*sensor.plan), sensor.plan->rate.name),
            {}});
    }
  }
}

// A simulator with the motion and the effects of one axis of a unit.
Expected<simulation::Simulator> axis_simulator(const gateway::GyroPlan& unit, std::size_t gyro,
                                               std::size_t axis, const model::Model& model,
                                               const simulation::Profile& profile,
                                               simulation::Settings settings) {
  model::Model own{.file = model.file, .effects = {}};
  std::copy_if(model.effects.begin(), model.effects.end(), std::back_inserter(own.effects),
               [&](const model::Effect& effect) {
                 return effect.gyro == gyro && effect.of_axis.value_or(axis) == axis;
               });
  std::array<std::array<double, 3>, 3> about{};
  for (std::size_t sensor = 0; sensor < 3; ++sensor) {
    for (std::size_t i = 0; i < 3; ++i)
      about[sensor][i] = unit.mount.at(i, sensor);
  }
  settings.seed ^= kAxisSeed * axis;
  return simulation::Simulator::make(std::move(own), turned(profile, about[axis], about), settings);
}

Expected<Sensors> simulate_units(const Plan& plan, const model::Model& model,
                                 const simulation::Profile& profile,
                                 const simulation::Settings& settings) {
  Sensors sensors;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    for (const gateway::GyroPlan& axis : plan.gyros[gyro].axes) {
      const auto simulator =
          axis_simulator(plan.gyros[gyro], gyro, axis.sensor_axis, model, profile, settings);
      if (!simulator) return tl::unexpected(simulator.error());
      sensors[gyro].push_back({.plan = &axis, .samples = simulator->gyro(gyro)});
    }
  }
  return sensors;
}

// Checks that the profile has the motion of single gyros, or of units about all of their axes.
Expected<void> check_motion(const Plan& plan, const simulation::Profile& profile,
                            const model::Model& model) {
  if (plan.axes.empty()) {
    if (!profile.has_rate)
      return fail(profile.file, "has no column rate_dps", "the rate that both gyros measure");
    for (const model::Effect& effect : model.effects) {
      if (!effect.of_axis) continue;
      return fail(at_line(model.file, effect.line),
                  "an effect of one axis, and the gyros have one axis each", "leave `axis` out");
    }
    return {};
  }
  for (const std::size_t axis : plan.output.axes) {
    if (profile.other_rate_dps[axis]) continue;
    const char name = gateway::kAxisNames[axis];
    return fail(profile.file, fmt::format("has no column rate_{}_dps", name),
                fmt::format("the motion about the vehicle's axis {}", name));
  }
  return {};
}

Expected<void> check_output(const SimulateOptions& options, std::vector<std::string> inputs) {
  if (options.output.ends_with(".xz")) {
    return fail(options.output, "cannot be written compressed",
                "write a .log, then `xz` compresses it");
  }
  inputs.insert(inputs.end(), {options.model, options.profile});
  return check_outputs(inputs, {options.output});
}

}  // namespace

int run_simulate(const SimulateOptions& options) {
  const auto loaded = gateway::load_config(options.config);
  if (!loaded) return report(loaded.error());
  const Plan& plan = loaded->plan;
  for (const gateway::GyroPlan& gyro : plan.gyros) {
    for (const gateway::GyroPlan& sensor : sensors_of(gyro)) {
      if (const auto good = gateway::check_valid(sensor); !good) return report(good.error());
    }
  }
  auto model =
      model::load_model(options.model, {.names = {plan.gyros[0].name, plan.gyros[1].name}});
  if (!model) return report(model.error());
  auto profile = simulation::load_profile(options.profile);
  if (!profile) return report(profile.error());
  if (const auto good = check_motion(plan, *profile, *model); !good) return report(good.error());
  auto messages = messages_of(plan, profile->has_acceleration());
  const simulation::Settings settings = settings_of(options, messages);
  Expected<Sensors> sensors;
  if (!plan.axes.empty()) {
    sensors = simulate_units(plan, *model, *profile, settings);
    if (!sensors) return report(sensors.error());
    model->effects.clear();
  }
  const auto simulator =
      simulation::Simulator::make(*std::move(model), *std::move(profile), settings);
  if (!simulator) return report(simulator.error());
  if (plan.axes.empty()) {
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      (*sensors)[gyro].push_back({.plan = &plan.gyros[gyro], .samples = simulator->gyro(gyro)});
  }
  if (const auto good = check_output(options, loaded->files); !good) return report(good.error());
  auto output = OutputFile::open(options.output);
  if (!output) return report(output.error());

  Recording recording(plan, *simulator, *std::move(sensors), std::move(messages));
  recording.write(*output, options.start_s);
  if (const auto closed = output->close(); !closed) return report(closed.error());
  if (!options.quiet) recording.summarize(options);
  recording.warn_of_limits();
  return kDone;
}

}  // namespace vgyro::cli
