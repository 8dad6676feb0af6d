//! Waiting and shadow: the two states that look and do not fly.

use crate::decide::decider::{Deliberation, ask};
use crate::flight::plan::{self, cell_under, usable_battery};
use crate::flight::stream::Stream;
use crate::machine::{Phase, preference};
use crate::states::flying::{Flight, slot};
use crate::{Inputs, Machine, Missing, Outputs, State, Vehicle};
use gleaner_link::{Firmware, FlightMode, Severity};
use gleaner_policy::Policy;
use gleaner_units::{Cell, Decimal, Duration, Instant, Ned};

/// What is missing is told at most this often, so that a condition at its edge does not flood the link.
const TELL_PERIOD: Duration = Duration::from_secs(1);

/// An engage request that is not fulfilled yet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wait {
    missing: Option<Missing>,
    told: Option<(Instant, Missing)>,
    mode: Option<FlightMode>,
    was_armed: bool,
    hold: Option<Ned>,
    stream: Stream,
}

impl Wait {
    pub(crate) fn new(vehicle: &Vehicle) -> Wait {
        Wait {
            missing: None,
            told: None,
            mode: vehicle.mode,
            was_armed: vehicle.armed,
            hold: None,
            stream: Stream::default(),
        }
    }

    pub(crate) const fn missing(&self) -> Option<Missing> {
        self.missing
    }

    /// PX4: where it is, so that a switch to OFFBOARD moves nothing; once in OFFBOARD, where it then was.
    pub(crate) fn target_due(&mut self, now: Instant, vehicle: &Vehicle) -> Option<Ned> {
        if !vehicle.is_guided() || self.hold.is_none() {
            self.hold = vehicle.position.filter(|_| vehicle.ready);
        }
        self.stream.due(now, self.hold?, Firmware::Px4)
    }

    /// Whether someone took the aircraft back before we had it: GUIDED was left, or the autopilot began to
    /// return or land.
    fn was_taken(&mut self, inputs: &Inputs<'_>) -> bool {
        let Some(mode) = inputs.vehicle.mode else { return false };
        let was = self.mode.replace(mode);
        let left = mode != FlightMode::Guided || inputs.other_mode_seen;
        let began_to_leave = was.is_some_and(|was| was != mode) && inputs.vehicle.is_landing_or_returning();
        (was == Some(FlightMode::Guided) && left) || began_to_leave
    }
}

impl Machine {
    pub(crate) fn wait(
        &mut self,
        now: Instant,
        mut wait: Wait,
        inputs: &Inputs<'_>,
        out: &mut Outputs,
    ) -> Phase {
        let vehicle = inputs.vehicle;
        if wait.was_taken(inputs) {
            return Phase::Passive;
        }
        // ArduCopter disarms by itself after ten seconds on the ground. The next arming is another flight and
        // wants another request.
        if wait.was_armed && !vehicle.armed {
            return Phase::Idle;
        }
        wait.was_armed |= vehicle.armed;
        match plan::check(&self.mission, &self.guard, inputs) {
            Ok(plan) => Phase::Engaged(Flight::new(now, plan, wait.stream)),
            Err(missing) => {
                wait.missing = Some(missing);
                let due = wait.told.is_none_or(|(at, told)| told != missing && now.since(at) >= TELL_PERIOD);
                if due {
                    wait.told = Some((now, missing));
                    self.tell_missing(missing, inputs, out);
                }
                Phase::Waiting(wait)
            }
        }
    }

    fn tell_missing(&self, missing: Missing, inputs: &Inputs<'_>, out: &mut Outputs) {
        let needed =
            cell_under(&self.mission, inputs.vehicle).and_then(|(cell, _)| self.guard.way_home(cell));
        match (missing, needed, usable_battery(&self.mission, inputs)) {
            (Missing::EnoughBattery, Some(way), Some(battery)) => {
                let needed = way + self.guard.reserve();
                out.say(
                    Severity::Warning,
                    format_args!(
                        "gleaner: battery {}, way home needs {}",
                        Decimal::<1>(battery.0),
                        Decimal::<1>(needed.0)
                    ),
                );
            }
            _ => out.say(Severity::Info, format_args!("gleaner: waiting: {}", missing.text())),
        }
    }
}

/// What shadow mode has decided last.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ShadowWatch {
    last: Option<(Cell, Instant)>,
    failed: bool,
}

impl Machine {
    /// Decides when the aircraft comes to the centre of another cell, and after each slot; commands nothing.
    #[inline(never)]
    pub(crate) fn shadow<P: Policy>(
        &mut self,
        now: Instant,
        mut watch: ShadowWatch,
        inputs: &Inputs<'_>,
        policy: &mut P,
        out: &mut Outputs,
    ) -> Phase {
        let vehicle = inputs.vehicle;
        let place = cell_under(&self.mission, vehicle).filter(|_| vehicle.armed && vehicle.ready);
        let (Some((cell, offset_m)), Some(battery)) = (place, usable_battery(&self.mission, inputs)) else {
            return Phase::Shadow(watch);
        };
        let slot = slot(self.mission.grid().cell(), inputs.parameters);
        let at_centre = offset_m < inputs.parameters.arrive_radius().0;
        let due = watch.last.is_none_or(|(last, at)| (last != cell && at_centre) || now.since(at) >= slot);
        if !due || self.guard.distance(cell).is_none() {
            return Phase::Shadow(watch);
        }
        watch.last = Some((cell, now));
        let mut decision = Deliberation {
            mission: &self.mission,
            guard: &self.guard,
            devices: inputs.devices,
            preference: preference(inputs.parameters),
            collected: self.collected,
            sequence: self.sequence,
            now,
            state: State::Shadow,
            cell,
            battery,
            altitude: inputs.parameters.altitude(),
        }
        .open();
        match ask(policy, &mut decision) {
            Ok(()) => self.keep(decision, out),
            Err(reason) if !watch.failed => {
                watch.failed = true;
                out.say(Severity::Warning, format_args!("gleaner: shadow: {}", reason.text()));
            }
            Err(_) => {}
        }
        Phase::Shadow(watch)
    }
}
