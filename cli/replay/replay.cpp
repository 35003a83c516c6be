#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <span>
#include <sys/stat.h>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/spelling.h"
#include "canlog/candump.h"
#include "canlog/merged_reader.h"
#include "cli/axis_choice.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/log_notes.h"
#include "cli/log_progress.h"
#include "cli/other_senders.h"
#include "cli/output/errors.h"
#include "cli/output/gnuplot.h"
#include "cli/output/json_text.h"
#include "cli/output/output_file.h"
#include "cli/output/overwrite.h"
#include "cli/output/terminal.h"
#include "cli/output/unfinished.h"
#include "cli/replay/page.h"
#include "cli/replay/plot.h"
#include "cli/replay/rate_table.h"
#include "cli/replay/summary.h"
#include "gateway/condition_text.h"
#include "gateway/config.h"
#include "gateway/pipeline.h"
#include "gateway/saved_state.h"

namespace vgyro::cli {

namespace {

// As many as stay in the L1 cache between the parser and the pipeline.
constexpr std::size_t kRecordsAtOnce = 64;
constexpr can::BusIndex kForeignBus = 0xFF;

// Writes frames of the pipeline as candump lines.
class LineSink final : public gateway::FrameSink {
 public:
  LineSink(OutputFile& file, const gateway::Plan& plan)
      : file_(file),
        buses_(plan.buses.begin(), plan.buses.end()),
        lines_(&buses_[plan.output.bus]) {}
  [[gnu::flatten]] void put(const can::Frame& frame, TimePoint stamp) override {
    put_line(*lines_, frame, stamp);
  }
  void put_on(can::BusIndex bus, const can::Frame& frame, TimePoint stamp) override {
    put_line(buses_[bus], frame, stamp);
  }
  unsigned fraction_digits = 6;
  std::uint64_t frames = 0;

 private:
  void put_line(canlog::LineFormatter& lines, const can::Frame& frame, TimePoint stamp) {
    char* room = file_.room(canlog::kLineBytesMax);
    file_.commit(lines.format(room, stamp, frame, fraction_digits));
    ++frames;
  }

  OutputFile& file_;
  std::vector<canlog::LineFormatter> buses_;
  canlog::LineFormatter* lines_;  ///< for the bus of the output
};

class Totals final : public gateway::RateObserver {
 public:
  explicit Totals(ReplaySummary& summary, Course* course) : summary_(summary), course_(course) {}
  void on_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) override {
    if (!begun_) first_ = t;
    if (begun_ && t - last_ > kGap) {
      summary_.add_gap({to_seconds(last_ - first_), to_seconds(t - last_)});
    }
    begun_ = true;
    last_ = t;
    if (course_ != nullptr) course_->add_rate(t, raw_dps, virtual_dps);
    if (std::isnan(virtual_dps)) return;
    summary_.rate_sum_dps += virtual_dps;
    ++summary_.rates;
    for (std::size_t i = 0; i < 2; ++i) {
      if (std::isnan(raw_dps[i])) continue;
      summary_.raw_sum_dps[i] += raw_dps[i];
      ++summary_.raws[i];
    }
  }

  void on_condition(TimePoint t, const fusion::Condition& condition) override {
    if (course_ != nullptr) course_->add_condition(t, condition);
  }

 private:
  static constexpr Duration kGap = std::chrono::milliseconds(500);
  static_assert(ReplaySummary::kGap_s == 0.5);
  ReplaySummary& summary_;
  Course* course_;
  bool begun_ = false;
  TimePoint first_;
  TimePoint last_;
};

/// Totals of one axis of several.
class AxisTotals final : public gateway::RateObserver {
 public:
  AxisTotals(AxisSummary& summary, Course* course) : summary_(&summary), course_(course) {}
  void on_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) override {
    if (course_ != nullptr) course_->add_rate(t, raw_dps, virtual_dps);
    if (std::isnan(virtual_dps)) return;
    summary_->rate_sum_dps += virtual_dps;
    ++summary_->rates;
  }
  void on_condition(TimePoint t, const fusion::Condition& condition) override {
    if (course_ != nullptr) course_->add_condition(t, condition);
  }

 private:
  AxisSummary* summary_;
  Course* course_;
};

