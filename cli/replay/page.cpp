#include "cli/replay/page.h"

#include <cmath>

#include <nlohmann/json.hpp>
#include <vgyro_pages_text.h>

#include "cli/axis_choice.h"
#include "cli/page/page.h"
#include "gateway/config.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;
using Bucket = Course::Bucket;
using Mean = Course::Mean;
using Envelope = Course::Envelope;

// Enough digits of rates and drifts for any screen, and of times for a millisecond in a week.
constexpr int kDigits = 6;
constexpr int kDigitsOfTime = 9;
// Headings have an absolute step, because they are compared with each other however far the
// platform turned.
constexpr double kHeadingSteps_per_deg = 1e4;
// A point that interrupts its curve; null means "no point here, the line goes on".
constexpr const char* kBreak = "break";

// In the order of Course::Shade: the names of their colours in the style.
constexpr std::array<const char*, Course::kShades> kShadeKeys{
    "calibrating", "stop",    "refused", "ambiguous",
    "one_gyro",    "fault_1", "fault_2", "contradicted"};

struct MeanColumn {
  const char* name;
  Course::Column mean;
  bool is_heading = false;
};
constexpr std::array<MeanColumn, 13> kMeans{{
    {"heading_1", [](const Bucket& b) -> const Mean& { return b.heading[0]; }, true},
    {"heading_2", [](const Bucket& b) -> const Mean& { return b.heading[1]; }, true},
    {"heading_mean", [](const Bucket& b) -> const Mean& { return b.heading[2]; }, true},
    {"heading_virtual", [](const Bucket& b) -> const Mean& { return b.heading[3]; }, true},
    {"heading_sigma", [](const Bucket& b) -> const Mean& { return b.heading_sigma; }},
    {"excess_1", [](const Bucket& b) -> const Mean& { return b.excess[0]; }},
    {"excess_2", [](const Bucket& b) -> const Mean& { return b.excess[1]; }},
    {"drift_1", [](const Bucket& b) -> const Mean& { return b.bias[0]; }},
    {"drift_2", [](const Bucket& b) -> const Mean& { return b.bias[1]; }},
    {"drift_sigma_1", [](const Bucket& b) -> const Mean& { return b.bias_sigma[0]; }},
    {"drift_sigma_2", [](const Bucket& b) -> const Mean& { return b.bias_sigma[1]; }},
    {"temperature_1", [](const Bucket& b) -> const Mean& { return b.temperature[0]; }},
    {"temperature_2", [](const Bucket& b) -> const Mean& { return b.temperature[1]; }},
}};

struct EnvelopeColumn {
  const char* name;
  const Envelope& (*envelope)(const Bucket&);
  Course::Column mean;
};
constexpr std::array<EnvelopeColumn, 4> kEnvelopes{{
    {"rate_1", [](const Bucket& b) -> const Envelope& { return b.raw[0]; },
     [](const Bucket& b) -> const Mean& { return b.raw[0]; }},
    {"rate_2", [](const Bucket& b) -> const Envelope& { return b.raw[1]; },
     [](const Bucket& b) -> const Mean& { return b.raw[1]; }},
    {"rate_mean", [](const Bucket& b) -> const Envelope& { return b.average; },
     [](const Bucket& b) -> const Mean& { return b.average; }},
    {"rate_virtual", [](const Bucket& b) -> const Envelope& { return b.rate; },
     [](const Bucket& b) -> const Mean& { return b.rate; }},
}};

Json heading_number(double heading_deg) {
  return std::round(heading_deg * kHeadingSteps_per_deg) / kHeadingSteps_per_deg;
}

// A point for each row; null or "break" if there is none.
template <typename Value>
Json points(const Course& course, const std::vector<std::size_t>& rows,
            const std::vector<bool>& breaks, Course::Column mean, Value value) {
  Json json = Json::array();
  for (const std::size_t row : rows) {
    const Bucket& bucket = course.buckets()[row];
    if (mean(bucket).count > 0) {
      json.push_back(value(bucket));
    } else if (breaks[row]) {
      json.push_back(kBreak);
    } else {
      json.push_back(nullptr);
    }
  }
  return json;
}

// The buckets in which any curve has a point or a break.
std::vector<std::size_t> rows_of(const Course& course) {
  std::vector<bool> is_row(course.buckets().size(), false);
  const auto look = [&](Course::Column column) {
    const std::vector<bool> breaks = course.breaks(column);
    for (std::size_t i = 0; i < is_row.size(); ++i) {
      if (breaks[i] || column(course.buckets()[i]).count > 0) is_row[i] = true;
    }
  };
  for (const MeanColumn& column : kMeans)
    look(column.mean);
  for (const EnvelopeColumn& column : kEnvelopes)
    look(column.mean);
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < is_row.size(); ++i) {
    if (is_row[i]) rows.push_back(i);
  }
  return rows;
}

