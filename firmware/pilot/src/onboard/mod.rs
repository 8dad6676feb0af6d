//! Bytes in, bytes out: link endpoint, radio decoder, device table and [`Machine`] in one.

mod heard;
mod program;
mod rc;
mod recall;
mod receiving;
mod sending;
mod settings;

pub use settings::{OnboardError, Settings};

use self::heard::Heard;
use self::rc::Knob;
use self::recall::Recall;
use crate::exchange::{collected, device_states};
use crate::{
    Decision, Deliberator, Fault, Inputs, MAX_DEVICES, Machine, Missing, Mission, ReturnReason, Rules, State,
    Vehicle,
};
use core::fmt;
use gleaner_link::{
    AutopilotCommand, Component, Enable, LinkStats, ParameterId, Parameters, Severity, Status,
};
use gleaner_policy::{DeviceState, SelfTestError};
use gleaner_radio::{Report, ReportStats, TableStats};
use gleaner_units::{BatteryUnits, Cell, Duration, Instant};
use heapless::Vec;

/// Numbers for a summary or a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    /// Decisions since boot, of policy, guard and shadow.
    pub decisions: u32,
    /// Battery units paid in this mission (0.5 a hover, 1 a move).
    pub spent: BatteryUnits,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// Changes of the preference since boot.
    pub preference_changes: u32,
    /// The cell that the current leg leads to.
    pub target: Option<Cell>,
    /// What is missing before the mission can be engaged.
    pub missing: Option<Missing>,
    /// Why the pilot flies home.
    pub return_reason: Option<ReturnReason>,
    /// Why the pilot gave up.
    pub fault: Option<Fault>,
    /// Whether the aircraft has landed at the end of a mission.
    pub landed: bool,
    /// Counters of the link.
    pub link: LinkStats,
    /// Counters of the radio's serial port.
    pub radio: ReportStats,
    /// Reports that came by `TUNNEL` and were no reports.
    pub tunnel_refused: u32,
    /// Counters of the reports of all sources.
    pub reports: TableStats,
}

/// The whole pilot. Feed it bytes, poll it at 20 Hz or more, carry its bytes away.
pub struct Onboard<P> {
    machine: Machine,
    policy: P,
    link: Component,
    rules: Rules,
    heard: Heard,
    recall: Recall,
    knob: (Option<u8>, Knob),
    refused: Vec<(AutopilotCommand, bool), 2>,
    hand_back_requested: bool,
    tunnel_refused: u32,
    inference_time: Option<Duration>,
    engage_inhibited: bool,
    offers_models: bool,
    decision_taken: bool,
}

impl<P: Deliberator> Onboard<P> {
    /// A pilot at boot. `self_test` is the result of [`gleaner_policy::self_test`] with this policy; after a
    /// failure the pilot speaks but never engages. `GLN_ENABLE` starts at 0 whatever `parameters` contain: only a
    /// request in this run engages.
    ///
    /// # Errors
    /// See [`OnboardError`].
    pub fn new(
        mission: Mission,
        parameters: Parameters,
        settings: Settings,
        policy: P,
        self_test: Result<(), SelfTestError>,
    ) -> Result<Onboard<P>, OnboardError> {
        let mut onboard = Onboard::grounded(parameters, settings.checked()?, policy);
        onboard.rules = settings.rules;
        onboard.load(&mission, self_test)?;
        Ok(onboard)
    }

    /// A pilot at boot that has no mission: it speaks but never engages, as after a failed self-test. A board, whose
    /// stack is shorter than a pilot is long, begins with this one and then gives it its mission where it stands.
    pub fn grounded(mut parameters: Parameters, settings: gleaner_link::Settings, policy: P) -> Onboard<P> {
        // 0 is in the parameter's range.
        let _ = parameters.set_id(ParameterId::Enable, Enable::Off.value());
        Onboard {
            machine: Machine::grounded(),
            policy,
            link: Component::new(settings, parameters),
            rules: Rules::DEFAULT,
            heard: Heard::new(),
            recall: Recall::default(),
            knob: (None, Knob::default()),
            refused: Vec::new(),
            hand_back_requested: false,
            tunnel_refused: 0,
            inference_time: None,
            engage_inhibited: false,
            offers_models: false,
            decision_taken: true,
        }
    }