// Maps interface names of the log to indices of the plan, by the user's --map.
class BusMap {
 public:
  static Expected<BusMap> make(const std::vector<std::string>& entries, const gateway::Plan& plan) {
    BusMap map(plan);
    for (const std::string& entry : entries) {
      const std::size_t equals = entry.find('=');
      const std::string to = equals == std::string::npos ? "" : entry.substr(equals + 1);
      if (equals == 0 || to.empty()) {
        return fail("--map " + entry, "is not LOGNAME=CONFIGNAME", "for example --map vcan0=can0");
      }
      if (std::find(plan.buses.begin(), plan.buses.end(), to) == plan.buses.end()) {
        return fail("--map " + entry, "the configuration has no bus \"" + to + "\"",
                    suggest_name(to, plan.buses));
      }
      map.entries_.emplace_back(entry.substr(0, equals), to);
    }
    return map;
  }

  struct Buses {
    can::BusIndex plan = kForeignBus;  ///< index in the plan
    can::BusIndex all = 0;             ///< index in interfaces(), over all logs
  };
  Buses look_up(can::BusIndex log_bus, const canlog::InterfaceTable& of_log) {
    while (known_count_ <= log_bus) {
      const std::string& name = of_log.name(static_cast<can::BusIndex>(known_count_));
      known_[known_count_++] = {plan_index(name), interfaces_.index_of(name).value_or(0)};
    }
    return known_[log_bus];
  }

  [[nodiscard]] const std::vector<std::string>& interfaces() const { return interfaces_.names(); }

 private:
  explicit BusMap(const gateway::Plan& plan) : plan_(&plan) {}
  [[nodiscard]] can::BusIndex plan_index(const std::string& name) const {
    const auto mapped = std::find_if(entries_.begin(), entries_.end(),
                                     [&](const auto& entry) { return entry.first == name; });
    const std::string& wanted = mapped == entries_.end() ? name : mapped->second;
    const auto found = std::find(plan_->buses.begin(), plan_->buses.end(), wanted);
    return found == plan_->buses.end() ? kForeignBus
                                       : static_cast<can::BusIndex>(found - plan_->buses.begin());
  }
  const gateway::Plan* plan_;
  std::vector<std::pair<std::string, std::string>> entries_;
  std::array<Buses, canlog::InterfaceTable::kMax> known_;  ///< by the log's own index
  std::size_t known_count_ = 0;
  canlog::InterfaceTable interfaces_;
};

class Replay {
 public:
  Replay(const ReplayOptions& options, const gateway::Plan& plan, OutputFile& output, BusMap buses)
      : options_(options),
        is_drawn_(!options.plot.empty() || !options.html.empty()),
        output_(output),
        buses_(std::move(buses)),
        pipeline_(plan),
        sink_(output, plan),
        courses_(std::max<std::size_t>(pipeline_.axis_count(), 1),
                 Course(options.html.empty() ? kPlotBuckets : kPageBuckets)),
        totals_(summary_, is_drawn_ ? &courses_.front() : nullptr) {
    if (pipeline_.axis_count() == 0) pipeline_.observe(&totals_);
    observe_axes(plan);
  }

  /// Before the first log.
  void write_table(RateTable& table) {
    if (pipeline_.axis_count() == 0) pipeline_.observe_output(&table);
    for (std::size_t place = 0; place < pipeline_.axis_count(); ++place)
      pipeline_.observe_output(table.column(place), place);
  }
  /// Before the first log.
  Expected<void> take_up(const gateway::SavedState& state) { return pipeline_.resume(state); }

  /// `reader` reads the logs of these paths.
  Expected<void> run_logs(const std::vector<std::string>& paths, canlog::LogReader& reader) {
    if (std::count(paths.begin(), paths.end(), "-") > 0) {
      reader.before_wait([this] { output_.flush(); });
    }
    run_records(name_of(paths), reader);
    const auto parts = reader.parts();
    for (std::size_t i = 0; i < paths.size(); ++i)
      summary_.logs.push_back({paths[i], *parts[i]});
    summary_.interfaces = buses_.interfaces();
    if (reader.error()) return tl::unexpected(*reader.error());
    return {};
  }

