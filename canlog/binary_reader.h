#pragma once

// Shared by the readers of binary forms: counts, and names of buses that have numbers.

#include <array>
#include <optional>
#include <string_view>

#include "canlog/reader.h"

namespace vgyro::canlog {

class BinaryReader : public LogReader {
 public:
  [[nodiscard]] const LogCounts& counts() const final { return counts_; }
  [[nodiscard]] const InterfaceTable& interfaces() const final { return interfaces_; }
  [[nodiscard]] const std::optional<Error>& error() const final { return error_; }

 protected:
  /// `item` names what the form consists of (LogCounts::item).
  explicit BinaryReader(std::string_view item) { counts_.item = item; }

  /// Sets the bus by its channel number, from 1 on (canlog/writer.h); channel 0, which some tools
  /// write, is "can". False if there are too many buses.
  bool set_channel(unsigned channel, LogRecord& record) {
    if (channel < known_.size() && known_[channel]) {
      record.bus = *known_[channel];
      return true;
    }
    return set_new_channel(channel, record);
  }
  bool set_bus(std::string_view name, LogRecord& record);
  /// Takes nanoseconds since the epoch; shows 9 digits if 6 are not enough.
  static void set_stamp(std::int64_t ns, LogRecord& record) {
    constexpr std::int64_t kMicro_ns = 1'000;
    record.stamp = time_from_ns(ns);
    record.fraction_digits = ns % kMicro_ns == 0 ? 6 : 9;
  }

  LogCounts counts_;
  std::optional<Error> error_;

 private:
  bool set_new_channel(unsigned channel, LogRecord& record);

  InterfaceTable interfaces_;
  std::array<std::optional<can::BusIndex>, 256> known_{};  ///< by channel number
};

}  // namespace vgyro::canlog
