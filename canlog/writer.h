#pragma once

// Writes records as a log of some form. A writer has no files: its bytes go into a sink.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "canlog/record.h"

namespace vgyro::canlog {

/// Takes the bytes of a writer. It reports its first failure only when it is closed.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  virtual void write(std::string_view bytes) = 0;
  /// Overwrites bytes written earlier, so that a header can describe what follows it. Precondition:
  /// can_rewrite().
  virtual void rewrite(std::uint64_t offset, std::string_view bytes) = 0;
  [[nodiscard]] virtual bool can_rewrite() const = 0;
};

/// Interface names ↔ the channel numbers (from 1 on) of forms that have no names. When reading,
/// channel N is "canN-1", as in can-utils' asc2log and python-can. When writing, "canN-1" gets
/// channel N; other names, and those whose number is taken, get the lowest free one in order of
/// appearance.
std::string channel_name(unsigned channel);
class ChannelNumbers {
 public:
  unsigned channel_of(std::string_view name);
  struct Entry {
    std::string name;
    unsigned channel = 0;
  };
  [[nodiscard]] const std::vector<Entry>& entries() const { return entries_; }

 private:
  std::vector<Entry> entries_;
};

struct WriterOptions {
  unsigned fraction_digits = 0;  ///< 6 or 9; 0: as in each record
};

class LogWriter {
 public:
  LogWriter() = default;
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;
  virtual ~LogWriter() = default;

  /// `bus` is the name of the record's interface; `xl` holds the frame if record.is_xl. What the
  /// form cannot hold is counted and not written.
  virtual void put(const LogRecord& record, std::string_view bus, const XlFrame* xl) = 0;
  /// Call once, after the last record.
  virtual void finish() = 0;

  /// What put() could not write ("CAN XL frames"), and how often.
  struct Omission {
    std::string what;
    std::uint64_t frames = 0;
  };
  [[nodiscard]] const std::vector<Omission>& omissions() const { return omissions_; }
  /// The channel of each interface, for forms without names; else null.
  [[nodiscard]] virtual const ChannelNumbers* channels() const { return nullptr; }

 protected:
  void omit(std::string_view what);

 private:
  std::vector<Omission> omissions_;
};

/// A form that can be written, chosen by the ending of the output's name.
struct WrittenForm {
  std::string_view ending;  ///< ".blf"
  std::string_view name;
  bool is_text;   ///< can be packed on the way
  bool rewrites;  ///< needs a sink that can rewrite
  std::unique_ptr<LogWriter> (*writer)(ByteSink& sink, const WriterOptions& options);
};
std::span<const WrittenForm> written_forms();
/// The form for an output of this name; null if the ending is unknown.
const WrittenForm* written_form(std::string_view path);

}  // namespace vgyro::canlog
