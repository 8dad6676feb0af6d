//! What happened: the track, the slots, the frames; and their files.

use crate::autopilot::Truth;
use gleaner_pilot::{DecisionRecord, Mission};
use gleaner_policy::{DeviceState, Preference, Situation, Slots, Tokens};
use gleaner_units::{Duration, Instant, Ned, Rays};
use gleaner_world::{City, Serving};
use serde::Serialize;
use std::io::{self, Write};

/// One decision that passed by on the wire.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// When, since the autopilot's boot.
    pub at: Instant,
    /// Where the aircraft really was.
    pub position: Ned,
    /// What the pilot said.
    pub record: DecisionRecord,
    /// The devices as the radio reported them for this slot, in the mission's order.
    pub heard: Vec<DeviceState>,
    /// Whether it was flown: shadow decisions are not.
    pub flown: bool,
    /// What the slot brought.
    pub serving: Option<Serving>,
    /// Fraction of the data collected so far.
    pub collected: f32,
}

impl Slot {
    /// The observation that the pilot must have had: what it says of cell, battery and preference, what the radio
    /// reported, and the mission, flown at the altitude of the simulated city. `None` if its preference is
    /// impossible. So a decision that was made elsewhere can be made again here, and no pilot is asked what it saw.
    #[must_use]
    pub fn observation(&self, mission: &Mission) -> Option<(Tokens, Slots)> {
        let sight = Rays { heights: &mission.heights, altitude_m: City::ALTITUDE_M };
        let situation = Situation {
            cell: self.record.cell,
            battery: self.record.battery,
            spare: self.record.spare,
            terminal: mission.terminal,
            preference: Preference::new(self.record.w_data)?,
            sight: &sight,
        };
        Some(Tokens::build(&situation, self.heard.iter().copied()))
    }
}

/// A point of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackPoint {
    /// When, since the autopilot's boot.
    pub at: Instant,
    /// Where, in the estimator's frame.
    pub position: Ned,
}

/// Everything that is kept of a flight.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    track: Vec<TrackPoint>,
    slots: Vec<Slot>,
    frames: Vec<(Instant, Vec<u8>)>,
    next_point: Instant,
}

/// The clock of a telemetry log counts from 1970; a virtual flight begins on 2026-01-01, so that equal flights give
/// equal files.
const LOG_EPOCH_US: u64 = 1_767_225_600_000_000;

impl Journal {
    const TRACK_INTERVAL: Duration = Duration::from_millis(200);

    pub(crate) fn see(&mut self, now: Instant, truth: &Truth) {
        if now >= self.next_point {
            self.next_point = now + Journal::TRACK_INTERVAL;
            self.track.push(TrackPoint { at: now, position: truth.position });
        }
    }

    pub(crate) fn slot(&mut self, slot: Slot) {
        self.slots.push(slot);
    }

    pub(crate) fn frame(&mut self, now: Instant, bytes: Vec<u8>) {
        self.frames.push((now, bytes));
    }

    /// Where the aircraft was, five times a second.
    #[must_use]
    pub fn track(&self) -> &[TrackPoint] {
        &self.track
    }

    /// The decisions.
    #[must_use]
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// The frames of companion, autopilot and ground station, in order, each with the time since the autopilot's boot.
    pub fn frames(&self) -> impl Iterator<Item = (Instant, &[u8])> {
        self.frames.iter().map(|(at, frame)| (*at, frame.as_slice()))
    }

    /// Writes the frames as a telemetry log: for each the time in microseconds since 1970 as eight big-endian bytes,
    /// then the frame. Ground stations and pymavlink read it.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_tlog(&self, out: &mut impl Write) -> io::Result<()> {
        for (at, frame) in &self.frames {
            out.write_all(&(LOG_EPOCH_US + at.as_micros()).to_be_bytes())?;
            out.write_all(frame)?;
        }
        Ok(())
    }

    /// Writes one JSON object per decision.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_decisions(&self, out: &mut impl Write) -> io::Result<()> {
        for slot in &self.slots {
            serde_json::to_writer(&mut *out, &Line::new(slot))?;
            out.write_all(b"\n")?;
        }
        Ok(())
    }
}

/// One line of `decisions.jsonl`. The names are those of the companion's log; what only a simulation can know comes
/// last.
#[derive(Serialize)]
struct Line {
    sequence: u32,
    time_us: u64,
    state: &'static str,
    cell: [i16; 2],
    action: &'static str,
    mask: Vec<&'static str>,
    battery: f32,
    spare: f32,
    w_data: f32,
    collected: f32,
    logits: Option<[f32; 5]>,
    attended: Option<u16>,
    position_ned_m: [f32; 3],
    served: Option<usize>,
    served_units: f32,
    collected_after: f32,
}

impl Line {
    fn new(slot: &Slot) -> Line {
        let record = &slot.record;
        Line {
            sequence: record.sequence,
            time_us: slot.at.as_micros(),
            state: record.state.name(),
            cell: [record.cell.x, record.cell.y],
            action: record.action.name(),
            mask: record.mask.iter().map(|action| action.name()).collect(),
            battery: record.battery.0,
            spare: record.spare.0,
            w_data: record.w_data,
            collected: record.collected,
            logits: record.logits,
            attended: record.attended,
            position_ned_m: [slot.position.north_m, slot.position.east_m, slot.position.down_m],
            served: slot.serving.map(|serving| serving.device),
            served_units: slot.serving.map_or(0.0, |serving| serving.collected_units),
            collected_after: slot.collected,
        }
    }
}
