#pragma once

// [[output.layout]]: a message of any DBC file that the virtual rate goes out in, resolved as far
// as it can be before there is a rate: which bits, which range, what stands for "not available",
// and the value of all unused bits. Errors carry file and line, as in gateway/config.

#include "base/toml_reader.h"
#include "gateway/gyro_config.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// Reads the key `layout` of [output] into `plan.output`, whose bus is known, and adds their buses.
void read_output_layouts(TomlReader& output, TableContext context, Plan& plan);

/// No output is read back as an input, and none has the identifier of another.
void check_output_ids(TomlReader& output, const Plan& plan);

}  // namespace vgyro::gateway
