//! `serve`: the simulation in real time, with ports for a companion, its radio and a ground station.

use super::ProgramError;
use super::arguments::ServeOrder;
use super::introduction::{ports, write_mission};
use super::results::Brain;
use super::{model, results};
use crate::wired::receive;
use crate::{Aboard, Figures, FlightError, Operator, Orders, Pace, STEP, Simulation, Staged, Wired};
use gleaner_pilot::{Onboard, Parameters, Settings};
use gleaner_policy::Engine;
use gleaner_ports::{Endpoint, Port, wait};
use gleaner_units::{Duration, Instant};
use gleaner_world::World;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time;

/// After the motors have stopped, for the last words on the wires.
const LAST_WORDS: Duration = Duration::from_secs(2);
pub(super) fn serve(order: &ServeOrder) -> Result<bool, ProgramError> {
    let begun = time::Instant::now();
    let world = Arc::new(World::default_world());
    let staged = Staged::new(world, order.plan).map_err(FlightError::from)?;
    if let Some(path) = &order.mission_out {
        write_mission(&staged, path)?;
    }
    let mut server = Server::open(order, staged)?;
    let stop = gleaner_ports::end_requested().map_err(ProgramError::Signals)?;
    server.introduce(order)?;
    let finished = server.run(order, &stop)?;
    server.report(order, finished, begun)
}

/// Who decides.
enum Pilot {
    /// The pilot of this process, on the aircraft's clock.
    Inside(Box<Onboard<Engine>>, Brain),
    /// Whoever connects, on the wall's.
    Outside(Wired),
}

impl Pilot {
    fn open(order: &ServeOrder, staged: &Staged) -> Result<Pilot, ProgramError> {
        let open = |endpoint: &Endpoint| Port::open(endpoint).map_err(ProgramError::Port);
        let Some(companion) = &order.companion else {
            let policy = model::load(order.model.as_deref(), order.engine)?;
            let brain = model::brain(&policy);
            let (mission, settings) = (staged.mission.clone(), Settings::default());
            let onboard = Onboard::new(mission, Parameters::default(), settings, policy, Ok(()));
            return Ok(Pilot::Inside(Box::new(onboard.map_err(FlightError::Onboard)?), brain));
        };
        Ok(Pilot::Outside(Wired::new(open(companion)?, order.radio.as_ref().map(open).transpose()?)))
    }
}

/// The simulation with everything that is plugged into it.
struct Server {
    simulation: Simulation,
    pilot: Pilot,
    ground: Port,
    /// Arms and takes off, when asked to.
    operator: Option<Operator>,
    now: Instant,
}

impl Server {
    fn open(order: &ServeOrder, staged: Staged) -> Result<Server, ProgramError> {
        let pilot = Pilot::open(order, &staged)?;
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
        let ground = Port::open(&order.ground).map_err(ProgramError::Port)?;
        let simulation = Simulation::new(staged).map_err(FlightError::from)?;
        Ok(Server { simulation, pilot, ground, operator, now: Instant::ZERO })
    }

    fn introduce(&self, order: &ServeOrder) -> Result<(), ProgramError> {
        let (onboard, wired) = match &self.pilot {
            Pilot::Inside(_, brain) => (Some(brain.model.as_str()), None),
            Pilot::Outside(wired) => (None, Some(wired)),
        };
        let roles = [
            ("companion", wired.map(Wired::autopilot)),
            ("radio", wired.and_then(Wired::radio)),
            ("gcs", Some(&self.ground)),
        ];
        ports(&roles, onboard, order.mission_out.as_deref())
    }

    /// Runs until it is stopped (`false`) or, if that was asked for, until the aircraft has landed (`true`).
    fn run(&mut self, order: &ServeOrder, stop: &AtomicBool) -> Result<bool, ProgramError> {
        let mut pace = Pace::new(order.speed);
        let mut grounded_since = None;
        while !stop.load(Ordering::Relaxed) {
            for _ in 0..pace.due() {
                self.tick();
            }
            self.maintain();
            let truth = self.simulation.truth();
            let over = truth.on_ground && !truth.armed && self.simulation.referee().decisions() > 0;
            grounded_since = if over { grounded_since.or(Some(self.now)) } else { None };
            if order.until_landed && grounded_since.is_some_and(|since| self.now - since > LAST_WORDS) {
                return Ok(true);
            }
            self.rest(pace.rest());
        }
        Ok(false)
    }

    fn tick(&mut self) {
        self.now = self.now + STEP;
        let simulation = &mut self.simulation;
        receive(&mut self.ground, |bytes| simulation.hear_ground(bytes));
        simulation.step(self.now);
        match &mut self.pilot {
            Pilot::Inside(onboard, _) => onboard.exchange(simulation, self.now),
            Pilot::Outside(wired) => wired.exchange(simulation, self.now),
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
        // Peers come and go; the port mends itself.
        let _ = self.ground.maintain(now);
        if let Pilot::Outside(wired) = &mut self.pilot {
            wired.maintain(now);
        }
    }

    fn rest(&self, at_most: time::Duration) {
        let mut ports = vec![&self.ground];
        if let Pilot::Outside(wired) = &self.pilot {
            ports.push(wired.autopilot());
        }
        if wait(&ports, at_most).is_err() {
            std::thread::sleep(at_most);
        }
    }

    fn report(&self, order: &ServeOrder, finished: bool, begun: time::Instant) -> Result<bool, ProgramError> {
        let slots = self.simulation.journal().slots();
        let Some(first) = slots.first() else { return Ok(!finished) };
        let switches = slots.windows(2).filter(|pair| pair[0].record.w_data != pair[1].record.w_data).count();
        let figures = Figures::of(&self.simulation, first.record.w_data, switches);
        let brain = match &self.pilot {
            Pilot::Inside(_, brain) => brain.clone(),
            Pilot::Outside(_) => Brain::of("companion"),
        };
        let picture = results::write_files(&order.out, &self.simulation, &figures, &brain)?;
        let wall_s = begun.elapsed().as_secs_f64();
        if order.json {
            println!("{}", results::json(&figures, &brain, wall_s));
        } else {
            let mut lines = results::summary(&self.simulation, &figures, &brain);
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
