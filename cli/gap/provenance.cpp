#include "cli/gap/provenance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ctime>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/gap/sha256.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

// 1990 and 2200: a stamp outside counts from a start, not from 1970. CAN loggers are younger.
constexpr double kDateLeast_s = 631'152'000.0;
constexpr double kDateMost_s = 7'258'118'400.0;

bool is_plain(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         (c != '\0' && std::strchr("-_./=:,+@%", c) != nullptr);
}

// As a shell reads it back.
std::string quoted(const std::string& word) {
  if (!word.empty() && std::all_of(word.begin(), word.end(), is_plain)) return word;
  std::string text = "'";
  for (const char c : word) {
    if (c == '\'') {
      text += R"('\'')";
    } else {
      text += c;
    }
  }
  return text + "'";
}

}  // namespace

std::string command_text(const std::vector<std::string>& words) {
  std::string text = "vgyro";
  for (const std::string& word : words)
    text += " " + quoted(word);
  return text;
}

std::string began_text(double began_s) {
  if (!(began_s >= kDateLeast_s && began_s < kDateMost_s))
    return fmt::format("no date: the stamps begin at {:.3f} s", began_s);
  const auto seconds = static_cast<std::time_t>(std::floor(began_s));
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", &utc);
  return text.data();
}

InputFile input_file(const std::string& path) {
  return {path, sha256_of_file(path).value_or(""), {}};
}

Json provenance_json(const Provenance& provenance) {
  Json files = Json::array();
  for (const InputFile& file : provenance.files)
    files.push_back({{"path", file.path}, {"sha256", file.sha256}, {"began", file.began}});
  return {{"version", VGYRO_VERSION}, {"command", provenance.command}, {"files", files}};
}

}  // namespace vgyro::cli
