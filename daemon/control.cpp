#include "daemon/control.h"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <new>
#include <string_view>
#include <utility>

#include "gateway/condition_text.h"
#include "gateway/config.h"

namespace vgyro::daemon {
namespace {

constexpr const char* kInterfaceName = "org.vgyro.Gateway1";
constexpr const char* kPath = "/org/vgyro/Gateway1";
constexpr const char* kNothingToSave = "org.vgyro.Error.NothingToSave";
constexpr const char* kNoCapture = "org.vgyro.Error.NoCapture";

/// Writes one dictionary {string: variant} or {string: number}; keeps the first error.
class Dictionary {
 public:
  Dictionary(sd_bus_message* message, const char* entry) : message_(message), entry_(entry) {
    keep(sd_bus_message_open_container(message_, 'a', entry_));
  }

  void put(const char* key, const std::string& value) {
    keep(sd_bus_message_append(message_, "{sv}", key, "s", value.c_str()));
  }
  void put(const char* key, double value) {
    keep(sd_bus_message_append(message_, "{sv}", key, "d", value));
  }
  void put(const char* key, bool value) {
    keep(sd_bus_message_append(message_, "{sv}", key, "b", static_cast<int>(value)));
  }
  void put(const char* key, std::uint64_t value) {
    keep(sd_bus_message_append(message_, "{sv}", key, "t", value));
  }
  void put_number(std::string_view key, double value) {
    keep(sd_bus_message_append(message_, "{sd}", std::string(key).c_str(), value));
  }
  void put_count(std::string_view key, std::uint64_t value) {
    keep(sd_bus_message_append(message_, "{st}", std::string(key).c_str(), value));
  }

  /// A dictionary of counters as the value of `key`.
  template <class Counts, class NameOf>
  void put_counts(const char* key, const Counts& counts, const NameOf& name_of) {
    keep(sd_bus_message_open_container(message_, 'e', "sv"));
    keep(sd_bus_message_append(message_, "s", key));
    keep(sd_bus_message_open_container(message_, 'v', "a{st}"));
    Dictionary inner(message_, "{st}");
    for (std::size_t i = 0; i < counts.size(); ++i)
      inner.put_count(name_of(i), counts[i]);
    keep(inner.close());
    keep(sd_bus_message_close_container(message_));
    keep(sd_bus_message_close_container(message_));
  }

  int close() {
    keep(sd_bus_message_close_container(message_));
    return result_;
  }