  ReplaySummary& finish() {
    summary_.status = pipeline_.status();
    for (std::size_t place = 0; place < pipeline_.axis_count(); ++place)
      summary_.axes[place].status = pipeline_.axis_status(place);
    summary_.frames_out = sink_.frames;
    summary_.slope_dps_s.fill(std::numeric_limits<double>::quiet_NaN());
    summary_.slope_sigma_dps_s = summary_.slope_dps_s;
    summary_.bias_sigma_dps = summary_.slope_dps_s;
    const std::optional<gateway::SavedState> known = pipeline_.memory();
    if (known) keep_axes_sigma(*known);
    for (std::size_t i = 0; known && i < 2; ++i) {
      // With several axes this is the first axis's, and the summary of all has no drift.
      if (pipeline_.axis_count() == 0)
        summary_.bias_sigma_dps[i] = std::sqrt(known->drift.bias_covariance[2 * i]);
      if (!(known->drift.slope_sigma_dps_s[i] > 0.0)) continue;  // 0 stands for "not known"
      summary_.slope_dps_s[i] = known->drift.slope_dps_s[i];
      summary_.slope_sigma_dps_s[i] = known->drift.slope_sigma_dps_s[i];
    }
    return summary_;
  }

  /// One course, or one for each axis.
  const std::vector<Course>& courses() const { return courses_; }

 private:
  void observe_axes(const gateway::Plan& plan) {
    const std::size_t count = pipeline_.axis_count();
    summary_.axes.resize(count);
    for (std::size_t place = 0; place < count; ++place) {
      summary_.axes[place].name = gateway::kAxisNames[plan.axes[place].axis];
      axis_totals_.emplace_back(summary_.axes[place], is_drawn_ ? &courses_[place] : nullptr);
    }
    for (std::size_t place = 0; place < count; ++place)
      pipeline_.observe(&axis_totals_[place], place);
  }

  // An axis that is not calibrated has no saved state.
  void keep_axes_sigma(const gateway::SavedState& known) {
    for (const gateway::SavedState& saved : known.axes) {
      for (AxisSummary& axis : summary_.axes) {
        if (axis.name != gateway::kAxisNames[saved.axis]) continue;
        axis.bias_sigma_dps = {std::sqrt(saved.drift.bias_covariance[0]),
                               std::sqrt(saved.drift.bias_covariance[2])};
      }
    }
  }

  void run_records(const std::string& name, canlog::LogReader& reader) {
    LogProgress progress("replay " + name, reader);
    std::array<canlog::LogRecord, kRecordsAtOnce> room;
    const canlog::InterfaceTable& interfaces = reader.interfaces();
    while (const std::size_t count = reader.next_batch(room)) {
      for (const canlog::LogRecord& record : std::span(room).first(count)) {
        if (!record.is_xl) take(record, interfaces);
      }
      progress.add(count);
    }
    summary_.last_s = to_seconds(last_.time_since_epoch());
  }

  void take(const canlog::LogRecord& record, const canlog::InterfaceTable& interfaces) {
    if (first_) summary_.first_s = to_seconds(record.stamp.time_since_epoch());
    first_ = false;
    last_ = record.stamp;
    const BusMap::Buses buses = buses_.look_up(record.bus, interfaces);
    summary_.ids.add(buses.all, record.frame);
    sink_.fraction_digits =
        options_.digits != 0 ? options_.digits : unsigned{record.fraction_digits};
    pipeline_.receive(buses.plan, record.frame, record.stamp, sink_);
    if (is_drawn_) follow_drift(record.stamp);
  }

  // Records the drift whenever the pipeline has sent it.
  void follow_drift(TimePoint stamp) {
    if (sink_.frames == frames_seen_) return;
    frames_seen_ = sink_.frames;
    const gateway::Status& status = pipeline_.status();
    if (status.biases_out == biases_seen_) return;
    biases_seen_ = status.biases_out;
    for (std::size_t i = 0; i < courses_.size(); ++i)
      courses_[i].add_status(stamp,
                             pipeline_.axis_count() == 0 ? status : pipeline_.axis_status(i));
    follow_sigma(stamp);
  }

