#pragma once

// A receiver that uses only the published DBC file: output frames → signals by name.

#include <cstdint>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "can/frame.h"
#include "dbc/multiplex.h"
#include "dbc/parser.h"

namespace vgyro::gateway {

struct Field {
  double value = 0.0;
  std::int64_t raw = 0;
  std::string label;  ///< label of the raw value; empty if it has none
};
using Fields = std::map<std::string, Field>;

class Receiver {
 public:
  /// `file` is in dbc/.
  explicit Receiver(const std::string& file)
      : database_(dbc::load(std::string(VGYRO_DBC_DIR) + "/" + file).value()) {}

  [[nodiscard]] Fields decode(const can::Frame& frame) const {
    Fields fields;
    for (const dbc::Message& message : database_.messages) {
      if (!message.matches(frame.id, frame.has(can::kExtended))) continue;
      EXPECT_EQ(frame.length, message.size_bytes);
      dbc::MessageCodec(message).for_each(
          frame.payload(), [&](const dbc::Signal& signal, const dbc::Reading& reading) {
            const std::string* label = signal.label(reading.raw);
            fields[signal.name] = {reading.value, reading.raw, label ? *label : ""};
          });
    }
    return fields;
  }

 private:
  dbc::Database database_;
};

}  // namespace vgyro::gateway
