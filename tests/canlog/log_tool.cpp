// Runs the product's log reader and writer for tests in other languages.
// log_tool read FILE      one JSON object per record; the counts as the last line
// log_tool write < JSON   objects of that form in, lines of a log out

#include <cstdio>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "canlog/candump.h"

namespace {

using nlohmann::json;
using vgyro::can::Frame;
using vgyro::can::FrameFlag;
using vgyro::canlog::Direction;

constexpr std::pair<const char*, FrameFlag> kFlags[] = {
    {"extended", vgyro::can::kExtended}, {"remote", vgyro::can::kRemote},
    {"error", vgyro::can::kError},       {"fd", vgyro::can::kFd},
    {"brs", vgyro::can::kBitRateSwitch}, {"esi", vgyro::can::kErrorStateIndicator},
};
constexpr const char* kDirections[] = {"", "R", "T"};

json told(const vgyro::canlog::LogRecord& record, const std::string& interface) {
  const Frame& frame = record.frame;
  json object = {{"ns", to_ns(record.stamp)},
                 {"interface", interface},
                 {"digits", record.fraction_digits},
                 {"direction", kDirections[static_cast<std::size_t>(record.direction)]},
                 {"id", frame.id},
                 {"length", frame.length},
                 {"raw_dlc", frame.raw_dlc}};
  for (const auto& [name, flag] : kFlags)
    object[name] = frame.has(flag);
  const auto payload = frame.has(vgyro::can::kRemote) ? frame.payload().first(0) : frame.payload();
  object["data"] = std::vector<int>(payload.begin(), payload.end());
  return object;
}

int read(const char* path) {
  const auto opened = vgyro::canlog::open_log(path);
  if (!opened) {
    std::cerr << opened.error().message() << '\n';
    return 1;
  }
  vgyro::canlog::LogReader& reader = **opened;
  vgyro::canlog::LogRecord record;
  while (reader.next(record)) {
    if (!record.is_xl) {
      std::cout << told(record, reader.interfaces().name(record.bus)).dump() << '\n';
    }
  }
  const auto& counts = reader.counts();
  std::cout << json{{"frames", counts.frames},
                    {"xl", counts.xl_frames},
                    {"other", counts.other_lines},
                    {"malformed", counts.malformed_lines}}
                   .dump()
            << '\n';
  return 0;
}

int write() {
  for (std::string line; std::getline(std::cin, line);) {
    const json object = json::parse(line);
    Frame frame;
    frame.id = object["id"];
    frame.length = object["length"];
    frame.raw_dlc = object["raw_dlc"];
    for (const auto& [name, flag] : kFlags) {
      if (object[name]) frame.flags = static_cast<std::uint8_t>(frame.flags | flag);
    }
    std::size_t at = 0;
    for (const std::uint8_t byte : object["data"])
      frame.data.at(at++) = byte;
    const std::string direction = object["direction"];
    char text[vgyro::canlog::kLineBytesMax];
    const std::size_t length =
        vgyro::canlog::format_line(text, vgyro::time_from_ns(object["ns"]),
                                   std::string(object["interface"]), frame, object["digits"],
                                   direction.empty()  ? Direction::kUnknown
                                   : direction == "R" ? Direction::kReceived
                                                      : Direction::kTransmitted);
    std::cout.write(text, static_cast<std::streamsize>(length));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view mode = argc > 1 ? argv[1] : "";
  if (mode == "read" && argc == 3) return read(argv[2]);
  if (mode == "write" && argc == 2) return write();
  std::cerr << "usage: log_tool read FILE | log_tool write\n";
  return 2;
}
