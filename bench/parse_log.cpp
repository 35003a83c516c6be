// Parses every line of a candump log and prints the number of its frames.

#include <cstdio>
#include <utility>

#include "canlog/candump.h"
#include "canlog/log_source.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: vgyro_parse_log LOG\n", stderr);
    return 2;
  }
  auto source = vgyro::canlog::open_source(argv[1]);
  if (!source) {
    std::fprintf(stderr, "%s\n", source.error().message().c_str());
    return 1;
  }
  vgyro::canlog::CandumpReader reader(std::move(*source));
  vgyro::canlog::LogRecord record;
  unsigned long long id_sum = 0;  // printed, so that the compiler can leave out no parsing
  while (reader.next(record))
    id_sum += record.frame.id + record.frame.data[0];
  std::printf("%llu frames (sum %llu)\n", static_cast<unsigned long long>(reader.counts().frames),
              id_sum);
  return reader.error() ? 1 : 0;
}
