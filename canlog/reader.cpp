#include "canlog/reader.h"

#include "canlog/candump.h"
#include "canlog/log_source.h"

namespace vgyro::canlog {

Expected<std::unique_ptr<LogReader>> open_log(const std::string& path) {
  auto source = open_source(path);
  if (!source) return tl::unexpected(source.error());
  return std::make_unique<CandumpReader>(std::move(*source));
}

}  // namespace vgyro::canlog
