#pragma once

// The frames that the gateway reads, made from values: the other direction of gyro_input.h. What a
// signal cannot carry becomes the nearest that it can; unused bits are 0.

#include <cstdint>
#include <optional>
#include <span>

#include "base/error.h"
#include "can/frame.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// All bits 0, of the length that the DBC file gives the message.
can::Frame empty_frame(const FrameMatch& match);

/// The message's page is turned to the quantity's, and its value written.
void put_quantity(const Quantity& quantity, double value, can::Frame& frame);

/// Rate with its sign, alive counter, validity. `count` is the number of the frame.
void put_gyro(const GyroPlan& plan, double rate_dps, std::uint64_t count, can::Frame& frame);

/// Writes a value for which the comparison holds, leaving the bits where it does already; false
/// when there is none.
bool put_valid(const ValidCondition& condition, std::span<std::uint8_t> payload);

/// The alive counter of frame number `count`, where there is one.
void put_counter(const E2ePlan& e2e, std::uint64_t count, can::Frame& frame);

/// The check value, when everything else stands in the frame.
void seal(const E2ePlan& e2e, can::Frame& frame);

/// Does the frame that put_gyro() filled have room for this quantity of the gyro's (kBesides), or
/// has that a page of its own?
bool carries(const GyroPlan& plan, const Quantity& beside, const can::Frame& frame);

/// The largest magnitude that the rate's signal can carry on both sides, deg/s.
double carried_dps(const GyroPlan& plan);

/// Error when no value of the signal fulfils the plan's `valid`.
Expected<void> check_valid(const GyroPlan& plan);

}  // namespace vgyro::gateway
