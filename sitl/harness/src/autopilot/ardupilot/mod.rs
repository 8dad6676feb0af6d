//! A simulated ArduCopter 4.6, after measurements on its own simulator.
//!
//! # What is reproduced
//! - **Streams**: unasked, a link carries heartbeats, texts, changed parameters, and origin and home once. Everything
//!   else needs `SET_MESSAGE_INTERVAL` or `REQUEST_DATA_STREAM` on that link, and then has exactly the requested rate.
//! - **Heartbeat**: 1 Hz, and at once on a mode change.
//! - **GUIDED**: a position target holds until it is replaced. Targets are never acknowledged. They are ignored outside
//!   GUIDED, when disarmed, and outside the fence. A target during the take-off climb replaces the take-off.
//! - **Modes**: a mode ends only by a command, the pilot or a failsafe. `DO_SET_MODE` GUIDED is accepted even during a
//!   failsafe: the companion must restrain itself.
//! - **Battery failsafe**: latched, once per level.
//! - **Estimator failsafe**: LAND one second after the estimator reports its position as untrusted (`FS_EKF_ACTION` 1;
//!   from ArduPilot's documentation, not measured).
//! - **NaN** in a target ends the simulation, as it ends ArduPilot's simulator ([`Truth::killed_by_nan`]).

mod commands;
mod modes;
mod telemetry;
#[cfg(test)]
mod tests;

use super::airframe::Airframe;
use super::battery::Thresholds;
use super::guidance::{Guidance, Profile};
use super::motion::{Response, SpeedLimits};
use super::parameters::{Defaults, ParameterTable};
use super::ports::Ports;
use super::{AircraftFault, AircraftSettings, Autopilot, Commander, LinkId, Truth, VehicleMode};
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::MavParamType::{
    MAV_PARAM_TYPE_INT8 as I8, MAV_PARAM_TYPE_INT16 as I16, MAV_PARAM_TYPE_INT32 as I32,
    MAV_PARAM_TYPE_REAL32 as F32,
};
use mavlink::dialects::ardupilotmega::MavSeverity;

/// Defaults of ArduCopter 4.6.
pub(super) const DEFAULTS: Defaults = &[
    ("SYSID_THISMAV", 1.0, I16),
    ("SYSID_MYGCS", 255.0, I16),
    ("WPNAV_SPEED", 1000.0, F32),
    ("WPNAV_SPEED_UP", 250.0, F32),
    ("WPNAV_SPEED_DN", 150.0, F32),
    ("WPNAV_ACCEL", 250.0, F32),
    ("WPNAV_RADIUS", 200.0, F32),
    ("LAND_SPEED", 50.0, I16),
    ("LAND_ALT_LOW", 1000.0, I16),
    ("RTL_ALT", 1500.0, I32),
    ("RTL_LOIT_TIME", 5000.0, I32),
    ("GUID_TIMEOUT", 3.0, F32),
    ("GUID_OPTIONS", 0.0, I32),
    ("DISARM_DELAY", 10.0, I8),
    ("ARMING_CHECK", 1.0, I32),
    ("FENCE_ENABLE", 0.0, I8),
    ("FENCE_TYPE", 7.0, I8),
    ("FENCE_RADIUS", 300.0, F32),
    ("FENCE_ALT_MAX", 100.0, F32),
    ("BATT_CAPACITY", 3300.0, I32),
    ("BATT_LOW_VOLT", 10.5, F32),
    ("BATT_LOW_TIMER", 10.0, I8),
    ("BATT_FS_LOW_ACT", 0.0, I8),
    ("BATT_CRT_VOLT", 0.0, F32),
    ("BATT_FS_CRT_ACT", 0.0, I8),
];

/// From power on to the first heartbeat after a reboot.
const BOOT_TIME: Duration = Duration::from_secs(3);
/// From `NAV_TAKEOFF` to leaving the ground: 29.0 s to 59 m were measured at 2.5 m/s.
const SPIN_UP: Duration = Duration::from_millis(3_300);

/// Parameters in the units that the simulation needs, kept beside the table so that a tick looks nothing up.
#[derive(Clone, Copy, Debug)]
struct Tuning {
    profile: Profile,
    thresholds: Thresholds,
    disarm_delay: Duration,
    fence: Option<Fence>,
}

#[derive(Clone, Copy, Debug)]
struct Fence {
    radius_m: Option<f64>,
    height_m: Option<f64>,
}

/// The simulated autopilot with its aircraft.
#[derive(Debug)]
pub(crate) struct ArduCopter {
    /// The last boot, on the clock that [`Autopilot::step`] is given.
    booted_at: Instant,
    now: Instant,
    up_from: Instant,
    ports: Ports,
    parameters: ParameterTable,
    tuning: Tuning,
    airframe: Airframe,
    mode: VehicleMode,
    mode_by: Commander,
    guidance: Guidance,
    armed: bool,
    armed_at: Instant,
    /// Horizontal speed in force, m/s.
    cruise_mps: f64,
    next_heartbeat: Instant,
    killed_by_nan: bool,
    ignored_targets: u32,
}

impl ArduCopter {
    /// An autopilot at boot, on the ground, in STABILIZE.
    pub fn new(settings: AircraftSettings) -> ArduCopter {
        let mut parameters = ParameterTable::new(DEFAULTS);
        parameters.set("SYSID_THISMAV", f32::from(settings.system_id));
        ArduCopter::boot(Airframe::new(settings, Response::ARDUCOPTER), parameters)
    }

