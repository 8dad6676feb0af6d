//! Shadow: decides and logs as if engaged, commands nothing.

use super::Outcome;
use crate::decide::{Decider, Deliberator, Standpoint};
use crate::flight::energy::Energy;
use crate::scene::Scene;
use crate::{Outputs, State};
use gleaner_link::Severity;
use gleaner_units::{Cell, Instant};

/// The last decision of shadow mode.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shadow {
    last: Option<(Cell, Instant)>,
    failed: bool,
}

impl Shadow {
    /// Decides when the aircraft reaches the centre of another cell, and after each slot.
    pub(crate) fn step<D: Deliberator>(
        &mut self,
        scene: &Scene<'_>,
        energy: &Energy,
        decider: &mut Decider,
        policy: &mut D,
        out: &mut Outputs,
    ) -> Outcome {
        let vehicle = scene.vehicle();
        let place = scene.cell_under().filter(|_| vehicle.armed && vehicle.ready);
        let (Some((cell, offset_m)), Some(percent)) = (place, vehicle.battery_percent) else {
            return Outcome::Stay;
        };
        let at_centre = offset_m < scene.inputs.parameters.arrive_radius().0;
        let is_due = self
            .last
            .is_none_or(|(last, at)| (last != cell && at_centre) || scene.now.since(at) >= scene.slot());
        if !is_due || scene.guard.distance(cell).is_none() {
            return Outcome::Stay;
        }
        self.last = Some((cell, scene.now));
        let at = Standpoint { state: State::Shadow, cell, battery: energy.offered(scene, percent) };
        if let Err(reason) = decider.ask(scene, at, policy, out)
            && !core::mem::replace(&mut self.failed, true)
        {
            out.say(Severity::Warning, format_args!("gleaner: shadow: {}", reason.text()));
        }
        Outcome::Stay
    }
}
