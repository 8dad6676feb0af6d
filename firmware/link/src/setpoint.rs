//! Position targets.

use crate::address::Address;
use crate::message::Velocity;
use crate::wire::packet::Packet;
use gleaner_units::{Instant, Ned};
use mavlink::dialects::ardupilotmega::{
    MavFrame, PositionTargetTypemask, SET_POSITION_TARGET_LOCAL_NED_DATA,
};

/// A point of the local frame to fly to, and the velocity on the way if a steady stream follows.
///
/// ArduCopter's position-only targets never time out; with a velocity the target moves on for three seconds
/// (`GUID_TIMEOUT`) and then stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionTarget {
    /// The point, relative to the estimator's origin.
    pub position: Ned,
    /// Velocity feed-forward.
    pub velocity: Option<Velocity>,
}

/// Why a target was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetError {
    /// A coordinate is NaN or infinite. ArduPilot's simulation crashes on it; PX4 stops controlling the axis.
    NotFinite,
}

impl PositionTarget {
    /// Position only: velocity, acceleration, yaw and yaw rate are ignored (3576).
    const POSITION_MASK: u16 = 0x0DF8;
    /// Position and velocity (3520).
    const POSITION_AND_VELOCITY_MASK: u16 = 0x0DC0;

    /// A target without velocity.
    #[must_use]
    pub const fn at(position: Ned) -> PositionTarget {
        PositionTarget { position, velocity: None }
    }

    pub(crate) fn packet(&self, now: Instant, target: Address) -> Result<Option<Packet>, TargetError> {
        let velocity = self.velocity.unwrap_or_default();
        if !self.position.is_finite() || !velocity.is_finite() {
            return Err(TargetError::NotFinite);
        }
        let mask = match self.velocity {
            None => PositionTarget::POSITION_MASK,
            Some(_) => PositionTarget::POSITION_AND_VELOCITY_MASK,
        };
        Ok(Packet::new(&SET_POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: now.as_boot_ms(),
            x: self.position.north_m,
            y: self.position.east_m,
            z: self.position.down_m,
            vx: velocity.north_mps,
            vy: velocity.east_mps,
            vz: velocity.down_mps,
            type_mask: PositionTargetTypemask::from_bits_retain(mask),
            target_system: target.system,
            target_component: target.component,
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            ..SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        }))
    }
}
