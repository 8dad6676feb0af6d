//! From the machine's outputs to the link.

use super::Onboard;
use crate::{Deliberator, Outputs, RECORD_BYTES_MAX, State};
use gleaner_link::{Enable, ParameterId, Severity, TUNNEL_DECISION};
use gleaner_units::Instant;

impl<P: Deliberator> Onboard<P> {
    pub(super) fn send(&mut self, now: Instant, out: &Outputs) {
        if out.withdraw {
            self.link.revoke();
        }
        if let Some(target) = &out.setpoint {
            // Not sent without an autopilot; its loss is in the next snapshot.
            let _ = self.link.steer(now, target);
        }
        if let Some(command) = out.command
            && self.link.request(now, command).is_err()
        {
            let _ = self.refused.push((command, false));
        }
        for notice in &out.notices {
            self.link.say(notice.severity, format_args!("{}", notice.text));
            self.recall.keep(now, notice);
        }
        self.recall.heard(self.link.autopilot().heartbeat_at());
        self.show_enable();
        self.show_lookahead();
        self.show_only_model();
        self.send_decision(out);
        self.send_telemetry(now, out);
    }

    /// `GLN_ENABLE` shows the truth: 0 once the request is over, for whatever reason.
    fn show_enable(&mut self) {
        let truth = match self.state() {
            State::Waiting | State::Engaged | State::Homing => Enable::Engage,
            State::Shadow => Enable::Shadow,
            State::Boot | State::Idle | State::Done | State::Passive | State::Fault => Enable::Off,
        };
        if self.link.parameters().enable() != truth {
            // All three are in the parameter's range.
            let _ = self.link.set_parameter(ParameterId::Enable, truth.value());
        }
    }

    /// `GLN_LOOKAHEAD` stays 0 in a program that has none.
    fn show_lookahead(&mut self) {
        if !P::LOOKS_AHEAD && self.link.parameters().looks_ahead() {
            // 0 is in the parameter's range.
            let _ = self.link.set_parameter(ParameterId::Lookahead, 0.0);
            self.link.say(Severity::Warning, format_args!("gleaner: this program has no look-ahead"));
        }
    }

    fn send_decision(&mut self, out: &Outputs) {
        let Some(decision) = self.machine.decision().filter(|_| out.decided) else { return };
        self.decision_taken = false;
        let mut buffer = [0; RECORD_BYTES_MAX];
        if let Some(bytes) = decision.record().encode(&mut buffer) {
            self.link.tunnel(TUNNEL_DECISION, bytes);
        }
    }

    fn send_telemetry(&mut self, now: Instant, out: &Outputs) {
        let Some(telemetry) = out.telemetry else { return };
        let infer_us = self.inference_time.map(|took| took.as_micros() as f32);
        let values = gleaner_link::Telemetry {
            data_weight: Some(telemetry.w_data),
            collected: Some(telemetry.collected),
            spare_units: telemetry.spare.map(|spare| spare.0),
            inference_us: infer_us,
            attended_device: telemetry.attended.map(f32::from),
            unit_percent: Some(telemetry.unit_pct),
            landing_percent: telemetry.land_pct,
            snr_offset_db: telemetry.snr_off,
        };
        self.link.send_telemetry(now, &values);
    }
}
