//! Bytes in, bytes out: link endpoint, radio decoder, device table and [`Machine`] in one.

mod rc;

use self::rc::Knob;
use crate::{
    Decision, Fault, Inputs, MAX_DEVICES, Machine, Missing, Mission, MissionError, Outputs, RECORD_BYTES_MAX,
    Request, ReturnReason, State, Vehicle,
};
use core::fmt;
use gleaner_link::{
    AutopilotCommand, Component, Enable, Event, LinkStats, OperatorRequest, Outcome, ParameterId, Parameters,
    PositionTarget, SettingsError, Severity, Status, TUNNEL_DECISION,
};
use gleaner_policy::{DeviceState, Policy, SelfTestError};
use gleaner_radio::{DeviceTable, ReportDecoder, ReportStats, decode_body};
use gleaner_units::{BatteryUnits, Cell, Duration, Instant};
use heapless::Vec;

/// Who we are on the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// MAVLink system id when no vehicle's can be adopted; `None` is 1.
    pub system_id: Option<u8>,
    /// MAVLink component id, 191 unless something else on the vehicle has it.
    pub component_id: u8,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { system_id: None, component_id: 191 }
    }
}

impl Settings {
    /// As the link wants them.
    ///
    /// # Errors
    /// The ids are impossible.
    pub fn checked(self) -> Result<gleaner_link::Settings, SettingsError> {
        gleaner_link::Settings::new(self.system_id.unwrap_or(1), self.component_id)
    }
}

/// Why there can be no pilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnboardError {
    /// The mission cannot be flown.
    Mission(MissionError),
    /// The ids are impossible.
    Settings(SettingsError),
    /// A mission was to be loaded over another, or after the first poll.
    Begun,
}

impl fmt::Display for OnboardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OnboardError::Mission(error) => write!(f, "mission: {error}"),
            OnboardError::Settings(error) => write!(f, "settings: {error}"),
            OnboardError::Begun => f.write_str("a mission is loaded once, before the first poll"),
        }
    }
}

impl core::error::Error for OnboardError {}

impl From<MissionError> for OnboardError {
    fn from(error: MissionError) -> OnboardError {
        OnboardError::Mission(error)
    }
}

impl From<SettingsError> for OnboardError {
    fn from(error: SettingsError) -> OnboardError {
        OnboardError::Settings(error)
    }
}

/// Numbers for a summary or a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    /// Decisions since boot, of policy, guard and shadow.
    pub decisions: u32,
    /// Battery units paid since the mission was engaged (0.5 a hover, 1 a move).
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
    /// Reports of devices that are not of this mission.
    pub unknown_reports: u32,
}

/// What the link told since the last poll.
#[derive(Default)]
struct Told {
    request: Option<Request>,
    other_mode_seen: bool,
    ended: Vec<(AutopilotCommand, bool), 8>,
}

/// The whole pilot. Feed it bytes, poll it at 20 Hz or more, carry its bytes away.
pub struct Onboard<P> {
    machine: Machine,
    policy: P,
    link: Component,
    radio: ReportDecoder,
    devices: DeviceTable<MAX_DEVICES>,
    knob: (Option<u8>, Knob),
    refused: Vec<(AutopilotCommand, bool), 2>,
    tunnel_refused: u32,
    inference_time: Option<Duration>,
    engage_inhibited: bool,
    decision_taken: bool,
}

