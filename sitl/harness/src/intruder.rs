//! Other participants on the network: a second vehicle, a second ground station, hostile packets.

use crate::wire::Speaker;
use gleaner_link::Address;
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavFrame, MavModeFlag,
    MavParamType, MavState, MavType, PARAM_REQUEST_LIST_DATA, PARAM_SET_DATA, PositionTargetTypemask,
    SET_POSITION_TARGET_LOCAL_NED_DATA, SYS_STATUS_DATA,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// Who joins the network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intrusion {
    /// A copter with system id 2 in LOITER, with its own heartbeats, positions and an empty battery.
    SecondVehicle,
    /// A second ground station (system 250) sends its own position target once a second: metres north and east of
    /// the aircraft's take-off point.
    OtherStation([f32; 2]),
    /// A station that is not on the allow-list (system 66, component 25) commands the pilot: engage, off, return, preference,
    /// `GLN_ENABLE`, broadcast and addressed; between them broken frames and an unknown message whose payload is a
    /// complete engage command.
    Hostile,
    /// The operator's station requests all parameters and sets the preference, 50 times a second.
    ParameterStorm,
    /// The operator's station repeats its last engage command with `confirmation` 1, as after a lost acknowledgement.
    Retransmission,
}

impl fmt::Display for Intrusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Intrusion::SecondVehicle => write!(f, "a second vehicle joins the network"),
            Intrusion::OtherStation([north, east]) => {
                write!(f, "a second station sends targets {north:.0} m north, {east:.0} m east of home")
            }
            Intrusion::Hostile => write!(f, "hostile packets arrive"),
            Intrusion::ParameterStorm => write!(f, "parameters are requested and set 50 times a second"),
            Intrusion::Retransmission => write!(f, "the engage command is retransmitted"),
        }
    }
}

/// `MAV_COMP_ID_USER1`: no ground station has it.
const USER_COMPONENT: u8 = 25;

/// Where a frame enters the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Entry {
    /// On the companion's own line.
    Companion,
    /// On the autopilot's ground link.
    Ground,
}

/// An intrusion in progress.
#[derive(Debug)]
pub(crate) struct Intruder {
    intrusion: Intrusion,
    until: Instant,
    next_at: Instant,
    turn: u32,
    /// Height of the other station's targets, m down.
    down_m: f32,
    vehicle: Address,
    pilot: Address,
    speaker: Speaker,
    rng: ChaCha8Rng,
}

