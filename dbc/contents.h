#pragma once

// The statements of one DBC file before they are combined. They may come in any order, so anything
// that refers to a message or signal waits here until the whole file has been read.

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dbc/database.h"

namespace vgyro::dbc {

/// A message's identifier as DBC files write it: bit 31 set for 29-bit identifiers.
using FileId = std::uint32_t;
inline constexpr FileId kExtendedBit = 0x80000000;
/// VECTOR__INDEPENDENT_SIG_MSG keeps signals that belong to no message.
inline constexpr FileId kNoMessage = 0xC0000000;

/// Keeps the first oddities and counts the others, so that a hostile file cannot fill the memory.
class Diagnostics {
 public:
  static constexpr std::size_t kShownMax = 100;

  void add(unsigned line, std::string what);
  /// In the order of lines; a last entry counts the omitted ones.
  [[nodiscard]] std::vector<Diagnostic> take();

 private:
  std::vector<Diagnostic> shown_;
  std::size_t hidden_ = 0;
  unsigned first_hidden_line_ = 0;
};

struct Reference {
  unsigned line = 0;
  FileId id = 0;
  std::string signal;  ///< empty: the message itself
};

struct CommentStatement {
  Reference at;
  std::string text;
};

struct LongNameStatement {
  Reference at;
  std::string name;
};

struct LabelsStatement {
  Reference at;
  std::vector<ValueLabel> labels;
  std::string table;  ///< name of a VAL_TABLE_, instead of labels
};

inline constexpr std::uint32_t kFloatKindMax = 2;

struct FloatStatement {
  Reference at;
  std::uint32_t kind = 0;  ///< 0 integer, 1 float32, 2 float64
};

struct MultiplexStatement {
  Reference at;
  MultiplexCondition condition;
};

/// The number or the label of an attribute's value.
struct AttributeValue {
  std::optional<std::uint32_t> number;
  std::string text;
};

struct FrameFormatStatement {
  Reference at;
  AttributeValue value;
};

/// `m3` on the SG_ line; the multiplexor is known only when the message is complete.
struct SimpleMultiplex {
  std::size_t message = 0;
  std::size_t signal = 0;
  std::uint64_t value = 0;
};

/// GenSigStartValue of a signal.
struct StartValueStatement {
  Reference at;
  double raw = 0.0;
};

struct Contents {
  std::vector<Message> messages;
  std::vector<SimpleMultiplex> simple_multiplex;
  std::vector<CommentStatement> comments;
  std::vector<LongNameStatement> long_names;
  std::vector<LabelsStatement> labels;
  std::vector<FloatStatement> floats;
  std::vector<MultiplexStatement> multiplex;
  std::vector<FrameFormatStatement> frame_formats;
  std::vector<StartValueStatement> start_values;
  std::map<std::string, std::vector<ValueLabel>, std::less<>> label_tables;
  std::vector<std::string> frame_format_labels;
  AttributeValue frame_format_default;
  std::optional<double> start_value_default;
  std::string protocol;
  std::string protocol_default;
  Diagnostics diagnostics;
};

/// The identifier without bit 31, and whether it has 29 bits.
struct SplitId {
  std::uint32_t id;
  bool extended;
};
SplitId split_id(FileId file_id);

}  // namespace vgyro::dbc
