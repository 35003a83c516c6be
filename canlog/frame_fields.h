#pragma once

// Fields of a frame as logs of every form have them, with the bounds that a frame has.

#include "can/frame.h"

namespace vgyro::canlog {

/// A classic or FD frame's length; for FD padded up to what an FD frame can have. Null, or why not.
const char* set_length(unsigned bytes, can::Frame& frame);

/// A DLC code, 0 to 15: of FD the length it stands for, of a classic frame above 8 a raw DLC.
const char* set_dlc(unsigned dlc, can::Frame& frame);

/// An error frame of a log that gives no details, in the form that asc2log writes.
void set_error_frame(can::Frame& frame);

/// The smallest length code, 0 to 15, whose length holds the bytes (at most 64).
unsigned dlc_of(std::size_t bytes);

/// Null, or why it cannot be.
const char* set_id(std::uint32_t id, bool extended, can::Frame& frame);

}  // namespace vgyro::canlog