impl Intruder {
    /// An intrusion from now on. `pilot` is the component under test, `down_m` the altitude at which it flies.
    pub fn new(
        now: Instant,
        intrusion: Intrusion,
        lasts: Duration,
        pilot: Address,
        down_m: f32,
        seed: u64,
    ) -> Intruder {
        let address = match intrusion {
            Intrusion::SecondVehicle => Address::new(2, 1),
            Intrusion::OtherStation(_) => Address::new(250, 190),
            Intrusion::Hostile => Address::new(66, USER_COMPONENT),
            Intrusion::ParameterStorm | Intrusion::Retransmission => Address::new(255, 190),
        };
        Intruder {
            intrusion,
            until: now + lasts,
            next_at: now,
            turn: 0,
            down_m,
            vehicle: Address::new(pilot.system, 1),
            pilot,
            speaker: Speaker::new(address),
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// Whether it has ended.
    pub fn is_over(&self, now: Instant) -> bool {
        now >= self.until
    }

    /// The frames that are due.
    pub fn poll(&mut self, now: Instant) -> Vec<(Entry, Vec<u8>)> {
        if now < self.next_at {
            return Vec::new();
        }
        let interval = match self.intrusion {
            Intrusion::SecondVehicle => Duration::from_millis(200),
            Intrusion::OtherStation(_) | Intrusion::Retransmission => Duration::from_secs(1),
            Intrusion::Hostile => Duration::from_millis(40),
            Intrusion::ParameterStorm => Duration::from_millis(20),
        };
        self.next_at = now + interval;
        self.turn += 1;
        match self.intrusion {
            Intrusion::SecondVehicle => self.second_vehicle(now),
            Intrusion::OtherStation(at) => vec![(Entry::Ground, self.target(at))],
            Intrusion::Hostile => self.hostile(),
            Intrusion::ParameterStorm => {
                let Address { system, component } = self.pilot;
                let list = PARAM_REQUEST_LIST_DATA { target_system: system, target_component: component };
                let weight = f32::from(self.rng.random_range(0..=20_u8)) / 20.0;
                vec![
                    (Entry::Ground, self.speaker.frame(&list)),
                    (Entry::Ground, self.set("GLN_W_DATA", weight)),
                ]
            }
            Intrusion::Retransmission => {
                let frame = self.command(MavCmd::MAV_CMD_USER_2, 1.0, self.pilot, 1);
                vec![(Entry::Ground, frame)]
            }
        }
    }

    fn second_vehicle(&mut self, now: Instant) -> Vec<(Entry, Vec<u8>)> {
        let mut frames = Vec::new();
        if self.turn % 5 == 1 {
            frames.push(self.speaker.frame(&HEARTBEAT_DATA {
                custom_mode: 5,
                mavtype: MavType::MAV_TYPE_QUADROTOR,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                base_mode: MavModeFlag::from_bits_retain(0xD1),
                system_status: MavState::MAV_STATE_CRITICAL,
                mavlink_version: 3,
            }));
            frames.push(
                self.speaker.frame(&SYS_STATUS_DATA { battery_remaining: 1, ..SYS_STATUS_DATA::DEFAULT }),
            );
        }
        frames.push(self.speaker.frame(&LOCAL_POSITION_NED_DATA {
            time_boot_ms: now.as_boot_ms(),
            x: -500.0,
            y: 900.0,
            z: -20.0,
            vx: 5.0,
            vy: 5.0,
            vz: 0.0,
        }));
        frames.into_iter().map(|frame| (Entry::Companion, frame)).collect()
    }

    fn target(&mut self, [north_m, east_m]: [f32; 2]) -> Vec<u8> {
        self.speaker.frame(&SET_POSITION_TARGET_LOCAL_NED_DATA {
            x: north_m,
            y: east_m,
            z: self.down_m,
            type_mask: PositionTargetTypemask::from_bits_retain(0x0DF8),
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            target_system: self.vehicle.system,
            target_component: self.vehicle.component,
            ..SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        })
    }

    fn hostile(&mut self) -> Vec<(Entry, Vec<u8>)> {
        let to = if self.turn.is_multiple_of(2) { self.pilot } else { Address::ALL };
        let enable = f32::from(self.rng.random_range(0..3_u8));
        let frame = match self.rng.random_range(0..7) {
            0 => self.command(MavCmd::MAV_CMD_USER_2, enable, to, 0),
            1 => self.command(MavCmd::MAV_CMD_USER_3, 0.0, to, 0),
            2 => self.command(MavCmd::MAV_CMD_USER_1, f32::NAN, to, 0),
            3 => self.set("GLN_ENABLE", 1.0),
            4 => self.set("GLN_ALT", 20.0),
            5 => {
                let mut broken = self.command(MavCmd::MAV_CMD_USER_2, 0.0, to, 0);
                let at = self.rng.random_range(1..broken.len());
                broken[at] = self.rng.next_u32() as u8;
                broken
            }
            _ => {
                // The payload of an unknown message is a whole engage command of the operator's station.
                let mut operator = Speaker::new(Address::new(255, 190));
                std::mem::swap(&mut self.speaker, &mut operator);
                let engage = self.command(MavCmd::MAV_CMD_USER_2, 1.0, self.pilot, 0);
                std::mem::swap(&mut self.speaker, &mut operator);
                self.speaker.raw_frame(54_321, &engage)
            }
        };
        vec![(Entry::Ground, frame)]
    }

    fn set(&mut self, name: &str, value: f32) -> Vec<u8> {
        self.speaker.frame(&PARAM_SET_DATA {
            param_value: value,
            target_system: self.pilot.system,
            target_component: self.pilot.component,
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        })
    }

    fn command(&mut self, command: MavCmd, param1: f32, to: Address, confirmation: u8) -> Vec<u8> {
        self.speaker.frame(&COMMAND_LONG_DATA {
            param1,
            command,
            target_system: to.system,
            target_component: to.component,
            confirmation,
            ..COMMAND_LONG_DATA::DEFAULT
        })
    }
}
