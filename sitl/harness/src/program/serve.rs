//! `serve`: the simulation in real time, with ports for a companion, its radio and a ground station.

use super::ProgramError;
use super::arguments::ServeOrder;
use super::{model, results};
use crate::flight::exchange;
use crate::{Figures, FlightError, Operator, Orders, Simulation, Staged};
use gleaner_pilot::{Onboard, Parameters, Settings, mission_file};
use gleaner_policy::onnx::TractPolicy;
use gleaner_ports::{Endpoint, Port, RECEIVE_BYTES, wait};
use gleaner_units::{Duration, Instant};
use gleaner_world::World;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time;

/// The rate of the physics and of the pilot.
const TICK: Duration = Duration::from_millis(20);
/// After the motors have stopped, for the last words on the wires.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Reads per port and tick: a flood on one port must not stop the world.
const READS_PER_TICK: usize = 64;
/// After so many ticks at once the machine was asleep or is too slow; the world then loses time instead of racing.
const TICKS_AT_ONCE: u32 = 50;

pub(super) fn serve(order: &ServeOrder) -> Result<bool, ProgramError> {
    let begun = time::Instant::now();
    let world = Arc::new(World::default_world());
    let staged = Staged::new(world, order.plan).map_err(FlightError::from)?;
    if let Some(path) = &order.mission_out {
        write_mission(&staged, path)?;
    }
    let mut server = Server::open(order, staged)?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).map_err(ProgramError::Signals)?;
    server.introduce(order)?;
    let finished = server.run(order, &stop)?;
    server.report(order, finished, begun)
}

fn write_mission(staged: &Staged, path: &Path) -> Result<(), ProgramError> {
    let city = path.with_extension("city.csv");
    let name = city.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let fail = |path: &Path| {
        let path = path.to_owned();
        move |source| ProgramError::Write { path, source }
    };
    std::fs::write(&city, staged.world.city().to_csv()).map_err(fail(&city))?;
    std::fs::write(path, mission_file::write(&staged.mission, &name)).map_err(fail(path))
}

/// The simulation with everything that is plugged into it.
struct Server {
    simulation: Simulation,
    /// The pilot, when it runs in this process.
    onboard: Option<(Onboard<TractPolicy>, String)>,
    companion: Option<Port>,
    radio: Option<Port>,
    ground: Port,
    /// Arms and takes off, when asked to.
    operator: Option<Operator>,
    now: Instant,
}

impl Server {
    fn open(order: &ServeOrder, staged: Staged) -> Result<Server, ProgramError> {
        let onboard = match order.onboard {
            false => None,
            true => {
                let policy = model::load(order.model.as_deref())?;
                let name = model::name(&policy);
                let (mission, settings) = (staged.mission.clone(), Settings::default());
                let onboard = Onboard::new(mission, Parameters::default(), settings, policy, Ok(()));
                Some((onboard.map_err(FlightError::Onboard)?, name))
            }
        };
        let open = |endpoint: &Endpoint| Port::open(endpoint).map_err(ProgramError::Port);
        let companion = order.companion.as_ref().map(open).transpose()?;
        let radio = order.radio.as_ref().map(open).transpose()?;
        let operator = order.auto_takeoff.then(|| {
            Operator::new(Orders {
                // Not the ground station's own: both may speak at once.
                station_id: 254,
                system_id: staged.copter.system_id,
                component_id: Settings::default().component_id,
                parameters: Vec::new(),
                altitude_m: staged.altitude_m(),
                engage: false,
                switches: Vec::new(),
            })
        });
        let ground = open(&order.ground)?;
        let simulation = Simulation::new(staged).map_err(FlightError::from)?;
        Ok(Server { simulation, onboard, companion, radio, ground, operator, now: Instant::ZERO })
    }

    /// One line per endpoint, with the port that the system chose where it was asked to.
    fn introduce(&self, order: &ServeOrder) -> Result<(), ProgramError> {
        let mut out = io::stdout().lock();
        let mut say = |line: String| writeln!(out, "{line}").map_err(ProgramError::Stdout);
        for (role, port) in [
            ("companion", self.companion.as_ref()),
            ("radio", self.radio.as_ref()),
            ("gcs", Some(&self.ground)),
        ] {
            if let Some(port) = port {
                say(format!("{role} {}", endpoint(port)))?;
            }
        }
        if let Some((_, model)) = &self.onboard {
            say(format!("onboard {model}"))?;
        }
        if let Some(path) = &order.mission_out {
            say(format!("mission {}", path.display()))?;
        }
        out.flush().map_err(ProgramError::Stdout)
    }

