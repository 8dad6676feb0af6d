//! Telemetry, once a second.

use super::{Machine, Phase};
use crate::exchange::collected;
use crate::scene::Scene;
use crate::{Inputs, Outputs, Telemetry};
use gleaner_units::{Duration, Instant};

const PERIOD: Duration = Duration::from_secs(1);

impl Machine {
    pub(super) fn report(
        &mut self,
        now: Instant,
        inputs: &Inputs<'_>,
        snr_off: Option<f32>,
        out: &mut Outputs,
    ) {
        if !self.monitor.report_due(now, PERIOD) {
            return;
        }
        self.monitor.set_collected(collected(&self.mission, inputs.devices));
        let Machine { mission, guard, monitor, energy, phase, decider, .. } = self;
        let evidence_from = monitor.evidence_from();
        let scene = Scene { now, mission, guard, inputs, evidence_from, late: false, pace: monitor.pace() };
        let course = match phase {
            Phase::Flying(flight) => Some((flight.course.last_cell(), flight.course.units_ahead())),
            _ => None,
        };
        let spare = match (course, &phase) {
            (Some((cell, ahead)), _) => guard.spare(cell, energy.available(&scene, ahead)),
            (None, Phase::Shadow(_)) => decider.last().map(|decision| decision.spare),
            _ => None,
        };
        out.telemetry = Some(Telemetry {
            w_data: inputs.parameters.data_weight(),
            collected: monitor.collected(),
            spare,
            attended: decider.last().and_then(|decision| decision.attended),
            unit_pct: energy.unit_percent(&scene),
            land_pct: course.and_then(|(cell, ahead)| energy.touchdown_percent(&scene, cell, ahead)),
            snr_off,
        });
    }
}
