//! Aircraft, line, radio and referee in one: everything around the pilot, bytes in and bytes out, on virtual time.

use crate::autopilot::{AircraftFault, Autopilot, LinkId, Truth, VehicleMode};
use crate::intruder::{Entry, Intruder};
use crate::journal::{Journal, Slot};
use crate::line::{Lane, Line, LineFault};
use crate::modem::Modem;
use crate::radio_fault::RadioFaults;
use crate::referee::Referee;
use crate::script::IncidentKind;
use crate::setup::{MissionSetup, PlanError};
use crate::wire::{parse, relayed};
use gleaner_link::{Address, Frame, FrameDecoder, Message, TUNNEL_DECISION};
use gleaner_pilot::DecisionRecord;
use gleaner_policy::DeviceState;
use gleaner_radio::Report;
use gleaner_units::{Duration, Instant, Ned};
use gleaner_world::Field;
use mavlink::dialects::ardupilotmega::PARAM_VALUE_DATA;

/// The time that the pilot and the aircraft may take to settle after an injected position error.
const SETTLING: Duration = Duration::from_secs(20);

/// The most by which a delay makes a damaged frame late.
const LATE: Duration = Duration::from_secs(1);

/// The world around one pilot.
#[derive(Debug)]
pub struct Simulation {
    setup: MissionSetup,
    now: Instant,
    autopilot: Box<dyn Autopilot>,
    modem: Modem,
    referee: Referee,
    journal: Journal,
    line: Line,
    radio_faults: RadioFaults,
    intruders: Vec<Intruder>,
    /// Reads the companion's frames.
    tap: FrameDecoder,
    /// Reads the ground station's frames, for the log.
    ground_tap: FrameDecoder,
    component_id: u8,
    /// Whether slots are being decided; otherwise the modem follows the aircraft.
    deciding: bool,
}

