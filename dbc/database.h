#pragma once

// The contents of a DBC file as values: messages, signals, units, labels. Built by dbc/parser.h;
// independent of frames on a bus.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

namespace vgyro::dbc {

enum class ByteOrder : std::uint8_t { kIntel, kMotorola };
enum class ValueType : std::uint8_t { kUnsigned, kSigned, kFloat32, kFloat64 };

/// Whose rules define the raw values that are not measurements (dbc/codes.h).
enum class CodeRules : std::uint8_t { kNone, kJ1939, kNmea2000 };

struct ValueLabel {
  std::int64_t raw = 0;
  std::string text;
};

/// A signal is present only while the multiplexor signal's raw value lies in one of the ranges.
struct MultiplexCondition {
  std::string multiplexor;  ///< name of a signal of the same message, itself perhaps conditional
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;  ///< both ends included
};

struct Signal {
  std::string name;
  std::string long_name;        ///< from SystemSignalLongSymbol; empty: `name` is complete
  std::uint16_t start_bit = 0;  ///< as in the file: LSB for Intel, MSB for Motorola
  std::uint16_t length_bits = 0;
  ByteOrder byte_order = ByteOrder::kIntel;
  ValueType type = ValueType::kUnsigned;
  double factor = 1.0;
  double offset = 0.0;
  double minimum = 0.0;  ///< physical; minimum == maximum means that the file gives no range
  double maximum = 0.0;
  std::string unit;  ///< UTF-8
  std::string comment;
  bool is_multiplexor = false;
  std::optional<MultiplexCondition> condition;
  std::vector<ValueLabel> labels;
  std::optional<double> start_raw;  ///< GenSigStartValue: the raw value before the first frame
  unsigned line = 0;

  [[nodiscard]] const std::string* label(std::int64_t raw) const;
  [[nodiscard]] bool is_integer() const {
    return type == ValueType::kSigned || type == ValueType::kUnsigned;
  }
};

struct Message {
  std::string name;
  std::string long_name;  ///< from SystemMessageLongSymbol; empty: `name` is complete
  std::uint32_t id = 0;   ///< without flags
  bool extended = false;
  bool is_j1939 = false;  ///< compare by PGN, any source address
  bool is_fd = false;     ///< CAN FD, according to VFrameFormat or its length
  CodeRules codes = CodeRules::kNone;
  std::uint16_t size_bytes = 0;
  std::string sender;
  std::string comment;
  std::vector<Signal> signals;
  unsigned line = 0;

  /// Finds a signal by its name, or by its long name if no signal has that name.
  [[nodiscard]] const Signal* find_signal(std::string_view signal_name) const;
  /// For suggestions: names, then long names.
  [[nodiscard]] std::vector<std::string> signal_names() const;
  /// Does a frame with this identifier carry this message?
  [[nodiscard]] bool matches(std::uint32_t frame_id, bool frame_extended) const;
  /// Identifier bits that take part in the match: all 11 or 29, or J1939's PGN.
  [[nodiscard]] std::uint32_t id_mask() const;
};

/// The bits of a 29-bit identifier that contain its J1939 parameter group: the mask of a message
/// with this identifier if it is a J1939 message.
std::uint32_t pgn_mask(std::uint32_t id);
/// J1939: the same parameter group from the same sender, whatever its priority, to the same
/// receiver.
bool same_sender(std::uint32_t id, std::uint32_t other);

/// Something odd in the file. The rest of the file is kept.
struct Diagnostic {
  unsigned line = 0;
  std::string what;
};

struct Database {
  std::string path;
  std::vector<Message> messages;
  std::vector<Diagnostic> diagnostics;

  /// Finds a message by its name, or by its long name if no message has that name.
  [[nodiscard]] const Message* find_message(std::string_view message_name) const;
  /// For suggestions: names, then long names.
  [[nodiscard]] std::vector<std::string> message_names() const;
};

}  // namespace vgyro::dbc
