//! From the link's events to the machine's inputs.

use super::Onboard;
use crate::{Deliberator, Request, State};
use gleaner_link::{AutopilotCommand, Enable, Event, OperatorRequest, Outcome, ParameterId};
use gleaner_radio::decode_body;
use gleaner_units::Instant;
use heapless::Vec;

/// What the link received since the last poll.
#[derive(Default)]
pub(super) struct Received {
    pub(super) requests: Vec<Request, { Received::REQUESTS }>,
    pub(super) ended: Vec<(AutopilotCommand, bool), 8>,
}

impl Received {
    const REQUESTS: usize = 8;

    /// In order. When there is no room, an off takes the place of all others, and anything else is dropped.
    fn request(&mut self, request: Request) {
        if self.requests.is_full() && request == Request::Off {
            self.requests.clear();
        }
        let _ = self.requests.push(request);
    }
}

impl<P: Deliberator> Onboard<P> {
    pub(super) fn take_events(&mut self, now: Instant) -> Received {
        let mut received = Received::default();
        for &refused in &self.refused {
            // Two of eight at most.
            let _ = received.ended.push(refused);
        }
        self.refused.clear();
        if core::mem::take(&mut self.hand_back_requested) {
            received.request(Request::HandBack);
        }
        while let Some(event) = self.link.next_event() {
            match event {
                Event::Operator(OperatorRequest::Enable(enable)) => received.request(match enable {
                    Enable::Off => Request::Off,
                    Enable::Engage => Request::Engage,
                    Enable::Shadow => Request::Shadow,
                }),
                Event::Operator(OperatorRequest::ReturnNow) => received.request(Request::Return),
                Event::RequestEnded { outcome: Outcome::Superseded, .. } => {}
                Event::RequestEnded { command, outcome } => {
                    // At most two commands are under way, each ends once.
                    let _ = received.ended.push((command, outcome == Outcome::Accepted));
                }
                Event::RadioReport(payload) => match decode_body(&payload) {
                    Ok(report) => self.heard.report(now, &report),
                    Err(_) => self.tunnel_refused = self.tunnel_refused.saturating_add(1),
                },
                Event::AutopilotConnected => self.repeat_unheard(),
                Event::AutopilotRebooted => self.repeat_newest(),
                // The snapshot, the parameters and the link's flags carry the rest.
                _ => {}
            }
        }
        received
    }

    fn repeat_unheard(&mut self) {
        for notice in self.recall.unheard() {
            self.link.say(notice.severity, format_args!("{}", notice.text));
        }
    }

    /// A ground station behind an autopilot that rebooted may have lost the reason of the state.
    fn repeat_newest(&mut self) {
        if matches!(self.state(), State::Fault | State::Passive)
            && let Some(notice) = self.recall.newest()
        {
            self.link.say(notice.severity, format_args!("{}", notice.text));
        }
    }

    /// The knob writes the parameter, so that every ground station sees what holds.
    pub(super) fn follow_knob(&mut self, now: Instant) {
        let channel = self.link.parameters().data_weight_channel();
        if self.knob.0 != channel {
            self.knob = (channel, Default::default());
        }
        let Some(channel) = channel else { return };
        let pulse_us = self.link.autopilot().rc_pulse_us(now, channel);
        if let Some(weight) = self.knob.1.turned(pulse_us) {
            // The knob's range is the parameter's.
            let _ = self.link.set_parameter(ParameterId::DataWeight, weight);
        }
    }
}
