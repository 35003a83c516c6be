#pragma once

// Makes the frames that the gateway reads from values, the reverse of gyro_input.h. A value that a
// signal cannot carry becomes the nearest one that it can; unused bits are 0.

#include <cstdint>
#include <optional>
#include <span>

#include "base/error.h"
#include "can/frame.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// All bits 0, of the length that the DBC file gives the message.
can::Frame empty_frame(const FrameMatch& match);

/// Selects the page of the quantity in a multiplexed message, and writes the value.
void put_quantity(const Quantity& quantity, double value, can::Frame& frame);

/// Rate with its sign, alive counter, validity. `count` is the number of the frame.
void put_gyro(const GyroPlan& plan, double rate_dps, std::uint64_t count, can::Frame& frame);

/// Writes a value for which the comparison holds; leaves the bits alone if it holds already. False
/// if there is no such value.
bool put_valid(const ValidCondition& condition, std::span<std::uint8_t> payload);

/// Writes the alive counter of frame number `count`, if the message has one.
void put_counter(const E2ePlan& e2e, std::uint64_t count, can::Frame& frame);

/// Writes the check value. Call it when the rest of the frame is complete.
void seal(const E2ePlan& e2e, can::Frame& frame);

/// Is there room for this quantity of the gyro's (kBesides) in the frame that put_gyro() filled, or
/// is it on a page of its own?
bool carries(const GyroPlan& plan, const Quantity& beside, const can::Frame& frame);

/// The largest magnitude that the rate's signal can carry in both directions, deg/s.
double carried_dps(const GyroPlan& plan);

/// Error when no value of the signal fulfils the plan's `valid`.
Expected<void> check_valid(const GyroPlan& plan);

}  // namespace vgyro::gateway
