#include "canlog/reader.h"

#include <algorithm>

#include "canlog/candump.h"
#include "canlog/forms.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

// The form that recognises the earliest line. `from` is the place to begin, and to continue from
// when there are more bytes.
const Form* form_of_lines(std::string_view head, bool is_whole, std::size_t& from) {
  while (from < head.size()) {
    std::size_t end = head.find('\n', from);
    if (end == head.npos) {
      // The last line of a log may lack its end, or be cut off.
      if (!is_whole) return nullptr;
      end = head.size();
    }
    std::uint64_t skipped = 0;
    const std::string_view line = clean_line(head.substr(from, end - from), skipped);
    for (const Form& form : forms()) {
      if (form.has_line != nullptr && form.has_line(line)) return &form;
    }
    from = end + 1;
  }
  return nullptr;
}

const Form* binary_form(std::string_view head) {
  for (const Form& form : forms()) {
    if (form.begins != nullptr && form.begins(head)) return &form;
  }
  return nullptr;
}

// No control characters except those of layout.
bool is_text(std::string_view head) {
  const auto odd = std::count_if(head.begin(), head.end(), [](char c) {
    return (c >= '\0' && c < '\t') || (c > '\r' && c < ' ') || c == '\x7F';
  });
  return odd == 0;
}

std::string known_forms() {
  std::string names;
  for (const Form& form : forms()) {
    if (!form.name.empty()) names += (names.empty() ? "" : ", ") + std::string(form.name);
  }
  return names;
}

Error unknown(const HeadedSource& source) {
  for (const ForeignForm& form : foreign_forms()) {
    if (form.begins(source.head())) {
      return {source.name(), std::string(form.what) + ", which is not read here",
              std::string(form.remedy)};
    }
  }
  return {source.name(),
          is_text(source.head()) ? "is text, but not a known log of CAN frames"
                                 : "is not a known log of CAN frames",
          "known are: " + known_forms()};
}

bool is_foreign(std::string_view head) {
  const auto all = foreign_forms();
  return std::any_of(all.begin(), all.end(),
                     [&](const ForeignForm& form) { return form.begins(head); });
}

bool is_nothing(std::string_view head) {
  return head.find_first_not_of(std::string_view("\0 \t\r\n\xEF\xBB\xBF", 8)) == head.npos;
}

}  // namespace

Expected<std::unique_ptr<LogReader>> open_log(const std::string& path) {
  auto bytes = open_bytes(path);
  if (!bytes) return tl::unexpected(bytes.error());
  return open_log(std::move(*bytes));
}

Expected<std::unique_ptr<LogReader>> open_log(std::unique_ptr<ByteSource> bytes) {
  auto source = std::make_unique<HeadedSource>(std::move(bytes));
  const Form* form = nullptr;
  std::size_t looked_at = 0;
  while (form == nullptr && source->grow()) {
    form = binary_form(source->head());
    // A foreign form may contain lines of a log.
    if (form == nullptr && is_foreign(source->head())) return tl::unexpected(unknown(*source));
    if (form == nullptr) form = form_of_lines(source->head(), false, looked_at);
  }
  if (form == nullptr) form = form_of_lines(source->head(), true, looked_at);
  if (form != nullptr) return form->open(std::move(source));
  if (source->head().empty() && source->error()) return tl::unexpected(*source->error());
  // An empty log is a log; a log may also begin with very many NUL bytes.
  if (is_nothing(source->head())) {
    return std::make_unique<CandumpReader>(std::make_unique<LogSource>(std::move(source)));
  }
  return tl::unexpected(unknown(*source));
}

}  // namespace vgyro::canlog
