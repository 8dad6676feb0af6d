//! What is watched in every state: the poll itself, the preference, the altitude parameter, the vehicle's clock.

use crate::{Inputs, Outputs, Vehicle};
use gleaner_link::Severity;
use gleaner_units::{Decimal, Duration, Instant};

/// A poll that is later than this is a failure of the decision loop: PX4 has left OFFBOARD by then
/// (`COM_OF_LOSS_T` 1 s), and an aircraft at 20 m/s has flown a whole cell unwatched.
const LATE: Duration = Duration::from_secs(1);
/// After a late poll the queues of the operating system hold old messages that are read as if they arrived now. So long
/// after it they have been read, and a heartbeat is evidence again.
const DRAIN: Duration = Duration::from_millis(500);
/// Over this time the vehicle's clock is compared with ours.
const CLOCK_PERIOD: Duration = Duration::from_secs(3);
/// Two comparisons in a row differ by less than this factor, else messages were late.
const CLOCK_AGREES: f32 = 1.1;

/// The watches that outlive a flight.
#[derive(Clone, Debug)]
pub(super) struct Monitor {
    polled_at: Option<Instant>,
    evidence_from: Option<Instant>,
    w_data: Option<f32>,
    preference_changes: u32,
    altitude_m: Option<f32>,
    clock: Option<(Instant, u32)>,
    clock_reported: bool,
    /// The last comparison of the clocks.
    clock_ratio: f32,
    /// Seconds of the vehicle per second of ours.
    pace: f32,
    vehicle_seen: bool,
    disarmed_seen: bool,
    reported_at: Option<Instant>,
    collected: f32,
}

impl Monitor {
    pub(super) const fn new() -> Monitor {
        Monitor {
            polled_at: None,
            evidence_from: None,
            w_data: None,
            preference_changes: 0,
            altitude_m: None,
            clock: None,
            clock_reported: false,
            clock_ratio: 1.0,
            pace: 1.0,
            vehicle_seen: false,
            disarmed_seen: false,
            reported_at: None,
            collected: 0.0,
        }
    }

    /// Whether this poll is too late after the last one, or before it.
    pub(super) fn keep_time(&mut self, now: Instant) -> bool {
        let late = self.polled_at.is_some_and(|at| now.since(at) > LATE || now < at);
        self.polled_at = Some(now);
        if late {
            self.evidence_from = Some(now + DRAIN);
        }
        late
    }

    /// Heartbeats that arrived up to here may be old.
    pub(super) const fn evidence_from(&self) -> Option<Instant> {
        self.evidence_from
    }

    pub(super) const fn preference_changes(&self) -> u32 {
        self.preference_changes
    }

    pub(super) const fn collected(&self) -> f32 {
        self.collected
    }

    pub(super) const fn set_collected(&mut self, collected: f32) {
        self.collected = collected;
    }

    /// Whether the motors are armed for the first time since they were disarmed: another mission.
    pub(super) fn armed_again(&mut self, vehicle: &Vehicle) -> bool {
        if vehicle.mode.is_none() {
            return false;
        }
        core::mem::replace(&mut self.disarmed_seen, !vehicle.armed) && vehicle.armed
    }

    /// Whether a report is due now.
    pub(super) fn report_due(&mut self, now: Instant, period: Duration) -> bool {
        let due = self.reported_at.is_none_or(|at| now.since(at) >= period);
        if due {
            self.reported_at = Some(now);
        }
        due
    }

    pub(super) fn watch(
        &mut self,
        now: Instant,
        inputs: &Inputs<'_>,
        flight_down_m: Option<f32>,
        out: &mut Outputs,
    ) {
        self.watch_preference(inputs, out);
        self.watch_altitude(inputs, flight_down_m, out);
        self.watch_clock(now, inputs, out);
        if !self.vehicle_seen && inputs.vehicle.mode.is_some() {
            self.vehicle_seen = true;
            if inputs.vehicle.armed && !inputs.vehicle.on_ground {
                out.say(Severity::Critical, format_args!("gleaner: started over an armed vehicle, idle"));
            }
        }
    }

    fn watch_preference(&mut self, inputs: &Inputs<'_>, out: &mut Outputs) {
        let w_data = inputs.parameters.data_weight();
        if self.w_data.replace(w_data).is_some_and(|last| last != w_data) {
            self.preference_changes = self.preference_changes.saturating_add(1);
            let w_data = Decimal::<2>(w_data);
            out.say(Severity::Info, format_args!("gleaner: preference w_data {w_data}, next decision"));
        }
    }

    fn watch_altitude(&mut self, inputs: &Inputs<'_>, flight_down_m: Option<f32>, out: &mut Outputs) {
        let altitude_m = inputs.parameters.altitude().0;
        let changed = self.altitude_m.replace(altitude_m).is_some_and(|last| last != altitude_m);
        if changed && flight_down_m.is_some() {
            out.say(Severity::Notice, format_args!("gleaner: GLN_ALT acts at the next engage"));
        }
    }

    /// Seconds of the vehicle per second of ours: 1 unless a simulator runs faster or slower.
    pub(super) const fn pace(&self) -> f32 {
        self.pace
    }

    /// Slots and timeouts run on our clock; only the moving target runs on the vehicle's, because its velocity does.
    fn watch_clock(&mut self, now: Instant, inputs: &Inputs<'_>, out: &mut Outputs) {
        let Some(boot_ms) = inputs.vehicle.boot_ms else {
            self.clock = None;
            return;
        };
        let (since, since_ms) = *self.clock.get_or_insert((now, boot_ms));
        let ours = now.since(since);
        if ours < CLOCK_PERIOD {
            return;
        }
        self.clock = Some((now, boot_ms));
        let ratio = boot_ms.wrapping_sub(since_ms) as f32 * 1e-3 / ours.as_secs_f32();
        let last = core::mem::replace(&mut self.clock_ratio, ratio);
        if (0.8..=1.25).contains(&ratio) {
            self.pace = 1.0;
            return;
        }
        let agrees = ratio < CLOCK_AGREES * last && last < CLOCK_AGREES * ratio && ratio < 1e3;
        if agrees {
            self.pace = ratio;
        }
        if agrees && !core::mem::replace(&mut self.clock_reported, true) {
            let ratio = Decimal::<1>(ratio);
            out.say(Severity::Warning, format_args!("gleaner: vehicle clock at {ratio} x, real time only"));
        }
    }
}
