// `vgyro convert`: logs of any known form → one log of the form that the output's name selects.

#include <algorithm>

#include <fmt/format.h>

#include "canlog/merged_reader.h"
#include "canlog/pack.h"
#include "canlog/writer.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/log_notes.h"
#include "cli/log_progress.h"
#include "cli/output/errors.h"
#include "cli/output/output_file.h"
#include "cli/output/overwrite.h"
#include "cli/output/terminal.h"
#include "cli/output/unfinished.h"

namespace vgyro::cli {

namespace {

class FileSink final : public canlog::ByteSink {
 public:
  explicit FileSink(OutputFile& file) : file_(file) {}
  void write(std::string_view bytes) override { file_.write(bytes); }
  void rewrite(std::uint64_t offset, std::string_view bytes) override {
    file_.rewrite(offset, bytes);
  }
  [[nodiscard]] bool can_rewrite() const override { return file_.can_rewrite(); }

 private:
  OutputFile& file_;
};

struct Target {
  const canlog::WrittenForm* form = nullptr;
  std::string_view packing;  ///< ".gz", …; empty: none
};

Expected<Target> target_of(const std::string& path) {
  if (path == "-") return Target{canlog::written_form(".log"), {}};
  Target target;
  target.packing = canlog::packing_ending(path);
  const std::string_view bare =
      std::string_view(path).substr(0, path.size() - target.packing.size());
  target.form = canlog::written_form(bare);
  if (target.form == nullptr) {
    std::string endings;
    for (const canlog::WrittenForm& form : canlog::written_forms())
      endings += fmt::format("{}{} ({})", endings.empty() ? "" : ", ", form.ending, form.name);
    return fail(
        path, "its name does not select a log form",
        "the name ends in " + endings + "; text also in .log.gz, .log.xz, .log.zst and so on");
  }
  if (!target.packing.empty() && !target.form->is_text) {
    return fail(path, fmt::format("{} is already compressed", target.form->name),
                fmt::format("leave {} away", target.packing));
  }
  return target;
}

void copy_records(canlog::LogReader& reader, canlog::LogWriter& writer, const std::string& name) {
  LogProgress progress("convert " + name, reader);
  canlog::LogRecord record;
  while (reader.next(record)) {
    writer.put(record, reader.interfaces().name(record.bus), reader.xl_frame());
    progress.add();
  }
  writer.finish();
}

void tell_logs(const ConvertOptions& options, const canlog::LogReader& reader) {
  const auto parts = reader.parts();
  for (std::size_t i = 0; i < parts.size(); ++i)
    tell("{}", log_text(options.logs[i], *parts[i], true));
}

// Reports what was read from each log, and the channel of each interface name.
void tell_result(const ConvertOptions& options, const Target& target,
                 const canlog::LogReader& reader, const canlog::LogWriter& writer) {
  tell_logs(options, reader);
  std::string channels;
  if (writer.channels() != nullptr) {
    for (const auto& [name, channel] : writer.channels()->entries())
      channels += fmt::format("{}channel {} is {}", channels.empty() ? "; " : ", ", channel, name);
  }
  tell("{}: {}{}\n", options.output == "-" ? "standard output" : options.output, target.form->name,
       channels);
}

}  // namespace

int run_convert(const ConvertOptions& options) {
  const auto target = target_of(options.output);
  if (!target) return report(target.error());
  if (const auto free = check_outputs(options.logs, {options.output}); !free) {
    return report(free.error());
  }
  const auto opened = canlog::open_logs(options.logs);
  if (!opened) return report(opened.error());
  canlog::LogReader& reader = **opened;
  auto output = OutputFile::open(options.output);
  if (!output) return report(output.error());
  const FinishOnInterrupt finish(std::count(options.logs.begin(), options.logs.end(), "-") > 0);
  if (options.output == "-") reader.before_wait([&] { output->flush(); });
  FileSink file(*output);
  if (target->form->rewrites && !file.can_rewrite()) {
    return report(Error{
        options.output,
        fmt::format("{} is completed at the end, so the output must be a file", target->form->name),
        "name a file"});
  }
  std::unique_ptr<canlog::PackingSink> packed;
  if (!target->packing.empty()) packed = canlog::packing_sink(target->packing, file);
  canlog::ByteSink& sink = packed ? static_cast<canlog::ByteSink&>(*packed) : file;
  const auto writer = target->form->writer(sink, {options.digits});
  copy_records(reader, *writer, name_of(options.logs));
  if (packed) packed->finish();
  if (reader.counts().frames + reader.counts().xl_frames == 0 && !reader.error()) {
    if (!options.quiet) tell_logs(options, reader);
    return report(Error{name_of(options.logs), kNoFrame, kLogsRemedy});
  }
  if (const auto closed = output->close(); !closed) return report(closed.error());
  if (!options.quiet) tell_result(options, *target, reader, *writer);
  for (const canlog::LogWriter::Omission& omission : writer->omissions()) {
    warn({options.output,
          fmt::format("{} {} are not in it, which this form or its readers do not know",
                      omission.frames, omission.what),
          {}});
  }
  return reader.error() ? report(*reader.error()) : kDone;
}

}  // namespace vgyro::cli
