//! Requests that only ArduPilot knows, or answers in its own way.

use super::super::stack::FlightStack;
use super::super::{AutopilotKind, Commander, LinkId, VehicleMode};
use super::ArduCopter;
use gleaner_link::Frame;
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::MavSeverity;

/// Superseded messages that ground stations still send; the generated names carry deprecation warnings.
pub(super) const SET_MODE: u32 = 11;
pub(super) const REQUEST_DATA_STREAM: u32 = 66;

impl ArduCopter {
    pub(super) fn select_mode(&mut self, by: Commander, custom_mode: u32) -> MavResult {
        match VehicleMode::from_custom_mode(AutopilotKind::ArduPilot, custom_mode) {
            None => {
                self.say(MavSeverity::MAV_SEVERITY_WARNING, &format!("No such mode {custom_mode}"));
                MAV_RESULT_FAILED
            }
            Some(mode) => self.request_mode(by, mode),
        }
    }

    /// The older message with the same meaning as `DO_SET_MODE`.
    pub(super) fn set_mode_by_message(&mut self, link: LinkId, frame: &Frame) {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let custom_mode = u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]);
        let result = self.select_mode(link.commander(), custom_mode);
        self.vehicle.ports.acknowledge(link, SET_MODE as u16, result, frame.sender);
    }

    /// `REQUEST_DATA_STREAM` of older ground stations; every stream number requests all messages here.
    pub(super) fn set_all_streams(&mut self, link: LinkId, frame: &Frame) {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let (rate_hz, start) = (u16::from_le_bytes([byte(0), byte(1)]), byte(5) == 1);
        let interval_us = if start && rate_hz > 0 { 1e6 / f32::from(rate_hz) } else { -1.0 };
        self.vehicle.ports.streams(link).set_all(self.vehicle.now, interval_us);
    }
}

/// As ArduPilot spells the mode in its texts.
pub(super) const fn name(mode: VehicleMode) -> &'static str {
    match mode {
        VehicleMode::Stabilize => "Stabilize",
        VehicleMode::AltitudeHold => "AltHold",
        VehicleMode::Guided | VehicleMode::TakeOff => "Guided",
        VehicleMode::Hold => "Loiter",
        VehicleMode::Return => "RTL",
        VehicleMode::Land => "Land",
        VehicleMode::Brake => "Brake",
    }
}
