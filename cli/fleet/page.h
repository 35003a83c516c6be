#pragma once

// A fleet for people: one page that holds all it needs and runs no script; names reach it as text.

#include <string>

#include "fleet/judge.h"

namespace vgyro::cli {

std::string fleet_page(const fleet::Pool& pool, const fleet::Judgement& judgement);

}  // namespace vgyro::cli
