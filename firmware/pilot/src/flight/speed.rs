//! The speed limit of the autopilot.

use crate::Outputs;
use crate::scene::Scene;
use gleaner_link::{AutopilotCommand, Firmware, Severity};
use gleaner_units::{Instant, MetresPerSecond};

/// The aircraft must be able to catch up with the moving target: at the target's own speed it would keep its lag, and
/// overshoot when the target stops.
const HEADROOM_MPS: f32 = 2.0;

/// The speed requested of the autopilot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Speed {
    requested: Option<MetresPerSecond>,
    /// When another speed was wanted.
    wanted_at: Option<Instant>,
}

impl Speed {
    /// Requests `GLN_SPEED` with a headroom when it changes. The moving target keeps `GLN_SPEED` by itself.
    /// `WPNAV_SPEED` has no effect on a guided leg that is under way, the command has. PX4 accepts it without effect in
    /// OFFBOARD, so it is not requested there.
    pub(crate) fn keep(&mut self, scene: &Scene<'_>, out: &mut Outputs) {
        let wanted = scene.inputs.parameters.speed();
        if scene.vehicle().firmware == Some(Firmware::ArduPilot) && self.requested != Some(wanted) {
            let wanted_at = *self.wanted_at.get_or_insert(scene.now);
            if scene.is_ours_since(wanted_at) {
                *self = Speed { requested: Some(wanted), wanted_at: None };
                out.command = Some(AutopilotCommand::ChangeSpeed(MetresPerSecond(wanted.0 + HEADROOM_MPS)));
            }
        }
        let refused =
            |end: &(AutopilotCommand, bool)| matches!(end, (AutopilotCommand::ChangeSpeed(_), false));
        if scene.inputs.ended.iter().any(refused) {
            out.say(Severity::Warning, format_args!("gleaner: speed not accepted by the autopilot"));
        }
    }
}
