//! States and reasons in plain words.

use gleaner_link::{Firmware, FlightMode};
use gleaner_pilot::{Machine, State};

/// Who has the aircraft.
pub(crate) const fn owner(state: State, armed: bool) -> &'static str {
    match state {
        State::Boot | State::Idle if armed => "The operator has the aircraft; Gleaner is idle",
        State::Boot | State::Idle => "The aircraft is on the ground; Gleaner is idle",
        State::Waiting => "The operator has the aircraft; Gleaner waits to engage",
        State::Engaged => "Gleaner flies the mission",
        State::Homing => "Gleaner flies to the terminal",
        State::Done => "The mission is over: the autopilot lands or has landed",
        State::Passive => "The pilot or a failsafe has the aircraft",
        State::Fault => "Gleaner gave up: take the aircraft",
        State::Shadow => "The operator has the aircraft; Gleaner only watches",
    }
}

/// Why it waits, returns, gave up or was taken over; empty while the mission runs.
pub(crate) fn reason(machine: &Machine) -> String {
    let text = machine
        .missing()
        .map(|missing| format!("Waiting: {}", missing.text()))
        .or_else(|| machine.fault().map(|fault| format!("Fault: {}", fault.text())))
        .or_else(|| machine.take_over().map(|take_over| format!("Taken over: {}", take_over.text())))
        .or_else(|| machine.return_reason().map(|reason| format!("Going home: {}", reason.text())));
    text.unwrap_or_default()
}

/// The autopilot's mode by its own name.
pub(crate) const fn mode(mode: Option<FlightMode>, firmware: Option<Firmware>) -> &'static str {
    match (mode, firmware) {
        (None, _) => "not heard",
        (Some(FlightMode::Guided), Some(Firmware::Px4)) => "OFFBOARD",
        (Some(FlightMode::Guided), _) => "GUIDED",
        (Some(FlightMode::Hold), _) => "hold",
        (Some(FlightMode::TakeOff), _) => "take-off",
        (Some(FlightMode::Return), _) => "return",
        (Some(FlightMode::Land), _) => "land",
        (Some(FlightMode::Other(_)), _) => "another mode",
    }
}
