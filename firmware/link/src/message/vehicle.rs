//! State of the autopilot and of the vehicle.

use super::MessageFault;
use crate::fields::Fields;
use gleaner_units::{GeoPoint, Metres, Ned};
use mavlink::dialects::ardupilotmega as dialect;

/// `MAV_STATE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SystemState {
    /// Not yet known.
    Uninitialised = 0,
    /// Starting.
    Boot = 1,
    /// Calibrating, not flight-ready.
    Calibrating = 2,
    /// On the ground, can be launched at any time.
    Standby = 3,
    /// Active.
    Active = 4,
    /// A failsafe: control is still possible.
    Critical = 5,
    /// Mayday.
    Emergency = 6,
    /// Powering down.
    PowerOff = 7,
    /// Terminating the flight.
    FlightTermination = 8,
}

impl SystemState {
    pub(crate) fn from_wire(value: u8) -> SystemState {
        match value {
            1 => SystemState::Boot,
            2 => SystemState::Calibrating,
            3 => SystemState::Standby,
            4 => SystemState::Active,
            5 => SystemState::Critical,
            6 => SystemState::Emergency,
            7 => SystemState::PowerOff,
            8 => SystemState::FlightTermination,
            _ => SystemState::Uninitialised,
        }
    }
}

/// `HEARTBEAT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// `MAV_AUTOPILOT`: 3 ArduPilot, 12 PX4, 8 none.
    pub autopilot: u8,
    /// `MAV_TYPE`.
    pub vehicle: u8,
    /// Whether the motors are armed.
    pub armed: bool,
    /// `base_mode` as sent.
    pub base_mode: u8,
    /// The autopilot's own mode number.
    pub custom_mode: u32,
    /// State of the system.
    pub state: SystemState,
}

impl Heartbeat {
    const ARMED: u8 = 0x80;

    pub(super) fn read(fields: Fields<'_>) -> Heartbeat {
        Heartbeat {
            autopilot: fields.u8(5),
            vehicle: fields.u8(4),
            armed: fields.u8(6) & Heartbeat::ARMED != 0,
            base_mode: fields.u8(6),
            custom_mode: fields.u32(0),
            state: SystemState::from_wire(fields.u8(7)),
        }
    }
}

/// `SYS_STATUS`, the fields that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SysStatus {
    /// Sensors that are enabled (`MAV_SYS_STATUS_SENSOR`).
    pub sensors_enabled: u32,
    /// Sensors that are healthy.
    pub sensors_healthy: u32,
    /// Battery left, percent.
    pub battery_remaining_percent: Option<u8>,
}

impl SysStatus {
    pub(super) fn read(fields: Fields<'_>) -> SysStatus {
        // Order on the wire is by size: three u32, then nine 16-bit fields, then battery_remaining.
        SysStatus {
            sensors_enabled: fields.u32(4),
            sensors_healthy: fields.u32(8),
            battery_remaining_percent: percent(fields.i8(30)),
        }
    }
}

/// -1 and other values outside 0..100 mean "unknown".
fn percent(value: i8) -> Option<u8> {
    u8::try_from(value).ok().filter(|&percent| percent <= 100)
}

/// `MAV_BATTERY_CHARGE_STATE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChargeState {
    /// Not reported.
    Unknown,
    /// Not low.
    Ok,
    /// Low: warn and watch.
    Low,
    /// Return or abort now.
    Critical,
    /// Damage is imminent.
    Emergency,
    /// Failed.
    Failed,
    /// Diagnosed as defective.
    Unhealthy,
    /// Charging.
    Charging,
}

impl ChargeState {
    fn from_wire(value: u8) -> ChargeState {
        match value {
            1 => ChargeState::Ok,
            2 => ChargeState::Low,
            3 => ChargeState::Critical,
            4 => ChargeState::Emergency,
            5 => ChargeState::Failed,
            6 => ChargeState::Unhealthy,
            7 => ChargeState::Charging,
            _ => ChargeState::Unknown,
        }
    }

    /// Whether the autopilot's battery failsafe has been triggered: low or worse.
    #[must_use]
    pub const fn is_failsafe(self) -> bool {
        !matches!(self, ChargeState::Unknown | ChargeState::Ok | ChargeState::Charging)
    }
}

