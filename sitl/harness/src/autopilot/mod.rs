//! A simulated ArduCopter 4.6: the behaviour of the real one as it was measured on its own simulation, as far as a
//! companion computer and a ground station can see it.
//!
//! # What is imitated
//! - **Streams**: unasked, a link carries heartbeats, texts, changed parameters, and origin and home once. The rest only
//!   after `SET_MESSAGE_INTERVAL` on that link, at exactly the rate asked for.
//! - **GUIDED**: position targets hold for ever, are never acknowledged, are silently ignored outside GUIDED, when
//!   unarmed, and beyond the fence. A target during the take-off climb replaces the take-off.
//! - **Modes** change at once and a heartbeat says so at once. Nothing but a command or the pilot changes them back:
//!   `DO_SET_MODE` GUIDED is accepted even during a failsafe. The restraint must be the companion's.
//! - **Battery failsafe**: latched, once per level.
//! - **Estimator failsafe**: LAND, a second after the estimator mistrusts itself (`FS_EKF_ACTION` 1). From ArduPilot's
//!   documentation, not measured; the aircraft does not drift.
//! - **Not a number** in a target ends the simulation, as it ends ArduPilot's ([`Truth::killed_by_nan`]).
//! - **Routing**: messages pass between the links as ArduPilot passes them, to those who have spoken.
//!
//! # What is not
//! Attitude, wind, sensors, missions, geofence breach actions, sticks (the pilot is simulated by
//! [`Copter::pilot_selects`], with centred sticks).
//!
//! # Time
//! All times inside are this autopilot's clock, zero at its boot. [`Copter::step`] is the only thing that lets time
//! pass; its argument counts from the first boot.

mod battery;
mod commands;
mod guidance;
mod mode;
mod motion;
mod parameters;
mod routing;
mod streams;
mod telemetry;
#[cfg(test)]
mod tests;

pub use battery::Pack;
pub use mode::CopterMode;

use crate::wire::Speaker;
use battery::Battery;
use gleaner_link::{Address, FrameDecoder};
use gleaner_units::{BatteryUnits, Duration, GeoPoint, Instant, Ned};
use guidance::Guidance;
use mavlink::dialects::ardupilotmega::{MavSeverity, STATUSTEXT_DATA};
use motion::Body;
use parameters::ParameterTable;
use rand_chacha::ChaCha8Rng;
use routing::Routes;
use streams::Streams;

/// From power on to the first heartbeat after a [`Copter::reboot`].
const BOOT_TIME: Duration = Duration::from_secs(3);

/// One of the autopilot's serial ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LinkId(pub(crate) usize);

impl LinkId {
    /// Where the companion computer is.
    pub const COMPANION: LinkId = LinkId(0);
    /// Where the ground station is.
    pub const GROUND: LinkId = LinkId(1);
    /// Where the harness itself speaks when the ground link belongs to somebody else.
    pub const CREW: LinkId = LinkId(2);
    /// All of them.
    pub const ALL: [LinkId; 3] = [LinkId::COMPANION, LinkId::GROUND, LinkId::CREW];
}

/// What the simulated aircraft is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CopterSettings {
    /// MAVLink system id.
    pub system_id: u8,
    /// Where the estimator's origin lies.
    pub origin: GeoPoint,
    /// Where the aircraft stands at boot, in the estimator's frame; down is the ground's.
    pub stand: Ned,
    /// Its battery.
    pub pack: Pack,
    /// Standard deviation of the slow wander of the position estimate on each axis, m; 0 for none.
    pub wander_m: f32,
    /// Names the wander.
    pub seed: u64,
}

/// What is really so, for a referee. Nothing of it goes over a wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Where the aircraft is, in the estimator's frame.
    pub position: Ned,
    /// Its speed over the ground, m/s.
    pub ground_speed_mps: f32,
    /// Height above the ground it started from, m.
    pub height_m: f32,
    /// Whether the motors are armed.
    pub armed: bool,
    /// Whether it stands on the ground.
    pub on_ground: bool,
    /// Flight mode.
    pub mode: CopterMode,
    /// Whether the pilot on board asked for it, not the human pilot, the ground station or a failsafe.
    pub mode_is_companions: bool,
    /// What the battery holds.
    pub battery: BatteryUnits,
    /// Whether a target that was not a number has ended it: it is silent since.
    pub killed_by_nan: bool,
    /// Whether it speaks: not while it boots again, and nobody can know its mode then.
    pub speaks: bool,
    /// Position targets that were ignored: not GUIDED, not flying, or beyond the fence.
    pub ignored_targets: u32,
}

#[derive(Debug)]
struct Link {
    decoder: FrameDecoder,
    speaker: Speaker,
    streams: Streams,
    out: Vec<Vec<u8>>,
}

/// The simulated autopilot with its aircraft.
#[derive(Debug)]
pub struct Copter {
    settings: CopterSettings,
    /// The last boot, on the clock that [`Copter::step`] is given.
    booted_at: Instant,
    now: Instant,
    links: [Link; 3],
    routes: Routes,
    parameters: ParameterTable,
    mode: CopterMode,
    mode_is_companions: bool,
    guidance: Guidance,
    armed: bool,
    armed_at: Instant,
    on_ground: bool,
    grounded_at: Instant,
    body: Body,
    /// Unit vector of the nose.
    heading: [f64; 2],
    /// Horizontal speed in force, m/s.
    cruise_mps: f64,
    home: Option<Ned>,
    /// From when to when the estimator mistrusts itself.
    estimator_lost: Option<(Instant, Instant)>,
    battery: Battery,
    /// The estimate is this far from the truth.
    wander: [f64; 3],
    rng: ChaCha8Rng,
    speaks_from: Instant,
    next_heartbeat: Instant,
    killed_by_nan: bool,
    ignored_targets: u32,
    rc_dial_us: u16,
}

