// Reads a log of any form and prints the number of its frames and the time taken.

#include <chrono>
#include <cstdio>

#include "canlog/reader.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: vgyro_read_log LOG\n", stderr);
    return 2;
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto opened = vgyro::canlog::open_log(argv[1]);
  if (!opened) {
    std::fprintf(stderr, "%s\n", opened.error().message().c_str());
    return 1;
  }
  vgyro::canlog::LogReader& reader = **opened;
  vgyro::canlog::LogRecord record;
  unsigned long long id_sum = 0;  // printed, so that the compiler can leave out no reading
  while (reader.next(record))
    id_sum += record.frame.id + record.frame.data[0];
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  std::printf("%llu frames (sum %llu) in %.3f s\n",
              static_cast<unsigned long long>(reader.counts().frames), id_sum, seconds.count());
  return reader.error() ? 1 : 0;
}
