//! Aircraft, radio and referee in one: everything around the pilot, bytes in and bytes out, on virtual time.

use crate::autopilot::{Copter, CopterMode, LinkId, Truth};
use crate::journal::{Journal, Slot};
use crate::mission::{PlanError, Staged};
use crate::modem::Modem;
use crate::referee::Referee;
use crate::wire::{parse, relayed};
use crate::wires::{WireFault, Wires};
use gleaner_link::{Frame, FrameDecoder, Message, TUNNEL_DECISION};
use gleaner_pilot::DecisionRecord;
use gleaner_policy::DeviceState;
use gleaner_radio::Report;
use gleaner_units::{Duration, Instant, Ned};
use gleaner_world::Field;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, PARAM_SET_DATA, PARAM_VALUE_DATA};

/// Whether an operator asks the pilot on board to engage, by command or by parameter.
fn asks_to_engage(frame: &Frame) -> bool {
    let command = parse::<COMMAND_LONG_DATA>(frame);
    let parameter = parse::<PARAM_SET_DATA>(frame);
    command.is_some_and(|c| c.command == MavCmd::MAV_CMD_USER_2 && c.param1 == 1.0)
        || parameter.is_some_and(|p| p.param_id.to_str() == Ok("GLN_ENABLE") && p.param_value == 1.0)
}

/// The world around one pilot.
#[derive(Debug)]
pub struct Simulation {
    staged: Staged,
    now: Instant,
    copter: Copter,
    modem: Modem,
    referee: Referee,
    journal: Journal,
    wires: Wires,
    /// Listens to what the companion says.
    tap: FrameDecoder,
    /// The same for the ground station, for the log.
    ground_tap: FrameDecoder,
    /// Whether slots are being decided; otherwise the modem follows the aircraft.
    deciding: bool,
}

