// Writes the report page of a made-up result to standard output, for report_page_test.py; with an
// argument, the first page of a result of two axes.

#include <cstdio>
#include <vector>

#include "cli/gap/report_page.h"
#include "made_up_result.h"

namespace {

using vgyro::cli::AxisResult;

// The effects about an axis are of a unit's own axis, which is a different one.
AxisResult made_up_axis(const char* axis, std::size_t sensor_axis) {
  AxisResult result{vgyro::cli::made_up_subject(), vgyro::cli::made_up_result()};
  result.subject.axis = axis;
  result.subject.sensor_axis = {sensor_axis, sensor_axis};
  return result;
}

}  // namespace

int main(int argc, char** /*argv*/) {
  const std::vector<AxisResult> axes{made_up_axis("x", 2), made_up_axis("y", 1)};
  const std::string page = argc > 1 ? vgyro::cli::overview_page(axes)
                                    : vgyro::cli::report_page(vgyro::cli::made_up_subject(),
                                                              vgyro::cli::made_up_result());
  return std::fwrite(page.data(), 1, page.size(), stdout) == page.size() ? 0 : 1;
}