    fn boot(airframe: Airframe, parameters: ParameterTable) -> ArduCopter {
        let tuning = tuning(&parameters);
        ArduCopter {
            booted_at: Instant::ZERO,
            now: Instant::ZERO,
            up_from: Instant::ZERO,
            ports: Ports::new(airframe.settings.system_id, telemetry::STREAMABLE),
            cruise_mps: parameters.value("WPNAV_SPEED") / 100.0,
            parameters,
            tuning,
            airframe,
            mode: VehicleMode::Stabilize,
            mode_by: Commander::Operator,
            guidance: Guidance::Halt,
            armed: false,
            armed_at: Instant::ZERO,
            next_heartbeat: Instant::ZERO,
            killed_by_nan: false,
            ignored_targets: 0,
        }
    }

    fn reboot(&mut self) {
        let settings = self.airframe.settings;
        // Swapped out only to move its parts into the next boot.
        let before = std::mem::replace(self, ArduCopter::new(settings));
        *self = ArduCopter {
            booted_at: before.booted_at + (before.now - Instant::ZERO),
            up_from: Instant::ZERO + BOOT_TIME,
            next_heartbeat: Instant::ZERO + BOOT_TIME,
            ignored_targets: before.ignored_targets,
            ..ArduCopter::boot(before.airframe.rebooted(), before.parameters)
        };
    }

    fn set_own_parameter(&mut self, name: &str, value: f32) -> Option<usize> {
        let index = self.parameters.set(name, value)?;
        self.tuning = tuning(&self.parameters);
        Some(index)
    }

    /// `STATUSTEXT` on every link.
    fn say(&mut self, severity: MavSeverity, text: &str) {
        self.ports.say(&LinkId::ALL, severity, text);
    }
}

fn tuning(parameters: &ParameterTable) -> Tuning {
    let metres = |name| parameters.value(name) / 100.0;
    let seconds = |seconds: f64| Duration::from_secs_f32(seconds as f32);
    let kinds = parameters.value("FENCE_TYPE") as u32;
    Tuning {
        profile: Profile {
            limits: SpeedLimits {
                horizontal_mps: metres("WPNAV_SPEED"),
                up_mps: metres("WPNAV_SPEED_UP"),
                down_mps: metres("WPNAV_SPEED_DN"),
            },
            spin_up: SPIN_UP,
            target_timeout: seconds(parameters.value("GUID_TIMEOUT")),
            return_height_m: metres("RTL_ALT"),
            return_wait: seconds(parameters.value("RTL_LOIT_TIME") / 1000.0),
            land_slow_below_m: metres("LAND_ALT_LOW"),
            land_mps: metres("LAND_SPEED"),
            turns_to_course: true,
        },
        thresholds: Thresholds {
            low_v: parameters.value("BATT_LOW_VOLT") as f32,
            critical_v: parameters.value("BATT_CRT_VOLT") as f32,
            timer: seconds(parameters.value("BATT_LOW_TIMER")),
        },
        // Measured 10.4 s with the default of 10.
        disarm_delay: seconds(parameters.value("DISARM_DELAY") + 0.4),
        fence: (parameters.value("FENCE_ENABLE") != 0.0).then(|| Fence {
            radius_m: (kinds & 2 != 0).then(|| parameters.value("FENCE_RADIUS")),
            height_m: (kinds & 1 != 0).then(|| parameters.value("FENCE_ALT_MAX")),
        }),
    }
}

impl Autopilot for ArduCopter {
    fn step(&mut self, now: Instant) {
        self.advance(now);
    }

    fn receive(&mut self, link: LinkId, mut bytes: &[u8]) {
        loop {
            let (rest, frame) = self.ports.receive(link, bytes);
            let Some(frame) = frame else { return };
            bytes = rest;
            if !self.killed_by_nan {
                self.handle(link, &frame);
            }
        }
    }

    fn transmit(&mut self, link: LinkId) -> Vec<Vec<u8>> {
        self.ports.transmit(link)
    }

    fn pilot_selects(&mut self, mode: VehicleMode) {
        // Without a take-off mode the switch position does nothing.
        if mode != VehicleMode::TakeOff {
            self.enter(mode, Commander::Operator);
        }
    }

    fn inject(&mut self, fault: AircraftFault) {
        match fault {
            AircraftFault::Reboot => self.reboot(),
            AircraftFault::PilotSelects(mode) => self.pilot_selects(mode),
            AircraftFault::Fence(radius_m) => {
                for (name, value) in [("FENCE_TYPE", 2.0), ("FENCE_RADIUS", radius_m), ("FENCE_ENABLE", 1.0)]
                {
                    self.set_own_parameter(name, value);
                }
            }
            AircraftFault::OriginShift(_) => {
                self.airframe.inject(self.now, fault);
                self.announce_origin_and_home();
            }
            _ => self.airframe.inject(self.now, fault),
        }
    }

    fn set_parameter(&mut self, name: &str, value: f32) -> bool {
        self.set_own_parameter(name, value).is_some()
    }

    fn truth(&self) -> Truth {
        let position = self.airframe.true_position();
        Truth {
            position,
            ground_speed_mps: self.airframe.body.ground_speed_mps() as f32,
            height_m: self.airframe.settings.stand.down_m - position.down_m,
            armed: self.armed,
            on_ground: self.airframe.on_ground,
            mode: self.mode,
            mode_by: self.mode_by,
            target_by: self.guidance.target_by(),
            battery: self.airframe.battery.left(),
            killed_by_nan: self.killed_by_nan,
            is_up: self.now >= self.up_from,
            ignored_targets: self.ignored_targets,
        }
    }

    fn settings(&self) -> &AircraftSettings {
        &self.airframe.settings
    }
}