/// `BATTERY_STATUS`, the fields that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatteryStatus {
    /// Battery number; 0 is the main one.
    pub id: u8,
    /// Left, percent.
    pub remaining_percent: Option<u8>,
    /// Charge state as the autopilot judges it.
    pub charge: ChargeState,
    /// Drawn since the start, mAh.
    pub consumed_mah: Option<u32>,
    /// Current, in units of 10 mA.
    pub current_ca: Option<u16>,
}

impl BatteryStatus {
    pub(super) fn read(fields: Fields<'_>) -> BatteryStatus {
        BatteryStatus {
            id: fields.u8(32),
            remaining_percent: percent(fields.i8(35)),
            charge: ChargeState::from_wire(fields.u8(40)),
            consumed_mah: u32::try_from(fields.i32(0)).ok(),
            current_ca: u16::try_from(fields.i16(30)).ok(),
        }
    }
}

/// Velocity in the local frame, m/s. Always finite in a [`super::Message`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// North, m/s.
    pub north_mps: f32,
    /// East, m/s.
    pub east_mps: f32,
    /// Down, m/s: negative when climbing.
    pub down_mps: f32,
}

impl Velocity {
    /// Whether all three are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.north_mps.is_finite() && self.east_mps.is_finite() && self.down_mps.is_finite()
    }
}

/// `LOCAL_POSITION_NED`: relative to the estimator's origin, which is not home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalPosition {
    /// The autopilot's time since it started, ms.
    pub time_boot_ms: u32,
    /// Position.
    pub position: Ned,
    /// Velocity.
    pub velocity: Velocity,
}

impl TryFrom<dialect::LOCAL_POSITION_NED_DATA> for LocalPosition {
    type Error = MessageFault;

    fn try_from(data: dialect::LOCAL_POSITION_NED_DATA) -> Result<LocalPosition, MessageFault> {
        let position = Ned { north_m: data.x, east_m: data.y, down_m: data.z };
        let velocity = Velocity { north_mps: data.vx, east_mps: data.vy, down_mps: data.vz };
        if !position.is_finite() || !velocity.is_finite() {
            return Err(MessageFault::NotFinite);
        }
        Ok(LocalPosition { time_boot_ms: data.time_boot_ms, position, velocity })
    }
}

fn geo_point(lat_deg_e7: i32, lon_deg_e7: i32) -> Result<GeoPoint, MessageFault> {
    let exists = lat_deg_e7.unsigned_abs() <= 900_000_000 && lon_deg_e7.unsigned_abs() <= 1_800_000_000;
    if exists { Ok(GeoPoint { lat_deg_e7, lon_deg_e7 }) } else { Err(MessageFault::NotOnTheGlobe) }
}

/// `GLOBAL_POSITION_INT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlobalPosition {
    /// The autopilot's time since it started, ms.
    pub time_boot_ms: u32,
    /// Position.
    pub point: GeoPoint,
    /// Above mean sea level, mm.
    pub altitude_amsl_mm: i32,
    /// Above home.
    pub altitude_above_home: Metres,
}

impl TryFrom<dialect::GLOBAL_POSITION_INT_DATA> for GlobalPosition {
    type Error = MessageFault;

    fn try_from(data: dialect::GLOBAL_POSITION_INT_DATA) -> Result<GlobalPosition, MessageFault> {
        Ok(GlobalPosition {
            time_boot_ms: data.time_boot_ms,
            point: geo_point(data.lat, data.lon)?,
            altitude_amsl_mm: data.alt,
            altitude_above_home: Metres(data.relative_alt as f32 * 1e-3),
        })
    }
}

/// The position target that the autopilot follows: `POSITION_TARGET_LOCAL_NED` or `POSITION_TARGET_GLOBAL_INT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FollowedTarget {
    /// In the local frame.
    Local(Ned),
    /// On the globe; its altitude has one of several references and is not read.
    Global(GeoPoint),
}

impl FollowedTarget {
    /// Bits 0..2 of `POSITION_TARGET_TYPEMASK`: no position is followed.
    const POSITION_IGNORED: u16 = 0b111;

    pub(super) fn read_local(fields: Fields<'_>) -> Result<Option<FollowedTarget>, MessageFault> {
        if fields.u16(48) & FollowedTarget::POSITION_IGNORED != 0 {
            return Ok(None);
        }
        let target = Ned { north_m: fields.f32(4), east_m: fields.f32(8), down_m: fields.f32(12) };
        if target.is_finite() {
            Ok(Some(FollowedTarget::Local(target)))
        } else {
            Err(MessageFault::NotFinite)
        }
    }

