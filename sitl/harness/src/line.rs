//! The line between companion computer and autopilot, with its faults.

use gleaner_units::{Duration, Instant};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// A direction of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lane {
    /// From the companion to the autopilot.
    Up,
    /// From the autopilot to the companion.
    Down,
}

/// A fault of the line. The number of a random fault is N of its probability 1/N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineFault {
    /// Nothing passes; `None` is both directions.
    Cut(Option<Lane>),
    /// One byte in N is replaced by a random byte.
    Noise(u32),
    /// Every frame is late by this much.
    Delay(Duration),
    /// One frame in N arrives twice.
    Duplication(u32),
    /// One frame in N arrives 60 ms late, after its successors.
    Reordering(u32),
    /// `COMMAND_ACK` frames of the autopilot are lost.
    AcksLost,
}

impl fmt::Display for LineFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LineFault::Cut(None) => write!(f, "the line to the autopilot is cut"),
            LineFault::Cut(Some(Lane::Up)) => write!(f, "the line is cut towards the autopilot only"),
            LineFault::Cut(Some(Lane::Down)) => write!(f, "the line is cut from the autopilot only"),
            LineFault::Noise(one_in) => write!(f, "one byte in {one_in} on the line is wrong"),
            LineFault::Delay(by) => write!(f, "the line delays frames by {:.1} s", by.as_secs_f32()),
            LineFault::Duplication(one_in) => write!(f, "one frame in {one_in} on the line arrives twice"),
            LineFault::Reordering(one_in) => write!(f, "one frame in {one_in} on the line arrives late"),
            LineFault::AcksLost => write!(f, "the autopilot's acknowledgements are lost"),
        }
    }
}

/// `COMMAND_ACK`.
const COMMAND_ACK: u32 = 77;
/// Extra delay of a reordered frame.
const REORDER_DELAY: Duration = Duration::from_millis(60);

#[derive(Debug, Default)]
struct Queue {
    /// Frames that have arrived.
    ready: Vec<Vec<u8>>,
    /// Frames under way and when they arrive.
    under_way: Vec<(Instant, Vec<u8>)>,
    last_due: Instant,
}

/// Both directions of the line.
#[derive(Debug)]
pub(crate) struct Line {
    faults: Vec<(LineFault, Instant)>,
    up: Queue,
    down: Queue,
    rng: ChaCha8Rng,
}

impl Line {
    /// A line without faults. `seed` is that of the random faults.
    pub fn new(seed: u64) -> Line {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Line { faults: Vec::new(), up: Queue::default(), down: Queue::default(), rng }
    }

    /// Begins a fault.
    pub fn fail(&mut self, now: Instant, fault: LineFault, lasts: Duration) {
        self.faults.push((fault, now + lasts));
    }

    /// Puts a frame on the line.
    pub fn send(&mut self, now: Instant, lane: Lane, mut frame: Vec<u8>) {
        if !self.faults.is_empty() {
            self.faults.retain(|(_, until)| now < *until);
        }
        let (mut delay, mut late, mut copies) = (Duration::ZERO, Duration::ZERO, 1);
        for (fault, _) in &self.faults {
            match *fault {
                LineFault::Cut(cut) if cut.is_none_or(|cut| cut == lane) => return,
                LineFault::AcksLost if lane == Lane::Down && message_id(&frame) == Some(COMMAND_ACK) => {
                    return;
                }
                LineFault::Cut(_) | LineFault::AcksLost => {}
                LineFault::Noise(one_in) => disturb(&mut self.rng, one_in, &mut frame),
                LineFault::Delay(by) => delay = delay + by,
                LineFault::Duplication(one_in) => {
                    copies += usize::from(self.rng.random_ratio(1, one_in.max(1)));
                }
                LineFault::Reordering(one_in) => {
                    if self.rng.random_ratio(1, one_in.max(1)) {
                        late = REORDER_DELAY;
                    }
                }
            }
        }
        let queue = match lane {
            Lane::Up => &mut self.up,
            Lane::Down => &mut self.down,
        };
        for _ in 0..copies {
            queue.put(now, delay, late, frame.clone());
        }
    }

    /// The frames that have arrived, in order.
    pub fn arrived(&mut self, now: Instant, lane: Lane) -> Vec<Vec<u8>> {
        let queue = match lane {
            Lane::Up => &mut self.up,
            Lane::Down => &mut self.down,
        };
        queue.arrived(now)
    }
}

