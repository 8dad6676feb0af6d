//! What a ground station knows of the flight: everything that the frames on the vehicle's link show.
//!
//! Used where the pilot runs in another process, and for the telemetry log of a finished flight.

use crate::flight::{DeviceState, Live, Text};
use crate::words::{mode, owner};
use gleaner_link::{
    Address, Firmware, FlightMode, Frame, Heartbeat, Message, TUNNEL_DECISION, is_multirotor,
};
use gleaner_pilot::{DecisionRecord, LoggedDecision, Mission, State};
use gleaner_units::{Action, GridFrame, Ned};
use mavlink::dialects::ardupilotmega::NAMED_VALUE_FLOAT_DATA;
use mavlink::{MavlinkVersion, MessageData as _};

/// `MAV_COMP_ID_AUTOPILOT1`.
const AUTOPILOT: u8 = 1;
/// How the pilot's texts begin when its state changes, after "gleaner: ".
const STATE_TEXTS: [(&str, State); 9] = [
    ("idle", State::Idle),
    ("engage requested", State::Waiting),
    ("engaged", State::Engaged),
    ("going home", State::Homing),
    ("landing", State::Done),
    ("landed", State::Done),
    ("passive", State::Passive),
    ("fault", State::Fault),
    ("shadow, ", State::Shadow),
];

/// The flight as the vehicle's link shows it.
#[derive(Clone, Debug)]
pub struct Station {
    pilot: Address,
    /// In a local frame whose origin is the grid's corner.
    frame: GridFrame,
    mission: Mission,
    firmware: Option<Firmware>,
    mode: Option<FlightMode>,
    armed: bool,
    state: Option<State>,
    reason: String,
    position: Option<(f32, f32)>,
    height_m: Option<f32>,
    charge_pct: Option<u8>,
    spent_units: f32,
    telemetry: Telemetry,
    devices: Vec<DeviceState>,
    /// Whether anything of the vehicle was received.
    on_wire: bool,
}

/// The newest `NAMED_VALUE_FLOAT` values of the pilot.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Telemetry {
    pub spare_units: Option<f32>,
    pub land_pct: Option<f32>,
    w_data: f32,
    collected: f32,
}

/// Something in a frame that the page lists.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// A text of the pilot or the autopilot.
    Text(Text),
    /// A decision of the pilot.
    Decision(DecisionRecord),
}

impl Station {
    /// A station that has heard nothing yet.
    #[must_use]
    pub fn new(mission: &Mission, pilot: Address) -> Station {
        let devices = mission
            .devices
            .iter()
            .map(|site| DeviceState { remaining: site.data, snr_db: None, reachable: false })
            .collect();
        Station {
            pilot,
            frame: GridFrame::new(mission.grid(), mission.pose, mission.pose.corner),
            mission: mission.clone(),
            firmware: None,
            mode: None,
            armed: false,
            state: None,
            reason: String::new(),
            position: None,
            height_m: None,
            charge_pct: None,
            spent_units: 0.0,
            telemetry: Telemetry::default(),
            devices,
            on_wire: false,
        }
    }

    /// Reads a frame that arrived at `t_s`.
    pub fn receive(&mut self, t_s: f64, frame: &Frame) -> Option<Heard> {
        if frame.sender.system != self.pilot.system {
            return None;
        }
        self.on_wire = true;
        let from_pilot = frame.sender.component == self.pilot.component;
        if from_pilot && frame.message_id == NAMED_VALUE_FLOAT_DATA::ID {
            self.telemetry.read(frame);
            return None;
        }
        match Message::decode(frame).ok()?? {
            Message::StatusText { severity, text, .. } => {
                let text = String::from_utf8_lossy(&text).into_owned();
                if from_pilot {
                    self.follow(&text);
                }
                Some(Heard::Text(Text { t_s, severity, text }))
            }
            Message::Tunnel { payload_type: TUNNEL_DECISION, payload, .. } if from_pilot => {
                let record = DecisionRecord::decode(&payload)?;
                self.decided(&record);
                Some(Heard::Decision(record))
            }
            message => {
                if frame.sender.component == AUTOPILOT {
                    self.observe(&message);
                }
                None
            }
        }
    }

    /// The vehicle's pilot, once its address is known.
    pub fn set_pilot(&mut self, pilot: Address) {
        self.pilot = pilot;
    }

    /// The devices as the radio reported them, in the mission's order.
    pub fn set_devices(&mut self, devices: Vec<DeviceState>) {
        self.devices = devices;
    }