 private:
  void keep(int result) {
    if (result < 0 && result_ >= 0) result_ = result;
  }
  sd_bus_message* message_;
  const char* entry_;
  int result_ = 0;
};

int append_gyro(sd_bus_message* reply, const Snapshot& now, std::size_t k) {
  const gateway::GyroPlan& plan = now.plan->gyros[k];
  const gateway::GyroStatus& gyro = now.status.gyros[k];
  std::array<std::uint64_t, gateway::kFaultCount> faults{};
  for (std::size_t i = 0; i < faults.size(); ++i)
    faults[i] = gyro.faults[i].times;
  Dictionary fields(reply, "{sv}");
  fields.put("name", plan.name);
  fields.put("bus", plan.bus);
  fields.put("message", plan.message);
  fields.put("in_use", gyro.heard);
  fields.put("health", health_text(gyro));
  fields.put("rate_dps", gyro.last_rate_dps);
  fields.put("bias_dps", gyro.bias_dps);
  fields.put("bias_sigma_dps", now.bias_sigma_dps[k]);
  fields.put("slope_dps_s", now.slope_dps_s[k]);
  fields.put("slope_sigma_dps_s", now.slope_sigma_dps_s[k]);
  fields.put("temperature_c", gyro.temperature_c);
  if (plan.supply_voltage) fields.put("supply_v", gyro.supply_v);
  fields.put("frames", gyro.frames);
  fields.put("samples", gyro.samples);
  fields.put("missing", gyro.missing);
  fields.put("unpaired", gyro.unpaired);
  fields.put_counts("rejected", gyro.rejected,
                    [](std::size_t i) { return to_string(static_cast<gateway::Reject>(i)); });
  fields.put_counts("faults", faults,
                    [](std::size_t i) { return to_string(static_cast<gateway::Fault>(i)); });
  return fields.close();
}

int append_bus(sd_bus_message* reply, const BusStatus& bus) {
  Dictionary fields(reply, "{sv}");
  fields.put("name", bus.name);
  fields.put("present", bus.present);
  fields.put("link_up", bus.link_up);
  fields.put("controller", std::string(to_string(bus.controller)));
  fields.put("received", bus.received);
  fields.put("lost", bus.lost);
  fields.put("downs", bus.downs);
  fields.put("reopened", bus.reopened);
  fields.put("restamped", bus.restamped);
  fields.put("foreign", bus.foreign);
  fields.put("contested", bus.contested);
  fields.put_counts("errors", bus.errors,
                    [](std::size_t i) { return to_string(static_cast<can::ErrorCause>(i)); });
  return fields.close();
}

int append_gyros(sd_bus_message* reply, const Snapshot& now) {
  int result = sd_bus_message_open_container(reply, 'a', "a{sv}");
  for (std::size_t k = 0; k < now.status.gyros.size() && result >= 0; ++k)
    result = append_gyro(reply, now, k);
  return result < 0 ? result : sd_bus_message_close_container(reply);
}

// One axis of a platform with several.
int append_axis(sd_bus_message* reply, const Snapshot& now, std::size_t place) {
  const gateway::Status& status = now.axes[place];
  const std::size_t axis = now.plan->axes[place].axis;
  Dictionary fields(reply, "{sv}");
  fields.put("axis", std::string(1, gateway::kAxisNames[axis]));
  fields.put("state", std::string(to_string(status.state)));
  fields.put("quality", std::string(to_string(status.quality)));
  fields.put("rate_dps", status.rate_dps);
  fields.put("sigma_dps", status.sigma_dps);
  fields.put("bias_sigma_dps", status.bias_sigma_dps);
  for (std::size_t k = 0; k < 2; ++k) {
    const std::string number = std::to_string(k + 1);
    fields.put(("bias_" + number + "_dps").c_str(), status.gyros[k].bias_dps);
    fields.put(("health_" + number).c_str(), health_text(status.gyros[k]));
  }
  fields.put("normalized_innovation", status.normalized_innovation);
  fields.put("misalignment_deg", now.status.misalignment_deg[axis]);
  fields.put("misalignment_sigma_deg", now.status.misalignment_sigma_deg[axis]);
  fields.put("stops", status.stops);
  fields.put("pairs", status.pairs);
  return fields.close();
}

int append_axes(sd_bus_message* reply, const Snapshot& now) {
  int result = sd_bus_message_open_container(reply, 'a', "a{sv}");
  for (std::size_t place = 0; place < now.axes.size() && result >= 0; ++place)
    result = append_axis(reply, now, place);
  return result < 0 ? result : sd_bus_message_close_container(reply);
}

int append_buses(sd_bus_message* reply, const Snapshot& now) {
  int result = sd_bus_message_open_container(reply, 'a', "a{sv}");
  for (const BusStatus& bus : now.traffic.buses) {
    if (result >= 0) result = append_bus(reply, bus);
  }
  return result < 0 ? result : sd_bus_message_close_container(reply);
}

int append_counters(sd_bus_message* reply, const Snapshot& now) {
  const gateway::Status& status = now.status;
  const can::TransmitCounts& sent = now.traffic.transmitted;
  const gateway::LayoutCounts layouts = status.layouts_total();
  const std::pair<const char*, std::uint64_t> counters[] = {
      {"pairs", status.pairs},
      {"rates", status.rates_out},
      {"rates_valid", status.rates_out_valid},
      {"rates_out_of_range", status.rates_out_of_range},
      {"biases", status.biases_out},
      {"layout_frames", layouts.frames},
      {"layout_frames_valid", layouts.valid},
      {"layout_out_of_range", layouts.out_of_range},
      {"layout_withheld", layouts.withheld},
      {"windows", status.windows},
      {"windows_skipped", status.windows_skipped},
      {"stops", status.stops},
      {"stops_refused", status.stops_refused},
      {"stops_open", status.stops_open},
      {"estimate_restarts", status.estimate_restarts},
      {"disagreements", status.disagreements},
      {"contradictions", status.contradictions},
      {"calibration_restarts", status.calibration_restarts},
      {"clock_steps", status.clock_steps},
      {"reference_rejected", status.reference_rejected},
      {"accelerometer_rejected", status.accelerometer_rejected},
      {"speed_rejected", status.speed_rejected},
      {"frames_received", now.traffic.received()},
      {"frames_lost", now.traffic.lost()},
      {"frames_sent", sent.sent},
      {"frames_stale", sent.dropped_stale},
      {"frames_overflowed", sent.dropped_overflow},
      {"frames_refused", sent.dropped_failed},
      {"send_retries", sent.retries},
      {"frames_shadowed", now.traffic.shadowed},
      {"log_lines_lost", now.log_lines_lost},
      {"service_messages_lost", now.service_messages_lost},
  };
  Dictionary fields(reply, "{st}");
  for (const auto& [name, count] : counters)
    fields.put_count(name, count);
  return fields.close();
}

int append_hypotheses(sd_bus_message* reply, const Snapshot& now) {
  Dictionary fields(reply, "{sd}");
  for (std::size_t i = 0; i < now.status.probability.size(); ++i) {
    if (now.status.probability[i] <= gateway::kWorthTelling) continue;
    fields.put_number(gateway::to_string(static_cast<fusion::Hypothesis>(i)),
                      now.status.probability[i]);
  }
  return fields.close();
}

// Empty if the inputs are not recorded.
int append_captures(sd_bus_message* reply, const Snapshot& now) {
  Dictionary fields(reply, "{sv}");
  if (now.capture) {
    const CaptureStatus& capture = *now.capture;
    fields.put("directory", capture.directory);
    fields.put("held_s", capture.ring.seconds);
    fields.put("held_frames", capture.ring.frames);
    fields.put("held_bytes", capture.ring.bytes);
    fields.put("frames_dropped", capture.ring.dropped);
    fields.put("is_writing", capture.is_writing);
    fields.put_counts("written", capture.written,
                      [](std::size_t i) { return to_string(static_cast<CaptureCause>(i)); });
    fields.put("failed", capture.failed);
    fields.put("held_back", capture.held_back);
    fields.put("last", capture.last);
  }
  return fields.close();
}

int append_text(sd_bus_message* reply, std::string_view text) {
  return sd_bus_message_append(reply, "s", std::string(text).c_str());
}
int append_number(sd_bus_message* reply, double number) {
  return sd_bus_message_append(reply, "d", number);
}
int append_flag(sd_bus_message* reply, bool flag) {
  return sd_bus_message_append(reply, "b", static_cast<int>(flag));
}

// sd-bus is C: nothing may be thrown through it.
template <class Answer>
int or_no_memory(const Answer& answer) {
  try {
    return answer();
  } catch (const std::bad_alloc&) {
    return -ENOMEM;
  }
}

using Append = int (*)(sd_bus_message*, const Snapshot&);

struct Property {
  const char* name;
  Append append;
};

constexpr Property kProperties[] = {
    {"Version", [](sd_bus_message* m, const Snapshot&) { return append_text(m, VGYRO_VERSION); }},
    {"Instance",
     [](sd_bus_message* m, const Snapshot& now) { return append_text(m, now.instance); }},
    {"Method",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_text(m, gateway::to_string(now.plan->corrector.method));
     }},
    {"Fingerprint",
     [](sd_bus_message* m, const Snapshot& now) { return append_text(m, now.fingerprint); }},
    {"UptimeS",
     [](sd_bus_message* m, const Snapshot& now) { return append_number(m, now.uptime_s); }},
    {"ConfigRefused",
     [](sd_bus_message* m, const Snapshot& now) { return append_flag(m, now.config_refused); }},
    {"Transmit", [](sd_bus_message* m,
                    const Snapshot& now) { return append_flag(m, now.plan->output.transmit); }},
    {"State", [](sd_bus_message* m,
                 const Snapshot& now) { return append_text(m, to_string(now.status.state)); }},
    {"Quality", [](sd_bus_message* m,
                   const Snapshot& now) { return append_text(m, to_string(now.status.quality)); }},
    {"Restored",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_text(m, to_string(now.status.restored));
     }},
    {"Valid",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_flag(m, std::isfinite(now.status.rate_dps));
     }},
    {"Disagree",
     [](sd_bus_message* m, const Snapshot& now) { return append_flag(m, now.status.disagree); }},
    {"Contradiction",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_text(m, gateway::to_string(now.status.pair.contradiction));
     }},
    {"ContradictionText",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_text(
           m, gateway::contradiction_text(now.status.pair,
                                          {now.plan->gyros[0].name, now.plan->gyros[1].name}));
     }},
    {"Ambiguous",
     [](sd_bus_message* m, const Snapshot& now) { return append_flag(m, now.status.ambiguous); }},
    {"RatesTooFarApart",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_flag(m, now.status.rates_too_far_apart);
     }},
    {"Hypotheses", append_hypotheses},
    {"RateDps",
     [](sd_bus_message* m, const Snapshot& now) { return append_number(m, now.status.rate_dps); }},
    {"SigmaDps",
     [](sd_bus_message* m, const Snapshot& now) { return append_number(m, now.status.sigma_dps); }},
    {"BiasSigmaDps",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_number(m, now.status.bias_sigma_dps);
     }},
    {"LastStopAgeS",
     [](sd_bus_message* m, const Snapshot& now) { return append_number(m, now.last_stop_age_s); }},
    {"NormalizedInnovation",
     [](sd_bus_message* m, const Snapshot& now) {
       return append_number(m, now.status.normalized_innovation);
     }},
    {"CalibratedS", [](sd_bus_message* m,
                       const Snapshot& now) { return append_number(m, now.status.calibrated_s); }},
    {"RestS", [](sd_bus_message* m,
                 const Snapshot& now) { return append_number(m, now.plan->calibration.rest_s); }},
    {"Gyros", append_gyros},
    {"Axes", append_axes},
    {"Buses", append_buses},
    {"Counters", append_counters},
    {"Captures", append_captures},
};

}  // namespace

