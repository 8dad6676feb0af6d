//! Grave texts that the operator may not have received.

use crate::Notice;
use gleaner_link::Severity;
use gleaner_units::Instant;
use heapless::Deque;

/// The last texts of WARNING and above. Those that were sent while the autopilot's link was silent are sent again when
/// it is back: the reason of a fault must not be lost with the link that caused it.
#[derive(Debug, Default)]
pub(super) struct Recall {
    kept: Deque<(Instant, Notice), { Recall::KEPT }>,
    /// When the autopilot was last heard.
    heard_at: Option<Instant>,
}

impl Recall {
    const KEPT: usize = 4;

    pub(super) fn keep(&mut self, now: Instant, notice: &Notice) {
        if notice.severity > Severity::Warning {
            return;
        }
        if self.kept.is_full() {
            let _ = self.kept.pop_front();
        }
        let _ = self.kept.push_back((now, notice.clone()));
    }

    /// The autopilot was last heard then; `None` while it is lost.
    pub(super) fn heard(&mut self, at: Option<Instant>) {
        self.heard_at = at.or(self.heard_at);
    }

    /// The texts since the autopilot was last heard.
    pub(super) fn unheard(&self) -> impl Iterator<Item = &Notice> {
        let since = self.heard_at;
        let unheard = self.kept.iter().filter(move |(at, _)| since.is_some_and(|since| *at >= since));
        unheard.map(|(_, notice)| notice)
    }

    /// The newest text.
    pub(super) fn newest(&self) -> Option<&Notice> {
        self.kept.back().map(|(_, notice)| notice)
    }
}
