//! The targets that we sent, compared with the target that the autopilot follows.
//!
//! GUIDED is not ownership: a ground station may send its own target in the same mode. The autopilot reports the target
//! that it follows (`POSITION_TARGET_LOCAL_NED`, or `POSITION_TARGET_GLOBAL_INT` if another station asked for it). A
//! new target that is not one of ours is a take-over.

use crate::message::FollowedTarget;
use crate::setpoint::PositionTarget;
use gleaner_units::{Duration, GeoPoint, Instant, Metres, Ned};
use heapless::Deque;

/// Distinct targets that we sent lately, and the target that the autopilot follows.
#[derive(Debug, Default)]
pub(crate) struct Steering {
    sent: Deque<(Instant, PositionTarget), { Steering::REMEMBERED }>,
    since: Option<Instant>,
    followed: Option<Ned>,
    foreign: Option<Ned>,
    reported: bool,
    ended: bool,
    /// The origin of the local frame that the targets are in.
    origin: Option<GeoPoint>,
}

impl Steering {
    /// At 10 Hz and one entry per [`Steering::SPACING`]: more than a second of a moving target.
    const REMEMBERED: usize = 8;
    /// Targets sent in quicker succession replace each other.
    const SPACING: Duration = Duration::from_millis(200);
    /// Before this the autopilot may still report the target of its take-off.
    const SETTLE: Duration = Duration::from_secs(1);
    /// Distance at which two targets differ.
    const TOLERANCE: Metres = Metres(3.0);
    /// ArduCopter moves a target with a velocity on for `GUID_TIMEOUT` (default 3 s) when no other follows, s.
    const COASTING_S: f32 = 3.5;

    /// A target of ours leaves.
    pub fn sent(&mut self, now: Instant, target: PositionTarget) {
        if self.ended {
            *self = Steering { origin: self.origin, ..Steering::default() };
        }
        self.since.get_or_insert(now);
        match self.sent.back().copied() {
            Some((_, last)) if last == target => return,
            Some((at, _)) if now.since(at) < Steering::SPACING => {
                // Keeps the time of the first, so that a steady stream still adds an entry per spacing.
                let _ = self.sent.pop_back();
                let _ = self.sent.push_back((at, target));
                return;
            }
            _ => {}
        }
        if self.sent.is_full() {
            let _ = self.sent.pop_front();
        }
        let _ = self.sent.push_back((now, target));
    }

    /// The autopilot reports the target that it follows. `origin` ties a global target to the local frame.
    pub fn follows(&mut self, now: Instant, reported: &FollowedTarget, origin: Option<GeoPoint>) {
        self.reported = true;
        self.move_origin(origin);
        let Some(since) = self.since else { return };
        let Some(target) = reported.local(origin) else { return };
        let is_known = self.sent.iter().any(|(_, ours)| is_on(ours, &target))
            || self.followed.is_some_and(|followed| same(&followed, &target));
        if !is_known && now.since(since) >= Steering::SETTLE {
            self.foreign = Some(target);
        }
        self.followed = Some(target);
    }

    /// When the estimator's origin moves, the same target has other coordinates. That is no take-over.
    fn move_origin(&mut self, origin: Option<GeoPoint>) {
        let Some(origin) = origin else { return };
        let Some(before) = self.origin.replace(origin).filter(|before| *before != origin) else { return };
        let (north, east) = before.offset_to(&origin);
        let targets = self.sent.iter_mut().map(|(_, target)| &mut target.position);
        for target in targets.chain(&mut self.followed).chain(&mut self.foreign) {
            target.north_m -= north.0;
            target.east_m -= east.0;
        }
    }

    /// The target of someone else, if the autopilot followed one since we began to steer. Stays until we begin again.
    pub const fn foreign(&self) -> Option<Ned> {
        self.foreign
    }

    /// Whether the autopilot reported its target since the last call.
    pub fn take_reported(&mut self) -> bool {
        core::mem::take(&mut self.reported)
    }

    /// We stop steering. Targets are still compared, since the aircraft may have to be given back; the next target of
    /// ours is a new beginning.
    pub fn end(&mut self) {
        self.ended = true;
    }
}

fn same(a: &Ned, b: &Ned) -> bool {
    a.horizontal_distance(b).0 <= Steering::TOLERANCE.0
        && (!b.down_m.is_finite() || (a.down_m - b.down_m).abs() <= Steering::TOLERANCE.0)
}

