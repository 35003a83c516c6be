#pragma once

// Sets fields of a frame from a log of any form, within the limits of a frame.

#include "can/frame.h"

namespace vgyro::canlog {

/// Sets the length; for FD it is padded to a possible one. Null, or what is wrong.
const char* set_length(unsigned bytes, can::Frame& frame);

/// A DLC code, 0 to 15: for FD its length, above 8 in a classic frame a raw DLC.
const char* set_dlc(unsigned dlc, can::Frame& frame);

/// An error frame from a log without details, in the form that asc2log writes.
void set_error_frame(can::Frame& frame);

/// The smallest length code, 0 to 15, whose length holds the bytes (at most 64).
unsigned dlc_of(std::size_t bytes);

/// Returns null, or what is wrong.
const char* set_id(std::uint32_t id, bool extended, can::Frame& frame);

}  // namespace vgyro::canlog
