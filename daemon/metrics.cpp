#include "daemon/metrics.h"

#include <cmath>
#include <cstdio>
#include <fcntl.h>
#include <iterator>
#include <string_view>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/whole_write.h"
#include "gateway/config.h"

namespace vgyro::daemon {
namespace {

using Labels = std::vector<std::pair<std::string_view, std::string_view>>;

std::string escaped(std::string_view value) {
  std::string out;
  for (const char c : value) {
    if (c == '\\' || c == '"') out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
  return out;
}

class Text {
 public:
  /// node_exporter merges the files of all gateways of a host, so each gateway needs a label.
  explicit Text(std::string_view instance)
      : common_(instance.empty() ? "" : fmt::format("gateway=\"{}\"", escaped(instance))) {}

  void family(std::string_view name, std::string_view type, std::string_view help) {
    name_ = name;
    fmt::format_to(std::back_inserter(text_), "# HELP {} {}\n# TYPE {} {}\n", name, help, name,
                   type);
  }
  void sample(const Labels& labels, double value) {
    line(labels, std::isfinite(value) ? fmt::format("{}", value) : "NaN");
  }
  void sample(const Labels& labels, std::uint64_t value) { line(labels, fmt::format("{}", value)); }
  void sample(const Labels& labels, bool value) { line(labels, value ? "1" : "0"); }
  std::string take() { return std::move(text_); }

 private:
  void line(const Labels& labels, const std::string& value) {
    text_ += name_;
    const bool labelled = !labels.empty() || !common_.empty();
    if (labelled) text_ += '{' + common_;
    std::string_view before = common_.empty() ? "" : ",";
    for (const auto& [key, content] : labels) {
      fmt::format_to(std::back_inserter(text_), "{}{}=\"{}\"", before, key, escaped(content));
      before = ",";
    }
    if (labelled) text_ += '}';
    fmt::format_to(std::back_inserter(text_), " {}\n", value);
  }

  std::string common_;
  std::string_view name_;
  std::string text_;
};

void add_build(Text& text, const Snapshot& now) {
  text.family("vgyro_build_info", "gauge",
              "Always 1: the version, and the method and fingerprint of the configuration in use.");
  text.sample({{"version", VGYRO_VERSION},
               {"fingerprint", now.fingerprint},
               {"method", gateway::to_string(now.plan->corrector.method)}},
              true);
}

void add_rate(Text& text, const Snapshot& now) {
  const gateway::Status& status = now.status;
  text.family("vgyro_state", "gauge", "The gateway's state: 1 for the present one.");
  for (int i = 0; i < gateway::kStateCount; ++i) {
    const auto state = static_cast<gateway::State>(i);
    text.sample({{"state", to_string(state)}}, status.state == state);
  }
  text.family("vgyro_rate_valid", "gauge", "1 while a valid rate goes out.");
  text.sample({}, std::isfinite(status.rate_dps));
  text.family("vgyro_rate_degrees_per_second", "gauge", "The virtual rate; NaN while invalid.");
  text.sample({}, status.rate_dps);
  text.family("vgyro_rate_sigma_degrees_per_second", "gauge", "Its standard deviation.");
  text.sample({}, status.sigma_dps);
  text.family("vgyro_bias_sigma_degrees_per_second", "gauge",
              "Standard deviation of the drift that is subtracted from the rate.");
  text.sample({}, status.bias_sigma_dps);
  text.family("vgyro_gyros_disagree", "gauge", "1 while the gyros contradict each other.");
  text.sample({}, status.disagree);
  text.family("vgyro_pair_contradicted", "gauge",
              "1 while the gyros cannot be on one platform, by reason; no rate is valid then.");
  for (std::size_t i = 1; i < fusion::kContradictions; ++i) {
    const auto contradiction = static_cast<fusion::Contradiction>(i);
    text.sample({{"why", gateway::to_string(contradiction)}},
                status.pair.contradiction == contradiction);
  }
  text.family("vgyro_ambiguous", "gauge",
              "1 while the data can be read in two ways; sigma spans both.");
  text.sample({}, status.ambiguous);
  text.family("vgyro_hypothesis_probability", "gauge", "Probability of each hypothesis.");
  for (std::size_t i = 0; i < status.probability.size(); ++i) {
    text.sample({{"hypothesis", gateway::to_string(static_cast<fusion::Hypothesis>(i))}},
                status.probability[i]);
  }
  text.family("vgyro_rates_too_far_apart", "gauge",
              "1 while no pairs can be formed: the gyros' rates are too far apart.");
  text.sample({}, status.rates_too_far_apart);
  text.family("vgyro_uptime_seconds", "gauge", "Since the start of the process.");
  text.sample({}, now.uptime_s);
  text.family("vgyro_transmit", "gauge", "1 while frames are sent, 0 in shadow mode.");
  text.sample({}, now.plan->output.transmit);
  text.family("vgyro_config_refused", "gauge", "1 while a configuration is refused.");
  text.sample({}, now.config_refused);
}

void add_counters(Text& text, const Snapshot& now) {
  const gateway::Status& status = now.status;
  const can::TransmitCounts& sent = now.traffic.transmitted;
  text.family("vgyro_pairs_total", "counter", "Aligned pairs of samples.");
  text.sample({}, status.pairs);
  text.family("vgyro_rates_total", "counter", "VG_Rate frames made, by whether they were valid.");
  text.sample({{"valid", "yes"}}, status.rates_out_valid);
  text.sample({{"valid", "no"}}, status.rates_out - status.rates_out_valid);
  // Gauges, not counters: a stretch whose verdict changes moves from one to another.
  text.family("vgyro_stops", "gauge",
              "Steady stretches so far, by whether they were taken for stops and learned from, for "
              "turns of both gyros together, or ended open.");
  text.sample({{"verdict", "learned"}}, status.stops);
  text.sample({{"verdict", "refused"}}, status.stops_refused);
  text.sample({{"verdict", "open"}}, status.stops_open);
  text.family("vgyro_last_stop_age_seconds", "gauge",
              "Since the last stop that was learned from; NaN before the first one.");
  text.sample({}, now.last_stop_age_s);
  text.family("vgyro_normalized_innovation", "gauge",
              "Squared deviation of the last measurements of the drifts from their prediction, by "
              "its expected variance: 1 where noise and drifts are as assumed; NaN before the "
              "first.");
  text.sample({}, status.normalized_innovation);
  text.family("vgyro_estimate_restarts_total", "counter",
              "Times that the estimate was not finite and was restarted: a fault of vgyro.");
  text.sample({}, status.estimate_restarts);
  text.family("vgyro_clock_steps_total", "counter", "Times that the stamps were set back.");
  text.sample({}, status.clock_steps);
  text.family("vgyro_sent_frames_total", "counter", "Frames sent.");
  text.sample({}, sent.sent);
  text.family("vgyro_dropped_frames_total", "counter", "Frames that did not go out, by cause.");
  text.sample({{"cause", "stale"}}, sent.dropped_stale);
  text.sample({{"cause", "overflow"}}, sent.dropped_overflow);
  text.sample({{"cause", "refused"}}, sent.dropped_failed);
  text.family("vgyro_shadowed_frames_total", "counter",
              "Frames that shadow mode kept from the buses.");
  text.sample({}, now.traffic.shadowed);
  text.family("vgyro_log_lines_lost_total", "counter", "Lines lost because nothing reads the log.");
  text.sample({}, now.log_lines_lost);
  text.family("vgyro_service_messages_lost_total", "counter",
              "Messages that the service manager did not take at once.");
  text.sample({}, now.service_messages_lost);
}

void add_layouts(Text& text, const Snapshot& now) {
  const std::vector<gateway::OutputLayout>& layouts = now.plan->output.layouts;
  if (layouts.empty()) return;
  const auto each = [&](const auto& add) {
    for (std::size_t i = 0; i < layouts.size(); ++i) {
      const gateway::OutputLayout& layout = layouts[i];
      const std::string id = gateway::to_string(gateway::FrameId{layout.id, layout.extended});
      add(Labels{{"message", layout.message}, {"bus", now.plan->buses[layout.bus]}, {"id", id}},
          now.status.layouts_out[i]);
    }
  };
  using Counts = const gateway::LayoutCounts&;
  text.family("vgyro_layout_frames_total", "counter",
              "Frames of each [[output.layout]] made, by whether their rate was valid.");
  each([&](Labels labels, Counts counts) {
    labels.emplace_back("valid", "yes");
    text.sample(labels, counts.valid);
    labels.back().second = "no";
    text.sample(labels, counts.frames - counts.valid);
  });
  text.family("vgyro_layout_out_of_range_total", "counter",
              "Rates that the layout cannot carry, or whose standard deviation it cannot.");
  each([&](const Labels& labels, Counts counts) { text.sample(labels, counts.out_of_range); });
  text.family("vgyro_layout_withheld_total", "counter",
              "Frames not sent because the layout cannot say that no rate is valid.");
  each([&](const Labels& labels, Counts counts) { text.sample(labels, counts.withheld); });
}

void add_gyros(Text& text, const Snapshot& now) {
  const auto each = [&](const auto& add) {
    for (std::size_t k = 0; k < now.status.gyros.size(); ++k)
      add(std::string_view(now.plan->gyros[k].name), now.status.gyros[k], k);
  };
  using Gyro = const gateway::GyroStatus&;
  using Name = std::string_view;
  text.family("vgyro_gyro_in_use", "gauge", "1 while the gyro's samples are used.");
  each([&](Name name, Gyro gyro, std::size_t) { text.sample({{"gyro", name}}, gyro.heard); });
  text.family("vgyro_gyro_rate_degrees_per_second", "gauge", "Last sample of the gyro.");
  each([&](Name name, Gyro gyro, std::size_t) {
    text.sample({{"gyro", name}}, gyro.last_rate_dps);
  });
  text.family("vgyro_gyro_bias_degrees_per_second", "gauge",
              "Bias of the gyro; NaN until calibrated.");
  each([&](Name name, Gyro gyro, std::size_t) { text.sample({{"gyro", name}}, gyro.bias_dps); });
  text.family("vgyro_gyro_bias_sigma_degrees_per_second", "gauge", "How well that is known.");
  each([&](Name name, Gyro, std::size_t k) {
    text.sample({{"gyro", name}}, now.bias_sigma_dps[k]);
  });
  text.family("vgyro_gyro_bias_slope_degrees_per_second_squared", "gauge",
              "Slope of the bias; NaN if unknown.");
  each([&](Name name, Gyro, std::size_t k) { text.sample({{"gyro", name}}, now.slope_dps_s[k]); });
  text.family("vgyro_gyro_bias_slope_sigma_degrees_per_second_squared", "gauge",
              "How well that is known.");
  each([&](Name name, Gyro, std::size_t k) {
    text.sample({{"gyro", name}}, now.slope_sigma_dps_s[k]);
  });
  text.family("vgyro_gyro_temperature_celsius", "gauge", "NaN if the gyro sends none.");
  each([&](Name name, Gyro gyro, std::size_t) {
    text.sample({{"gyro", name}}, gyro.temperature_c);
  });
  text.family("vgyro_gyro_frames_total", "counter", "Frames with its identifier.");
  each([&](Name name, Gyro gyro, std::size_t) { text.sample({{"gyro", name}}, gyro.frames); });
  text.family("vgyro_gyro_missing_frames_total", "counter",
              "Frames missing by the gyro's counter.");
  each([&](Name name, Gyro gyro, std::size_t) { text.sample({{"gyro", name}}, gyro.missing); });
  text.family("vgyro_gyro_rejected_frames_total", "counter", "Frames not used, by cause.");
  each([&](Name name, Gyro gyro, std::size_t) {
    for (std::size_t i = 0; i < gateway::kRejectCount; ++i) {
      text.sample({{"gyro", name}, {"cause", to_string(static_cast<gateway::Reject>(i))}},
                  gyro.rejected[i]);
    }
  });
  text.family("vgyro_gyro_faults_total", "counter", "Times that a fault began.");
  each([&](Name name, Gyro gyro, std::size_t) {
    for (std::size_t i = 0; i < gateway::kFaultCount; ++i) {
      text.sample({{"gyro", name}, {"fault", to_string(static_cast<gateway::Fault>(i))}},
                  gyro.faults[i].times);
    }
  });
}

// Only if the inputs are recorded.
void add_captures(Text& text, const Snapshot& now) {
  if (!now.capture) return;
  const CaptureStatus& capture = *now.capture;
  text.family("vgyro_captures_total", "counter",
              "Recordings of the inputs that were written, by cause.");
  for (std::size_t i = 0; i < kCaptureCauses; ++i)
    text.sample({{"cause", to_string(static_cast<CaptureCause>(i))}}, capture.written[i]);
  text.family("vgyro_captures_failed_total", "counter", "Recordings that could not be written.");
  text.sample({}, capture.failed);
  text.family("vgyro_captures_held_back_total", "counter",
              "Causes of a recording that came too soon after one of their kind.");
  text.sample({}, capture.held_back);
  text.family("vgyro_capture_held_seconds", "gauge",
              "Time from the first to the last frame in memory, ready to be written.");
  text.sample({}, capture.ring.seconds);
  text.family("vgyro_capture_held_frames", "gauge", "Frames in memory.");
  text.sample({}, capture.ring.frames);
  text.family("vgyro_capture_held_bytes", "gauge", "Memory that they take, packed.");
  text.sample({}, capture.ring.bytes);
  text.family("vgyro_capture_dropped_frames_total", "counter",
              "Frames missing in the recording: no processor time, or no memory, to pack them.");
  text.sample({}, capture.ring.dropped);
}

// The metrics of each axis, on a platform with several.
void add_axes(Text& text, const Snapshot& now) {
  if (now.axes.empty()) return;
  const auto each = [&](const auto& add) {
    for (std::size_t i = 0; i < now.axes.size(); ++i) {
      const std::string axis(1, gateway::kAxisNames[now.plan->axes[i].axis]);
      add(Labels{{"axis", axis}}, now.axes[i]);
    }
  };
  using Axis = const gateway::Status&;
  text.family("vgyro_axis_state", "gauge", "The state of each axis: 1 for the present one.");
  each([&](Labels labels, Axis axis) {
    labels.emplace_back("state", "");
    for (int i = 0; i < gateway::kStateCount; ++i) {
      labels.back().second = to_string(static_cast<gateway::State>(i));
      text.sample(labels, axis.state == static_cast<gateway::State>(i));
    }
  });
  text.family("vgyro_axis_rate_degrees_per_second", "gauge",
              "The virtual rate about it; NaN while invalid.");
  each([&](const Labels& labels, Axis axis) { text.sample(labels, axis.rate_dps); });
  text.family("vgyro_axis_rate_sigma_degrees_per_second", "gauge", "Its standard deviation.");
  each([&](const Labels& labels, Axis axis) { text.sample(labels, axis.sigma_dps); });
  text.family("vgyro_axis_bias_degrees_per_second", "gauge",
              "Drift of each unit about it; NaN until calibrated.");
  each([&](Labels labels, Axis axis) {
    labels.emplace_back("gyro", "");
    for (std::size_t k = 0; k < 2; ++k) {
      labels.back().second = now.plan->gyros[k].name;
      text.sample(labels, axis.gyros[k].bias_dps);
    }
  });
  text.family("vgyro_axis_faults_total", "counter", "Times that a fault of a unit's axis began.");
  each([&](Labels labels, Axis axis) {
    labels.emplace_back("gyro", "");
    labels.emplace_back("fault", "");
    for (std::size_t k = 0; k < 2; ++k) {
      labels[1].second = now.plan->gyros[k].name;
      for (std::size_t i = 0; i < gateway::kFaultCount; ++i) {
        labels[2].second = to_string(static_cast<gateway::Fault>(i));
        text.sample(labels, axis.gyros[k].faults[i].times);
      }
    }
  });
}

void add_misalignment(Text& text, const Snapshot& now) {
  if (now.axes.empty()) return;
  text.family("vgyro_misalignment_degrees", "gauge",
              "Rotation of the second unit against the first, about each axis.");
  for (std::size_t i = 0; i < gateway::kAxes; ++i)
    text.sample({{"axis", std::string_view(&gateway::kAxisNames[i], 1)}},
                now.status.misalignment_deg[i]);
  text.family("vgyro_misalignment_sigma_degrees", "gauge", "How well that is known.");
  for (std::size_t i = 0; i < gateway::kAxes; ++i)
    text.sample({{"axis", std::string_view(&gateway::kAxisNames[i], 1)}},
                now.status.misalignment_sigma_deg[i]);
}

// Few gyros send their supply voltage; if neither does, there is no family full of NaN.
void add_supply(Text& text, const Snapshot& now) {
  const auto& gyros = now.plan->gyros;
  if (!gyros[0].supply_voltage && !gyros[1].supply_voltage) return;
  text.family("vgyro_gyro_supply_volts", "gauge", "NaN until the first value arrives.");
  for (std::size_t k = 0; k < gyros.size(); ++k) {
    if (gyros[k].supply_voltage)
      text.sample({{"gyro", gyros[k].name}}, now.status.gyros[k].supply_v);
  }
}

void add_buses(Text& text, const Snapshot& now) {
  const std::vector<BusStatus>& buses = now.traffic.buses;
  text.family("vgyro_bus_up", "gauge", "1 while the interface is there and its link is up.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.link_up);
  text.family("vgyro_bus_off", "gauge", "1 while its controller is bus-off.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.controller == can::ControllerState::kBusOff);
  text.family("vgyro_bus_received_frames_total", "counter", "Frames that passed the filters.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.received);
  text.family("vgyro_bus_lost_frames_total", "counter", "Lost in the socket's buffer.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.lost);
  text.family("vgyro_bus_link_downs_total", "counter",
              "Times that the link went down, or the interface was removed while up.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.downs);
  text.family("vgyro_bus_restamped_frames_total", "counter",
              "Frames whose stamp was no time of arrival: the time of reading is used.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.restamped);
  text.family("vgyro_bus_foreign_frames_total", "counter",
              "Frames with our identifiers from another sender.");
  for (const BusStatus& bus : buses)
    text.sample({{"bus", bus.name}}, bus.foreign);
  text.family("vgyro_bus_errors_total", "counter",
              "Errors that its controller reported, by cause.");
  for (const BusStatus& bus : buses) {
    for (std::size_t i = 0; i < can::kErrorCauseCount; ++i) {
      text.sample({{"bus", bus.name}, {"cause", to_string(static_cast<can::ErrorCause>(i))}},
                  bus.errors[i]);
    }
  }
}

}  // namespace

std::string metrics_text(const Snapshot& now) {
  Text text(now.instance);
  add_build(text, now);
  add_rate(text, now);
  add_counters(text, now);
  add_layouts(text, now);
  add_gyros(text, now);
  add_supply(text, now);
  add_axes(text, now);
  add_misalignment(text, now);
  add_buses(text, now);
  add_captures(text, now);
  return text.take();
}

MetricsFile::MetricsFile(std::string path, Log& log)
    : path_(std::move(path)),
      new_path_(path_ + ".new"),
      log_(log),
      writer_([this](const std::string& text) { return replace(text); }) {}

bool MetricsFile::second_passed() {
  if (const std::optional<Expected<void>> written = writer_.take_result()) {
    const bool failed_before = std::exchange(failed_, !*written);
    if (!*written && !failed_before) log_.warning("{}", written->error().message());
    if (*written && failed_before) log_.notice("{}: written again", path_);
  }
  return second_++ % kPeriod_s == 0;
}

// No fsync: after a loss of power the metrics are outdated anyway.
Expected<void> MetricsFile::replace(const std::string& text) const {
  const int fd =
      ::open(new_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0644);
  // Readable by all users, whatever the service's umask.
  const bool whole = fd >= 0 && ::fchmod(fd, 0644) == 0 && write_all(fd, text);
  if (whole && ::close(fd) == 0 && ::rename(new_path_.c_str(), path_.c_str()) == 0) return {};
  auto failed = fail(path_, "metrics cannot be written: " + system_reason(),
                     "name a file in a folder that the gateway may write to (--metrics FILE)");
  if (fd >= 0 && !whole) ::close(fd);
  ::unlink(new_path_.c_str());
  return failed;
}

}  // namespace vgyro::daemon
