#pragma once

// [[output.layout]]: a message of any DBC file in which the virtual rate is sent, resolved as far
// as possible before there is a rate: which bits, which range, which code for "not available", and
// the value of all unused bits. Errors carry file and line, as in gateway/config.

#include "base/toml_reader.h"
#include "gateway/gyro_config.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// Reads the key `layout` of [output] into `plan.output`, whose bus is known, and adds the layouts'
/// buses.
void read_output_layouts(TomlReader& output, TableContext context, Plan& plan);

/// Reports outputs that would be read back as an input, and outputs with the same identifier.
void check_output_ids(TomlReader& output, const Plan& plan);

}  // namespace vgyro::gateway
