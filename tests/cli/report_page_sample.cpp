// Writes the report page of a made-up result to standard output, for report_page_test.py.

#include <cstdio>

#include "cli/gap/report_page.h"
#include "made_up_result.h"

int main() {
  const std::string page =
      vgyro::cli::report_page(vgyro::cli::made_up_subject(), vgyro::cli::made_up_result());
  return std::fwrite(page.data(), 1, page.size(), stdout) == page.size() ? 0 : 1;
}
