#include "can/error_frame.h"

namespace vgyro::can {

std::string_view to_string(ControllerState state) {
  constexpr std::array<std::string_view, 4> kNames{"active", "warning", "passive", "bus_off"};
  return kNames[static_cast<std::size_t>(state)];
}

std::string_view to_string(ErrorCause cause) {
  constexpr std::array<std::string_view, kErrorCauseCount> kNames{
      "bus_off",          "restarted", "error_passive", "error_warning", "lost_arbitration",
      "not_acknowledged", "overflow",  "send_timeout",  "transceiver"};
  return kNames[static_cast<std::size_t>(cause)];
}

void ControllerWatch::note(const Frame& frame) {
  if (!frame.has(kError)) return;
  if ((frame.id & kSendTimeout) != 0) add(ErrorCause::kSendTimeout);
  if ((frame.id & kLostArbitration) != 0) add(ErrorCause::kLostArbitration);
  if ((frame.id & kTransceiver) != 0) add(ErrorCause::kTransceiver);
  if ((frame.id & kNotAcknowledged) != 0) add(ErrorCause::kNotAcknowledged);
  if ((frame.id & kControllerProblem) != 0 && frame.length > 1) note_controller(frame.data[1]);
  // If one frame reports both, the return from bus-off is the newer event.
  if ((frame.id & kBusOff) != 0) {
    add(ErrorCause::kBusOff);
    state_ = ControllerState::kBusOff;
  }
  if ((frame.id & kRestarted) != 0) {
    add(ErrorCause::kRestarted);
    state_ = ControllerState::kActive;
  }
}

void ControllerWatch::note_controller(std::uint8_t bits) {
  if ((bits & (kReceiveOverflow | kSendOverflow)) != 0) add(ErrorCause::kOverflow);
  if ((bits & (kReceivePassive | kSendPassive)) != 0) {
    add(ErrorCause::kErrorPassive);
    state_ = ControllerState::kPassive;
  } else if ((bits & (kReceiveWarning | kSendWarning)) != 0) {
    add(ErrorCause::kErrorWarning);
    state_ = ControllerState::kWarning;
  } else if ((bits & kActiveAgain) != 0) {
    state_ = ControllerState::kActive;
  }
}

}  // namespace vgyro::can
