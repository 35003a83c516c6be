#include "daemon/capture.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "gateway/condition_text.h"

namespace vgyro::daemon {
namespace {

// If the ring's thread has not packed the last block by then, the capture is written without it.
constexpr int kPackingSecondsMost = 20;
// Waits at the end of the process. systemd would allow longer, but a disk that is slower than this
// would hardly finish then either.
constexpr std::chrono::milliseconds kPackingPatience{1000};
constexpr std::chrono::milliseconds kDiskPatience{5000};
// Further causes listed in one capture; its frames show the others.
constexpr std::size_t kAlsoMost = 8;

std::string input_text(const std::string& bus, const gateway::FrameMatch& match) {
  const std::string id = to_string(gateway::FrameId{match.id, match.extended});
  const std::uint32_t all = match.extended ? can::kExtendedIdMax : can::kStandardIdMax;
  if (match.mask == all) return fmt::format("{} {}", bus, id);
  return fmt::format("{} {} mask {:08X}", bus, id, match.mask);
}

}  // namespace

/// Where the writing thread leaves its result.
struct Capture::Desk {
  std::mutex mutex;  ///< guards what follows
  std::optional<Expected<std::string>> result;
};

Capture::Capture(Options options, Log& log)
    : options_(std::move(options)),
      log_(log),
      store_(std::make_shared<CaptureStore>(options_.directory, options_.disk)),
      ring_(options_.ring),
      desk_(std::make_shared<Desk>()) {}

Capture::~Capture() = default;

Expected<void> Capture::open(TimePoint now) {
  bool other = false;
  Expected<void> opened = store_->open(other);
  if (!opened && other) return opened;
  if (!opened) {
    told_of_failure_ = true;
    log_.tell(Severity::kWarning, {.cause = "capture"}, "{}; trying again with each capture",
              opened.error().message());
  }
  // The interval also holds across restarts: a gateway that restarts in a loop must not wear out
  // the disk.
  for (std::size_t i = 0; i < kCaptureCauses; ++i) {
    const std::optional<TimePoint> newest = store_->newest(static_cast<CaptureCause>(i));
    if (!newest || now < *newest) continue;
    const double left_s = options_.interval_s - to_seconds(span(*newest, now));
    quiet_s_[i] = static_cast<int>(std::clamp(left_s, 0.0, double{1.0} * options_.interval_s));
  }
  return {};
}

void Capture::use(const gateway::Plan& plan, const std::string& fingerprint) {
  std::vector<Input> inputs;
  for (gateway::FrameMatch match : plan.inputs()) {
    const std::string& bus = plan.buses[match.bus];
    match.bus = 0;
    match.bytes = 0;
    Input input{bus, std::move(match)};
    // Both gyros may be in one message.
    if (std::find(inputs.begin(), inputs.end(), input) == inputs.end())
      inputs.push_back(std::move(input));
  }
  const bool all_stay = std::all_of(inputs_.begin(), inputs_.end(), [&](const Input& input) {
    return std::find(inputs.begin(), inputs.end(), input) != inputs.end();
  });
  if (!all_stay) {
    ring_.forget();
    log_.notice("the recording of the last minutes begins anew: an input that was in it is gone");
  }
  ring_.use(std::make_shared<CaptureSource>(CaptureSource{plan.buses, fingerprint}));
  router_ = std::make_unique<gateway::Router>(plan);
  inputs_ = std::move(inputs);
  gyro_names_ = {plan.gyros[0].name, plan.gyros[1].name};
  fingerprint_ = fingerprint;
}

void Capture::second_passed(const gateway::Status& status, TimePoint now) {
  ring_.second_passed();
  for (int& left_s : quiet_s_)
    left_s = std::max(0, left_s - 1);
  take_result();
  look_for_causes(status, now);
  second_passed(asked_);
  second_passed(caused_);
}

void Capture::look_for_causes(const gateway::Status& status, TimePoint now) {
  const CaptureTriggers::Causes causes = triggers_.look(status);
  for (std::size_t i = 0; i < kCaptureCauses; ++i) {
    const auto cause = static_cast<CaptureCause>(i);
    if (causes[i]) begin(cause, text_of(cause, status), now);
  }
}

// A cause that begins while the capture of an earlier one still gathers frames is listed in that
// capture.
void Capture::begin(CaptureCause cause, std::string text, TimePoint now) {
  int& quiet_s = quiet_s_[static_cast<std::size_t>(cause)];
  if (quiet_s > 0) {
    ++held_back_;
    return;
  }
  quiet_s = options_.interval_s;
  if (caused_) {
    if (caused_->note.also.size() < kAlsoMost) caused_->note.also.push_back(std::move(text));
    return;
  }
  caused_ = Pending{.note = note_of(cause, std::move(text), now),
                    .seconds_left = kAftermathSeconds,
                    .sealed = {},
                    .packing_s = 0};
}

std::string Capture::text_of(CaptureCause cause, const gateway::Status& status) const {
  switch (cause) {
    case CaptureCause::kContradicted:
      return gateway::contradiction_text(status.pair, gyro_names_);
    case CaptureCause::kDisagree:
      return "the gyros disagree; it is not known which one is wrong";
    case CaptureCause::kStopsRefused:
      return gateway::stretches_text(gateway::steady_stretches(status));
    case CaptureCause::kAsked:
      break;
  }
  return "requested on D-Bus";
}

CaptureNote Capture::note_of(CaptureCause cause, std::string text, TimePoint now) const {
  CaptureNote note{.cause = cause,
                   .text = std::move(text),
                   .also = {},
                   .at = now,
                   .instance = options_.instance,
                   .fingerprint = fingerprint_,
                   .inputs = {},
                   .overlaps = {}};
  for (const Input& input : inputs_)
    note.inputs.push_back(input_text(input.bus, input.match));
  return note;
}

Expected<void> Capture::ask(Answer answer, TimePoint now) {
  if (asked_ || answer_) {
    return fail({}, "a capture that was asked for is still being written",
                "ask again when it is done");
  }
  asked_ = Pending{.note = note_of(CaptureCause::kAsked, text_of(CaptureCause::kAsked, {}), now),
                   .seconds_left = 0,
                   .sealed = ring_.seal(),
                   .packing_s = 0};
  answer_ = std::move(answer);
  return {};
}

void Capture::second_passed(std::optional<Pending>& pending) {
  if (!pending) return;
  if (pending->seconds_left > 0 && --pending->seconds_left > 0) return;
  if (!pending->sealed) pending->sealed = ring_.seal();
  const bool is_packed = ring_.is_packed(*pending->sealed);
  if (is_packed || ++pending->packing_s > kPackingSecondsMost) start_writing(pending);
}

// Only one capture is written at a time: each may hold as many frames as the ring.
void Capture::start_writing(std::optional<Pending>& pending) {
  if (writing_) return;
  CaptureRing::Blocks blocks = ring_.blocks();
  CaptureNote note = std::move(pending->note);
  pending.reset();
  if (blocks.empty()) {
    const Expected<std::string> nothing =
        fail({}, "there is nothing to write: no frame of an input came, or none was packed",
             "`vgyro status` shows the buses");
    if (note.cause == CaptureCause::kAsked) {
      answer(nothing);
    } else {
      tell_failure(nothing.error());
    }
    return;
  }
  writing_frames_ = 0;
  TimePoint first = blocks.front()->first;
  writing_last_ = blocks.front()->last;
  for (const auto& block : blocks) {
    writing_frames_ += block->frames;
    first = std::min(first, block->first);
    writing_last_ = std::max(writing_last_, block->last);
  }
  if (!last_.empty() && first <= last_stamp_) note.overlaps = last_.substr(last_.rfind('/') + 1);
  writing_ = std::move(note);
  write(std::move(blocks));
}

void Capture::write(CaptureRing::Blocks blocks) {
  try {
    thread_.start([desk = desk_, store = store_, note = *writing_, blocks = std::move(blocks)] {
      Expected<std::string> written;
      try {
        written = store->write(note, blocks);
      } catch (const std::exception& error) {
        written = fail(store->directory(), error.what());
      }
      const std::scoped_lock lock(desk->mutex);
      desk->result = std::move(written);
    });
  } catch (const std::exception& error) {
    desk_->result = fail(options_.directory, std::string("no thread to write it: ") + error.what());
  }
}

void Capture::take_result() {
  std::optional<Expected<std::string>> result;
  {
    const std::scoped_lock lock(desk_->mutex);
    result = std::exchange(desk_->result, std::nullopt);
  }
  if (!result || !writing_) return;
  tell(*result);
  const bool was_asked = writing_->cause == CaptureCause::kAsked;
  writing_.reset();
  if (was_asked) answer(*result);
}

void Capture::tell(const Expected<std::string>& written) {
  if (!written) {
    tell_failure(written.error());
    return;
  }
  told_of_failure_ = false;
  ++written_[static_cast<std::size_t>(writing_->cause)];
  last_ = *written;
  last_stamp_ = writing_last_;
  log_.tell(Severity::kNotice, {.cause = "capture"}, "{}: capture of {} input frames; cause: {}",
            last_, writing_frames_, writing_->text);
}

void Capture::tell_failure(const Error& error) {
  ++failed_;
  if (std::exchange(told_of_failure_, true)) return;
  log_.tell(Severity::kWarning, {.cause = "capture"}, "{}", error.message());
}

void Capture::answer(const Expected<std::string>& written) {
  const Answer answer = std::exchange(answer_, nullptr);
  if (answer) answer(written);
}

void Capture::finish() {
  if (writing_ && thread_.finish(kDiskPatience)) take_result();
  if (!caused_ || writing_) return;
  ring_.wait_until_packed(ring_.seal(), kPackingPatience);
  start_writing(caused_);
  if (thread_.finish(kDiskPatience)) take_result();
}

CaptureStatus Capture::status() const {
  return {.directory = options_.directory,
          .ring = ring_.counts(),
          .written = written_,
          .failed = failed_,
          .held_back = held_back_,
          .is_writing = writing_.has_value(),
          .last = last_};
}

}  // namespace vgyro::daemon