  // Records the σ of each drift, from the state that would be saved; no more often than a picture
  // shows.
  void follow_sigma(TimePoint stamp) {
    if (sigma_seen_ && stamp - *sigma_seen_ < kSigmaEvery) return;
    sigma_seen_ = stamp;
    const std::optional<gateway::SavedState> known = pipeline_.memory();
    if (!known) return;
    const auto show = [&](Course& course, const fusion::DriftMemory& drift) {
      course.add_bias_sigma(
          stamp, {std::sqrt(drift.bias_covariance[0]), std::sqrt(drift.bias_covariance[2])});
    };
    if (pipeline_.axis_count() == 0) return show(courses_.front(), known->drift);
    for (const gateway::SavedState& axis : known->axes) {
      for (std::size_t i = 0; i < courses_.size(); ++i) {
        if (summary_.axes[i].name == gateway::kAxisNames[axis.axis]) show(courses_[i], axis.drift);
      }
    }
  }

  static constexpr Duration kSigmaEvery = std::chrono::seconds(1);
  const ReplayOptions& options_;
  bool is_drawn_;
  OutputFile& output_;
  BusMap buses_;
  gateway::Pipeline pipeline_;
  LineSink sink_;
  ReplaySummary summary_;
  std::vector<Course> courses_;  ///< one, or one for each axis
  Totals totals_;
  std::vector<AxisTotals> axis_totals_;
  bool first_ = true;
  TimePoint last_;
  std::uint64_t frames_seen_ = 0;
  std::uint64_t biases_seen_ = 0;
  std::optional<TimePoint> sigma_seen_;
};

std::string causes_of_rejection(const gateway::GyroStatus& gyro) {
  std::string causes;
  for (std::size_t i = 0; i < gateway::kRejectCount; ++i) {
    if (gyro.rejected[i] == 0) continue;
    causes += fmt::format("{}{} {}", causes.empty() ? "" : ", ", gyro.rejected[i],
                          to_string(static_cast<gateway::Reject>(i)));
  }
  return causes;
}

// Explains why frames of both gyros gave no pair.
std::optional<Error> explain_no_pair(const gateway::Status& status, const gateway::Plan& plan,
                                     const std::string& logs) {
  if (status.pairs > 0) return std::nullopt;
  for (std::size_t i = 0; i < 2; ++i) {
    if (status.gyros[i].samples > 0) continue;
    return Error{logs,
                 fmt::format("no frame of gyro {} could be used: {}", plan.gyros[i].name,
                             causes_of_rejection(status.gyros[i])),
                 "`vgyro check` shows which bits are read, `vgyro decode` what the log holds"};
  }
  if (status.rates_too_far_apart) {
    const std::size_t slow = status.gyros[0].samples < status.gyros[1].samples ? 0 : 1;
    return Error{logs,
                 fmt::format("gyro {} sends so much more often than gyro {} that no pairs can be "
                             "made of them ({} samples and {})",
                             plan.gyros[1 - slow].name, plan.gyros[slow].name,
                             status.gyros[1 - slow].samples, status.gyros[slow].samples),
                 "up to 2000 times as often is possible; a gyro so slow adds nothing to the other"};
  }
  return Error{logs,
               fmt::format("the gyros {} and {} never spoke at the same time, or too shortly",
                           plan.gyros[0].name, plan.gyros[1].name),
               "use a recording that contains both gyros"};
}

// Explains why there is no output, with a remedy.
std::optional<Error> explain_silence(const ReplaySummary& summary, const gateway::Plan& plan,
                                     const std::string& logs) {
  std::uint64_t frames = 0;
  for (const LogSummary& log : summary.logs)
    frames += log.counts.frames + log.counts.xl_frames;
  if (frames == 0) {
    return Error{logs, kNoFrame, kLogsRemedy};
  }
  for (std::size_t i = 0; i < 2; ++i) {
    if (summary.status.gyros[i].frames > 0) continue;
    std::string names;
    for (const std::string& name : summary.interfaces)
      names += (names.empty() ? "" : ", ") + name;
    return Error{
        logs,
        fmt::format("no frame of gyro {} ({} {:X} on {})", plan.gyros[i].name,
                    plan.gyros[i].message, plan.gyros[i].match.id, plan.gyros[i].bus),
        fmt::format("the log's interfaces are: {}; --map LOGNAME={} takes one of them for {}",
                    names, plan.gyros[i].bus, plan.gyros[i].bus)};
  }
  return explain_no_pair(summary.status, plan, logs);
}

