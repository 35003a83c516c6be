#include "cli/output/json_text.h"

#include "cli/output/output_file.h"

namespace vgyro::cli {

std::string json_text(const nlohmann::ordered_json& json) {
  constexpr int kIndent = 2;
  return json.dump(kIndent, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

Expected<void> write_json(const std::string& path, const nlohmann::ordered_json& json) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  file->write(json_text(json));
  return file->close();
}

}  // namespace vgyro::cli
