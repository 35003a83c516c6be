#include <cmath>
#include <cstdio>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "analysis/pair_noise.h"
#include "analysis/recommendation.h"
#include "cli/allan/plot.h"
#include "cli/allan/report.h"
#include "cli/axis_choice.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/fleet/evidence_file.h"
#include "cli/log_notes.h"
#include "cli/output/errors.h"
#include "cli/output/gnuplot.h"
#include "cli/output/json_text.h"
#include "cli/output/output_file.h"
#include "cli/output/overwrite.h"
#include "cli/output/terminal.h"
#include "cli/pair_recording.h"
#include "cli/recording.h"
#include "gateway/config.h"

namespace vgyro::cli {

namespace {

// In a shorter recording not even white noise can be determined.
constexpr double kSecondsMin = 10.0;

Expected<AllanReport> judge(const AllanOptions& options, const gateway::Plan& plan,
                            const analysis::PairRecording& recording) {
  const double seconds = recording.paired[0].seconds();
  if (seconds < kSecondsMin) {
    return fail(
        name_of(options.logs),
        fmt::format("holds {:.1f} s of both gyros{}, too short to separate noise from drift",
                    seconds, about_axis(plan)),
        fmt::format("use at least {:g} s; an hour at rest shows drift", kSecondsMin));
  }
  AllanReport report{name_of(options.logs), {plan.gyros[0].name, plan.gyros[1].name}, {}, {}};
  report.axis = axis_name(plan);
  if (!report.axis.empty())
    report.sensor_axis = {plan.gyros[0].sensor_axis, plan.gyros[1].sensor_axis};
  report.noise = analysis::judge_pair(recording);
  if (const auto& fit = report.noise.difference.fit) {
    report.recommendation = analysis::recommend(*fit, report.noise.difference.seconds);
  }
  return report;
}

Expected<std::vector<AllanReport>> judge_all(const AllanOptions& options,
                                             const std::vector<gateway::Plan>& pairs) {
  const auto recordings = read_pair_recordings(options.logs, pairs);
  if (!recordings) return tl::unexpected(recordings.error());
  std::vector<AllanReport> reports;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    auto one = judge(options, pairs[i], (*recordings)[i]);
    if (!one) return tl::unexpected(one.error());
    reports.push_back(*std::move(one));
  }
  return reports;
}

// One picture for each axis.
std::vector<std::string> pictures_of(const AllanOptions& options,
                                     const std::vector<gateway::Plan>& pairs) {
  std::vector<std::string> paths;
  paths.reserve(pairs.size());
  for (const gateway::Plan& pair : pairs)
    paths.push_back(pairs.size() > 1 ? path_of_axis(options.plot, axis_name(pair)) : options.plot);
  return paths;
}

std::string text_of(const std::vector<AllanReport>& reports) {
  std::string text;
  for (const AllanReport& report : reports)
    text += (text.empty() ? "" : "\n") + to_text(report);
  return text;
}

nlohmann::ordered_json json_of(const std::vector<AllanReport>& reports) {
  if (reports.size() == 1) return to_json(reports.front());
  nlohmann::ordered_json json{{"format", 1}, {"log", reports.front().log}};
  for (const AllanReport& report : reports)
    json["axes"].push_back(to_json(report));
  return json;
}

Expected<void> write(const AllanOptions& options, const std::vector<AllanReport>& reports,
                     const std::vector<std::string>& pictures) {
  // If JSON goes to standard output, the text goes to stderr.
  put_text(options.json == "-" ? stderr : stdout, text_of(reports));
  if (!options.json.empty()) {
    if (auto done = write_json(options.json, json_of(reports)); !done) return done;
  }
  for (std::size_t i = 0; !options.plot.empty() && i < reports.size(); ++i) {
    if (auto done = draw_allan(pictures[i], reports[i]); !done) return done;
  }
  return {};
}

gap::GyroEvidence noise_evidence(const analysis::SeriesNoise& noise) {
  gap::GyroEvidence gyro;
  gyro.samples = noise.interval_s > 0.0 ? std::round(noise.seconds / noise.interval_s) : 0.0;
  if (!noise.fit) return gyro;
  const auto log_variance = [](const analysis::Estimate& estimate) {
    return estimate.resolved ? std::pow(estimate.sigma / estimate.value, 2) : 0.0;
  };
  const analysis::NoiseFit& fit = *noise.fit;
  gyro.bias_dps = noise.mean_dps;
  if (fit.white_dps_rthz.resolved) gyro.white_dps_rthz = fit.white_dps_rthz.value;
  if (fit.walk_dps_rts.resolved) gyro.walk_dps_rts = fit.walk_dps_rts.value;
  gyro.log_noise_covariance = {log_variance(fit.white_dps_rthz), 0.0,
                               log_variance(fit.walk_dps_rts)};
  return gyro;
}

// Evidence of noise and biases, without shapes: only rest is evaluated here. The first log is read
// once more for its digest and its beginning.
Expected<void> leave_evidence(const AllanOptions& options, const std::vector<AllanReport>& reports,
                              const std::vector<gateway::Plan>& pairs,
                              const std::vector<std::string>& files) {
  std::string text;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto& gyros = pairs[i].gyros;
    const auto recordings = read_recordings(options.logs.front(), {&pairs[i], 1}, "allan");
    if (!recordings) return tl::unexpected(recordings.error());
    GapSubject subject;
    subject.gyros = {gyros[0].name, gyros[1].name};
    subject.axis = axis_name(pairs[i]);
    subject.types = {gyros[0].type, gyros[1].type};
    subject.serials = {gyros[0].serial, gyros[1].serial};
    subject.sensor_axis = {gyros[0].sensor_axis, gyros[1].sensor_axis};
    gap::DriveEvidence evidence;
    for (std::size_t k = 0; k < 2; ++k)
      evidence.gyros[k] = noise_evidence(reports[i].noise.gyros[k]);
    const std::array flipped{gyros[0].flipped, gyros[1].flipped};
    text += drive_text({subject, *recordings, std::move(evidence), flipped, ""}, files, "");
  }
  auto file = OutputFile::open(options.evidence);
  if (!file) return tl::unexpected(file.error());
  file->write(text);
  return file->close();
}

}  // namespace

int run_allan(const AllanOptions& options) {
  const auto loaded = gateway::load_config(options.config);
  if (!loaded) return report(loaded.error());
  const auto pairs = chosen_pairs(options.config, loaded->plan, options.axis);
  if (!pairs) return report(pairs.error());
  for (const Error& warning : loaded->warnings)
    warn(warning);
  if (!options.plot.empty()) {
    if (const auto good = check_picture_path(options.plot); !good) return report(good.error());
  }
  std::vector<std::string> inputs = loaded->files;
  inputs.insert(inputs.end(), options.logs.begin(), options.logs.end());
  const std::vector<std::string> pictures = pictures_of(options, *pairs);
  std::vector<std::string> outputs = pictures;
  outputs.push_back(options.json);
  if (!options.evidence.empty()) outputs.push_back(options.evidence);
  if (const auto free = check_outputs(inputs, outputs); !free) return report(free.error());
  const auto reports = judge_all(options, *pairs);
  if (!reports) return report(reports.error());
  if (!options.evidence.empty()) {
    const auto left = leave_evidence(options, *reports, *pairs, loaded->files);
    if (!left) return report(left.error());
  }
  const auto written = write(options, *reports, pictures);
  return written ? kDone : report(written.error());
}

}  // namespace vgyro::cli
