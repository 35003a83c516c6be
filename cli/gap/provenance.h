#pragma once

// Where a gap report comes from: enough to make it again, and to see whether the files are still
// the same. The same input and command line give the same text; no clock is read.

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace vgyro::cli {

struct InputFile {
  std::string path;    ///< as it was given
  std::string sha256;  ///< of its bytes; empty: no regular file, or gone since
  std::string began;   ///< of a recording: when its first frame came; empty: no recording
};

struct Provenance {
  std::string command;           ///< the command line, quoted for a shell
  std::vector<InputFile> files;  ///< configuration, DBC files, model, recordings
};

/// "vgyro gap --config 'my car.toml'", of the words after the program's name.
std::string command_text(const std::vector<std::string>& words);

/// "2026-05-04 08:00:12 UTC"; of stamps that are no date, what they are.
std::string began_text(double began_s);

InputFile input_file(const std::string& path);

nlohmann::ordered_json provenance_json(const Provenance& provenance);

}  // namespace vgyro::cli
