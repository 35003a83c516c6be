#include "daemon/reporter.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "gateway/condition_text.h"
#include "gateway/model_plan.h"

namespace vgyro::daemon {
namespace {

constexpr double kDegPerHour = 3600.0;

std::string bias_text(double bias_dps) {
  return std::isfinite(bias_dps) ? fmt::format("{:.2f}", bias_dps * kDegPerHour) : "unknown";
}

// "3 h": in the largest unit that gives at least 2.
std::string age_text(double age_s) {
  if (!std::isfinite(age_s)) return "an unknown time";
  if (age_s < 120.0) return fmt::format("{:.0f} s", age_s);
  if (age_s < 7200.0) return fmt::format("{:.0f} min", age_s / 60.0);
  if (age_s < 172'800.0) return fmt::format("{:.0f} h", age_s / 3600.0);
  return fmt::format("{:.0f} days", age_s / 86'400.0);
}

// The rest of the sentence "gyro left ...": what is wrong.
std::string sentence(gateway::Fault fault) {
  switch (fault) {
    case gateway::Fault::kSilent:
      return "is silent";
    case gateway::Fault::kFlaggedInvalid:
      return "is not used: it flags its rate as invalid";
    case gateway::Fault::kUnreadable:
      return "is not used: its frames hold no rate";
    case gateway::Fault::kCounterStuck:
      return "is not used: its alive counter stands still";
    case gateway::Fault::kSaturated:
      return "is not used: it is at the end of its range";
    case gateway::Fault::kStuck:
      return "is not used: its value stands still and should not";
    case gateway::Fault::kDeadBand:
      return "is not used: it reads 0 inside its dead band";
    case gateway::Fault::kNoisy:
      return "has far more noise than before";
    case gateway::Fault::kBlind:
      return gateway::blind_text() + ": " + gateway::blind_advice();
  }
  return "";
}

// The beginning of a sentence that ends with "once" or "N times".
const char* sentence(can::ErrorCause cause) {
  switch (cause) {
    case can::ErrorCause::kBusOff:
      return "bus-off: wiring, bit rate, or no other node on the bus; `ip link set … type can "
             "restart-ms 100` brings the controller back by itself;";
    case can::ErrorCause::kRestarted:
      return "the controller is back on the bus, restarted";
    case can::ErrorCause::kErrorPassive:
      return "error-passive";
    case can::ErrorCause::kErrorWarning:
      return "the controller warns of many errors on the bus,";
    case can::ErrorCause::kLostArbitration:
      return "a frame lost the arbitration and was not sent,";
    case can::ErrorCause::kNotAcknowledged:
      return "no other node on the bus acknowledged a frame,";
    case can::ErrorCause::kOverflow:
      return "the controller's buffers overflowed";
    case can::ErrorCause::kSendTimeout:
      return "the driver gave up a frame that could not be sent,";
    case can::ErrorCause::kTransceiver:
      return "the transceiver reports a fault of the wires,";
  }
  return "";
}

std::string trouble_of(const BusStatus& bus) {
  if (!bus.present) return fmt::format("; {} is not there", bus.name);
  if (!bus.link_up) return fmt::format("; {} is down", bus.name);
  if (bus.contested) return fmt::format("; another sender uses our identifiers on {}", bus.name);
  switch (bus.controller) {
    case can::ControllerState::kBusOff:
      return fmt::format("; {} is bus-off", bus.name);
    case can::ControllerState::kPassive:
      return fmt::format("; {} is error-passive", bus.name);
    case can::ControllerState::kActive:
    case can::ControllerState::kWarning:
      break;
  }
  return {};
}

}  // namespace

Reporter::Reporter(std::array<std::string, 2> gyro_names, double rest_s, Log& log)
    : names_(std::move(gyro_names)), rest_s_(rest_s), log_(log) {}

std::uint64_t Traffic::received() const {
  std::uint64_t sum = 0;
  for (const BusStatus& bus : buses)
    sum += bus.received;
  return sum;
}

std::uint64_t Traffic::lost() const {
  std::uint64_t sum = 0;
  for (const BusStatus& bus : buses)
    sum += bus.lost;
  return sum;
}

void Reporter::start_from(const can::TransmitCounts& transmitted) {
  last_sent_ = transmitted.sent;
  stale_.count = transmitted.dropped_stale;
  overflow_.count = transmitted.dropped_overflow;
  failed_.count = transmitted.dropped_failed;
}

void Reporter::state_changed(const gateway::Status& status) {
  const gateway::State before = std::exchange(state_, status.state);
  if (!state_lines_.take()) return;
  std::string silent;
  for (std::size_t k = 0; k < status.gyros.size(); ++k) {
    if (!status.gyros[k].heard && !status.gyros[k].fault)
      silent += fmt::format(", gyro {} is silent", names_[k]);
  }
  log_.tell(Severity::kNotice, {.cause = to_string(status.state)}, "{} (was {}){}",
            to_string(status.state), to_string(before), silent);
}

void Reporter::fault_changed(std::size_t gyro, const gateway::Status& status) {
  const auto now = status.gyros[gyro].fault;
  const auto before = std::exchange(faults_[gyro], now);
  if (!health_lines_.take()) return;
  if (now) {
    log_.tell(Severity::kWarning, {.gyro = names_[gyro], .cause = to_string(*now)}, "gyro {} {}",
              names_[gyro], sentence(*now));
  } else if (status.gyros[gyro].heard) {
    log_.tell(Severity::kNotice, {.gyro = names_[gyro], .cause = "well"},
              "gyro {} is healthy again (was {})", names_[gyro], to_string(*before));
  } else {
    log_.tell(Severity::kNotice, {.gyro = names_[gyro], .cause = "silent"},
              "gyro {} is silent (was {})", names_[gyro], to_string(*before));
  }
}

void Reporter::axis_state_changed(char axis, const gateway::Status& status, AxisTold& told) {
  const gateway::State before = std::exchange(told.state, status.state);
  if (!state_lines_.take()) return;
  log_.tell(Severity::kNotice, {.cause = to_string(status.state)}, "axis {}: {} (was {})", axis,
            to_string(status.state), to_string(before));
}

void Reporter::axis_fault_changed(char axis, std::size_t gyro, const gateway::Status& status,
                                  AxisTold& told) {
  const auto now = status.gyros[gyro].fault;
  const auto before = std::exchange(told.faults[gyro], now);
  if (!health_lines_.take()) return;
  if (now) {
    log_.tell(Severity::kWarning, {.gyro = names_[gyro], .cause = to_string(*now)},
              "axis {} of gyro {} {}", axis, names_[gyro], sentence(*now));
  } else {
    log_.tell(Severity::kNotice, {.gyro = names_[gyro], .cause = "well"},
              "axis {} of gyro {} is {} (was {})", axis, names_[gyro],
              status.gyros[gyro].heard ? "healthy again" : "silent", to_string(*before));
  }
}

void Reporter::contradiction_changed(const gateway::Status& status) {
  contradiction_ = status.pair.contradiction;
  disagree_ = status.disagree;  // part of the contradiction, not reported separately
  if (!health_lines_.take()) return;
  if (contradiction_ == fusion::Contradiction::kNone) {
    log_.notice("the gyros move together again, as on one platform");
    return;
  }
  log_.tell(Severity::kError, {.cause = gateway::to_string(contradiction_)}, "{}; {}",
            gateway::contradiction_text(status.pair, names_), gateway::contradiction_advice());
}

void Reporter::disagreement_changed(const gateway::Status& status) {
  disagree_ = status.disagree;
  if (!health_lines_.take()) return;
  if (disagree_) {
    log_.tell(Severity::kWarning, {.cause = "disagree"},
              "the gyros disagree; it is not known which one is wrong");
  } else {
    log_.notice("the gyros no longer disagree");
  }
}

void Reporter::ambiguity_changed(const gateway::Status& status) {
  ambiguous_ = status.ambiguous;
  if (!health_lines_.take()) return;
  if (ambiguous_) {
    log_.tell(Severity::kWarning, {.cause = "ambiguous"}, "{}",
              gateway::ambiguity_text(status.probability, names_));
  } else {
    const std::string seems = gateway::hypotheses_text(status.probability, names_);
    log_.notice("one explanation of the rates remains{}{}", seems.empty() ? "" : ": ", seems);
  }
}

std::string Reporter::second_passed(const gateway::Status& status, const Traffic& traffic) {
  ++second_;
  if (const std::uint64_t held = state_lines_.second_passed(); held > 0) {
    log_.warning("{} more changes of state in the last minute", held);
  }
  if (const std::uint64_t held = health_lines_.second_passed(); held > 0) {
    log_.warning("{} more changes of health in the last minute", held);
  }
  for (std::size_t k = 0; k < gyros_.size(); ++k) {
    tell_gyro(names_[k], status.gyros[k], gyros_[k]);
  }
  tell_pipeline(status);
  tell_corrector(status);
  tell_restored(status);
  tell_sent(traffic.transmitted);
  for (const BusStatus& bus : traffic.buses)
    tell_bus(bus, buses_[bus.name]);

  std::string doing{to_string(status.state)};
  if (status.state == gateway::State::kCalibrating) {
    doing += fmt::format(" ({:.1f} of {:g} s)", status.calibrated_s, rest_s_);
  } else if (std::isfinite(status.rate_dps)) {
    doing += fmt::format(", {:.5f} deg/s", status.rate_dps);
  }
  if (status.restored == gateway::Restored::kTakenUp) {
    doing +=
        fmt::format(", with biases saved {} before the start", age_text(status.restored_age_s));
  }
  if (const std::string contradiction = gateway::contradiction_text(status.pair, names_);
      !contradiction.empty()) {
    doing += ": " + contradiction;
  }
  if (status.ambiguous) {
    const std::string seems = gateway::hypotheses_text(status.probability, names_);
    doing += fmt::format(", ambiguous{}{}", seems.empty() ? "" : ": ", seems);
  }
  for (const BusStatus& bus : traffic.buses)
    doing += trouble_of(bus);
  const std::uint64_t received =
      traffic.received() - std::exchange(last_received_, traffic.received());
  const std::uint64_t sent =
      traffic.transmitted.sent - std::exchange(last_sent_, traffic.transmitted.sent);
  return fmt::format("{}; bias {} deg/h; {} frames/s in, {} out", doing, biases(status), received,
                     sent);
}

std::uint64_t Reporter::news(Told& told, std::uint64_t count) const {
  const bool first = told.count == 0;
  if (count <= told.count || (!first && second_ < told.second + kRepeatSeconds)) return 0;
  told.second = second_;
  return count - std::exchange(told.count, count);
}

void Reporter::tell_gyro(const std::string& name, const gateway::GyroStatus& gyro, GyroTold& told) {
  for (std::size_t cause = 0; cause < gateway::kRejectCount; ++cause) {
    if (const std::uint64_t n = news(told.rejected[cause], gyro.rejected[cause]); n > 0) {
      const std::string_view why = to_string(static_cast<gateway::Reject>(cause));
      log_.tell(Severity::kWarning, {.gyro = name, .cause = why}, "gyro {}: {} frames not used: {}",
                name, n, why);
    }
  }
  tell_waiting(name, gyro, told);
  if (const std::uint64_t n = news(told.missing, gyro.missing); n > 0) {
    log_.tell(Severity::kWarning, {.gyro = name, .cause = "missing"},
              "gyro {}: {} frames missing by its counter", name, n);
  }
  const std::string counter = gateway::counter_text(gyro);
  if (!counter.empty() && !std::exchange(told.counter, true)) {
    log_.tell(Severity::kWarning, {.gyro = name, .cause = "counter"}, "gyro {}: {}", name, counter);
  }
  if (const std::uint64_t n = news(told.unpaired, gyro.unpaired); n > 0) {
    log_.tell(Severity::kInfo, {.gyro = name, .cause = "unpaired"},
              "gyro {}: {} samples found no partner: the other gyro had a gap", name, n);
  }
}

// Reported once, after the first frames had time to come.
void Reporter::tell_waiting(const std::string& name, const gateway::GyroStatus& gyro,
                            GyroTold& told) {
  if (!gyro.heard || gyro.waits_for == 0 || second_ < kRepeatSeconds) return;
  if (std::exchange(told.waiting, true)) return;
  for (const std::string_view input : gateway::inputs_text(gyro.waits_for)) {
    log_.warning("gyro {}: effects of {} are not taken back, it was never heard", name, input);
  }
}

void Reporter::tell_pipeline(const gateway::Status& status) {
  if (const std::uint64_t n = news(clock_steps_, status.clock_steps); n > 0) {
    log_.tell(Severity::kWarning, {.cause = "clock_step"}, "the stamps were set back {} times", n);
  }
  if (const std::uint64_t n = news(rates_out_of_range_, status.rates_out_of_range); n > 0) {
    log_.warning("{} virtual rates were beyond what VG_Rate can carry", n);
  }
  const std::uint64_t beyond = status.layouts_total().out_of_range;
  if (const std::uint64_t n = news(layouts_out_of_range_, beyond); n > 0) {
    log_.warning("{} times the virtual rate was beyond what an [[output.layout]] can carry", n);
  }
  if (const std::uint64_t n = news(reference_rejected_, status.reference_rejected); n > 0) {
    log_.warning("{} frames of the reference not used", n);
  }
  if (const std::uint64_t n = news(accelerometer_rejected_, status.accelerometer_rejected); n > 0) {
    log_.warning("{} frames of the accelerometer not used", n);
  }
  if (const std::uint64_t n = news(speed_rejected_, status.speed_rejected); n > 0) {
    log_.warning("{} frames of the speed not used", n);
  }
  if (const std::uint64_t n = news(windows_skipped_, status.windows_skipped); n > 0) {
    log_.warning("{} windows had too few pairs: drifts held", n);
  }
  if (const std::uint64_t n = news(restarts_, status.calibration_restarts); n > 0) {
    log_.warning("calibration started over {} times: the platform moved, or frames were missing",
                 n);
  }
  if (status.moved_in_calibration && !std::exchange(told_of_motion_, true)) {
    log_.warning("calibrated although the platform moved");
  }
}

void Reporter::tell_corrector(const gateway::Status& status) {
  if (news(estimate_restarts_, status.estimate_restarts) > 0) {
    log_.tell(Severity::kError, {.cause = "estimate_lost"}, "{}",
              gateway::restarts_text(status.estimate_restarts));
  }
  if (status.rates_too_far_apart && !std::exchange(told_of_far_rates_, true)) {
    log_.tell(Severity::kWarning, {.cause = "rates_too_far_apart"}, "{}",
              gateway::rates_too_far_apart_text());
  }
  const gateway::SteadyStretches stretches = gateway::steady_stretches(status);
  const std::string advice = gateway::stretches_advice(stretches);
  if (!advice.empty() && !std::exchange(told_of_stretches_, true)) {
    log_.tell(Severity::kWarning, {.cause = "stops_refused"}, "{}; {}",
              gateway::stretches_text(stretches), advice);
  }
}

void Reporter::tell_restored(const gateway::Status& status) {
  const gateway::Restored before = std::exchange(restored_, status.restored);
  if (status.restored == before) return;
  const bool was_told = before == gateway::Restored::kTakenUp;
  switch (status.restored) {
    case gateway::Restored::kNothing:
    case gateway::Restored::kOffered:
      return;
    case gateway::Restored::kRefused:
      log_.warning("the saved biases cannot be right; calibrating");
      return;
    case gateway::Restored::kTakenUp:
    case gateway::Restored::kConfirmed:
      break;
  }
  if (!was_told) {
    log_.notice("restored the biases saved {} ago: {} {:+.5f}, {} {:+.5f} deg/s; the rate ± {:.5f}",
                age_text(status.restored_age_s), names_[0], status.gyros[0].bias_dps, names_[1],
                status.gyros[1].bias_dps, status.restored_bias_sigma_dps);
  }
  if (status.restored == gateway::Restored::kConfirmed) {
    log_.notice("a stop has confirmed the biases of the earlier run");
  }
}

void Reporter::tell_sent(const can::TransmitCounts& sent) {
  if (const std::uint64_t n = news(stale_, sent.dropped_stale); n > 0) {
    log_.tell(Severity::kWarning, {.cause = "stale"},
              "{} frames dropped: the bus did not take them in time", n);
  }
  if (const std::uint64_t n = news(overflow_, sent.dropped_overflow); n > 0) {
    log_.tell(Severity::kWarning, {.cause = "overflow"},
              "{} frames dropped: too many waited for the bus", n);
  }
  if (const std::uint64_t n = news(failed_, sent.dropped_failed); n > 0) {
    log_.tell(Severity::kWarning, {.cause = "refused"},
              "{} frames dropped: the link does not carry them", n);
  }
}

void Reporter::tell_bus(const BusStatus& bus, BusTold& told) {
  if (const std::uint64_t n = news(told.lost, bus.lost); n > 0) {
    log_.tell(Severity::kWarning, {.cause = "receive_overrun", .bus = bus.name},
              "{}: {} received frames lost: the socket's buffer was full", bus.name, n);
  }
  if (const std::uint64_t n = news(told.restamped, bus.restamped); n > 0) {
    log_.tell(Severity::kWarning, {.cause = "restamped", .bus = bus.name},
              "{}: {} frames had a stamp that is not the time of their arrival, so the time of "
              "reading is used; does a program on this host send them with a launch time "
              "(SO_TXTIME)?",
              bus.name, n);
  }
  if (const std::uint64_t n = news(told.foreign, bus.foreign); n > 0) {
    log_.tell(
        Severity::kWarning, {.cause = "foreign_frames", .bus = bus.name},
        "{}: {} frames with our identifiers came from another sender: is there a second "
        "gateway, or does the vehicle use them? [output] rate_id, bias_id and model_id choose "
        "others; a sensor that an [[output.layout]] takes the place of must be off the bus",
        bus.name, n);
  }
  for (std::size_t i = 0; i < can::kErrorCauseCount; ++i) {
    const auto cause = static_cast<can::ErrorCause>(i);
    if (const std::uint64_t n = news(told.errors[i], bus.errors[i]); n > 0) {
      const bool good = cause == can::ErrorCause::kRestarted;
      log_.tell(good ? Severity::kNotice : Severity::kWarning,
                {.cause = to_string(cause), .bus = bus.name}, "{}: {} {}", bus.name,
                sentence(cause), n == 1 ? std::string("once") : fmt::format("{} times", n));
    }
  }
}

std::string Reporter::biases(const gateway::Status& status) const {
  return fmt::format("{} {}, {} {}", names_[0], bias_text(status.gyros[0].bias_dps), names_[1],
                     bias_text(status.gyros[1].bias_dps));
}

void Reporter::summarize(const gateway::Status& status, const Traffic& traffic) {
  const can::TransmitCounts& sent = traffic.transmitted;
  const std::string stretches = gateway::stretches_text(gateway::steady_stretches(status));
  const std::string shadow =
      traffic.shadowed > 0 ? fmt::format(", {} not sent in shadow mode", traffic.shadowed) : "";
  log_.notice(
      "stopped: {} frames in ({} lost by the kernel), {} pairs, {} virtual rates ({} valid), "
      "{} frames out ({} stale, {} overflowed, {} refused, {} retries){}; {}{}bias {} deg/h",
      traffic.received(), traffic.lost(), status.pairs, status.rates_out, status.rates_out_valid,
      sent.sent, sent.dropped_stale, sent.dropped_overflow, sent.dropped_failed, sent.retries,
      shadow, stretches, stretches.empty() ? "" : "; ", biases(status));
}

}  // namespace vgyro::daemon
