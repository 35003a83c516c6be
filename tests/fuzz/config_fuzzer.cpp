// Input: the text of a configuration, a NUL byte, and the text of the DBC file that it names.
// Loading must give a plan from which a pipeline can be made, or errors with texts.

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <sys/mman.h>
#include <unistd.h>

#include "gateway/config.h"
#include "gateway/pipeline.h"

namespace {

// The configuration's DBC file is in its own folder, here /proc/self/fd: dbc = "201".
constexpr int kConfigFd = 200;
constexpr int kDbcFd = 201;

void place(int fd, std::string_view text) {
  const int memory = ::memfd_create("fuzzer", 0);
  const bool written =
      memory >= 0 && ::write(memory, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (!written || ::dup2(memory, fd) != fd) std::abort();
  ::close(memory);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::size_t end = text.find('\0');
  place(kConfigFd, text.substr(0, end));
  place(kDbcFd, end == text.npos ? std::string_view() : text.substr(end + 1));
  const auto loaded = vgyro::gateway::load_config("/proc/self/fd/" + std::to_string(kConfigFd));
  if (loaded) {
    assert(loaded->plan.gyros.size() == 2);
    const vgyro::gateway::Pipeline pipeline(loaded->plan);
    static_cast<void>(pipeline.status());
  } else {
    assert(!loaded.error().empty());
    for (const vgyro::Error& error : loaded.error())
      assert(!error.where.empty() && !error.what.empty());
  }
  return 0;
}