impl Queue {
    fn put(&mut self, now: Instant, delay: Duration, late: Duration, frame: Vec<u8>) {
        if self.under_way.is_empty() && delay == Duration::ZERO && late == Duration::ZERO {
            self.ready.push(frame);
            return;
        }
        // A delay that ends does not let later frames overtake.
        let due = (now + delay).max(self.last_due);
        self.last_due = due;
        self.under_way.push((due + late, frame));
    }

    fn arrived(&mut self, now: Instant) -> Vec<Vec<u8>> {
        let mut frames = std::mem::take(&mut self.ready);
        if !self.under_way.is_empty() {
            // A stable sort: frames due at the same time keep their order.
            self.under_way.sort_by_key(|(due, _)| *due);
            let count = self.under_way.iter().take_while(|(due, _)| *due <= now).count();
            frames.extend(self.under_way.drain(..count).map(|(_, frame)| frame));
        }
        frames
    }
}

fn disturb(rng: &mut ChaCha8Rng, one_in: u32, frame: &mut [u8]) {
    for byte in frame {
        if rng.random_ratio(1, one_in.max(1)) {
            *byte = rng.next_u32() as u8;
        }
    }
}

/// Message id of a MAVLink 2 frame.
pub(crate) fn message_id(frame: &[u8]) -> Option<u32> {
    match frame {
        [0xFD, _, _, _, _, _, _, id0, id1, id2, ..] => Some(u32::from_le_bytes([*id0, *id1, *id2, 0])),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Instant {
        Instant::from_millis(ms)
    }

    fn numbers(frames: Vec<Vec<u8>>) -> Vec<u8> {
        frames.iter().map(|frame| frame[0]).collect()
    }

    #[test]
    fn without_faults_frames_pass_at_once_and_in_order() {
        let mut line = Line::new(1);
        for number in 0..5 {
            line.send(at(20), Lane::Up, vec![number]);
        }
        assert_eq!(numbers(line.arrived(at(20), Lane::Up)), [0, 1, 2, 3, 4]);
        assert!(line.arrived(at(20), Lane::Down).is_empty());
    }

    #[test]
    fn a_one_way_cut_drops_one_direction_until_it_ends() {
        let mut line = Line::new(1);
        line.fail(at(0), LineFault::Cut(Some(Lane::Down)), Duration::from_secs(1));
        line.send(at(500), Lane::Up, vec![1]);
        line.send(at(500), Lane::Down, vec![2]);
        line.send(at(1000), Lane::Down, vec![3]);
        assert_eq!(numbers(line.arrived(at(1000), Lane::Up)), [1]);
        assert_eq!(numbers(line.arrived(at(1000), Lane::Down)), [3]);
    }

    #[test]
    fn a_delay_that_ends_does_not_reorder() {
        let mut line = Line::new(1);
        line.fail(at(0), LineFault::Delay(Duration::from_millis(300)), Duration::from_millis(100));
        line.send(at(50), Lane::Down, vec![1]);
        line.send(at(200), Lane::Down, vec![2]);
        assert!(line.arrived(at(340), Lane::Down).is_empty());
        assert_eq!(numbers(line.arrived(at(350), Lane::Down)), [1, 2]);
    }

    #[test]
    fn reordering_and_duplication_keep_every_frame() {
        let mut line = Line::new(1);
        line.fail(at(0), LineFault::Reordering(2), Duration::from_secs(10));
        line.fail(at(0), LineFault::Duplication(2), Duration::from_secs(10));
        let mut came = Vec::new();
        for number in 0..20 {
            line.send(at(u64::from(number) * 20), Lane::Down, vec![number]);
            came.extend(numbers(line.arrived(at(u64::from(number) * 20), Lane::Down)));
        }
        came.extend(numbers(line.arrived(at(1000), Lane::Down)));
        assert!(!came.is_sorted() && came.len() > 25, "{came:?}");
        came.sort_unstable();
        came.dedup();
        assert_eq!(came.len(), 20);
    }

    #[test]
    fn lost_acknowledgements_are_dropped_by_their_id() {
        let mut line = Line::new(1);
        line.fail(at(0), LineFault::AcksLost, Duration::from_secs(1));
        let frame = |id: u8| vec![0xFD, 0, 0, 0, 0, 1, 1, id, 0, 0];
        line.send(at(0), Lane::Down, frame(77));
        line.send(at(0), Lane::Down, frame(0));
        assert_eq!(line.arrived(at(0), Lane::Down), [frame(0)]);
    }
}