    /// Gives a grounded pilot its mission, before its first poll. `self_test` as in [`Onboard::new`].
    ///
    /// # Errors
    /// [`OnboardError::Mission`] and [`OnboardError::Begun`]; nothing changes.
    pub fn load(
        &mut self,
        mission: &Mission,
        self_test: Result<(), SelfTestError>,
    ) -> Result<(), OnboardError> {
        // A mission that can be flown has a cell inside its fence.
        if self.state() != State::Boot || !self.machine.mission().fence.is_empty() {
            return Err(OnboardError::Begun);
        }
        self.machine.load(mission, self_test.is_ok())?;
        for site in &mission.devices {
            // The capacities are the same, and the mission's check has found doubles already.
            let _ = self.heard.table.add(site.id, site.data);
        }
        Ok(())
    }

    /// Continues the budget of a mission that an earlier run of the program flew, in which it used `spent`
    /// ([`Stats::spent`]). It counts until the motors are armed anew. Before the first poll.
    pub fn resume_budget(&mut self, spent: BatteryUnits) {
        self.machine.resume_budget(spent);
    }

    /// Bytes from the autopilot's link (which also carries the ground station), in any pieces.
    pub fn receive_link(&mut self, now: Instant, bytes: &[u8]) {
        self.link.receive(now, bytes);
    }

    /// Bytes from the radio: postcard reports in COBS, in any pieces.
    pub fn receive_radio(&mut self, now: Instant, bytes: &[u8]) {
        self.heard.receive(now, bytes);
    }

    /// A report of another format, decoded by the program.
    pub fn receive_report(&mut self, now: Instant, report: &Report) {
        self.heard.report(now, report);
    }

    /// Bytes of the radio that the program decodes. They are only counted: bytes without reports are reported to the
    /// operator.
    pub fn observe_radio(&mut self, bytes: &[u8]) {
        self.heard.see(bytes);
    }

    /// One datagram of the autopilot's link.
    pub fn receive_link_datagram(&mut self, now: Instant, datagram: &[u8]) {
        self.link.receive_datagram(now, datagram);
    }

    /// One frame of the autopilot's link or of another port, from a decoder of the program's own
    /// ([`gleaner_link::Signing`]).
    pub fn receive_frame(&mut self, now: Instant, frame: &gleaner_link::Frame) {
        self.link.receive_frame(now, frame);
    }

    /// One step: decides what to send. The model runs inside. Call at 20 Hz or more. Heartbeat and targets leave from
    /// here only: when the calls stop, they stop. After a call that came late, or with a clock that went back, the pilot
    /// gives up and waits for new heartbeats.
    pub fn poll(&mut self, now: Instant) {
        let received = self.take_events(now);
        self.follow_knob(now);
        let vehicle = Vehicle::observe(now, self.link.autopilot());
        let other_mode_seen = self.link.take_other_mode();
        let target_reported = self.link.take_target_report();
        let inputs = Inputs {
            vehicle: &vehicle,
            devices: &self.heard.at(now, self.link.parameters().snr_age()),
            radio: self.heard.activity(),
            parameters: self.link.parameters(),
            rules: &self.rules,
            requests: &received.requests,
            other_mode_seen,
            foreign_target: self.link.foreign_target().is_some(),
            target_reported,
            ended: &received.ended,
            engage_inhibited: self.engage_inhibited,
        };
        let out = self.machine.poll(now, &inputs, &mut self.policy);
        if out.decided {
            self.heard.table.begin_slot();
        }
        self.send(now, &out);
        let link = &mut self.link;
        self.heard.remarks(now, |remark| link.say(Severity::Warning, format_args!("{remark}")));
        let status = Status {
            state: self.machine.system_state(),
            may_engage: self.machine.may_engage(),
            may_return: self.machine.may_return(),
        };
        self.link.poll(now, &status);
    }

    /// Moves bytes for the link into `buffer`; how many. Call until it gives 0.
    pub fn transmit(&mut self, buffer: &mut [u8]) -> usize {
        self.link.transmit(buffer)
    }