impl<P: Policy> Onboard<P> {
    /// A pilot at boot. `self_test` is the result of [`gleaner_policy::self_test`] with this policy; after a
    /// failure the pilot speaks but never engages. `GLN_ENABLE` starts at 0 whatever `parameters` say: only a
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
            radio: ReportDecoder::new(),
            devices: DeviceTable::empty(),
            knob: (None, Knob::default()),
            refused: Vec::new(),
            tunnel_refused: 0,
            inference_time: None,
            engage_inhibited: false,
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
            let _ = self.devices.add(site.id);
        }
        Ok(())
    }

    /// Bytes from the autopilot's link (which also carries the ground station), in any pieces.
    pub fn receive_link(&mut self, now: Instant, bytes: &[u8]) {
        self.link.receive(now, bytes);
    }

    /// Bytes from the radio: postcard reports in COBS, in any pieces.
    pub fn receive_radio(&mut self, now: Instant, bytes: &[u8]) {
        let devices = &mut self.devices;
        self.radio.push(bytes, |report| {
            devices.apply(now, &report);
        });
    }

    /// One step: decides what to send. The model runs inside. Call at 20 Hz or more; the clock must not go back.
    /// Heartbeat and targets leave from here only: when the calls stop, they stop.
    pub fn poll(&mut self, now: Instant) {
        let told = self.take_events(now);
        self.follow_knob(now);
        let vehicle = Vehicle::observe(now, self.link.autopilot());
        let devices = self.device_states(now);
        let inputs = Inputs {
            vehicle: &vehicle,
            devices: &devices,
            parameters: self.link.parameters(),
            request: told.request,
            other_mode_seen: told.other_mode_seen,
            ended: &told.ended,
            engage_inhibited: self.engage_inhibited,
        };
        let out = self.machine.poll(now, &inputs, &mut self.policy);
        self.send(now, &out);
        let state = self.machine.system_state();
        self.link.poll(now, &Status { state, may_engage: self.machine.may_engage(), may_return: true });
    }

    /// Moves bytes for the link into `buffer`; how many. Call until it gives 0.
    pub fn transmit(&mut self, buffer: &mut [u8]) -> usize {
        self.link.transmit(buffer)
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
    #[must_use]
    pub fn stats(&self) -> Stats {
        let machine = &self.machine;
        Stats {
            decisions: machine.decisions(),
            spent: machine.spent(),
            collected: machine.collected(),
            preference_changes: machine.preference_changes(),
            target: machine.target(),
            missing: machine.missing(),
            return_reason: machine.return_reason(),
            fault: machine.fault(),
            landed: machine.landed(),
            link: self.link.stats(),
            radio: self.radio.stats(),
            tunnel_refused: self.tunnel_refused,
            unknown_reports: self.devices.unknown_reports(),
        }
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

    /// How long the last inference took, measured by the program (a clock is an input); sent as `infer_us`.
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

    fn take_events(&mut self, now: Instant) -> Told {
        let mut told = Told::default();
        for &refused in &self.refused {
            // Two of eight at most.
            let _ = told.ended.push(refused);
        }
        self.refused.clear();
        while let Some(event) = self.link.next_event() {
            match event {
                Event::Operator(OperatorRequest::Enable(enable)) => {
                    told.request = Some(match enable {
                        Enable::Off => Request::Off,
                        Enable::Engage => Request::Engage,
                        Enable::Shadow => Request::Shadow,
                    });
                }
                Event::Operator(OperatorRequest::ReturnNow) => told.request = Some(Request::Return),
                Event::ModeChanged(mode) => told.other_mode_seen |= !mode.companion_may_steer(),
                Event::RequestEnded { outcome: Outcome::Superseded, .. } => {}
                Event::RequestEnded { command, outcome } => {
                    // At most two commands are under way, each ends once.
                    let _ = told.ended.push((command, outcome == Outcome::Accepted));
                }
                Event::RadioReport(payload) => match decode_body(&payload) {
                    Ok(report) => {
                        self.devices.apply(now, &report);
                    }
                    Err(_) => self.tunnel_refused = self.tunnel_refused.saturating_add(1),
                },
                // The snapshot and the parameters tell the rest.
                Event::Operator(OperatorRequest::SetPreference(_))
                | Event::Parameter(_)
                | Event::AutopilotConnected
                | Event::AutopilotLost
                | Event::AutopilotRebooted
                | Event::ArmedChanged(_)
                | Event::FailsafeBegan(_) => {}
            }
        }
        told
    }

    /// The knob writes the parameter, so that every ground station sees what holds.
    fn follow_knob(&mut self, now: Instant) {
        let channel = self.link.parameters().data_weight_channel();
        if self.knob.0 != channel {
            self.knob = (channel, Knob::default());
        }
        let Some(channel) = channel else { return };
        let pulse_us = self.link.autopilot().rc_pulse_us(now, channel);
        if let Some(weight) = self.knob.1.turned(pulse_us) {
            // The knob's range is the parameter's.
            let _ = self.link.set_parameter(ParameterId::DataWeight, weight);
        }
    }

    fn device_states(&self, now: Instant) -> Vec<DeviceState, MAX_DEVICES> {
        let max_age = self.link.parameters().snr_age();
        let mut states = Vec::new();
        for (index, site) in self.machine.mission().devices.iter().enumerate() {
            // The capacities are the same.
            let _ = states.push(DeviceState {
                cell: site.cell,
                remaining: self.devices.remaining(index).unwrap_or(site.data),
                snr: self.devices.snr(index, now, max_age),
            });
        }
        states
    }

    fn send(&mut self, now: Instant, out: &Outputs) {
        if out.withdraw {
            self.link.revoke();
        }
        if let Some(position) = out.setpoint {
            // Not sent without an autopilot; its loss is in the next snapshot.
            let _ = self.link.steer(now, &PositionTarget::at(position));
        }
        if let Some(command) = out.command
            && self.link.request(now, command).is_err()
        {
            let _ = self.refused.push((command, false));
        }
        for notice in &out.notices {
            self.link.say(notice.severity, format_args!("{}", notice.text));
        }
        if out.decided
            && let Some(decision) = self.machine.decision()
        {
            self.decision_taken = false;
            let mut buffer = [0; RECORD_BYTES_MAX];
            if let Some(bytes) = decision.record().encode(&mut buffer) {
                self.link.tunnel(TUNNEL_DECISION, bytes);
            }
        }
        self.send_telemetry(now, out);
    }

    fn send_telemetry(&mut self, now: Instant, out: &Outputs) {
        let Some(telemetry) = out.telemetry else { return };
        let infer_us = self.inference_time.map(|took| took.as_micros() as f32);
        let values = [
            ("w_data", Some(telemetry.w_data)),
            ("collected", Some(telemetry.collected)),
            ("spare_bat", telemetry.spare.map(|spare| spare.0)),
            ("infer_us", infer_us),
            ("attn_dev", telemetry.attended.map(f32::from)),
        ];
        for (name, value) in values {
            if let Some(value) = value {
                self.link.telemetry(now, name, value);
            }
        }
    }
}
