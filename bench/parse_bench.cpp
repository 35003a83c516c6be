// Cost of each stage per frame: the log's text, a signal's bits, the whole pipeline, the output's
// text. Uses examples/twin.log.xz, unpacked into memory beforehand.

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "base/time.h"
#include "canlog/candump.h"
#include "canlog/log_source.h"
#include "gateway/config.h"
#include "gateway/pipeline.h"

namespace vgyro {
namespace {

constexpr const char* kLog = VGYRO_EXAMPLES "/twin.log.xz";
constexpr const char* kConfig = VGYRO_EXAMPLES "/twin.toml";

[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::exit(1);
}

struct Recording {
  std::vector<canlog::LogRecord> records;
  std::vector<std::string> interfaces;
  std::string text;
};

Recording load_recording() {
  auto source = canlog::open_source(kLog);
  if (!source) give_up(source.error().message());
  canlog::CandumpReader reader(std::move(*source));
  Recording out;
  canlog::LogRecord record;
  char line[canlog::kLineBytesMax];
  while (reader.next(record)) {
    out.records.push_back(record);
    const std::size_t size =
        canlog::format_line(line, record.stamp, reader.interfaces().name(record.bus), record.frame,
                            record.fraction_digits);
    out.text.append(line, size);
  }
  if (reader.error()) give_up(reader.error()->message());
  out.interfaces = reader.interfaces().names();
  return out;
}

const Recording& recording() {
  static const Recording loaded = load_recording();
  return loaded;
}

gateway::Plan load_plan() {
  auto resolved = gateway::load_config(kConfig);
  if (!resolved) give_up(resolved.error().front().message());
  return resolved->plan;
}

void parse_log(benchmark::State& state) {
  std::int64_t frames = 0;
  for (auto _ : state) {
    state.PauseTiming();
    canlog::CandumpReader reader(canlog::log_from_text(recording().text));
    state.ResumeTiming();
    canlog::LogRecord record;
    while (reader.next(record)) {
      benchmark::DoNotOptimize(record.frame.data[0]);
      ++frames;
    }
  }
  state.SetItemsProcessed(frames);
}
BENCHMARK(parse_log)->Unit(benchmark::kMillisecond);

void format_log(benchmark::State& state) {
  const auto& [records, interfaces, text] = recording();
  char line[canlog::kLineBytesMax];
  for (auto _ : state) {
    for (const canlog::LogRecord& r : records)
      benchmark::DoNotOptimize(
          canlog::format_line(line, r.stamp, interfaces[r.bus], r.frame, r.fraction_digits));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(records.size()));
}
BENCHMARK(format_log)->Unit(benchmark::kMillisecond);

/// Argument: the gyro, 0 Intel, 1 Motorola.
void decode_rate(benchmark::State& state) {
  const gateway::Plan plan = load_plan();
  const auto& codec = plan.gyros.at(static_cast<std::size_t>(state.range(0))).rate.codec;
  const auto& records = recording().records;
  for (auto _ : state) {
    for (const canlog::LogRecord& r : records)
      benchmark::DoNotOptimize(codec.decode(r.frame.payload()).value);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(records.size()));
}
BENCHMARK(decode_rate)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

class CountingSink final : public gateway::FrameSink {
 public:
  void put(const can::Frame& frame, TimePoint /*stamp*/) override { sum += frame.data[0]; }
  std::uint64_t sum = 0;
};

/// One pass is the recording from waiting to the end of the run; the pipeline is rebuilt outside
/// the measured time. Argument: the method.
void pipeline_frame(benchmark::State& state) {
  gateway::Plan plan = load_plan();
  plan.corrector.method = static_cast<gateway::Method>(state.range(0));
  const auto& [records, interfaces, text] = recording();
  std::vector<can::BusIndex> plan_bus;
  for (const std::string& name : interfaces) {
    const auto at = std::find(plan.buses.begin(), plan.buses.end(), name);
    if (at == plan.buses.end()) give_up(name + " is not in the configuration");
    plan_bus.push_back(static_cast<can::BusIndex>(at - plan.buses.begin()));
  }
  CountingSink sink;
  for (auto _ : state) {
    state.PauseTiming();
    gateway::Pipeline pipeline(plan);
    state.ResumeTiming();
    for (const canlog::LogRecord& r : records) {
      pipeline.advance(r.stamp, sink);
      pipeline.receive(plan_bus[r.bus], r.frame, r.stamp, sink);
    }
  }
  benchmark::DoNotOptimize(sink.sum);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(records.size()));
}
BENCHMARK(pipeline_frame)
    ->ArgName("method")
    ->Arg(static_cast<std::int64_t>(gateway::Method::kMean))
    ->Arg(static_cast<std::int64_t>(gateway::Method::kMutual))
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vgyro

BENCHMARK_MAIN();
