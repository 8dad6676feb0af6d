//! A machine in virtual time, with an aircraft that flies to the last target in a straight line.

use gleaner_guard::Guard;
use gleaner_link::{AutopilotCommand, Firmware, FlightMode, Parameters, Velocity};
use gleaner_pilot::{
    ChannelAware, DeviceSite, Devices, Inputs, LookingAhead, Machine, Mission, Outputs, RadioActivity,
    Request, Rules, State, Telemetry, Vehicle,
};
use gleaner_policy::{Attention, DeviceState, Inference, Policy, Tokens};
use gleaner_units::{
    Action, BatteryUnits, Cell, CellSet, Degrees, Duration, GeoPoint, Grid, GridFrame, GridPose, HeightMap,
    Instant, Metres, Ned,
};

pub const CORNER: GeoPoint = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
pub const TERMINAL: Cell = Cell::new(6, 4);
pub const START: Cell = Cell::new(1, 1);
pub const DOWN_M: f32 = -60.0 + HOME_DOWN_M;
/// Home lies below the estimator's origin here, so that mixing them up shows.
pub const HOME_DOWN_M: f32 = 2.5;
const POLL: Duration = Duration::from_millis(50);
const FLIGHT_MPS: f32 = 10.0;
const HEARTBEAT: Duration = Duration::from_secs(1);

pub fn mission() -> Mission {
    let grid = Grid::new(8, 6, Metres(20.0)).unwrap();
    let mut fence = CellSet::full(grid);
    fence.remove(Cell::new(3, 3));
    let site = |id, x, y, data| DeviceSite { id, cell: Cell::new(x, y), data };
    let mission = Mission {
        heights: HeightMap::flat(grid),
        fence,
        pose: GridPose { corner: CORNER, rotation: Degrees(0.0) },
        terminal: TERMINAL,
        budget: BatteryUnits(30.0),
        devices: heapless::Vec::from_slice(&[site(7, 2, 4, 6000.0), site(9, 5, 1, 2000.0)]).unwrap(),
    };
    mission.check().unwrap();
    mission
}

/// Devices that are what the test says.
#[derive(Clone)]
pub struct Known(pub Vec<DeviceState>);

impl Devices for Known {
    fn state(&self, index: usize, _: &DeviceSite) -> DeviceState {
        self.0[index]
    }
}

/// Answers from a script, and keeps the tokens of each inference.
#[derive(Clone)]
pub struct Scripted {
    pub actions: std::collections::VecDeque<Action>,
    /// When the script is over.
    pub then: Action,
    pub fails: bool,
    pub logit: f32,
    pub asked: Vec<Tokens>,
}

impl Policy for Scripted {
    type Error = ();

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        self.asked.push(tokens.clone());
        if self.fails {
            return Err(());
        }
        let wanted = self.actions.pop_front().unwrap_or(self.then);
        let mut logits = [0.0; Action::COUNT];
        logits[wanted.index()] = self.logit;
        Ok(Inference { logits, attention: Attention::NONE })
    }
}

#[derive(Clone)]
pub struct Rig {
    pub machine: Machine,
    pub mission: Mission,
    pub vehicle: Vehicle,
    pub parameters: Parameters,
    pub devices: Known,
    pub rules: Rules,
    /// Whether the radio reports anything.
    pub radio_reports: bool,
    pub radio: RadioActivity,
    pub policy: Scripted,
    /// Decides in place of `policy`, if it is there.
    pub ahead: Option<LookingAhead<Scripted>>,
    /// As `ahead`: what a board decides with.
    pub aware: Option<ChannelAware<Scripted>>,
    pub now: Instant,
    pub request: Option<Request>,
    pub other_mode_seen: bool,
    pub foreign_target: bool,
    revoked: bool,
    /// The last telemetry in flight.
    pub telemetry: Option<Telemetry>,
    /// Whether heartbeats arrive.
    pub beats: bool,
    beat: (Option<FlightMode>, bool),
    pub ended: Vec<(AutopilotCommand, bool)>,
    pub engage_inhibited: bool,
    /// Whether the autopilot accepts commands, or refuses them; `None`: no answer.
    pub accepts: Option<bool>,
    /// Whether the aircraft flies to its targets.
    pub obeys: bool,
    /// A cell whose centre the autopilot drops as a target without a word (its own fence).
    pub dropped: Option<Cell>,
    pub target: Option<Ned>,
    pub texts: Vec<String>,
    pub setpoints: Vec<(u64, Ned)>,
    /// The velocities of the setpoints.
    pub velocities: Vec<(u64, Option<Velocity>)>,
    pub commands: Vec<(u64, AutopilotCommand)>,
    pub actions: Vec<Action>,
}