/// Whether `target` is `ours`, or where `ours` moves to with its velocity.
fn is_on(ours: &PositionTarget, target: &Ned) -> bool {
    let (at, velocity) = (ours.position, ours.velocity.unwrap_or_default());
    let [north, east] = [velocity.north_mps, velocity.east_mps];
    let squared = north * north + east * east;
    let towards = (target.north_m - at.north_m) * north + (target.east_m - at.east_m) * east;
    let after_s = if squared > 0.0 { (towards / squared).clamp(0.0, Steering::COASTING_S) } else { 0.0 };
    let moved =
        Ned { north_m: at.north_m + after_s * north, east_m: at.east_m + after_s * east, down_m: at.down_m };
    same(&moved, target)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(north_m: f32) -> Ned {
        Ned { north_m, east_m: 0.0, down_m: -60.0 }
    }

    fn ours(north_m: f32) -> PositionTarget {
        PositionTarget::at(at(north_m))
    }

    fn report(north_m: f32) -> FollowedTarget {
        FollowedTarget::Local(at(north_m))
    }

    #[test]
    fn a_new_target_that_we_did_not_send_is_foreign() {
        let mut steering = Steering::default();
        let ms = Instant::from_millis;
        steering.follows(ms(0), &report(500.0), None);
        steering.sent(ms(0), ours(0.0));
        steering.follows(ms(200), &report(-7.0), None);
        assert_eq!(steering.foreign(), None, "the target of the take-off");
        steering.follows(ms(1_500), &report(-7.0), None);
        assert_eq!(steering.foreign(), None, "reported again, ours was dropped");
        steering.follows(ms(1_600), &report(0.5), None);
        steering.sent(ms(3_000), ours(20.0));
        steering.follows(ms(3_100), &report(0.0), None);
        steering.follows(ms(3_200), &report(20.0), None);
        assert_eq!(steering.foreign(), None);
        steering.follows(ms(3_300), &report(300.0), None);
        steering.follows(ms(3_400), &report(20.0), None);
        assert_eq!(steering.foreign(), Some(at(300.0)), "also after ours is followed again");
        steering.end();
        assert_eq!(steering.foreign(), Some(at(300.0)));
        steering.sent(ms(9_000), ours(40.0));
        assert_eq!(steering.foreign(), None, "another flight");
    }

    #[test]
    fn a_moving_target_is_recognised_between_its_samples() {
        let mut steering = Steering::default();
        for step in 0..60_u32 {
            let now = Instant::from_millis(u64::from(step) * 100);
            steering.sent(now, ours(step as f32));
            if step > 4 {
                steering.follows(now, &report((step - 4) as f32), None);
            }
        }
        assert_eq!(steering.foreign(), None);
    }

    /// Moving targets at 10 m/s; the uplink is cut after two seconds, and ArduCopter moves the last one on.
    #[test]
    fn a_target_that_coasts_is_ours_and_one_beside_it_is_not() {
        let velocity = crate::message::Velocity { north_mps: 10.0, ..Default::default() };
        let mut steering = Steering::default();
        for step in 0..20_u32 {
            let now = Instant::from_millis(u64::from(step) * 100);
            steering.sent(now, PositionTarget { velocity: Some(velocity), ..ours(step as f32) });
        }
        for (after_ms, north_m) in [(500, 24.0), (2_000, 39.0), (3_000, 49.0), (9_000, 49.0)] {
            steering.follows(Instant::from_millis(2_000 + after_ms), &report(north_m), None);
            assert_eq!(steering.foreign(), None, "{north_m} m");
        }
        let beside = FollowedTarget::Local(Ned { east_m: 4.0, ..at(30.0) });
        steering.follows(Instant::from_millis(12_000), &beside, None);
        assert!(steering.foreign().is_some());
    }

    #[test]
    fn an_origin_that_moves_is_no_take_over() {
        let origin = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
        let moved = origin.offset_by(Metres(40.0), Metres(0.0));
        let mut steering = Steering::default();
        steering.sent(Instant::ZERO, ours(20.0));
        steering.follows(Instant::from_millis(2_000), &report(20.0), Some(origin));
        steering.follows(Instant::from_millis(2_100), &report(-20.0), Some(moved));
        assert_eq!(steering.foreign(), None);
        steering.follows(Instant::from_millis(2_200), &report(20.0), Some(moved));
        assert!(steering.foreign().is_some(), "40 m north of ours");
    }

    #[test]
    fn a_global_target_is_compared_in_the_plane() {
        let origin = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
        let mut steering = Steering::default();
        steering.sent(Instant::ZERO, ours(20.0));
        let global = |north_m| FollowedTarget::Global(origin.offset_by(Metres(north_m), Metres(0.0)));
        steering.follows(Instant::from_millis(2_000), &global(20.0), Some(origin));
        assert_eq!(steering.foreign(), None);
        steering.follows(Instant::from_millis(2_500), &global(90.0), None);
        assert_eq!(steering.foreign(), None, "without an origin nothing can be compared");
        steering.follows(Instant::from_millis(3_000), &global(90.0), Some(origin));
        assert!(steering.foreign().is_some());
    }
}