    /// How often everything of ours that moves the aircraft was revoked. Compare it after each poll: when it changed,
    /// frames that were transmitted before and have not left the program must not leave any more.
    #[must_use]
    pub const fn revocations(&self) -> u32 {
        self.link.revocations()
    }

    /// Gives the aircraft back before the program ends: with the next poll a flight ends, and the autopilot is requested
    /// to return or to hold ([`crate::OnStop`]). Poll on until [`Onboard::is_handing_back`] is false or the program's patience ends.
    pub fn hand_back(&mut self) {
        self.hand_back_requested = true;
    }

    /// Whether an aircraft is still to be given back.
    #[must_use]
    pub const fn is_handing_back(&self) -> bool {
        self.hand_back_requested || self.machine.is_handing_back()
    }

    /// The last decision, once.
    pub fn decision(&mut self) -> Option<&Decision> {
        if core::mem::replace(&mut self.decision_taken, true) { None } else { self.machine.decision() }
    }

    /// What the pilot is doing.
    #[must_use]
    pub const fn state(&self) -> State {
        self.machine.state()
    }

    /// The mission machine, to look at.
    #[must_use]
    pub const fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The MAVLink endpoint, to look at.
    #[must_use]
    pub const fn link(&self) -> &Component {
        &self.link
    }

    /// The numbers so far.
    ///
    /// # Cost
    /// One look at each device.
    #[must_use]
    pub fn stats(&self) -> Stats {
        let machine = &self.machine;
        // What remains does not age.
        let devices = self.heard.at(Instant::ZERO, Duration::ZERO);
        Stats {
            decisions: machine.decisions(),
            spent: machine.spent(),
            collected: collected(machine.mission(), &devices),
            preference_changes: machine.preference_changes(),
            target: machine.target(),
            missing: machine.missing(),
            return_reason: machine.return_reason(),
            fault: machine.fault(),
            landed: machine.landed(),
            link: self.link.stats(),
            radio: self.heard.decoder.stats(),
            tunnel_refused: self.tunnel_refused,
            reports: self.heard.table.stats(),
        }
    }

    /// The devices of the mission, in its order, as the next decision would see them.
    #[must_use]
    pub fn device_states(&self, now: Instant) -> Vec<DeviceState, MAX_DEVICES> {
        let heard = self.heard.at(now, self.link.parameters().snr_age());
        device_states(self.machine.mission(), &heard).collect()
    }

    /// The look-ahead's part of the last decision, for a log; `None` in a program without look-ahead. To be called after the
    /// poll at `now` in which it was decided.
    #[cfg(feature = "std")]
    #[must_use]
    pub fn logged_lookahead(&self, now: Instant) -> Option<crate::LoggedLookAhead> {
        let record = self.machine.decision()?.lookahead?;
        let parameters = self.link.parameters();
        let settings = (parameters.altitude(), parameters.reserve());
        let devices = self.device_states(now);
        Some(crate::LoggedLookAhead::new(record, self.machine.mission(), settings, devices))
    }

    /// The parameters as they are now.
    #[must_use]
    pub const fn parameters(&self) -> &Parameters {
        self.link.parameters()
    }

    /// The engine, for a program that times it.
    #[must_use]
    pub const fn policy(&self) -> &P {
        &self.policy
    }

    /// Ends the pilot. The policy can serve another one.
    #[must_use]
    pub fn into_policy(self) -> P {
        self.policy
    }

    /// How long the last decision took, network and look-ahead, measured by the program (a clock is an input); sent as
    /// `infer_us`.
    pub fn set_inference_time(&mut self, took: Duration) {
        self.inference_time = Some(took);
    }

    /// Blocks or permits engaging, for a switch on the aircraft. It does not end a mission that is already engaged: a
    /// wire that breaks in flight changes nothing.
    pub fn set_engage_inhibited(&mut self, inhibited: bool) {
        self.engage_inhibited = inhibited;
    }

    /// One line for the operator from the program around the pilot, such as a port that went down; leaves with
    /// the next polls as `STATUSTEXT`.
    pub fn say(&mut self, severity: Severity, text: fmt::Arguments<'_>) {
        self.link.say(severity, text);
    }
}
