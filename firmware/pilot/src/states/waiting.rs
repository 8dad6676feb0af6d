//! Waiting: a request to engage that is not fulfilled yet.

use super::Outcome;
use crate::flight::energy::Energy;
use crate::flight::plan;
use crate::flight::stream::Stream;
use crate::scene::Scene;
use crate::{Missing, Outputs, TakeOver, Vehicle};
use gleaner_link::{Firmware, FlightMode, PositionTarget, Severity};
use gleaner_units::{Decimal, Duration, Instant, Ned};

/// What is missing is reported at most this often, so that a condition at its edge does not flood the link.
const REPORT_PERIOD: Duration = Duration::from_secs(1);
/// Heartbeats come once a second: their absence is worth a text only after this time.
const HEARTBEAT_DUE: Duration = Duration::from_secs(3);

/// A request to engage.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wait {
    requested_at: Instant,
    missing: Option<Missing>,
    reported: Option<(Instant, Missing)>,
    mode: Option<FlightMode>,
    was_armed: bool,
    hold: Option<Ned>,
    stream: Stream,
}

impl Wait {
    pub(crate) fn new(now: Instant, vehicle: &Vehicle) -> Wait {
        Wait {
            requested_at: now,
            missing: None,
            reported: None,
            mode: vehicle.mode,
            was_armed: vehicle.armed,
            hold: None,
            stream: Stream::default(),
        }
    }

    pub(crate) const fn missing(&self) -> Option<Missing> {
        self.missing
    }

    pub(crate) const fn stream(&self) -> Stream {
        self.stream
    }

    /// PX4 accepts OFFBOARD only when targets stream already: the place of the aircraft, so that the switch moves
    /// nothing; once in OFFBOARD, the place where it then was. ArduPilot needs none. Resumed targets clear a failsafe of
    /// PX4, so there are none while one is set or while heartbeats are no evidence.
    pub(crate) fn target_due(&mut self, scene: &Scene<'_>) -> Option<PositionTarget> {
        let vehicle = scene.vehicle();
        if vehicle.firmware != Some(Firmware::Px4) || vehicle.failsafe || !scene.is_heard() {
            return None;
        }
        if !vehicle.is_guided() || self.hold.is_none() {
            self.hold = vehicle.position.filter(|_| vehicle.ready);
        }
        self.stream.due(scene.now, PositionTarget::at(self.hold?), Firmware::Px4)
    }

    pub(crate) fn step(&mut self, scene: &Scene<'_>, energy: &Energy, out: &mut Outputs) -> Outcome {
        let vehicle = scene.vehicle();
        if self.was_taken(scene) {
            return Outcome::Passive(TakeOver::Mode);
        }
        if vehicle.failsafe {
            out.say(Severity::Warning, format_args!("gleaner: request ended, autopilot failsafe"));
            return Outcome::Idle;
        }
        if scene.now.since(self.requested_at) >= scene.inputs.rules.request_lifetime {
            out.say(Severity::Warning, format_args!("gleaner: request expired, request again"));
            return Outcome::Idle;
        }
        // ArduCopter disarms by itself after ten seconds on the ground. The next arming is another flight and
        // needs another request.
        if self.was_armed && !vehicle.armed {
            return Outcome::Idle;
        }
        self.was_armed |= vehicle.armed;
        match plan::check(scene, energy, self.requested_at) {
            Ok(plan) => Outcome::Engage(plan),
            Err(missing) => {
                self.missing = Some(missing);
                self.report(scene, energy, missing, out);
                Outcome::Stay
            }
        }
    }

    /// Whether someone took the aircraft back before we had it: GUIDED was left, or the autopilot began to
    /// return or land.
    fn was_taken(&mut self, scene: &Scene<'_>) -> bool {
        let vehicle = scene.vehicle();
        let Some(mode) = vehicle.mode else { return false };
        let was = self.mode.replace(mode);
        let left = mode != FlightMode::Guided || scene.inputs.other_mode_seen;
        let began_to_leave = was.is_some_and(|was| was != mode) && vehicle.is_landing_or_returning();
        (was == Some(FlightMode::Guided) && left) || began_to_leave
    }

    fn report(&mut self, scene: &Scene<'_>, energy: &Energy, missing: Missing, out: &mut Outputs) {
        let is_early = missing == Missing::Heartbeat && scene.now.since(self.requested_at) < HEARTBEAT_DUE;
        let is_due = self
            .reported
            .is_none_or(|(at, reported)| reported != missing && scene.now.since(at) >= REPORT_PERIOD);
        if is_early || !is_due {
            return;
        }
        self.reported = Some((scene.now, missing));
        let needed = scene.cell_under().and_then(|(cell, _)| scene.guard.way_home(cell));
        let offered = scene.vehicle().battery_percent.map(|percent| energy.offered(scene, percent));
        let outside = scene.outside_grid().filter(|_| missing == Missing::InsideFence);
        if let Some(outside) = outside {
            let (length, unit) =
                if outside.0 >= 1000.0 { (outside.0 / 1000.0, "km") } else { (outside.0, "m") };
            let length = Decimal::<0>(length);
            return out
                .say(Severity::Info, format_args!("gleaner: waiting: {length} {unit} outside the grid"));
        }
        match (missing, needed, offered) {
            (Missing::EnoughBattery, Some(way), Some(offered)) => {
                let needed = way + scene.guard.reserve();
                let (offered, needed) = (Decimal::<1>(offered.0), Decimal::<1>(needed.0));
                out.say(
                    Severity::Warning,
                    format_args!("gleaner: battery {offered}, way home needs {needed}"),
                );
            }
            _ => out.say(Severity::Info, format_args!("gleaner: waiting: {}", missing.text())),
        }
    }
}
