#include "cli/fleet/evidence_file.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>
#include <variant>

#include <fmt/format.h>

#include "base/file.h"
#include "cli/fleet/drive_reader.h"
#include "cli/fleet/pool_text.h"

namespace vgyro::cli {

namespace {

// Lines parsed in parallel: enough to keep all threads busy, few enough to need little memory.
constexpr std::size_t kBatch = 1024;
constexpr std::size_t kWorkersMost = 16;

/// A parsed line; std::monostate: an empty one.
using Understood = std::variant<std::monostate, fleet::Drive, fleet::Pool, Fault>;

Understood understood(const std::string& line, JsonReader& reader) {
  if (line.empty()) return {};
  try {
    const JsonValue json = reader.parse(line);
    if (const std::uint64_t format = count_of(member(json, "format"), "format");
        format != kEvidenceFormat) {
      return Fault{
          fmt::format("its format is {}, and this version reads {}", format, kEvidenceFormat)};
    }
    const std::string_view what = text_of(member(json, "evidence"), "evidence");
    if (what == "drive") return drive_of(json, line);
    if (what == "pool") return pool_of(json);
    return Fault{"\"evidence\" is neither \"drive\" nor \"pool\""};
  } catch (const Fault& fault) {
    return fault;
  }
}

/// Reads ahead: while a batch is added to the pool, threads parse the next one.
class Lines {
 public:
  explicit Lines(const std::string& path) : file_(path, std::ios::binary) { ask(); }

  [[nodiscard]] bool is_open() const { return file_.is_open(); }
  /// The next lines in order; none if the file ended or could not be read further.
  std::vector<Understood> next() {
    std::vector<Understood> batch = next_.get();
    if (!batch.empty()) ask();
    return batch;
  }
  /// Precondition: next() returned none.
  [[nodiscard]] bool failed() const { return file_.bad(); }

 private:
  void ask() {
    next_ = std::async(std::launch::async, [this] { return batch(); });
  }

  std::vector<Understood> batch() {
    std::vector<std::string> lines;
    std::string line;
    while (lines.size() < kBatch && std::getline(file_, line))
      lines.push_back(std::move(line));
    std::vector<Understood> all(lines.size());
    const std::size_t workers =
        std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kWorkersMost);
    readers_.resize(workers);
    std::vector<std::future<void>> running;
    for (std::size_t worker = 0; worker < std::min(workers, lines.size()); ++worker) {
      running.push_back(std::async(std::launch::async, [&, worker] {
        for (std::size_t i = worker; i < lines.size(); i += workers)
          all[i] = understood(lines[i], readers_[worker]);
      }));
    }
    for (std::future<void>& one : running)
      one.get();
    return all;
  }

  std::ifstream file_;
  std::vector<JsonReader> readers_;  // one for each worker
  // Last, so that its destructor waits for the running batch before the other members are
  // destroyed.
  std::future<std::vector<Understood>> next_;
};

Expected<bool> add(const Understood& line, fleet::Pool& pool) {
  if (const auto* drive = std::get_if<fleet::Drive>(&line)) return pool.add(*drive);
  if (const auto* more = std::get_if<fleet::Pool>(&line)) {
    if (const auto added = pool.add(*more); !added) return tl::unexpected(added.error());
  }
  if (const auto* fault = std::get_if<Fault>(&line))
    return fail("", "no evidence: " + fault->what, fault->remedy);
  return true;
}

}  // namespace

Expected<std::size_t> add_evidence(const std::string& path, fleet::Pool& pool) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    return fail(path, code ? "cannot be read: " + code.message() : "is no file",
                "a file that vgyro gap --evidence or vgyro fleet wrote");
  }
  Lines lines(path);
  if (!lines.is_open()) return fail(path, "cannot be read: " + system_reason());
  std::size_t again = 0;
  unsigned number = 0;
  for (auto batch = lines.next(); !batch.empty(); batch = lines.next()) {
    for (const Understood& line : batch) {
      ++number;
      auto added = add(line, pool);
      if (!added) {
        added.error().where = at_line(path, number);
        return tl::unexpected(added.error());
      }
      if (!*added) ++again;
    }
  }
  if (lines.failed()) return fail(path, "cannot be read: " + system_reason());
  if (number == 0) return fail(path, "holds nothing", "a file that vgyro gap --evidence wrote");
  return again;
}

}  // namespace vgyro::cli
