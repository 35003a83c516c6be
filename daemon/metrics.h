#pragma once

// The gateway's metrics for Prometheus: a text file that node_exporter's textfile collector reads.
// A separate thread writes the file, whole or not at all; a file that cannot be written is reported
// once.

#include <string>

#include "daemon/background_writer.h"
#include "daemon/log.h"
#include "daemon/snapshot.h"

namespace vgyro::daemon {

/// Prometheus' text format, with the units in the names.
std::string metrics_text(const Snapshot& now);

class MetricsFile {
 public:
  static constexpr int kPeriod_s = 5;

  MetricsFile(std::string path, Log& log);

  /// To be called about once a second; true when it is time for write().
  bool second_passed();
  void write(const Snapshot& now) { writer_.put(metrics_text(now)); }

 private:
  [[nodiscard]] Expected<void> replace(const std::string& text) const;

  std::string path_;
  std::string new_path_;
  Log& log_;
  int second_ = 0;
  bool failed_ = false;  ///< the last write failed, and that was reported
  BackgroundWriter writer_;
};

}  // namespace vgyro::daemon