    /// Runs until it is stopped (`false`) or, if that was asked for, until the aircraft has landed (`true`).
    fn run(&mut self, order: &ServeOrder, stop: &AtomicBool) -> Result<bool, ProgramError> {
        let tick = time::Duration::from_micros(TICK.as_micros()).div_f32(order.speed);
        let mut next = time::Instant::now();
        let mut grounded_since = None;
        while !stop.load(Ordering::Relaxed) {
            let mut ticks = 0;
            while time::Instant::now() >= next && ticks < TICKS_AT_ONCE {
                self.tick();
                next += tick;
                ticks += 1;
            }
            if ticks == TICKS_AT_ONCE {
                next = time::Instant::now();
            }
            self.maintain();
            let truth = self.simulation.truth();
            let over = truth.on_ground && !truth.armed && self.simulation.referee().decisions() > 0;
            grounded_since = if over { grounded_since.or(Some(self.now)) } else { None };
            if order.until_landed && grounded_since.is_some_and(|since| self.now - since > LAST_WORDS) {
                return Ok(true);
            }
            self.rest(next.saturating_duration_since(time::Instant::now()));
        }
        Ok(false)
    }

    fn tick(&mut self) {
        self.now = self.now + TICK;
        let simulation = &mut self.simulation;
        if let Some(companion) = &mut self.companion {
            receive(companion, |bytes| simulation.hear_companion(bytes));
        }
        receive(&mut self.ground, |bytes| simulation.hear_ground(bytes));
        simulation.step(self.now);
        match &mut self.onboard {
            Some((onboard, _)) => exchange(simulation, onboard, self.now),
            None => {
                let frames = simulation.to_companion();
                if let Some(companion) = &mut self.companion {
                    frames.iter().for_each(|frame| companion.send(frame));
                }
                let reports = simulation.radio();
                if let Some(radio) = self.radio.as_mut().filter(|_| !reports.is_empty()) {
                    radio.send(&reports);
                }
            }
        }
        for frame in simulation.to_ground() {
            self.ground.send(&frame);
        }
        let asked = self.operator.as_mut().map_or(Vec::new(), |operator| operator.poll(self.now));
        for frame in simulation.crew(&asked) {
            if let Some(operator) = &mut self.operator {
                operator.receive(self.now, &frame);
            }
        }
    }

    fn maintain(&mut self) {
        let now = time::Instant::now();
        let ports = [self.companion.as_mut(), self.radio.as_mut(), Some(&mut self.ground)];
        for port in ports.into_iter().flatten() {
            // Peers come and go; the port mends itself.
            let _ = port.maintain(now);
        }
    }

    fn rest(&self, at_most: time::Duration) {
        let ports = [self.companion.as_ref(), Some(&self.ground)];
        let ports: Vec<&Port> = ports.into_iter().flatten().collect();
        if wait(&ports, at_most).is_err() {
            std::thread::sleep(at_most);
        }
    }

    fn report(&self, order: &ServeOrder, finished: bool, begun: time::Instant) -> Result<bool, ProgramError> {
        let slots = self.simulation.journal().slots();
        let Some(first) = slots.first() else { return Ok(!finished) };
        let switches = slots.windows(2).filter(|pair| pair[0].record.w_data != pair[1].record.w_data).count();
        let figures = Figures::of(&self.simulation, first.record.w_data, switches);
        let model = self.onboard.as_ref().map_or("of the companion", |(_, name)| name);
        let picture = results::write_files(&order.out, &self.simulation, &figures, model)?;
        let wall_s = begun.elapsed().as_secs_f64();
        if order.json {
            println!("{}", results::json(&figures, model, wall_s));
        } else {
            let mut lines = results::summary(&self.simulation, &figures, model);
            lines.push(("preference", format!("switched {switches} times")));
            lines.push((
                "ended",
                if figures.landed { "landed on the terminal" } else { "not landed on the terminal" }.into(),
            ));
            results::print(&lines, &figures, wall_s, &picture);
        }
        // Interrupted, there is no verdict.
        Ok(!finished || figures.is_good())
    }
}

fn receive(port: &mut Port, mut take: impl FnMut(&[u8])) {
    let mut buffer = [0; RECEIVE_BYTES];
    for _ in 0..READS_PER_TICK {
        match port.receive(&mut buffer) {
            0 => break,
            count => take(&buffer[..count]),
        }
    }
}

/// The endpoint with the port number that is really bound.
fn endpoint(port: &Port) -> String {
    match (port.endpoint(), port.local_address()) {
        (Endpoint::UdpIn(_), Some(address)) => format!("udpin:{address}"),
        (Endpoint::TcpIn(_), Some(address)) => format!("tcpin:{address}"),
        (endpoint, _) => endpoint.to_string(),
    }
}
