//! Reasons of the link not to engage: ids that are used twice, several autopilots, an unsupported vehicle.

use super::{Component, count};
use crate::message::{Message, Severity};
use crate::service::identity::Settled;
use crate::settings::EngageBlock;
use crate::wire::frame::Frame;
use gleaner_units::{Duration, Instant};

/// Heartbeats with our own ids that we did not send.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Duplicate {
    heartbeats: u8,
    last_at: Option<Instant>,
}

impl Component {
    /// A component with our ids that was silent for this long is gone.
    const DUPLICATE_GONE: Duration = Duration::from_secs(10);
    /// One may be a late echo of ours; two are another component.
    const DUPLICATE_HEARTBEATS: u8 = 2;

    pub(super) fn report_identity(&mut self, settled: Settled) {
        let own = self.identity.own();
        match settled {
            Settled::Configured(_) | Settled::Adopted(_) => {
                self.say(
                    Severity::Info,
                    format_args!("gleaner: system {}, component {}", own.system, own.component),
                );
            }
            // The reason not to engage is reported with all others.
            Settled::Several => {}
        }
    }

    /// Reports a new reason not to engage.
    pub(super) fn watch_block(&mut self, now: Instant) {
        let is_duplicate = self.duplicate.heartbeats >= Component::DUPLICATE_HEARTBEATS
            && self.duplicate.last_at.is_some_and(|at| now.since(at) < Component::DUPLICATE_GONE);
        let block = if is_duplicate {
            Some(EngageBlock::DuplicateId)
        } else if let Some(system) = self.identity.rival(now) {
            Some(EngageBlock::SeveralAutopilots(system))
        } else {
            self.autopilot.unsupported_vehicle().map(EngageBlock::NotMultirotor)
        };
        if block == self.block {
            return;
        }
        self.block = block;
        let own = self.identity.own();
        match block {
            None => {}
            Some(EngageBlock::DuplicateId) => {
                self.say(Severity::Critical, format_args!("gleaner: another component has our id {own}"));
            }
            Some(EngageBlock::SeveralAutopilots(_)) => {
                self.say(Severity::Critical, format_args!("gleaner: several autopilots: set system_id"));
            }
            Some(EngageBlock::NotMultirotor(vehicle)) => {
                self.say(Severity::Critical, format_args!("gleaner: MAV_TYPE {vehicle} is no multirotor"));
            }
        }
    }

    /// A message with our own ids: an echo of ours, which a router may return, or another component with the same ids.
    /// An echoed heartbeat has the sequence number of one that we sent.
    pub(super) fn watch_own_id(&mut self, now: Instant, frame: &Frame, message: &Message) {
        if !matches!(message, Message::Heartbeat(_)) || self.outgoing.sent_heartbeat(frame.sequence) {
            return;
        }
        count(&mut self.stats.duplicate_id);
        if self.duplicate.last_at.is_none_or(|at| now.since(at) >= Component::DUPLICATE_GONE) {
            self.duplicate.heartbeats = 0;
        }
        self.duplicate.heartbeats = self.duplicate.heartbeats.saturating_add(1);
        self.duplicate.last_at = Some(now);
    }
}
