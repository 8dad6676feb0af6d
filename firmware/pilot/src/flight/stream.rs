//! When a position target leaves.

use gleaner_link::Firmware;
use gleaner_units::{Duration, Instant, Ned};

/// PX4 leaves OFFBOARD when targets stop for `COM_OF_LOSS_T` (1 s, 0.5 s in older releases); its guide asks for
/// more than 2 Hz. 20 Hz when polled that often, never below 10 Hz when polled at 20 Hz or more.
const PX4_SPACING: Duration = Duration::from_millis(50);

/// ArduCopter keeps a position target without a timeout. Once a second covers a lost packet.
const ARDUPILOT_SPACING: Duration = Duration::from_secs(1);

/// The pace of the position targets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stream {
    sent: Option<(Instant, Ned)>,
}

impl Stream {
    /// `target` if it is due now. A target that is not finite is never due: NaN kills ArduPilot's simulation
    /// and lets PX4 drift along that axis.
    pub(crate) fn due(&mut self, now: Instant, target: Ned, firmware: Firmware) -> Option<Ned> {
        if !target.is_finite() {
            return None;
        }
        let due = match (self.sent, firmware) {
            (None, _) => true,
            (Some((at, _)), Firmware::Px4) => now.since(at) >= PX4_SPACING,
            (Some((at, last)), _) => last != target || now.since(at) >= ARDUPILOT_SPACING,
        };
        if due {
            self.sent = Some((now, target));
        }
        due.then_some(target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Ned = Ned { north_m: 1.0, east_m: 2.0, down_m: -60.0 };
    const B: Ned = Ned { north_m: 21.0, east_m: 2.0, down_m: -60.0 };

    fn sent(firmware: Firmware, poll_ms: u64, target: impl Fn(u64) -> Ned) -> Vec<u64> {
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
    fn a_target_that_is_not_finite_never_leaves() {
        let nan = Ned { east_m: f32::NAN, ..A };
        assert!(
            sent(Firmware::Px4, 50, |_| nan).is_empty() && sent(Firmware::ArduPilot, 50, |_| nan).is_empty()
        );
    }
}