impl Rig {
    /// An aircraft with everything in place but the request.
    pub fn new() -> Rig {
        Rig::with(mission(), true)
    }

    pub fn with(mission: Mission, self_test_passed: bool) -> Rig {
        let devices = mission
            .devices
            .iter()
            .map(|site| DeviceState { cell: site.cell, remaining: site.data, snr: None })
            .collect();
        let mut rig = Rig {
            machine: Machine::new(mission.clone(), self_test_passed).unwrap(),
            mission,
            vehicle: Vehicle {
                firmware: Some(Firmware::ArduPilot),
                mode: Some(FlightMode::Guided),
                armed: true,
                ready: true,
                origin: Some(CORNER.offset_by(Metres(-100.0), Metres(50.0))),
                home_down_m: Some(HOME_DOWN_M),
                battery_percent: Some(90),
                ..Vehicle::default()
            },
            parameters: Parameters::default(),
            devices: Known(devices),
            rules: Rules::DEFAULT,
            radio_reports: true,
            radio: RadioActivity::default(),
            policy: Scripted {
                actions: Default::default(),
                then: Action::Hover,
                fails: false,
                logit: 1.0,
                asked: Vec::new(),
            },
            ahead: None,
            aware: None,
            now: Instant::from_millis(10_000),
            request: None,
            other_mode_seen: false,
            foreign_target: false,
            revoked: false,
            telemetry: None,
            beats: true,
            beat: (None, false),
            ended: Vec::new(),
            engage_inhibited: false,
            accepts: Some(true),
            obeys: true,
            dropped: None,
            target: None,
            texts: Vec::new(),
            setpoints: Vec::new(),
            velocities: Vec::new(),
            commands: Vec::new(),
            actions: Vec::new(),
        };
        rig.place(START, 3.0);
        rig
    }

    /// Puts the aircraft `off_m` east of a cell's centre, at the flight altitude.
    pub fn place(&mut self, cell: Cell, off_m: f32) {
        let centre = self.centre(cell);
        self.vehicle.position = Some(Ned { east_m: centre.east_m + off_m, ..centre });
    }

    pub fn frame(&self) -> GridFrame {
        GridFrame::new(self.mission.grid(), self.mission.pose, CORNER.offset_by(Metres(-100.0), Metres(50.0)))
    }

    pub fn centre(&self, cell: Cell) -> Ned {
        self.frame().centre(cell, DOWN_M)
    }

    pub fn guard(&self) -> Guard {
        self.mission.guard(self.parameters.reserve()).unwrap()
    }

    pub fn state(&self) -> State {
        self.machine.state()
    }

    pub fn set(&mut self, name: &str, value: f32) {
        self.parameters.set(name, value).unwrap();
    }

    /// One poll, 50 ms after the last.
    pub fn step(&mut self) -> Outputs {
        self.step_after(POLL)
    }

