//! State of the autopilot that we serve.

use crate::address::Address;
use crate::event::{Event, Events, Failsafe};
use crate::message::{
    BatteryStatus, ChargeState, CommandResult, GlobalOrigin, GlobalPosition, Heartbeat, HomePosition,
    LandedState, LocalPosition, Message, RcChannels, SystemState,
};
use crate::mode::{Firmware, FlightMode, is_multirotor};
use crate::service::streams::{Streams, Wants};
use crate::wire::outgoing::Outgoing;
use gleaner_units::{Duration, Instant};

/// The last report of a kind, and when it arrived.
type Latest<T> = Option<(T, Instant)>;

/// The autopilot that we serve, as its messages describe it.
///
/// ```text
///            heartbeat                 5 s without one
/// unknown ------------> connected <------------------> lost
///                       |      ^        heartbeat
///                       +------+  its clock went back: everything is forgotten, streams are requested again
/// ```
#[derive(Debug, Default)]
pub struct Autopilot {
    address: Option<Address>,
    connected: bool,
    other_mode_seen: bool,
    heartbeat: Latest<Heartbeat>,
    known: Known,
}

/// State that a reboot makes invalid.
#[derive(Debug, Default)]
struct Known {
    position: Latest<LocalPosition>,
    global: Latest<GlobalPosition>,
    origin: Option<GlobalOrigin>,
    home: Option<HomePosition>,
    landed: Latest<LandedState>,
    estimator_flags: Latest<u16>,
    battery: Latest<BatteryStatus>,
    /// Worst charge state by battery id; ids beyond count as the last.
    charges: [Option<ChargeState>; 4],
    sys_battery_percent: Latest<Option<u8>>,
    rc: Latest<RcChannels>,
    failsafe: Option<Failsafe>,
    boot_ms: Option<u32>,
    streams: Streams,
}

/// Estimator flags of a valid position: attitude, velocities, absolute and predicted positions.
/// `EKF_STATUS_REPORT` and `ESTIMATOR_STATUS` have the same bits. PX4 sets the relative ones only without GNSS.
const ARDUPILOT_READY: u16 = 0x033F;
const PX4_READY: u16 = 0x0037;

impl Autopilot {
    /// Lost after five missed heartbeats.
    const LOST: Duration = Duration::from_secs(5);
    /// A command that moves the aircraft needs a heartbeat that is not older than this. Autopilots send one a second;
    /// the rest is for delays on the line.
    pub const EVIDENCE_AGE: Duration = Duration::from_millis(1_500);
    /// A clock that is behind by more than this restarted; less is messages out of order.
    const CLOCK_SLACK_MS: u32 = 1_000;

    /// Its address, once a heartbeat has arrived.
    #[must_use]
    pub const fn address(&self) -> Option<Address> {
        self.address
    }

    /// Whether a heartbeat arrived within the last five seconds (as of the last poll).
    #[must_use]
    pub const fn is_connected(&self) -> bool {
        self.connected
    }

    /// Its flight stack.
    #[must_use]
    pub fn firmware(&self) -> Option<Firmware> {
        self.heartbeat.map(|(heartbeat, _)| Firmware::from_wire(heartbeat.autopilot))
    }

    /// Its `MAV_TYPE`, if that is no multirotor: such a vehicle is not served.
    #[must_use]
    pub fn unsupported_vehicle(&self) -> Option<u8> {
        let (heartbeat, _) = self.heartbeat.filter(|_| self.connected)?;
        Some(heartbeat.vehicle).filter(|&vehicle| !is_multirotor(vehicle))
    }

    /// Its mode, `None` while not connected.
    #[must_use]
    pub fn mode(&self) -> Option<FlightMode> {
        self.heartbeat.filter(|_| self.connected).map(|(heartbeat, _)| mode_of(&heartbeat))
    }

    /// Whether it is connected and in a mode in which position targets are obeyed.
    #[must_use]
    pub fn companion_may_steer(&self) -> bool {
        self.mode().is_some_and(FlightMode::companion_may_steer)
    }

