// What recording the inputs costs beside the pipeline: the frames of examples/twin.log.xz go
// through the pipeline as through vgyrod, and into the ring or not, in turns. Prints the processor
// time that a frame takes, least of the rounds: of the loop's thread, and of the thread that packs.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "canlog/candump.h"
#include "canlog/log_source.h"
#include "daemon/capture_ring.h"
#include "gateway/config.h"
#include "gateway/pipeline.h"
#include "gateway/router.h"

namespace {

using namespace vgyro;

constexpr const char* kLog = VGYRO_EXAMPLES "/twin.log.xz";
constexpr const char* kConfig = VGYRO_EXAMPLES "/twin.toml";
constexpr int kRounds = 15;
constexpr daemon::CaptureRing::Limits kLimits{.seconds = 600, .bytes = 16U << 20U};
constexpr std::chrono::milliseconds kPatience{10'000};

struct Nothing final : gateway::FrameSink {
  void put(const can::Frame& /*frame*/, TimePoint /*stamp*/) override {}
};

[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::exit(1);
}

double clock_ns(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

std::vector<canlog::LogRecord> load_records() {
  auto source = canlog::open_source(kLog);
  if (!source) give_up(source.error().message());
  canlog::CandumpReader reader(std::move(*source));
  std::vector<canlog::LogRecord> records;
  for (canlog::LogRecord record; reader.next(record);)
    records.push_back(record);
  return records;
}

struct Cost {
  double loop_ns = 1e18;  ///< a frame
  double all_ns = 1e18;   ///< of all threads
};

/// One pass. The packing thread is waited for where vgyrod would have had time for it.
Cost pass(const gateway::Plan& plan, const std::vector<canlog::LogRecord>& records, bool captures,
          std::uint64_t& held_bytes) {
  gateway::Pipeline pipeline(plan);
  const gateway::Router router(plan);
  std::optional<daemon::CaptureRing> ring;
  if (captures) {
    ring.emplace(kLimits);
    ring->use(std::make_shared<daemon::CaptureSource>(daemon::CaptureSource{plan.buses, "bench"}));
  }
  Nothing sink;
  double loop_ns = 0.0;
  const double all_begin_ns = clock_ns(CLOCK_PROCESS_CPUTIME_ID);
  for (std::size_t at = 0; at < records.size();) {
    const std::size_t end = std::min(records.size(), at + daemon::CaptureRing::kBlockFrames);
    const double begin_ns = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    for (; at < end; ++at) {
      const canlog::LogRecord& record = records[at];
      pipeline.receive(record.bus, record.frame, record.stamp, sink);
      if (ring && record.frame.is_data() && router.roles(record.bus, record.frame) != 0)
        ring->put(record.bus, record.frame, record.stamp);
    }
    loop_ns += clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_ns;
    if (ring) ring->wait_until_packed(ring->seal(), kPatience);
  }
  const double all_ns = clock_ns(CLOCK_PROCESS_CPUTIME_ID) - all_begin_ns;
  if (ring) {
    held_bytes = ring->counts().bytes;
    if (ring->counts().frames != records.size()) give_up("frames are missing in the ring");
  }
  const auto frames = static_cast<double>(records.size());
  return {loop_ns / frames, all_ns / frames};
}

}  // namespace

int main() {
  const auto loaded = gateway::load_config(kConfig);
  if (!loaded) give_up(loaded.error().front().message());
  const std::vector<canlog::LogRecord> records = load_records();
  Cost without;
  Cost with;
  std::uint64_t held_bytes = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (const bool captures : {false, true}) {
      const Cost cost = pass(loaded->plan, records, captures, held_bytes);
      Cost& best = captures ? with : without;
      best.loop_ns = std::min(best.loop_ns, cost.loop_ns);
      best.all_ns = std::min(best.all_ns, cost.all_ns);
    }
  }
  const double seconds = to_seconds(records.back().stamp - records.front().stamp);
  const auto frames = static_cast<double>(records.size());
  std::printf("%.0f frames of %.0f s, least of %d rounds\n\n", frames, seconds, kRounds);
  std::printf(
      "| processor time a frame, ns | without | with the ring | ratio |\n|---|---:|---:|---:|\n");
  std::printf("| the loop's thread: pipeline, and put() | %.0f | %.0f | %.3f |\n", without.loop_ns,
              with.loop_ns, with.loop_ns / without.loop_ns);
  std::printf("| all threads: packing too | %.0f | %.0f | %.2f |\n\n", without.all_ns, with.all_ns,
              with.all_ns / without.all_ns);
  std::printf(
      "of a core at %.0f frames/s: %.3f %% for recording; packed %.1f bytes a frame, "
      "%.2f MB in ten minutes\n",
      frames / seconds, 1e-7 * (with.all_ns - without.all_ns) * frames / seconds,
      static_cast<double>(held_bytes) / frames, static_cast<double>(held_bytes) / seconds * 600e-6);
  return 0;
}