// With several axes, each has a picture of its own.
std::vector<std::string> pictures_of(const ReplayOptions& options, const gateway::Plan& plan) {
  if (plan.axes.empty()) return {options.plot};
  std::vector<std::string> paths;
  paths.reserve(plan.axes.size());
  for (const gateway::Plan& axis : plan.axes)
    paths.push_back(path_of_axis(options.plot, axis_name(axis)));
  return paths;
}

// Checks, before any output is overwritten, that the logs exist and that no input is an output.
Expected<void> check_files(const ReplayOptions& options, const gateway::Plan& plan,
                           std::vector<std::string> inputs) {
  for (const std::string& log : options.logs) {
    struct stat input {};
    if (log == "-") continue;
    if (::stat(log.c_str(), &input) != 0) return fail(log, "cannot be opened: " + system_reason());
    if (!S_ISREG(input.st_mode)) continue;
    if (const auto opened = canlog::open_log(log); !opened) return tl::unexpected(opened.error());
  }
  inputs.insert(inputs.end(), options.logs.begin(), options.logs.end());
  inputs.push_back(options.state);
  std::vector<std::string> outputs = pictures_of(options, plan);
  outputs.insert(outputs.end(), {options.output, options.json, options.csv, options.html});
  return check_outputs(inputs, outputs);
}

void warn_of_doubts(const ReplaySummary& summary, const gateway::Plan& plan) {
  const gateway::Status& status = summary.status;
  if (status.moved_in_calibration) {
    warn({"calibration",
          fmt::format("the platform moved during the {:g} s that should be rest: the drifts hold "
                      "part of that motion, and VG_Quality says so",
                      plan.calibration.rest_s),
          "when_moving = \"wait\" waits for rest"});
  }
  if (status.pairs == 0 || status.rates_out_valid > 0) return;
  if (status.calibration_restarts > 0) {
    warn(
        {"calibration",
         fmt::format("never complete: the platform moved again and again ({} times), and no {:g} s "
                     "of rest were found; no valid rate was sent",
                     status.calibration_restarts, plan.calibration.rest_s),
         "a shorter rest_s, source = \"reference\", or when_moving = \"accept\", which learns "
         "part of the motion as drift"});
  } else {
    warn({"calibration",
          fmt::format("not complete: {:.1f} of {:g} s; no valid rate was sent", status.calibrated_s,
                      plan.calibration.rest_s),
          "a longer log, or a shorter rest_s"});
  }
}

// Warns if the virtual gyro was mostly one gyro, or if its σ does not fit into VG_Sigma.
void warn_of_weakness(const ReplaySummary& summary, const gateway::Plan& plan) {
  for (std::size_t i = 0; i < 2; ++i) {
    if (summary.rates == 0 || 2 * summary.raws[i] >= summary.rates) continue;
    warn(
        {"gyro " + plan.gyros[i].name,
         fmt::format("was aside most of the time: it took part in {} of {} valid rates, the others "
                     "are of one gyro alone",
                     summary.raws[i], summary.rates),
         "the summary's \"faults\" and \"not used\" say why; --plot shows when"});
  }
  // The largest σ that VG_Sigma can hold: 0xFFE steps of 2e-5 deg/s.
  constexpr double kSigmaMost_dps = 0xFFE * 2e-5;
  if (plan.output.fd || !(summary.status.sigma_dps > kSigmaMost_dps)) return;
  warn({"sigma",
        fmt::format("at the end it is {:.2g} deg/s, and VG_Sigma carries {:.4f} deg/s at most: it "
                    "goes out as \"not available\"",
                    summary.status.sigma_dps, kSigmaMost_dps),
        "fd = true in [output] carries any; --csv holds it too"});
}

// Warns of data that the corrector could not use, with advice.
void warn_of_data(const ReplaySummary& summary, const gateway::Plan& plan) {
  const gateway::Status& status = summary.status;
  const gateway::SteadyStretches stretches = gateway::steady_stretches(status);
  if (const std::string advice = gateway::stretches_advice(stretches); !advice.empty())
    warn({"stops", gateway::stretches_text(stretches), advice});
  for (std::size_t i = 0; i < 2; ++i) {
    const auto& blind = status.gyros[i].faults[static_cast<std::size_t>(gateway::Fault::kBlind)];
    if (blind.times == 0) continue;
    const bool still = status.gyros[i].fault == gateway::Fault::kBlind;
    warn({"gyro " + plan.gyros[i].name,
          still ? gateway::blind_text()
                : "for a while it did not feel the rotation that the other one felt",
          gateway::blind_advice()});
  }
  if (status.rates_too_far_apart && status.pairs > 0)
    warn({"sample rates", gateway::rates_too_far_apart_text(), ""});
  if (status.estimate_restarts > 0)
    warn({"estimate", gateway::restarts_text(status.estimate_restarts), ""});
}