    pub(super) fn read_global(fields: Fields<'_>) -> Result<Option<FollowedTarget>, MessageFault> {
        if fields.u16(48) & FollowedTarget::POSITION_IGNORED != 0 {
            return Ok(None);
        }
        geo_point(fields.i32(4), fields.i32(8)).map(FollowedTarget::Global).map(Some)
    }

    /// In the local frame with its origin at `origin`; a global target gets a down of NaN.
    pub(crate) fn local(&self, origin: Option<GeoPoint>) -> Option<Ned> {
        match self {
            FollowedTarget::Local(target) => Some(*target),
            FollowedTarget::Global(point) => {
                let (north, east) = origin?.offset_to(point);
                Some(Ned { north_m: north.0, east_m: east.0, down_m: f32::NAN })
            }
        }
    }
}

/// `HOME_POSITION`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomePosition {
    /// Position.
    pub point: GeoPoint,
    /// Above mean sea level, mm.
    pub altitude_amsl_mm: i32,
    /// In the local frame; `None` when the autopilot does not know it (NaN on the wire).
    pub local: Option<Ned>,
}

impl TryFrom<dialect::HOME_POSITION_DATA> for HomePosition {
    type Error = MessageFault;

    fn try_from(data: dialect::HOME_POSITION_DATA) -> Result<HomePosition, MessageFault> {
        let local = Ned { north_m: data.x, east_m: data.y, down_m: data.z };
        Ok(HomePosition {
            point: geo_point(data.latitude, data.longitude)?,
            altitude_amsl_mm: data.altitude,
            local: local.is_finite().then_some(local),
        })
    }
}

/// `GPS_GLOBAL_ORIGIN`: where the local frame's origin lies on the globe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GlobalOrigin {
    /// Position.
    pub point: GeoPoint,
    /// Above mean sea level, mm.
    pub altitude_amsl_mm: i32,
}

impl TryFrom<dialect::GPS_GLOBAL_ORIGIN_DATA> for GlobalOrigin {
    type Error = MessageFault;

    fn try_from(data: dialect::GPS_GLOBAL_ORIGIN_DATA) -> Result<GlobalOrigin, MessageFault> {
        Ok(GlobalOrigin { point: geo_point(data.latitude, data.longitude)?, altitude_amsl_mm: data.altitude })
    }
}

/// `MAV_LANDED_STATE` of `EXTENDED_SYS_STATE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LandedState {
    /// Not reported.
    Unknown,
    /// On the ground.
    OnGround,
    /// In the air.
    InAir,
    /// Taking off.
    TakingOff,
    /// Landing.
    Landing,
}

impl LandedState {
    pub(super) fn from_wire(value: u8) -> LandedState {
        match value {
            1 => LandedState::OnGround,
            2 => LandedState::InAir,
            3 => LandedState::TakingOff,
            4 => LandedState::Landing,
            _ => LandedState::Unknown,
        }
    }
}

/// `RC_CHANNELS`: the channels of the aircraft pilot's transmitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RcChannels {
    /// The autopilot's time since it started, ms.
    pub time_boot_ms: u32,
    pulses_us: [Option<u16>; RcChannels::COUNT],
}

impl RcChannels {
    /// Number of channels in the message.
    pub const COUNT: usize = 18;
    const UNUSED: u16 = u16::MAX;

    pub(super) fn read(fields: Fields<'_>) -> RcChannels {
        let used = usize::from(fields.u8(40));
        let mut pulses_us = [None; RcChannels::COUNT];
        for (index, pulse) in pulses_us.iter_mut().enumerate().take(used) {
            // 0 is what ArduPilot sends for a channel without a receiver behind it.
            *pulse = Some(fields.u16(4 + 2 * index)).filter(|&us| us != RcChannels::UNUSED && us != 0);
        }
        RcChannels { time_boot_ms: fields.u32(0), pulses_us }
    }

    /// Pulse of a channel, microseconds (about 1000..2000). Channels count from 1, as on the transmitter.
    #[must_use]
    pub fn pulse_us(&self, channel: u8) -> Option<u16> {
        let index = usize::from(channel).checked_sub(1)?;
        self.pulses_us.get(index).copied().flatten()
    }
}