// Without SD_BUS_VTABLE_UNPRIVILEGED, sd-bus asks the bus for the caller of a method and waits for
// the answer. The policy file decides who may call.
const sd_bus_vtable Control::kInterface[] = {
    SD_BUS_VTABLE_START(0),
    SD_BUS_PROPERTY("Version", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_CONST),
    SD_BUS_PROPERTY("Instance", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_CONST),
    SD_BUS_PROPERTY("Method", "s", on_get, 0, 0),
    SD_BUS_PROPERTY("Fingerprint", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("UptimeS", "d", on_get, 0, 0),
    SD_BUS_PROPERTY("ConfigRefused", "b", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Transmit", "b", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("State", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Quality", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Restored", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Valid", "b", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Disagree", "b", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Contradiction", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("ContradictionText", "s", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Ambiguous", "b", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("RatesTooFarApart", "b", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Hypotheses", "a{sd}", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("RateDps", "d", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("SigmaDps", "d", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("BiasSigmaDps", "d", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("LastStopAgeS", "d", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("NormalizedInnovation", "d", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("CalibratedS", "d", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("RestS", "d", on_get, 0, 0),
    SD_BUS_PROPERTY("Gyros", "aa{sv}", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Axes", "aa{sv}", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
    SD_BUS_PROPERTY("Buses", "aa{sv}", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_INVALIDATION),
    SD_BUS_PROPERTY("Counters", "a{st}", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_INVALIDATION),
    SD_BUS_PROPERTY("Captures", "a{sv}", on_get, 0, SD_BUS_VTABLE_PROPERTY_EMITS_INVALIDATION),
    SD_BUS_METHOD("Capture", "", "s", on_capture, SD_BUS_VTABLE_UNPRIVILEGED),
    SD_BUS_METHOD("Recalibrate", "", "", on_recalibrate, SD_BUS_VTABLE_UNPRIVILEGED),
    SD_BUS_METHOD("SaveState", "", "", on_save_state, SD_BUS_VTABLE_UNPRIVILEGED),
    SD_BUS_VTABLE_END};

Control::Control(sd_event* events, Gateway gateway, std::string bus_name, Log& log)
    : events_(events), gateway_(std::move(gateway)), bus_name_(std::move(bus_name)), log_(log) {
  connect();
}

Control::~Control() {
  if (bus_ != nullptr) sd_bus_close_unref(bus_);  // flushing would wait
}

// No step waits: the handshake runs in the event loop, and on_name() receives the reply for the
// name.
void Control::connect() {
  wait_ = kRetrySeconds;
  has_name_ = false;
  int result = sd_bus_open_system(&bus_);
  if (result >= 0) result = sd_bus_attach_event(bus_, events_, SD_EVENT_PRIORITY_NORMAL);
  if (result >= 0) {
    result = sd_bus_add_object_vtable(bus_, nullptr, kPath, kInterfaceName, kInterface, this);
  }
  if (result >= 0)
    result = sd_bus_request_name_async(bus_, nullptr, bus_name_.c_str(), 0, &on_name, this);
  if (result < 0) disconnect(-result);
}

void Control::disconnect(int error) {
  if (bus_ != nullptr) {
    sd_bus_detach_event(bus_);
    sd_bus_close_unref(bus_);
    bus_ = nullptr;
  }
  if (std::exchange(told_of_failure_, true)) return;
  log_.tell(Severity::kNotice, {.cause = "no_dbus"},
            "no D-Bus: {}; `vgyro status` does not work until there is one", system_reason(error));
}

int Control::on_name(sd_bus_message* reply, void* self, sd_bus_error*) {
  constexpr std::uint32_t kOwner = 1;
  constexpr std::uint32_t kOwnerAlready = 4;
  auto& control = *static_cast<Control*>(self);
  std::uint32_t answer = 0;
  const char* why = "another gateway has it";
  if (sd_bus_message_is_method_error(reply, nullptr) != 0) {
    why = sd_bus_message_get_error(reply)->message;
  } else {
    sd_bus_message_read(reply, "u", &answer);
  }
  control.has_name_ = answer == kOwner || answer == kOwnerAlready;
  if (control.has_name_ && std::exchange(control.told_of_failure_, false)) {
    control.log_.notice("on D-Bus as {}", control.bus_name_);
  }
  if (control.has_name_ || std::exchange(control.told_of_failure_, true)) return 0;
  control.log_.tell(Severity::kNotice, {.cause = "no_dbus"},
                    "the bus does not give the name {}: {}; trying on (org.vgyro.Gateway1.conf "
                    "belongs into /usr/share/dbus-1/system.d)",
                    control.bus_name_, why == nullptr ? "no reason given" : why);
  return 0;
}

void Control::second_passed() {
  if (bus_ != nullptr && sd_bus_is_open(bus_) <= 0) disconnect(ECONNRESET);
  if (wait_ > 0) --wait_;
  if (bus_ == nullptr && wait_ == 0) connect();
  // The daemon that owns the name may end, or the policy file may change.
  if (bus_ != nullptr && !has_name_ && wait_ == 0) {
    wait_ = kRetrySeconds;
    sd_bus_request_name_async(bus_, nullptr, bus_name_.c_str(), 0, &on_name, this);
  }
  if (has_name_) tell_changes();
}

void Control::tell_changes() {
  std::uint64_t queued = 0;
  if (sd_bus_get_n_queued_write(bus_, &queued) < 0 || queued > kQueuedMost) return;
  sd_bus_emit_properties_changed(
      bus_, kPath, kInterfaceName, "State", "Quality", "Restored", "Valid", "Disagree",
      "Contradiction", "ContradictionText", "Ambiguous", "RatesTooFarApart", "Hypotheses",
      "RateDps", "SigmaDps", "BiasSigmaDps", "CalibratedS", "ConfigRefused", "Transmit",
      "Fingerprint", "LastStopAgeS", "Gyros", "Buses", "Counters", "Captures", nullptr);
}

int Control::on_get(sd_bus*, const char*, const char*, const char* property, sd_bus_message* reply,
                    void* self, sd_bus_error*) {
  return or_no_memory([&] {
    const Snapshot& now = static_cast<Control*>(self)->gateway_.snapshot();
    for (const Property& one : kProperties) {
      if (std::strcmp(one.name, property) == 0) return one.append(reply, now);
    }
    return -ENOENT;
  });
}

int Control::on_recalibrate(sd_bus_message* call, void* self, sd_bus_error*) {
  static_cast<Control*>(self)->gateway_.recalibrate();
  return sd_bus_reply_method_return(call, "");
}

// Replies once the capture is on the disk, which may take seconds; sd-bus serves other calls
// meanwhile.
int Control::on_capture(sd_bus_message* call, void* self, sd_bus_error* error) {
  return or_no_memory([&] {
    const std::shared_ptr<sd_bus_message> asked(sd_bus_message_ref(call), &sd_bus_message_unref);
    const Expected<void> begun =
        static_cast<Control*>(self)->gateway_.capture([asked](const Expected<std::string>& folder) {
          if (folder) {
            sd_bus_reply_method_return(asked.get(), "s", folder->c_str());
          } else {
            sd_bus_reply_method_errorf(asked.get(), kNoCapture, "%s",
                                       folder.error().message().c_str());
          }
        });
    if (!begun) return sd_bus_error_set(error, kNoCapture, begun.error().message().c_str());
    return 1;
  });
}

int Control::on_save_state(sd_bus_message* call, void* self, sd_bus_error* error) {
  return or_no_memory([&] {
    const Expected<void> saved = static_cast<Control*>(self)->gateway_.save_state();
    if (!saved) return sd_bus_error_set(error, kNothingToSave, saved.error().message().c_str());
    return sd_bus_reply_method_return(call, "");
  });
}

}  // namespace vgyro::daemon