// A contradicted pair is a mistake of the configuration, and thus an error if it is one at the end.
std::optional<Error> explain_contradiction(const ReplaySummary& summary,
                                           const gateway::Plan& plan) {
  const gateway::Status& status = summary.status;
  if (status.pair.contradiction != fusion::Contradiction::kNone) {
    return Error{"gyros",
                 gateway::contradiction_text(status.pair, {plan.gyros[0].name, plan.gyros[1].name}),
                 gateway::contradiction_advice()};
  }
  if (status.contradictions > 0) {
    warn({"gyros",
          "for a while they did not move together as two gyros of one platform do, and no rate was "
          "valid",
          "--plot shows when"});
  }
  return std::nullopt;
}

// Warns of an input without frames whose J1939 parameter group came from other senders.
void warn_of_senders_missed(const ReplaySummary& summary, const gateway::Plan& plan) {
  const auto look = [&](const std::string& title, const std::string& message,
                        const gateway::FrameMatch& match) {
    if (!match.extended) return;
    OtherSenders others;
    for (const IdCounts::Row& row : summary.ids.rows()) {
      if (!row.extended || summary.interfaces[row.bus] != plan.buses[match.bus]) continue;
      if (match.carries(row.id, true)) return;
      others.add(match.id, row.id);
    }
    if (!others.empty()) warn({title, others.text(message, match.id), others.remedy(match.mask)});
  };
  for (const gateway::GyroPlan& gyro : plan.gyros)
    look("gyro " + gyro.name, gyro.message, gyro.match);
  if (plan.reference) look("reference", plan.reference->message, plan.reference->match);
  if (plan.accelerometer)
    look("accelerometer", plan.accelerometer->message, plan.accelerometer->match);
  if (plan.speed) look("speed", plan.speed->message, plan.speed->match);
}

// Warns of other senders of our identifiers: a receiver of VG_Rate would get both.
void warn_of_other_senders(const ReplaySummary& summary, const gateway::Plan& plan) {
  for (std::size_t i = 0; i < plan.buses.size(); ++i) {
    const auto bus = static_cast<can::BusIndex>(i);
    const std::vector<gateway::FrameId> ours = gateway::output_ids(plan.output, bus);
    for (const IdCounts::Row& row : summary.ids.rows()) {
      const gateway::FrameId id{row.id, row.extended};
      if (summary.interfaces[row.bus] != plan.buses[bus]) continue;
      if (std::find(ours.begin(), ours.end(), id) == ours.end()) continue;
      warn({"output",
            fmt::format("identifier {} is on {} already, in {} frames of the log",
                        gateway::to_string(id), plan.buses[bus], row.frames),
            "if they are not an earlier run of the gateway, choose other rate_id, bias_id, "
            "model_id; of a layout, another id or bus, or take the sensor off the bus"});
    }
  }
}

// Without folders, to keep a title short.
std::string picture_name_of(std::vector<std::string> logs) {
  for (std::string& log : logs)
    log = log.substr(log.rfind('/') + 1);
  return name_of(logs);
}

Expected<void> write_page(const ReplayOptions& options, const gateway::Plan& plan,
                          const ReplaySummary& summary, const std::vector<Course>& courses,
                          OutputFile& file) {
  if (options.html.empty()) return {};
  const auto page =
      replay_page({picture_name_of(options.logs), options.config}, plan, summary, courses);
  if (!page) return fail(options.html, page.error().what);
  file.write(*page);
  return file.close();
}