impl Simulation {
    /// A simulation at the autopilot's boot.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn new(staged: Staged) -> Result<Simulation, PlanError> {
        let modem = Modem::new(staged.world.clone(), &staged.realization, staged.seed())?;
        let modem = modem.with_haste(staged.plan.haste);
        let guard = staged.mission.guard(staged.plan.reserve)?;
        let referee = Referee::new(&staged, guard);
        Ok(Simulation {
            copter: Copter::new(staged.copter),
            wires: Wires::new(staged.plan.seed),
            now: Instant::ZERO,
            modem,
            referee,
            journal: Journal::default(),
            tap: FrameDecoder::new(),
            ground_tap: FrameDecoder::new(),
            deciding: false,
            staged,
        })
    }

    /// Lets time pass until `now`.
    pub fn step(&mut self, now: Instant) {
        self.now = now;
        self.copter.step(now);
        let truth = self.copter.truth();
        self.referee.watch(now, &truth);
        self.journal.see(now, &truth);
        // Once somebody else flies, the devices are heard from wherever the aircraft is.
        let landing = truth.mode == CopterMode::Land;
        self.deciding &= truth.mode == CopterMode::Guided || landing;
        if !self.deciding
            && !truth.on_ground
            && let Some(cell) = self.staged.frame.cell(&truth.position)
        {
            self.modem.carry_to(cell);
        }
    }

    /// What the companion sends to the autopilot, in any pieces.
    pub fn hear_companion(&mut self, mut bytes: &[u8]) {
        let now = self.now;
        let all = bytes;
        while !bytes.is_empty() {
            let taken = self.tap.push(bytes);
            bytes = &bytes[taken..];
            while let Some(frame) = self.tap.next_frame() {
                self.journal.frame(now, relayed(&frame));
                self.overhear(&frame);
            }
        }
        self.copter.receive(LinkId::COMPANION, &self.wires.carry(now, all.to_vec()));
    }

    /// What the ground station sends.
    pub fn hear_ground(&mut self, mut bytes: &[u8]) {
        let now = self.now;
        let all = bytes;
        while !bytes.is_empty() {
            let taken = self.ground_tap.push(bytes);
            bytes = &bytes[taken..];
            while let Some(frame) = self.ground_tap.next_frame() {
                self.journal.frame(now, relayed(&frame));
                if asks_to_engage(&frame) {
                    self.referee.hear_engage_request();
                }
            }
        }
        self.copter.receive(LinkId::GROUND, all);
    }

    /// Frames from the autopilot for the companion.
    pub fn to_companion(&mut self) -> Vec<Vec<u8>> {
        let frames = self.copter.transmit(LinkId::COMPANION);
        frames.into_iter().map(|frame| self.wires.carry(self.now, frame)).collect()
    }

    /// Frames from the vehicle for the ground station.
    pub fn to_ground(&mut self) -> Vec<Vec<u8>> {
        let frames = self.copter.transmit(LinkId::GROUND);
        for frame in &frames {
            // The companion's were logged when they were sent. Byte 6 of a version 2 frame is the component.
            if frame.get(6) == Some(&1) {
                self.journal.frame(self.now, frame.clone());
            }
        }
        frames
    }

    /// The harness's own link to the autopilot: bytes in, frames out.
    pub fn crew(&mut self, frames: &[Vec<u8>]) -> Vec<Vec<u8>> {
        for frame in frames {
            self.copter.receive(LinkId::CREW, frame);
        }
        self.copter.transmit(LinkId::CREW)
    }

    /// Reports from the radio modem that are due.
    pub fn radio(&mut self) -> Vec<Report> {
        let reports = self.modem.reports(self.now);
        if self.wires.radio_is_silent(self.now) { Vec::new() } else { reports }
    }

    fn overhear(&mut self, frame: &Frame) {
        if let Some(value) = parse::<PARAM_VALUE_DATA>(frame) {
            self.referee.hear_parameter(value.param_id.to_str().unwrap_or_default(), value.param_value);
        } else if frame.message_id == COMMAND_LONG_DATA::ID {
            let asks_mode = |c: &COMMAND_LONG_DATA| c.command == MavCmd::MAV_CMD_DO_SET_MODE;
            if parse::<COMMAND_LONG_DATA>(frame).as_ref().is_some_and(asks_mode) {
                self.referee.hear_mode_request(self.now);
            }
        } else if let Ok(Some(Message::Tunnel { payload_type: TUNNEL_DECISION, payload, .. })) =
            Message::decode(frame)
            && let Some(record) = DecisionRecord::decode(&payload)
        {
            self.decided(record);
        }
    }

    /// A decision begins a slot: the present one is served, the next one is heard.
    fn decided(&mut self, record: DecisionRecord) {
        let truth = self.copter.truth();
        let flown = self.referee.hear_decision(self.now, &record, &truth);
        let heard = self.heard();
        let serving = flown.then(|| self.modem.slot(record.cell, record.action)).flatten();
        self.deciding |= flown;
        let collected = self.modem.field().collected_fraction();
        self.journal.slot(Slot {
            at: self.now,
            position: truth.position,
            record,
            heard,
            flown,
            serving,
            collected,
        });
    }

    /// The devices as the modem last reported them.
    fn heard(&self) -> Vec<DeviceState> {
        let devices = self.modem.field().devices().iter();
        devices
            .map(|device| DeviceState {
                cell: device.cell,
                remaining: device.remaining_units,
                snr: Some(device.snr).filter(|snr| snr.0.is_finite()),
            })
            .collect()
    }

    /// Something goes wrong with a wire.
    pub fn fail_wire(&mut self, fault: WireFault, lasts: Duration) {
        self.wires.fail(self.now, fault, lasts);
    }

    /// The simulated autopilot, for injections.
    pub fn copter_mut(&mut self) -> &mut Copter {
        &mut self.copter
    }

    /// What is really so.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.copter.truth()
    }

    /// The time, since the autopilot's boot.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// The devices.
    #[must_use]
    pub const fn field(&self) -> &Field {
        self.modem.field()
    }

    /// The referee's findings.
    #[must_use]
    pub const fn referee(&self) -> &Referee {
        &self.referee
    }

    /// What happened so far.
    #[must_use]
    pub const fn journal(&self) -> &Journal {
        &self.journal
    }

    /// What was fixed before the flight.
    #[must_use]
    pub const fn staged(&self) -> &Staged {
        &self.staged
    }

    /// Where the aircraft is on the grid: metres east and north of its south-west corner.
    #[must_use]
    pub fn on_grid(&self, position: &Ned) -> (f32, f32) {
        let point = self.staged.frame.point(position);
        (point.east_m, point.north_m)
    }
}