// Leaves out empty columns, and least and greatest values if every bucket has one sample.
Json columns_json(const Course& course, const std::vector<std::size_t>& rows) {
  Json columns = Json::object();
  for (const MeanColumn& column : kMeans) {
    if (!course.has(column.mean)) continue;
    columns[column.name] =
        points(course, rows, course.breaks(column.mean), column.mean, [&](const Bucket& bucket) {
          const double value = column.mean(bucket).value();
          return column.is_heading ? heading_number(value) : page_number(value, kDigits);
        });
  }
  const bool is_thinned = std::any_of(rows.begin(), rows.end(), [&](std::size_t row) {
    const Bucket& bucket = course.buckets()[row];
    return std::any_of(kEnvelopes.begin(), kEnvelopes.end(),
                       [&](const auto& column) { return column.mean(bucket).count > 1; });
  });
  for (const EnvelopeColumn& column : kEnvelopes) {
    if (!course.has(column.mean)) continue;
    const std::vector<bool> breaks = course.breaks(column.mean);
    const auto add = [&](const std::string& name, auto value) {
      columns[name] = points(course, rows, breaks, column.mean, value);
    };
    add(column.name, [&](const Bucket& b) { return page_number(column.mean(b).value(), kDigits); });
    if (!is_thinned) continue;
    add(std::string(column.name) + "_least",
        [&](const Bucket& b) { return page_number(column.envelope(b).least, kDigits); });
    add(std::string(column.name) + "_greatest",
        [&](const Bucket& b) { return page_number(column.envelope(b).greatest, kDigits); });
  }
  return columns;
}

Json stretches_json(const Course& course, const std::array<std::string, 2>& names) {
  Json json = Json::array();
  for (std::size_t shade = 0; shade < Course::kShades; ++shade) {
    if (course.stretches(shade).empty()) continue;
    Json spans = Json::array();
    for (const Course::Stretch& stretch : course.stretches(shade)) {
      const double from_s = std::max(to_seconds(stretch.from - course.begin()), 0.0);
      const double to_s = std::max(to_seconds(stretch.to - course.begin()), from_s);
      spans.push_back({page_number(from_s, kDigitsOfTime), page_number(to_s, kDigitsOfTime)});
    }
    json.push_back({{"shade", kShadeKeys[shade]},
                    {"name", course.shade_name(shade, names)},
                    {"spans_s", std::move(spans)}});
  }
  return json;
}

Json end_json(const Course& course) {
  if (!course.is_valid_begun()) return nullptr;
  const auto since_begin = [&](TimePoint t) {
    return page_number(to_seconds(t - course.begin()), kDigitsOfTime);
  };
  const bool is_sigma_known =
      course.has([](const Bucket& b) -> const Mean& { return b.heading_sigma; });
  return {{"valid_from_s", since_begin(course.valid_begin())},
          {"valid_to_s", since_begin(course.valid_end())},
          {"heading_1_deg", heading_number(course.heading_deg(0))},
          {"heading_2_deg", heading_number(course.heading_deg(1))},
          {"heading_mean_deg", heading_number(course.heading_deg(2))},
          {"heading_virtual_deg", heading_number(course.heading_deg(3))},
          {"heading_sigma_deg",
           is_sigma_known ? page_number(course.heading_sigma_deg(), kDigits) : Json(nullptr)}};
}

Json course_json(const Course& course, const std::string& axis,
                 const std::array<std::string, 2>& names) {
  const std::vector<std::size_t> rows = rows_of(course);
  Json times_s = Json::array();
  for (const std::size_t row : rows) {
    times_s.push_back(
        page_number(to_seconds(course.width()) * (static_cast<double>(row) + 0.5), kDigitsOfTime));
  }
  Json ranges = Json::array();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const auto [low, high] = course.drift_range_dps(gyro);
    ranges.push_back(high > low ? Json{page_number(low, kDigits), page_number(high, kDigits)}
                                : Json(nullptr));
  }
  return {{"axis", axis},
          {"begin_us",
           std::chrono::duration_cast<std::chrono::microseconds>(course.begin().time_since_epoch())
               .count()},
          {"step_s", to_seconds(course.width())},
          {"end", end_json(course)},
          {"stretches", stretches_json(course, names)},
          {"drift_ranges_dps", std::move(ranges)},
          {"t_s", std::move(times_s)},
          {"columns", columns_json(course, rows)}};
}

}  // namespace

Expected<std::string> replay_page(const PageSubject& subject, const gateway::Plan& plan,
                                  const ReplaySummary& summary, std::span<const Course> courses) {
  const std::array<std::string, 2> names{plan.gyros[0].name, plan.gyros[1].name};
  Json json{{"version", VGYRO_VERSION},
            {"log", subject.title},
            {"config", subject.config},
            {"gyros", names}};
  json["summary"] = to_json(summary, plan);
  json["summary"].erase("frames_by_id");  // long: one entry for each identifier on the bus
  json["courses"] = Json::array();
  for (std::size_t i = 0; i < courses.size(); ++i) {
    if (courses[i].empty()) continue;
    json["courses"].push_back(
        course_json(courses[i], plan.axes.empty() ? "" : axis_name(plan.axes[i]), names));
  }
  if (json["courses"].empty())
    return fail({}, "there is nothing to draw: no pair of samples was formed");
  return page_of({.title = "vgyro replay",
                  .noscript = "This page draws its tables and plots with a script that it holds "
                              "itself; please allow it. --plot draws a picture without one.",
                  .made_by = "Made by vgyro replay.",
                  .style = pages::replay_style,
                  .script = pages::replay_script},
                 json);
}

}  // namespace vgyro::cli
