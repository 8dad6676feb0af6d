//! What was true at engage, watched in flight: place, altitude, origin, radio.

use crate::flight::leg::Leg;
use crate::flight::plan::Plan;
use gleaner_units::{Duration, GeoPoint, Instant, Ned};

/// How far the aircraft may leave its altitude, and for how long: gusts and the end of a climb stay inside.
const ALTITUDE_M: f32 = 5.0;
const ALTITUDE_TIME: Duration = Duration::from_secs(3);
/// An origin that is announced again moves by the rounding of the message.
const ORIGIN_M: f32 = 1.0;
/// A position that moves faster than any multirotor jumped; the constant part covers delayed messages.
const JUMP_M: f32 = 10.0;
const JUMP_MPS: f32 = 30.0;
/// How far beside its leg the aircraft may be: two cells, and at least a reversal at full speed (34 m measured).
const BESIDE_CELLS: f32 = 2.0;
const BESIDE_M: f32 = 40.0;

/// The watches of one flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Watch {
    /// The last position, when it was judged and when it was measured on the autopilot's clock.
    position: Option<(Ned, Instant, Option<u32>)>,
    /// When the altitude was last right.
    level_at: Instant,
    jumped: bool,
}

/// What a watch found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finding {
    Fine,
    /// The position jumped for the first time.
    Jumped,
    /// It jumped again.
    JumpedAgain,
    /// The aircraft is away from its leg.
    Away,
    AltitudeLost,
}

impl Watch {
    pub(crate) const fn new(now: Instant) -> Watch {
        Watch { position: None, level_at: now, jumped: false }
    }

    /// Judges a position. After a jump the leg must be laid out anew from where the aircraft is.
    pub(crate) fn see(
        &mut self,
        now: Instant,
        boot_ms: Option<u32>,
        position: &Ned,
        plan: &Plan,
        leg: &Leg,
    ) -> Finding {
        let last = self.position.replace((*position, now, boot_ms));
        let moved = last.map(|(last, at, at_ms)| {
            // Messages may be lost: the time between two measurements is the autopilot's to say.
            let measured_ms = at_ms.zip(boot_ms).map(|(from_ms, to_ms)| to_ms.wrapping_sub(from_ms));
            let secs = measured_ms.map_or(now.since(at).as_secs_f32(), |ms| ms as f32 * 1e-3);
            (secs, position.horizontal_distance(&last).0)
        });
        if moved.is_some_and(|(secs, metres)| metres > JUMP_M + JUMP_MPS * secs) {
            return if core::mem::replace(&mut self.jumped, true) {
                Finding::JumpedAgain
            } else {
                Finding::Jumped
            };
        }
        let beside_m = (BESIDE_CELLS * plan.frame.grid().cell().0).max(BESIDE_M);
        if leg.beside(position) > beside_m {
            return Finding::Away;
        }
        if (position.down_m - plan.down_m).abs() <= ALTITUDE_M {
            self.level_at = now;
        }
        if now.since(self.level_at) > ALTITUDE_TIME { Finding::AltitudeLost } else { Finding::Fine }
    }
}

/// Whether the origin is another than at engage.
pub(crate) fn origin_moved(plan: &Plan, origin: Option<GeoPoint>) -> bool {
    origin.is_some_and(|origin| origin_offset_m(plan, &origin) > ORIGIN_M)
}

/// Distance of an origin from that at engage, m.
pub(crate) fn origin_offset_m(plan: &Plan, origin: &GeoPoint) -> f32 {
    let (north, east) = plan.origin.offset_to(origin);
    libm::hypotf(north.0, east.0)
}
