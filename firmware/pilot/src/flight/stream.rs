//! When a position target leaves.

use gleaner_link::{Firmware, PositionTarget};
use gleaner_units::{Duration, Instant};

/// PX4 leaves OFFBOARD when targets stop for `COM_OF_LOSS_T` (1 s, 0.5 s in older releases); its guide asks for
/// more than 2 Hz. 20 Hz when polled that often, never below 10 Hz when polled at 20 Hz or more.
const PX4_SPACING: Duration = Duration::from_millis(50);

/// A target with a velocity needs a steady stream of 10 Hz. It leaves right after ArduPilot has reported the target that it
/// follows: a target of another station is then reported before ours would replace it.
const MOVING_SPACING: Duration = Duration::from_millis(50);
/// Without a report it leaves after this time.
const MOVING_SPACING_MAX: Duration = Duration::from_millis(90);

/// ArduCopter keeps a target without a velocity without a timeout. Once a second covers a lost packet.
const ARDUPILOT_SPACING: Duration = Duration::from_secs(1);

/// The pace of the position targets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stream {
    sent: Option<(Instant, PositionTarget)>,
    reported: bool,
}

impl Stream {
    /// The autopilot reported the target that it follows.
    pub(crate) fn reported(&mut self) {
        self.reported = true;
    }

    /// `target` if it is due now. A target that is not finite is never due: NaN kills ArduPilot's simulation
    /// and lets PX4 drift along that axis.
    pub(crate) fn due(
        &mut self,
        now: Instant,
        target: PositionTarget,
        firmware: Firmware,
    ) -> Option<PositionTarget> {
        let velocity = target.velocity.unwrap_or_default();
        if !(target.position.is_finite() && velocity.is_finite()) {
            return None;
        }
        let due = match (self.sent, firmware) {
            (None, _) => true,
            (Some((at, _)), Firmware::Px4) => now.since(at) >= PX4_SPACING,
            (Some((at, _)), _) if target.velocity.is_some() => {
                let spacing = if self.reported { MOVING_SPACING } else { MOVING_SPACING_MAX };
                now.since(at) >= spacing
            }
            (Some((at, last)), _) => last != target || now.since(at) >= ARDUPILOT_SPACING,
        };
        if due {
            *self = Stream { sent: Some((now, target)), reported: false };
        }
        due.then_some(target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_link::Velocity;
    use gleaner_units::Ned;

    const A: PositionTarget = PositionTarget::at(Ned { north_m: 1.0, east_m: 2.0, down_m: -60.0 });
    const B: PositionTarget = PositionTarget::at(Ned { north_m: 21.0, east_m: 2.0, down_m: -60.0 });

    fn sent(firmware: Firmware, poll_ms: u64, target: impl Fn(u64) -> PositionTarget) -> Vec<u64> {
        let mut stream = Stream::default();
        (0..3000)
            .step_by(poll_ms as usize)
            .filter(|&ms| stream.due(Instant::from_millis(ms), target(ms), firmware).is_some())
            .collect()
    }

    #[test]
    fn ardupilot_gets_a_target_on_change_and_once_a_second() {
        assert_eq!(sent(Firmware::ArduPilot, 50, |ms| if ms < 1500 { A } else { B }), [0, 1000, 1500, 2500]);
    }

    #[test]
    fn px4_gets_ten_a_second_or_more_at_any_poll_rate_from_twenty() {
        for poll_ms in [1, 3, 7, 20, 30, 40, 49, 50] {
            let times = sent(Firmware::Px4, poll_ms, |_| A);
            assert!(times.windows(2).all(|pair| pair[1] - pair[0] <= 100), "poll every {poll_ms} ms");
        }
    }

    #[test]
    fn moving_targets_stream_steadily_also_when_they_stand() {
        for poll_ms in [20, 30, 50] {
            let times = sent(Firmware::ArduPilot, poll_ms, |_| PositionTarget {
                velocity: Some(Velocity::default()),
                ..A
            });
            assert!(times.windows(2).all(|pair| (90..=120).contains(&(pair[1] - pair[0]))), "{times:?}");
        }
    }

    #[test]
    fn a_target_that_is_not_finite_never_leaves() {
        let nan = PositionTarget::at(Ned { east_m: f32::NAN, ..A.position });
        let infinite = Velocity { north_mps: f32::INFINITY, ..Velocity::default() };
        let fast = PositionTarget { velocity: Some(infinite), ..A };
        for target in [nan, fast] {
            assert!(sent(Firmware::Px4, 50, |_| target).is_empty());
            assert!(sent(Firmware::ArduPilot, 50, |_| target).is_empty());
        }
    }
}