    /// Whether the motors are armed, as of the last heartbeat.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.heartbeat.is_some_and(|(heartbeat, _)| heartbeat.armed)
    }

    /// When its last heartbeat arrived, while connected.
    #[must_use]
    pub fn heartbeat_at(&self) -> Option<Instant> {
        self.heartbeat.filter(|_| self.connected).map(|(_, at)| at)
    }

    /// When a heartbeat last showed that the aircraft is ours: armed and in a mode in which position targets are
    /// obeyed. `None` as soon as a heartbeat shows otherwise, and when it is older than [`Autopilot::EVIDENCE_AGE`].
    #[must_use]
    pub fn ours_at(&self, now: Instant) -> Option<Instant> {
        let fresh = self.heartbeat_at().filter(|&at| now.since(at) <= Autopilot::EVIDENCE_AGE);
        fresh.filter(|_| self.is_armed() && self.companion_may_steer())
    }

    /// Whether a heartbeat since the last call showed a mode in which we do not steer, even if a later one does not.
    /// A flag and not an event: a queue that is full could drop it.
    pub(crate) fn take_other_mode(&mut self) -> bool {
        core::mem::take(&mut self.other_mode_seen)
    }

    /// Its `MAV_STATE`.
    #[must_use]
    pub fn system_state(&self) -> SystemState {
        self.heartbeat.map_or(SystemState::Uninitialised, |(heartbeat, _)| heartbeat.state)
    }

    /// The failsafe that it reports now. After one, only the operator may give control back.
    #[must_use]
    pub const fn failsafe(&self) -> Option<Failsafe> {
        self.known.failsafe
    }

    /// Position in the local frame, if reported within `max_age`.
    #[must_use]
    pub fn position(&self, now: Instant, max_age: Duration) -> Option<LocalPosition> {
        fresh(self.known.position, now, max_age)
    }

    /// Position on the globe, if reported within `max_age`.
    #[must_use]
    pub fn global_position(&self, now: Instant, max_age: Duration) -> Option<GlobalPosition> {
        fresh(self.known.global, now, max_age)
    }

    /// Origin of the local frame.
    #[must_use]
    pub const fn origin(&self) -> Option<GlobalOrigin> {
        self.known.origin
    }

    /// Home position. It is not the origin.
    #[must_use]
    pub const fn home(&self) -> Option<HomePosition> {
        self.known.home
    }

    /// On the ground or in the air.
    #[must_use]
    pub fn landed(&self) -> LandedState {
        self.known.landed.map_or(LandedState::Unknown, |(landed, _)| landed)
    }

    /// The main battery's last report.
    #[must_use]
    pub fn battery(&self) -> Option<BatteryStatus> {
        self.known.battery.map(|(battery, _)| battery)
    }

    /// Main battery left, percent, if reported within `max_age`; `SYS_STATUS` fills in for `BATTERY_STATUS`.
    #[must_use]
    pub fn battery_percent(&self, now: Instant, max_age: Duration) -> Option<u8> {
        fresh(self.known.battery, now, max_age)
            .and_then(|battery| battery.remaining_percent)
            .or_else(|| fresh(self.known.sys_battery_percent, now, max_age).flatten())
    }

    /// Charge drawn from the main battery, mAh, if reported within `max_age`.
    #[must_use]
    pub fn battery_drawn_mah(&self, now: Instant, max_age: Duration) -> Option<u32> {
        fresh(self.known.battery, now, max_age).and_then(|battery| battery.consumed_mah)
    }

    /// Pulse of an RC channel (from 1), microseconds, if reported within a second.
    #[must_use]
    pub fn rc_pulse_us(&self, now: Instant, channel: u8) -> Option<u16> {
        fresh(self.known.rc, now, Duration::from_secs(1)).and_then(|rc| rc.pulse_us(channel))
    }

    /// The autopilot's own clock at the last position, ms since it started.
    #[must_use]
    pub const fn boot_ms(&self) -> Option<u32> {
        self.known.boot_ms
    }

    /// Whether the estimator has a valid position, that position is fresh (one second) and the origin is known. The
    /// pre-arm bit of `SYS_STATUS` is no substitute: it can be set before there is a position.
    #[must_use]
    pub fn is_ready(&self, now: Instant) -> bool {
        let flags = fresh(self.known.estimator_flags, now, Duration::from_secs(3));
        let estimates = match self.firmware() {
            Some(Firmware::ArduPilot) => {
                flags.is_some_and(|flags| flags & ARDUPILOT_READY == ARDUPILOT_READY)
            }
            // Its onboard profile does not always include the report; without it, a fresh position is enough.
            Some(_) => flags.is_none_or(|flags| flags & PX4_READY == PX4_READY),
            None => false,
        };
        estimates
            && self.connected
            && self.known.origin.is_some()
            && self.position(now, Duration::from_secs(1)).is_some()
    }

    /// Takes in one message of the vehicle that we serve.
    pub(crate) fn observe(&mut self, now: Instant, sender: Address, message: &Message, events: &mut Events) {
        if let Message::Heartbeat(heartbeat) = message {
            if is_autopilot(heartbeat) && self.is_or_becomes(sender) {
                self.observe_heartbeat(now, *heartbeat, events);
            }
            return;
        }
        if self.address != Some(sender) {
            return;
        }
        self.watch_clock(message, events);
        self.known.streams.seen(now, message);
        let known = &mut self.known;
        match message {
            Message::LocalPosition(position) => known.position = Some((*position, now)),
            Message::GlobalPosition(position) => known.global = Some((*position, now)),
            Message::HomePosition(home) => known.home = Some(*home),
            Message::GlobalOrigin(origin) => known.origin = Some(*origin),
            Message::LandedState(landed) => known.landed = Some((*landed, now)),
            Message::EkfStatus(flags) | Message::EstimatorStatus(flags) => {
                known.estimator_flags = Some((*flags, now));
            }
            Message::RcChannels(rc) => known.rc = Some((*rc, now)),
            Message::SysStatus(status) => {
                known.sys_battery_percent = Some((status.battery_remaining_percent, now));
            }
            Message::BatteryStatus(battery) => {
                if battery.id == 0 {
                    known.battery = Some((*battery, now));
                }
                if let Some(charge) = known.charges.get_mut(usize::from(battery.id.min(3))) {
                    *charge = Some(battery.charge);
                }
                self.judge_failsafe(events);
            }
            _ => {}
        }
    }

    /// The autopilot answered a `MAV_CMD_SET_MESSAGE_INTERVAL`.
    pub(crate) fn interval_answered(&mut self, now: Instant, result: CommandResult) {
        self.known.streams.answered(now, result);
    }

    /// Detects the loss of the autopilot and asks for streams.
    /// RC channels are asked for only if `wants_rc`.
    pub(crate) fn poll(&mut self, now: Instant, wants_rc: bool, out: &mut Outgoing, events: &mut Events) {
        let heard_at = self.heartbeat.map(|(_, at)| at);
        if self.connected && heard_at.is_none_or(|at| now.since(at) > Autopilot::LOST) {
            self.connected = false;
            self.known = Known::default();
            events.push(Event::AutopilotLost);
        }
        if self.connected
            && let (Some(address), Some(firmware)) = (self.address, self.firmware())
        {
            let wants = Wants { origin: self.known.origin.is_none(), rc: wants_rc };
            self.known.streams.poll(now, address, firmware, wants, out);
        }
    }

    /// The first component of the system that sends as an autopilot remains the autopilot until it is lost.
    fn is_or_becomes(&mut self, sender: Address) -> bool {
        if !self.connected {
            self.address = Some(sender);
        }
        self.address == Some(sender)
    }

    fn observe_heartbeat(&mut self, now: Instant, heartbeat: Heartbeat, events: &mut Events) {
        let was = self.heartbeat.filter(|_| self.connected).map(|(heartbeat, _)| heartbeat);
        let mode_before = self.mode();
        self.heartbeat = Some((heartbeat, now));
        if !self.connected {
            self.connected = true;
            events.push(Event::AutopilotConnected);
        }
        self.other_mode_seen |= !self.companion_may_steer();
        if let Some(mode) = self.mode().filter(|mode| Some(*mode) != mode_before) {
            events.push(Event::ModeChanged(mode));
        }
        if was.is_none_or(|was| was.armed != heartbeat.armed) {
            events.push(Event::ArmedChanged(heartbeat.armed));
        }
        self.judge_failsafe(events);
    }

    fn judge_failsafe(&mut self, events: &mut Events) {
        let system = matches!(
            self.system_state(),
            SystemState::Critical | SystemState::Emergency | SystemState::FlightTermination
        );
        let battery = self.known.charges.iter().flatten().any(|charge| charge.is_failsafe());
        let failsafe = if battery {
            Some(Failsafe::Battery)
        } else if system {
            Some(Failsafe::System)
        } else {
            None
        };
        if let Some(began) = failsafe.filter(|_| failsafe != self.known.failsafe) {
            events.push(Event::FailsafeBegan(began));
        }
        self.known.failsafe = failsafe;
    }

    /// Detects a clock that went back: the autopilot restarted. A wrap after 49.7 days is not going back.
    fn watch_clock(&mut self, message: &Message, events: &mut Events) {
        let clock_ms = match message {
            Message::LocalPosition(position) => position.time_boot_ms,
            Message::GlobalPosition(position) => position.time_boot_ms,
            Message::RcChannels(rc) => rc.time_boot_ms,
            _ => return,
        };
        let behind_ms = self.known.boot_ms.map_or(0, |last| last.wrapping_sub(clock_ms));
        if behind_ms > Autopilot::CLOCK_SLACK_MS && behind_ms < u32::MAX / 2 {
            self.known = Known::default();
            events.push(Event::AutopilotRebooted);
        }
        let is_ahead = self.known.boot_ms.is_none_or(|last| clock_ms.wrapping_sub(last) < u32::MAX / 2);
        if is_ahead {
            self.known.boot_ms = Some(clock_ms);
        }
    }
}

fn fresh<T: Copy>(latest: Latest<T>, now: Instant, max_age: Duration) -> Option<T> {
    latest.filter(|(_, at)| now.since(*at) <= max_age).map(|(value, _)| value)
}

/// Whether a heartbeat is that of a vehicle's flight controller: it has an autopilot (`MAV_AUTOPILOT` other than 8, none),
/// and its `MAV_TYPE` is a vehicle. The component id does not matter. All others, with unknown types, count as peripherals
/// or ground stations: gimbals, cameras, companions, antenna trackers.
pub(crate) fn is_autopilot(heartbeat: &Heartbeat) -> bool {
    const NO_AUTOPILOT: u8 = 8;
    heartbeat.autopilot != NO_AUTOPILOT
        && matches!(heartbeat.vehicle, 1..=4 | 7..=17 | 19..=25 | 28 | 29 | 35 | 43 | 45..=47)
}

/// The flight mode that a heartbeat shows.
pub(crate) const fn mode_of(heartbeat: &Heartbeat) -> FlightMode {
    FlightMode::from_custom_mode(
        Firmware::from_wire(heartbeat.autopilot),
        heartbeat.vehicle,
        heartbeat.custom_mode,
    )
}
