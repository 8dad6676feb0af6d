//! The record of a flight: track, slots, frames, and their files.

use crate::autopilot::Truth;
use crate::setup::MissionSetup;
use gleaner_pilot::{DecisionRecord, LoggedDecision, LoggedLookAhead, Mission, SimulatedSlot};
use gleaner_policy::{DeviceState, Preference, Situation, Slots, Tokens};
use gleaner_units::{Duration, Instant, Metres, Ned, Rays};
use gleaner_world::{City, Serving};
use std::io::{self, Write};

/// One decision on the line, with the simulation's state.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// When, since the autopilot's boot.
    pub at: Instant,
    /// True position.
    pub position: Ned,
    /// The pilot's record.
    pub record: DecisionRecord,
    /// The devices as the radio reported them for this slot, in the mission's order.
    pub heard: Vec<DeviceState>,
    /// Whether it was flown: shadow decisions are not.
    pub flown: bool,
    /// The device served and its data.
    pub serving: Option<Serving>,
    /// Fraction of the data collected so far.
    pub collected: f32,
}

impl Slot {
    /// The observation behind the decision: cell, battery and preference of the record, the radio's reports, and the
    /// mission at the altitude of the simulated city. `None` if the record's preference is impossible. With it a
    /// decision that was made on a board can be repeated here.
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
            channel: self.record.channel,
        };
        Some(Tokens::build(&situation, self.heard.iter().copied()))
    }

    /// The line of a decision log for this slot, with the model's input built again; `None` if the record's preference is
    /// impossible.
    #[must_use]
    pub fn logged(&self, setup: &MissionSetup) -> Option<LoggedDecision> {
        let (tokens, slots) = self.observation(&setup.mission)?;
        Some(LoggedDecision {
            time_us: self.at.as_micros(),
            position_ned_m: Some([self.position.north_m, self.position.east_m, self.position.down_m]),
            lookahead: self.lookahead(setup),
            truth: Some(SimulatedSlot {
                served: self.serving.map(|serving| serving.device),
                served_units: self.serving.map_or(0.0, |serving| serving.collected_units),
                collected_after: self.collected,
            }),
            ..LoggedDecision::from_record(LOG_EPOCH_S, &self.record, tokens, slots)
        })
    }

    /// The look-ahead's part of the log.
    fn lookahead(&self, setup: &MissionSetup) -> Option<LoggedLookAhead> {
        let settings = (Metres(setup.altitude_m()), setup.plan.reserve);
        let record = self.record.lookahead?;
        Some(LoggedLookAhead::new(record, &setup.mission, settings, self.heard.iter().copied()))
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

/// The record of a flight.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    track: Vec<TrackPoint>,
    slots: Vec<Slot>,
    frames: Vec<(Instant, Vec<u8>)>,
    next_point: Instant,
    /// Nothing is recorded.
    off: bool,
}

/// The clock of a log counts from 1970. A virtual flight begins on 2026-01-01, so that equal flights give equal files.
const LOG_EPOCH_S: u64 = 1_767_225_600;

impl Journal {
    const TRACK_INTERVAL: Duration = Duration::from_millis(200);

    /// A journal that records nothing.
    pub(crate) fn off() -> Journal {
        Journal { off: true, ..Journal::default() }
    }

    pub(crate) const fn is_off(&self) -> bool {
        self.off
    }

    pub(crate) fn track_point(&mut self, now: Instant, truth: &Truth) {
        if !self.off && now >= self.next_point {
            self.next_point = now + Journal::TRACK_INTERVAL;
            self.track.push(TrackPoint { at: now, position: truth.position });
        }
    }

    pub(crate) fn slot(&mut self, slot: Slot) {
        self.slots.push(slot);
    }

    pub(crate) fn frame(&mut self, now: Instant, bytes: &[u8]) {
        if !self.off {
            self.frames.push((now, bytes.to_vec()));
        }
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
            out.write_all(&(LOG_EPOCH_S * 1_000_000 + at.as_micros()).to_be_bytes())?;
            out.write_all(frame)?;
        }
        Ok(())
    }

    /// Writes one JSON object per decision, as `gleaner run` does: `gleaner replay` reads both. The inputs of model and
    /// look-ahead are built again from the records and `setup`; a record with an impossible preference has none and is
    /// left out.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_decisions(&self, setup: &MissionSetup, out: &mut impl Write) -> io::Result<()> {
        for line in self.slots.iter().filter_map(|slot| slot.logged(setup)) {
            serde_json::to_writer(&mut *out, &line)?;
            out.write_all(b"\n")?;
        }
        Ok(())
    }
}
