#include <fmt/core.h>

#include "base/printable.h"
#include "base/toml_merge.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/output/errors.h"
#include "cli/output/terminal.h"
#include "gateway/config.h"
#include "gateway/model_plan.h"

namespace vgyro::cli {

namespace {

std::string id_text(const gateway::FrameMatch& match) {
  if (!match.extended) return fmt::format("{:03X}", match.id);
  const bool any_source = (match.mask & 0xFFU) == 0;
  return any_source ? fmt::format("{:06X}xx", match.id >> 8U) : fmt::format("{:08X}", match.id);
}

void print_row(std::string_view role, const std::string& bus, const gateway::FrameMatch& match,
               const std::string& message, const gateway::Quantity& quantity) {
  const std::string signal = message + "." + quantity.name;
  say("  {:<14}{:<8}{:<10}{:<25} {:<7} {}\n", role, bus, id_text(match), signal,
      printable(quantity.unit), quantity.layout);
}

void detail(std::string_view what, const std::string& text) {
  say("    {:<12}{}\n", what, text);
}

void print_e2e(const gateway::E2ePlan& e2e) {
  if (e2e.crc) detail("crc", fmt::format("{}, {}", e2e.crc->name, e2e.crc->kind));
  if (!e2e.counter) return;
  std::string text = fmt::format("{}, runs 0 to {}", e2e.counter->name, e2e.counter->modulus - 1);
  if (e2e.counter->max_delta > 0)
    text += fmt::format(", steps of at most {}", e2e.counter->max_delta);
  detail("counter", text);
}

void print_rate(const gateway::GyroPlan& gyro) {
  detail("accepted",
         fmt::format("{:g} to {:g} {}{}", gyro.rate.lowest(), gyro.rate.highest(),
                     printable(gyro.rate.unit), gyro.rate.scale < 0 ? ", sign flipped" : ""));
  if (!gyro.rate.codes.empty()) {
    detail("codes", fmt::format("raw values from 0x{:X} to 0x{:X} are no measurement",
                                gyro.rate.codes.first, gyro.rate.codes.last));
  }
  if (gyro.sign) detail("sign", "from a signal of its own: 1 is negative");
}

// The quantities in a gyro's message besides its rate.
void print_message(const gateway::GyroPlan& gyro) {
  if (gyro.temperature) {
    detail("temperature", fmt::format("{} in {}, {}", gyro.temperature->name,
                                      printable(gyro.temperature->unit), gyro.temperature->layout));
  }
  if (gyro.supply_voltage) {
    detail("supply",
           fmt::format("{} in {}, {}", gyro.supply_voltage->name,
                       printable(gyro.supply_voltage->unit), gyro.supply_voltage->layout));
  }
  for (std::size_t axis = 0; axis < gateway::kOtherAxes.size(); ++axis) {
    const auto& other = gyro.*gateway::kOtherAxes[axis];
    if (!other) continue;
    detail(fmt::format("about {}", "xyz"[axis]),
           fmt::format("{} in {}, {}", other->name, printable(other->unit), other->layout));
  }
  print_e2e(gyro.e2e);
  if (gyro.valid) detail("valid when", gyro.valid->text);
  if (gyro.max_bias_dps) detail("bias", fmt::format("at most {:g} deg/s", *gyro.max_bias_dps));
}

// How a unit's axes lie in the vehicle, and how far the given matrix is from a rotation.
void print_mount(const gateway::Mount& mount) {
  if (!mount.turns() && mount.corrected == 0.0) return;
  for (std::size_t axis = 0; axis < gateway::kAxes; ++axis) {
    detail(axis == 0 ? "mount" : "",
           fmt::format("vehicle's {} = {:+.6f} x {:+.6f} y {:+.6f} z", gateway::kAxisNames[axis],
                       mount.at(axis, 0), mount.at(axis, 1), mount.at(axis, 2)));
  }
  detail("", mount.corrected == 0.0
                 ? std::string("a rotation, exactly")
                 : fmt::format("as given; its elements differ from a rotation by up to {:.2g}",
                               mount.corrected));
}

void print_gyro(const gateway::GyroPlan& gyro) {
  if (gyro.axes.empty()) {
    print_row("gyro " + gyro.name, gyro.bus, gyro.match, gyro.message, gyro.rate);
    print_rate(gyro);
    print_message(gyro);
    return;
  }
  for (const gateway::GyroPlan& axis : gyro.axes) {
    print_row(fmt::format("gyro {} {}", gyro.name, gateway::kAxisNames[axis.sensor_axis]), axis.bus,
              axis.match, axis.message, axis.rate);
    print_rate(axis);
    const bool last_of_message = &axis == &gyro.axes.back() || !(axis.match == (&axis)[1].match);
    if (last_of_message) print_message(axis);
  }
  print_mount(gyro.mount);
}

void print_calibration(const gateway::CalibrationPlan& plan, std::string_view about) {
  say("  {:<14}", "calibration");
  if (plan.from_reference) {
    say("the first {:g} s against [reference]\n", plan.rest_s);
    return;
  }
  const bool waits = plan.when_moving == fusion::WhenMoving::kWait;
  say("the first {:g} s{}, true rate {}{:g} deg/s", plan.rest_s,
      waits ? " of rest" : ", used as rest even if the platform moves", about, plan.rate_dps);
  if (plan.doubt_dps > 0.0)
    say(", the Earth's share unknown: {:.2g} deg/s more in sigma", plan.doubt_dps);
  say("\n");
}

void print_output(const gateway::Plan& plan) {
  const gateway::OutputPlan& output = plan.output;
  if (!output.vgyro_frames) return;
  const std::string& bus = plan.buses[output.bus];
  if (output.axes.empty()) {
    say("  {:<14}{:<8}VG_Rate {:03X}, VG_Bias {:03X}, VG_Model {:03X}, {}\n", "output", bus,
        output.rate_id, output.bias_id, output.model_id,
        output.fd ? "VG_Rate as CAN FD" : "classic CAN");
  }
  if (output.rate_is_shared)
    say("  {:<14}{:<8}VG_Rates {:03X}, all axes, as CAN FD\n", "output", bus, output.rate_id);
  for (const gateway::Plan& pair : plan.axes) {
    const std::string rate =
        output.rate_is_shared ? "" : fmt::format("VG_Rate {:03X}, ", pair.output.rate_id);
    say("  {:<14}{:<8}{}VG_Bias {:03X}, VG_Model {:03X}, classic CAN\n",
        fmt::format("output {}", gateway::kAxisNames[pair.axis]), bus, rate, pair.output.bias_id,
        pair.output.model_id);
  }
}

void print_model(const gateway::Plan& plan) {
  if (!plan.model) return;
  say("  {:<14}{}, {} effects\n", "model", plan.model->file, plan.model->effects.size());
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    say("    gyro {}\n", plan.gyros[gyro].name);
    for (const model::Effect& effect : gateway::effects_of(plan, gyro)) {
      say("      {:<15}{:<28}{}\n", gateway::treatment(effect.kind), model::info(effect.kind).name,
          model::parameters_text(effect));
    }
  }
}

// "0xFFFF, not available", or the raw value sent instead if the field has no such code.
std::string said_of_none(const gateway::OutputField& field) {
  return field.has_code ? field.code : fmt::format("0x{:X}", field.none_raw);
}

std::string range_text(const gateway::OutputField& field) {
  std::string text =
      fmt::format("{:g} to {:g} {}", field.minimum, field.maximum, printable(field.unit));
  if (field.step > 0.0) text += fmt::format(" in steps of {:g} deg/s", field.step);
  return text;
}

void print_flag(const gateway::OutputFlag& flag, const char* otherwise) {
  detail("valid", fmt::format("{}: 0x{:X}, and 0x{:X} {}", flag.text, flag.valid_raw,
                              flag.invalid_raw, otherwise));
}

void print_layout_rate(const gateway::OutputLayout& layout, const gateway::LayoutRate& one) {
  const gateway::OutputField& rate = one.rate;
  detail("carries", range_text(rate) + (rate.scale < 0 ? ", sign flipped" : ""));
  if (one.sign) detail("sign", "in a signal of its own: 1 is negative");
  if (one.valid) print_flag(*one.valid, "when this rate is not valid");
  if (layout.rates.size() == 1 && layout.valid) print_flag(*layout.valid, "when no rate is valid");
  if (!layout.can_say_invalid()) {
    detail("not valid",
           "silence: neither the rate nor another signal can say it; `valid` or "
           "`rate_not_available` may name one");
    return;
  }
  detail("not valid", said_of_none(rate) + (rate.has_code ? "" : ", no rotation, and flagged"));
  if (rate.beyond_raw != rate.none_raw)
    detail("beyond", fmt::format("0x{:X}, out of range", rate.beyond_raw));
}

void print_layout_sigma(const gateway::OutputField& sigma) {
  detail("sigma", fmt::format("{}, {}; unknown or beyond: {}", sigma.name, range_text(sigma),
                              sigma.has_code ? sigma.code : "the rate is not valid"));
}

void print_layout(const gateway::Plan& plan, const gateway::OutputLayout& layout) {
  const gateway::OutputField& rate = layout.rates.front().rate;
  const bool several = layout.rates.size() > 1;
  const std::string id = gateway::to_string(gateway::FrameId{layout.id, layout.extended});
  say("  {:<14}{:<8}{:<10}{:<26}{:<8}{}\n", "layout", plan.buses[layout.bus], id,
      layout.message + "." + rate.name, printable(rate.unit), rate.layout);
  detail("frame",
         fmt::format("{} bytes{}, {}", layout.bytes, layout.fd ? ", CAN FD" : "",
                     layout.every ? fmt::format("every {:g} ms", to_seconds(*layout.every) * 1e3)
                                  : "with every rate"));
  for (const gateway::LayoutRate& one : layout.rates) {
    if (!plan.axes.empty()) {
      detail("axis", fmt::format("{}: {}, {}", gateway::kAxisNames[one.axis], one.rate.name,
                                 one.rate.layout));
    }
    print_layout_rate(layout, one);
    if (one.sigma) print_layout_sigma(*one.sigma);
  }
  if (several && layout.valid) print_flag(*layout.valid, "when not all rates are valid");
  print_e2e(layout.e2e);
  for (const gateway::RestingSignal& signal : layout.resting)
    detail("fixed", fmt::format("{}: {}", signal.name, signal.says));
}

std::vector<gateway::Quantity> rates_of(const gateway::ReferencePlan& reference) {
  std::vector<gateway::Quantity> rates;
  for (const auto& axis : reference.axes) {
    if (axis) rates.push_back(*axis);
  }
  return rates.empty() ? std::vector{reference.rate} : rates;
}

void print_plan(const gateway::Plan& plan) {
  say("  {:<14}{:<8}{:<10}{:<25} {:<7} {}\n", "", "bus", "id", "signal", "unit", "bits");
  for (const gateway::GyroPlan& gyro : plan.gyros)
    print_gyro(gyro);
  if (plan.reference) {
    for (const gateway::Quantity& rate : rates_of(*plan.reference)) {
      print_row("reference", plan.reference->bus, plan.reference->match, plan.reference->message,
                rate);
    }
    print_e2e(plan.reference->e2e);
  }
  if (plan.accelerometer) {
    for (const gateway::Quantity& axis : plan.accelerometer->axes) {
      print_row("accelerometer", plan.accelerometer->bus, plan.accelerometer->match,
                plan.accelerometer->message, axis);
    }
    print_e2e(plan.accelerometer->e2e);
  }
  if (plan.speed) {
    print_row("speed", plan.speed->bus, plan.speed->match, plan.speed->message, plan.speed->speed);
    print_e2e(plan.speed->e2e);
  }
  if (plan.axes.empty()) print_calibration(plan.calibration, "");
  for (const gateway::Plan& pair : plan.axes)
    print_calibration(pair.calibration, fmt::format("about {} ", gateway::kAxisNames[pair.axis]));
  say("  {:<14}{}", "corrector", gateway::to_string(plan.corrector.method));
  if (plan.corrector.method == gateway::Method::kMutual) {
    say(", window {:g} s, drift polynomial of order {}", plan.corrector.window_s,
        plan.corrector.order);
  } else if (plan.corrector.method == gateway::Method::kOptimal) {
    say(", windows of at most {:g} s", plan.corrector.window_s);
  }
  say("\n");
  print_model(plan);
  if (!plan.output.transmit)
    say("  {:<14}the gateway sends none of these frames: transmit = false\n", "shadow mode");
  print_output(plan);
  for (const gateway::OutputLayout& layout : plan.output.layouts)
    print_layout(plan, layout);
}

void print_origins(const toml::table& table) {
  say("  {:<14}merged from several files\n", "values");
  for (const TomlOrigin& origin : toml_origins(table))
    say("    {:<32}{:<24} {}\n", origin.key, origin.value, origin.where);
}

}  // namespace

int run_check(const CheckOptions& options) {
  const gateway::ConfigOverrides overrides{options.method, options.model};
  const auto loaded = gateway::load_config(options.config, overrides);
  if (!loaded) return report(loaded.error());
  for (const Error& warning : loaded->warnings)
    warn(warning);
  say("{}: good\n", options.config);
  say("  {:<14}{}\n", "fingerprint", gateway::fingerprint_of(*loaded, overrides));
  print_plan(loaded->plan);
  if (loaded->text.files.size() > 1) print_origins(loaded->text.table);
  return kDone;
}

}  // namespace vgyro::cli
