#include "unpacked.h"

#include <array>
#include <cstdio>
#include <lzma.h>

#include <gtest/gtest.h>

namespace vgyro::daemon {

std::string unpacked(const std::string& xz) {
  lzma_stream stream = LZMA_STREAM_INIT;
  EXPECT_EQ(::lzma_stream_decoder(&stream, UINT64_MAX, LZMA_CONCATENATED), LZMA_OK);
  stream.next_in = reinterpret_cast<const std::uint8_t*>(xz.data());
  stream.avail_in = xz.size();
  std::string text;
  std::vector<char> room(65'536);
  lzma_ret result = LZMA_OK;
  while (result == LZMA_OK) {
    stream.next_out = reinterpret_cast<std::uint8_t*>(room.data());
    stream.avail_out = room.size();
    result = ::lzma_code(&stream, LZMA_FINISH);
    text.append(room.data(), room.size() - stream.avail_out);
  }
  EXPECT_EQ(result, LZMA_STREAM_END);
  ::lzma_end(&stream);
  return text;
}

std::string unpacked(const CaptureRing::Blocks& blocks) {
  std::string xz;
  for (const auto& block : blocks)
    xz += block->xz;
  return xz.empty() ? xz : unpacked(xz);
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    lines.push_back(text.substr(at, end - at));
    at = end == std::string::npos ? text.size() : end + 1;
  }
  return lines;
}

can::Frame numbered_frame(std::uint32_t number) {
  can::Frame frame;
  frame.id = 0x101;
  frame.length = 8;
  for (std::size_t i = 0; i < 4; ++i)
    frame.data[i] = static_cast<std::uint8_t>(number >> 8 * (3 - i));
  return frame;
}

// The last 123 ns do not show in candump's digits.
TimePoint numbered_stamp(std::uint32_t number) {
  return time_from_ns(1'700'000'000'000'000'123 + std::int64_t{number} * 1'000'000);
}

std::string numbered_line(std::uint32_t number, const std::string& bus) {
  std::array<char, 128> line{};
  const int bytes =
      std::snprintf(line.data(), line.size(), "(%u.%03u000) %s 101#%08X00000000",
                    1'700'000'000U + number / 1000, number % 1000, bus.c_str(), number);
  return {line.data(), static_cast<std::size_t>(bytes)};
}

}  // namespace vgyro::daemon