impl Simulation {
    /// A simulation at the autopilot's boot, for a pilot with this component id.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn new(setup: MissionSetup, component_id: u8) -> Result<Simulation, PlanError> {
        let modem = Modem::new(setup.world.clone(), &setup.realization, setup.seed())?;
        let modem = modem.with_speedup(setup.plan.speedup).with_ids(setup.device_ids());
        Ok(Simulation {
            autopilot: setup.plan.autopilot.boot(setup.aircraft),
            line: Line::new(setup.plan.seed),
            radio_faults: RadioFaults::default(),
            intruders: Vec::new(),
            now: Instant::ZERO,
            modem,
            referee: Referee::new(&setup, component_id),
            journal: Journal::default(),
            tap: FrameDecoder::new(),
            ground_tap: FrameDecoder::new(),
            component_id,
            deciding: false,
            setup,
        })
    }

    /// The same without a record of the flight: [`Simulation::journal`] stays empty. For flights whose end alone counts.
    pub(crate) fn without_record(self) -> Simulation {
        Simulation { journal: Journal::off(), ..self }
    }

    /// Advances time to `now`.
    pub fn step(&mut self, now: Instant) {
        self.now = now;
        self.autopilot.step(now);
        self.poll_intruders();
        let truth = self.autopilot.truth();
        self.referee.watch(now, &truth);
        self.journal.track_point(now, &truth);
        // Outside the pilot's slots, the devices are heard from the cell below the aircraft.
        self.deciding &= matches!(truth.mode, VehicleMode::Guided | VehicleMode::Land);
        if !self.deciding
            && !truth.on_ground
            && let Some(cell) = self.setup.frame.cell(&truth.position)
        {
            self.modem.carry_to(cell);
        }
    }

    fn poll_intruders(&mut self) {
        let now = self.now;
        self.intruders.retain(|intruder| !intruder.is_over(now));
        let frames: Vec<_> = self.intruders.iter_mut().flat_map(|intruder| intruder.poll(now)).collect();
        for (entry, frame) in frames {
            match entry {
                Entry::Companion => self.line.send(now, Lane::Down, frame),
                Entry::Ground => self.autopilot.receive(LinkId::GROUND, &frame),
            }
        }
    }

    /// Bytes from the companion to the autopilot, in any pieces.
    pub fn from_companion(&mut self, mut bytes: &[u8]) {
        let now = self.now;
        while let Some(frame) = self.tap.read(&mut bytes) {
            let raw = relayed(&frame);
            self.journal.frame(now, &raw);
            self.referee.sent(now, &frame);
            self.read_companion(&frame);
            self.line.send(now, Lane::Up, raw);
        }
        self.carry_up();
    }

    fn carry_up(&mut self) {
        for frame in self.line.arrived(self.now, Lane::Up) {
            self.autopilot.receive(LinkId::COMPANION, &frame);
        }
    }

    /// Bytes from the ground station, in any pieces.
    pub fn from_ground(&mut self, bytes: &[u8]) {
        if !self.journal.is_off() {
            let mut rest = bytes;
            while let Some(frame) = self.ground_tap.read(&mut rest) {
                self.journal.frame(self.now, &relayed(&frame));
            }
        }
        self.autopilot.receive(LinkId::GROUND, bytes);
    }

    /// Frames that have arrived at the companion. The caller reports each to [`Simulation::delivered`] when the pilot
    /// reads it.
    pub fn to_companion(&mut self) -> Vec<Vec<u8>> {
        self.carry_up();
        for frame in self.autopilot.transmit(LinkId::COMPANION) {
            self.line.send(self.now, Lane::Down, frame);
        }
        self.line.arrived(self.now, Lane::Down)
    }

    /// The pilot reads a frame that arrived at the companion at `at`.
    pub fn delivered(&mut self, at: Instant, frame: &[u8]) {
        self.referee.delivered(at, frame);
    }

    /// Frames from the vehicle for the ground station.
    pub fn to_ground(&mut self) -> Vec<Vec<u8>> {
        let frames = self.autopilot.transmit(LinkId::GROUND);
        for frame in &frames {
            // The companion's were logged when they were sent. Byte 6 of a version 2 frame is the component.
            if frame.get(6) == Some(&1) {
                self.journal.frame(self.now, frame);
            }
        }
        frames
    }

    /// The harness's own link to the autopilot: frames in, frames out.
    pub fn crew(&mut self, frames: &[Vec<u8>]) -> Vec<Vec<u8>> {
        for frame in frames {
            self.autopilot.receive(LinkId::CREW, frame);
        }
        self.autopilot.transmit(LinkId::CREW)
    }

    /// Reports from the radio that are due.
    pub fn radio(&mut self) -> Vec<Report> {
        let reports = self.modem.reports(self.now);
        self.radio_faults.distort(self.now, reports)
    }

    fn read_companion(&mut self, frame: &Frame) {
        if let Some(value) = parse::<PARAM_VALUE_DATA>(frame) {
            self.referee.parameter(value.param_id.to_str().unwrap_or_default(), value.param_value);
        } else if let Ok(Some(Message::Tunnel { payload_type: TUNNEL_DECISION, payload, .. })) =
            Message::decode(frame)
            && let Some(record) = DecisionRecord::decode(&payload)
        {
            self.decided(record);
        }
    }

    /// A decision begins a slot: the present one is served, the next one is heard.
    fn decided(&mut self, record: DecisionRecord) {
        let truth = self.autopilot.truth();
        let flown = self.referee.decided(self.now, &record, &truth);
        let heard = if self.journal.is_off() { Vec::new() } else { self.heard() };
        let serving = flown.then(|| self.modem.slot(record.cell, record.action)).flatten();
        self.deciding |= flown;
        if self.journal.is_off() {
            return;
        }
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

    /// Injects an incident. Faults of the companion computer are injected there, not here.
    pub fn inject(&mut self, kind: IncidentKind) {
        let now = self.now;
        match kind {
            IncidentKind::Aircraft(fault) => {
                self.prepare_referee(fault);
                self.autopilot.inject(fault);
            }
            IncidentKind::Line(fault, lasts) => {
                if matches!(fault, LineFault::Noise(_)) {
                    self.referee.noisy_until(now + lasts + LATE);
                }
                self.line.fail(now, fault, lasts);
            }
            IncidentKind::Radio(fault, lasts) => self.radio_faults.begin(now, fault, lasts),
            IncidentKind::Intrusion(intrusion, lasts) => {
                let pilot = Address::new(self.setup.aircraft.system_id, self.component_id);
                let down_m = self.setup.aircraft.stand.down_m - self.setup.altitude_m();
                let seed = self.setup.plan.seed;
                self.intruders.push(Intruder::new(now, intrusion, lasts, pilot, down_m, seed));
            }
            IncidentKind::Computer(_) => {}
        }
    }

    /// Passes to the referee what a fault changes in its figures.
    fn prepare_referee(&mut self, fault: AircraftFault) {
        match fault {
            AircraftFault::PositionJump(_, lasts) => {
                self.referee.disturbed_until(self.now + lasts + SETTLING)
            }
            AircraftFault::OriginShift(_) => self.referee.disturbed_until(self.now + SETTLING),
            AircraftFault::Consumption(factor) => {
                let truth = self.truth();
                self.referee.price_changes(factor, &truth);
            }
            AircraftFault::Wind(wind) => {
                let [north, east] = wind.velocity_mps;
                let squared = north * north + east * east + 2.0 * wind.gust_mps * wind.gust_mps;
                let doubling = self.setup.aircraft.pack.doubling_mps;
                let truth = self.truth();
                self.referee.price_changes(1.0 + squared / (doubling * doubling), &truth);
            }
            _ => {}
        }
        if let AircraftFault::ChargeLost(units) = fault {
            let mut truth = self.truth();
            truth.battery = truth.battery - units;
            self.referee.charge_lost(&truth);
        }
    }

    /// The companion's program ended.
    pub fn companion_restarts(&mut self) {
        self.referee.companion_restarts();
    }

    /// The companion's program does not run until then.
    pub fn companion_stalls_until(&mut self, until: Instant) {
        self.referee.companion_stalls_until(until);
    }

    /// Ground truth.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.autopilot.truth()
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

    /// What was recorded.
    #[must_use]
    pub const fn journal(&self) -> &Journal {
        &self.journal
    }

    /// The mission as it was set up.
    #[must_use]
    pub const fn setup(&self) -> &MissionSetup {
        &self.setup
    }

    /// A position on the grid: metres east and north of its south-west corner.
    #[must_use]
    pub fn on_grid(&self, position: &Ned) -> (f32, f32) {
        let point = self.setup.frame.point(position);
        (point.east_m, point.north_m)
    }
}