int write_results(const ReplayOptions& options, const gateway::Plan& plan,
                  const ReplaySummary& summary, const std::vector<Course>& courses) {
  if (!options.json.empty()) {
    // A log's interface names may be any bytes.
    const auto done = write_json(options.json, to_json(summary, plan));
    if (!done) return report(done.error());
  }
  if (!options.quiet) put_text(stderr, to_text(summary, plan));
  const std::vector<std::string> pictures = pictures_of(options, plan);
  for (std::size_t i = 0; !options.plot.empty() && i < courses.size(); ++i) {
    const gateway::Plan& drawn = plan.axes.empty() ? plan : plan.axes[i];
    const PlotTexts texts{fmt::format("{}{}, method {}", picture_name_of(options.logs),
                                      about_axis(drawn), gateway::to_string(plan.corrector.method)),
                          {plan.gyros[0].name, plan.gyros[1].name}};
    const auto done = draw_plot(courses[i].coarser(kPlotBuckets), pictures[i], texts);
    if (!done) return report(done.error());
  }
  return kDone;
}

// Nothing where none is wanted.
Expected<std::optional<gateway::SavedState>> read_state(const std::string& path,
                                                        const gateway::Plan& plan) {
  constexpr const char* kRemedy = "omit --state to calibrate again";
  if (path.empty()) return std::nullopt;
  const auto text = read_file(path);
  if (!text) return tl::unexpected(text.error());
  auto state = gateway::saved_state_from(*text, path);
  if (!state) return fail(path, state.error().what, kRemedy);
  const auto same = gateway::check_devices(*state, plan);
  if (!same) return fail(path, same.error().what, kRemedy);
  return std::move(*state);
}

// Nothing where none is wanted.
Expected<std::optional<RateTable>> open_table(const std::string& path, const gateway::Plan& plan) {
  if (path.empty()) return std::nullopt;
  auto table = RateTable::open(path, plan);
  if (!table) return tl::unexpected(table.error());
  return std::move(*table);
}

}  // namespace

int run_replay(const ReplayOptions& options) {
  const auto loaded = gateway::load_config(options.config, {options.method, options.model});
  if (!loaded) return report(loaded.error());
  const gateway::Plan& plan = loaded->plan;
  if (!options.quiet) {
    for (const Error& warning : loaded->warnings)
      warn(warning);
  }
  if (!options.plot.empty()) {
    if (const auto good = check_picture_path(options.plot); !good) return report(good.error());
  }
  auto buses = BusMap::make(options.bus_map, plan);
  if (!buses) return report(buses.error());
  if (const auto good = check_files(options, plan, loaded->files); !good)
    return report(good.error());
  const auto state = read_state(options.state, plan);
  if (!state) return report(state.error());
  // Several logs are merged by stamp.
  const auto logs = canlog::open_logs(options.logs);
  if (!logs) return report(logs.error());
  auto output = OutputFile::open(options.output);
  if (!output) return report(output.error());
  auto table = open_table(options.csv, plan);
  if (!table) return report(table.error());
  // Opened before an hour of work, in case the page cannot be written.
  auto page = OutputFile::open(options.html);
  if (!page) return report(page.error());

  // An interrupt must not end the replay of a pipe, whose input ends with its writer.
  const FinishOnInterrupt finish(std::count(options.logs.begin(), options.logs.end(), "-") > 0);
  Replay replay(options, plan, *output, std::move(*buses));
  if (*state) {
    if (const auto taken = replay.take_up(**state); !taken) return report(taken.error());
  }
  if (*table) replay.write_table(**table);
  std::optional<Error> trouble;
  if (const auto ran = replay.run_logs(options.logs, **logs); !ran) trouble = ran.error();
  const ReplaySummary& summary = replay.finish();
  if (const auto closed = output->close(); !closed) return report(closed.error());
  if (*table) {
    if (const auto closed = (*table)->close(); !closed) return report(closed.error());
  }
  if (!trouble) trouble = explain_silence(summary, plan, name_of(options.logs));
  int written = write_results(options, plan, summary, replay.courses());
  const auto shown = write_page(options, plan, summary, replay.courses(), *page);
  if (!shown) written = report(shown.error());
  warn_of_doubts(summary, plan);
  warn_of_data(summary, plan);
  warn_of_weakness(summary, plan);
  warn_of_senders_missed(summary, plan);
  warn_of_other_senders(summary, plan);
  if (!trouble) trouble = explain_contradiction(summary, plan);
  if (trouble) return report(*trouble);
  return written;
}

}  // namespace vgyro::cli