    pub(crate) fn devices_mut(&mut self) -> &mut [DeviceState] {
        &mut self.devices
    }

    /// A decision on the wire.
    fn decided(&mut self, record: &DecisionRecord) {
        self.follow_decision(record.state, record.action);
        self.telemetry.w_data = record.w_data;
        self.telemetry.collected = record.collected;
    }

    /// A decision of a log, which may have no telemetry beside it.
    pub(crate) fn logged(&mut self, logged: &LoggedDecision) {
        if !self.on_wire {
            self.follow_decision(logged.state, logged.action);
            let [x, y] = logged.cell.map(f32::from);
            self.position = Some((x + 0.5, y + 0.5));
        }
        self.telemetry.w_data = logged.w_data;
        self.telemetry.collected = logged.collected;
        self.telemetry.spare_units = Some(logged.spare);
    }

    fn follow_decision(&mut self, state: State, action: Action) {
        if self.state != Some(state) {
            self.state = Some(state);
            self.reason.clear();
        }
        if state.flies() {
            self.spent_units += action.cost().0;
        }
    }

    /// The moment.
    #[must_use]
    pub fn live(&self, t_s: f64) -> Live {
        let state = self.state.unwrap_or(State::Idle);
        Live {
            t_s,
            state: self.state.map_or("not heard", State::name).into(),
            owner: owner(state, self.armed).into(),
            reason: self.reason.clone(),
            mode: mode(self.mode, self.firmware).into(),
            x: self.position.map(|(east, _)| east),
            y: self.position.map(|(_, north)| north),
            height_m: self.height_m,
            battery_units: Some((self.mission.budget.0 - self.spent_units).max(0.0)),
            spare_units: self.telemetry.spare_units,
            battery_pct: self.charge_pct.map(f32::from),
            land_pct: self.telemetry.land_pct,
            w_data: self.telemetry.w_data,
            collected: self.telemetry.collected,
            devices: self.devices.clone(),
        }
    }

    pub(crate) const fn telemetry(&self) -> Telemetry {
        self.telemetry
    }

    /// A text of the pilot announces each change of its state.
    fn follow(&mut self, text: &str) {
        let Some(words) = text.strip_prefix("gleaner: ") else { return };
        let Some((_, state)) = STATE_TEXTS.iter().find(|(start, _)| words.starts_with(start)) else { return };
        if *state == State::Waiting {
            self.spent_units = 0.0;
        }
        self.state = Some(*state);
        let explains = !matches!(state, State::Idle | State::Engaged | State::Shadow);
        self.reason = if explains { words.into() } else { String::new() };
    }

    fn observe(&mut self, message: &Message) {
        match message {
            Message::Heartbeat(heartbeat) => self.beat(heartbeat),
            Message::GlobalPosition(position) => {
                let (north, east) = self.mission.pose.corner.offset_to(&position.point);
                let down_m = -position.altitude_above_home.0;
                let point = self.frame.point(&Ned { north_m: north.0, east_m: east.0, down_m });
                let cell_m = self.mission.grid().cell().0;
                self.position = Some((point.east_m / cell_m, point.north_m / cell_m));
                self.height_m = Some(-down_m);
            }
            Message::BatteryStatus(battery) if battery.id == 0 => {
                self.charge_pct = battery.remaining_percent.or(self.charge_pct);
            }
            Message::SysStatus(status) => {
                self.charge_pct = status.battery_remaining_percent.or(self.charge_pct);
            }
            _ => {}
        }
    }

    fn beat(&mut self, heartbeat: &Heartbeat) {
        if !is_multirotor(heartbeat.vehicle) {
            return;
        }
        let firmware = Firmware::from_wire(heartbeat.autopilot);
        self.firmware = Some(firmware);
        self.armed = heartbeat.armed;
        self.mode = Some(FlightMode::from_custom_mode(firmware, heartbeat.vehicle, heartbeat.custom_mode));
    }
}

impl Telemetry {
    pub(crate) fn read(&mut self, frame: &Frame) {
        let Ok(value) = NAMED_VALUE_FLOAT_DATA::deser(MavlinkVersion::V2, frame.payload()) else { return };
        match value.name.to_str() {
            Ok("spare_bat") => self.spare_units = Some(value.value),
            Ok("land_pct") => self.land_pct = Some(value.value),
            Ok("w_data") => self.w_data = value.value,
            Ok("collected") => self.collected = value.value,
            _ => {}
        }
    }
}