impl Copter {
    /// An autopilot at boot, on the ground, in STABILIZE.
    #[must_use]
    pub fn new(settings: CopterSettings) -> Copter {
        let link = || Link {
            decoder: FrameDecoder::new(),
            speaker: Speaker::new(Address::new(settings.system_id, 1)),
            streams: Streams::default(),
            out: Vec::new(),
        };
        let Ned { north_m, east_m, down_m } = settings.stand;
        Copter {
            settings,
            booted_at: Instant::ZERO,
            now: Instant::ZERO,
            links: [link(), link(), link()],
            routes: Routes::default(),
            parameters: ParameterTable::new(settings.system_id),
            mode: CopterMode::Stabilize,
            mode_is_companions: false,
            guidance: Guidance::Halt,
            armed: false,
            armed_at: Instant::ZERO,
            on_ground: true,
            grounded_at: Instant::ZERO,
            body: Body::at([north_m, east_m, down_m].map(f64::from)),
            heading: [1.0, 0.0],
            cruise_mps: 10.0,
            home: None,
            estimator_lost: None,
            battery: Battery::new(settings.pack),
            wander: [0.0; 3],
            rng: rand::SeedableRng::seed_from_u64(settings.seed),
            speaks_from: Instant::ZERO,
            next_heartbeat: Instant::ZERO,
            killed_by_nan: false,
            ignored_targets: 0,
            rc_dial_us: 1500,
        }
    }

    /// Bytes that arrive on a link, in any pieces. They are acted on at once.
    pub fn receive(&mut self, link: LinkId, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let taken = self.links[link.0].decoder.push(bytes);
            bytes = &bytes[taken..];
            while let Some(frame) = self.links[link.0].decoder.next_frame() {
                if !self.killed_by_nan {
                    self.handle(link, &frame);
                }
            }
        }
    }

    /// The frames that leave on a link since the last call, in order.
    pub fn transmit(&mut self, link: LinkId) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.links[link.0].out)
    }

    /// The human pilot turns the mode switch.
    pub fn pilot_selects(&mut self, mode: CopterMode) {
        self.enter(mode, false);
    }

    /// The human pilot turns the dial on RC channel 6, microseconds.
    pub fn pilot_turns_dial(&mut self, pulse_us: u16) {
        self.rc_dial_us = pulse_us;
    }

    /// The estimator mistrusts itself for so long: the position is still told, and no longer vouched for.
    pub fn estimator_fails(&mut self, lasts: Duration) {
        self.estimator_lost = Some((self.now, self.now + lasts));
    }

    /// The pack's voltage changes to this: below a threshold for its time, the failsafe begins.
    pub fn set_voltage(&mut self, voltage_v: f32) {
        self.battery.voltage_v = voltage_v;
    }

    /// The pack loses units: a weak cell.
    pub fn lose_battery(&mut self, units: BatteryUnits) {
        self.battery.lose(units);
    }

    /// The autopilot's supply fails for a moment: the motors stop, the aircraft drops where it is, and the autopilot
    /// begins anew, with its parameters and nothing else: no mode, no home, no streams, nobody on its links.
    pub fn reboot(&mut self) {
        let [north, east, _] = self.body.position;
        let ground = f64::from(self.settings.stand.down_m);
        let fresh = Copter::new(self.settings);
        let before = std::mem::replace(self, fresh);
        self.booted_at = before.booted_at + (before.now - Instant::ZERO);
        self.speaks_from = Instant::ZERO + BOOT_TIME;
        self.next_heartbeat = self.speaks_from;
        self.body = Body::at([north, east, ground]);
        self.parameters = before.parameters;
        self.battery = before.battery;
        (self.wander, self.rng) = (before.wander, before.rng);
        self.ignored_targets = before.ignored_targets;
        self.rc_dial_us = before.rc_dial_us;
    }

    /// Sets one of the autopilot's own parameters before the flight, as a ground crew would. Whether it exists.
    pub fn set_parameter(&mut self, name: &str, value: f32) -> bool {
        self.parameters.set(name, value).is_some()
    }

    /// What is really so.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let [north_m, east_m, down_m] = self.true_position().map(|metres| metres as f32);
        Truth {
            position: Ned { north_m, east_m, down_m },
            ground_speed_mps: self.body.ground_speed_mps() as f32,
            height_m: self.settings.stand.down_m - down_m,
            armed: self.armed,
            on_ground: self.on_ground,
            mode: self.mode,
            mode_is_companions: self.mode_is_companions,
            battery: self.battery.left(),
            killed_by_nan: self.killed_by_nan,
            speaks: self.now >= self.speaks_from,
            ignored_targets: self.ignored_targets,
        }
    }

    /// What the aircraft is.
    #[must_use]
    pub const fn settings(&self) -> &CopterSettings {
        &self.settings
    }

    fn true_position(&self) -> [f64; 3] {
        let mut position = self.body.position;
        for (axis, wander) in position.iter_mut().zip(self.wander) {
            *axis -= wander;
        }
        position
    }

    fn link_mut(&mut self, link: LinkId) -> &mut Link {
        &mut self.links[link.0]
    }

    /// `STATUSTEXT` on every link.
    fn say(&mut self, severity: MavSeverity, text: &str) {
        let data = STATUSTEXT_DATA { severity, text: text.into(), ..STATUSTEXT_DATA::DEFAULT };
        for link in &mut self.links {
            let frame = link.speaker.frame(&data);
            link.out.push(frame);
        }
    }
}