    pub fn step_after(&mut self, pause: Duration) -> Outputs {
        self.now = self.now + pause;
        self.fly(pause);
        self.beat();
        if self.radio_reports {
            self.radio.heard_at = Some(self.now);
        }
        let ended = std::mem::take(&mut self.ended);
        let requests: Vec<Request> = self.request.take().into_iter().collect();
        let inputs = Inputs {
            vehicle: &self.vehicle,
            devices: &self.devices,
            parameters: &self.parameters,
            radio: self.radio,
            rules: &self.rules,
            requests: &requests,
            foreign_target: self.foreign_target,
            target_reported: false,
            other_mode_seen: std::mem::take(&mut self.other_mode_seen),
            ended: &ended,
            engage_inhibited: self.engage_inhibited,
        };
        let out = match (&mut self.ahead, &mut self.aware) {
            (Some(ahead), _) => self.machine.poll(self.now, &inputs, ahead),
            (None, Some(aware)) => self.machine.poll(self.now, &inputs, aware),
            (None, None) => self.machine.poll(self.now, &inputs, &mut self.policy),
        };
        let at_ms = self.now.as_millis();
        self.telemetry = out.telemetry.filter(|told| told.land_pct.is_some()).or(self.telemetry);
        self.revoked |= out.withdraw;
        if let Some(target) = out.setpoint {
            // The link compares only what is sent in our mode; a target after a revocation is a new beginning.
            let begins = std::mem::take(&mut self.revoked) || !self.vehicle.is_guided();
            self.foreign_target &= !begins;
            self.target = Some(target.position);
            self.setpoints.push((at_ms, target.position));
            self.velocities.push((at_ms, target.velocity));
        }
        if let Some(command) = out.command {
            self.commands.push((at_ms, command));
            self.answer(command);
        }
        self.texts.extend(out.notices.iter().map(|notice| notice.text.to_string()));
        if out.decided {
            self.actions.push(self.machine.decision().unwrap().action);
        }
        out
    }

    pub fn run(&mut self, secs: f32) {
        let end = self.now + Duration::from_secs_f32(secs);
        while self.now < end {
            self.step();
        }
    }

    /// Polls until the state is reached.
    pub fn run_to(&mut self, state: State) {
        for _ in 0..20 * 600 {
            if self.state() == state {
                return;
            }
            self.step();
        }
        panic!("still {:?} after ten minutes, said {:?}", self.state(), self.texts);
    }

    /// Engaged, before the first decision.
    pub fn engaged() -> Rig {
        let mut rig = Rig::new();
        rig.engage();
        rig
    }

    pub fn engage(&mut self) {
        self.request = Some(Request::Engage);
        for _ in 0..25 {
            self.step();
            if self.state() == State::Engaged {
                return;
            }
        }
        panic!("{:?}, missing {:?}, {:?}", self.state(), self.machine.missing(), self.texts);
    }

    pub fn said(&self, text: &str) -> usize {
        self.texts.iter().filter(|line| line.contains(text)).count()
    }

    pub fn commanded(&self, command: AutopilotCommand) -> usize {
        self.commands.iter().filter(|(_, sent)| *sent == command).count()
    }

    /// A heartbeat arrives once a second and with each change, as ArduPilot's do.
    fn beat(&mut self) {
        let beat = (self.vehicle.mode, self.vehicle.armed);
        let is_due = self.vehicle.heartbeat_at.is_none_or(|at| self.now.since(at) >= HEARTBEAT);
        if self.vehicle.mode.is_none() {
            self.vehicle.heartbeat_at = None;
        } else if self.beats && (is_due || beat != self.beat) {
            self.vehicle.heartbeat_at = Some(self.now);
        }
        self.beat = beat;
    }

    fn answer(&mut self, command: AutopilotCommand) {
        let Some(accepted) = self.accepts else { return };
        self.ended.push((command, accepted));
        if accepted {
            match command {
                AutopilotCommand::Land => self.vehicle.mode = Some(FlightMode::Land),
                AutopilotCommand::ReturnToLaunch => self.vehicle.mode = Some(FlightMode::Return),
                AutopilotCommand::Hold(_) => self.vehicle.mode = Some(FlightMode::Hold),
                AutopilotCommand::ChangeSpeed(_) => {}
            }
        }
    }

    fn fly(&mut self, pause: Duration) {
        let (Some(position), Some(target)) = (self.vehicle.position, self.target) else { return };
        if !(self.obeys && self.vehicle.armed && self.vehicle.is_guided()) {
            return;
        }
        if self.dropped.is_some_and(|cell| self.frame().cell(&target) == Some(cell)) {
            return;
        }
        let distance_m = position.horizontal_distance(&target).0;
        let share = (FLIGHT_MPS * pause.as_secs_f32() / distance_m.max(1e-3)).min(1.0);
        self.vehicle.position = Some(Ned {
            north_m: position.north_m + (target.north_m - position.north_m) * share,
            east_m: position.east_m + (target.east_m - position.east_m) * share,
            down_m: target.down_m,
        });
    }
}
