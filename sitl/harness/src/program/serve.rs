//! `serve`: the simulation in real time, with ports for a companion, its radio and a ground station.

use super::ProgramError;
use super::announce::{ports, write_mission};
use super::arguments::ServeOrder;
use super::page::Page;
use super::results::PolicyInfo;
use super::{load, model, results};
use crate::companion::parameters;
use crate::wired::receive;
use crate::{
    AutopilotKind, Companion, Figures, FlightError, MissionSetup, Operator, Orders, Pace, STEP, Simulation,
    Wired,
};
use gleaner_pilot::{Budget, LookingAhead, Onboard, Settings};
use gleaner_policy::Engine;
use gleaner_ports::{Endpoint, Port, wait};
use gleaner_units::{Duration, Instant};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time;

/// After disarming, for the last messages.
const LAST_MESSAGES: Duration = Duration::from_secs(2);
/// Between two updates of the live line.
const LIVE_INTERVAL: time::Duration = time::Duration::from_millis(500);

pub(super) fn serve(order: &ServeOrder) -> Result<bool, ProgramError> {
    let begun = time::Instant::now();
    let setup = load::setup(&order.mission)?;
    if let Some(path) = &order.mission_out {
        write_mission(&setup, path)?;
    }
    let mut server = Server::open(order, setup)?;
    let stop = gleaner_ports::end_requested().map_err(ProgramError::Signals)?;
    server.introduce(order)?;
    let finished = server.run(order, &stop)?;
    server.report(order, finished, begun)
}

/// Where the pilot runs. There is one of it in a process.
#[expect(clippy::large_enum_variant, reason = "one value in a process")]
enum Pilot {
    /// In this process, on the aircraft's clock.
    Inside(Box<Onboard<LookingAhead<Engine>>>, PolicyInfo),
    /// Behind a port, on the wall clock.
    Outside(Wired),
}

impl Pilot {
    fn open(order: &ServeOrder, setup: &MissionSetup) -> Result<Pilot, ProgramError> {
        let open = |endpoint: &Endpoint| Port::open(endpoint).map_err(ProgramError::Port);
        let Some(companion) = &order.companion else {
            let policy = model::load(order.model.as_deref(), order.engine)?;
            let policy_info = model::info(&policy);
            let (mission, settings) = (setup.mission.clone(), Settings::default());
            let policy = LookingAhead::new(policy, Budget::LINUX);
            let onboard = Onboard::new(mission, parameters(order.lookahead), settings, policy, Ok(()));
            return Ok(Pilot::Inside(Box::new(onboard.map_err(FlightError::Onboard)?), policy_info));
        };
        Ok(Pilot::Outside(Wired::new(open(companion)?, order.radio.as_ref().map(open).transpose()?)))
    }

    /// The model and the engine, as far as they are known here.
    fn info(&self) -> PolicyInfo {
        match self {
            Pilot::Inside(_, policy_info) => policy_info.clone(),
            Pilot::Outside(_) => PolicyInfo::outside("companion"),
        }
    }
}

/// The simulation with everything that is plugged into it.
struct Server {
    simulation: Simulation,
    pilot: Pilot,
    ground: Port,
    page: Option<Page>,
    /// Arms and takes off with `--auto-takeoff`.
    operator: Option<Operator>,
    now: Instant,
}

impl Server {
    fn open(order: &ServeOrder, setup: MissionSetup) -> Result<Server, ProgramError> {
        let pilot = Pilot::open(order, &setup)?;
        let operator = order.auto_takeoff.then(|| {
            Operator::new(Orders {
                // Not the ground station's own: both may send at once.
                station_id: 254,
                system_id: setup.aircraft.system_id,
                autopilot: setup.plan.autopilot,
                component_id: Settings::default().component_id,
                parameters: Vec::new(),
                altitude_m: setup.altitude_m(),
                engage: false,
                switches: Vec::new(),
            })
        });
        let ground = Port::open(&order.ground).map_err(ProgramError::Port)?;
        let simulation =
            Simulation::new(setup, Settings::default().component_id).map_err(FlightError::from)?;
        let page = order.http.map(|address| Page::open(address, order, &simulation, &pilot.info()));
        Ok(Server { page: page.transpose()?, simulation, pilot, ground, operator, now: Instant::ZERO })
    }

    fn introduce(&self, order: &ServeOrder) -> Result<(), ProgramError> {
        let (onboard, wired) = match &self.pilot {
            Pilot::Inside(_, policy_info) => (Some(policy_info.model.as_str()), None),
            Pilot::Outside(wired) => (None, Some(wired)),
        };
        let roles = [
            ("companion", wired.map(Wired::autopilot)),
            ("radio", wired.and_then(Wired::radio)),
            ("gcs", Some(&self.ground)),
        ];
        let page = self.page.as_ref().map_or(Vec::new(), Page::links);
        ports(&roles, onboard, order.mission_out.as_deref(), &page)?;
        for line in self.next_steps(order) {
            println!("{line}");
        }
        Ok(())
    }

    /// What to type next, on the ground station and on the companion.
    fn next_steps(&self, order: &ServeOrder) -> Vec<String> {
        let px4 = order.mission.plan.autopilot == AutopilotKind::Px4;
        let mut lines = Vec::new();
        if order.companion.is_some() {
            let mission =
                order.mission_out.as_ref().map_or("MISSION".into(), |path| path.display().to_string());
            lines.push(format!("next: gleaner run --mission {mission} --autopilot tcpout:127.0.0.1:5762"));
        }
        if !order.auto_takeoff {
            lines.push(match px4 {
                true => format!("next: arm, take off to {:.0} m above sea level", 584.0 + self.altitude_m()),
                false => format!("next: mode guided, arm throttle, takeoff {:.0}", self.altitude_m()),
            });
        }
        lines.push("next: engage component 191 (MAV_CMD_USER_2 param1 = 1, or GLN_ENABLE 1)".into());
        if px4 {
            lines.push("next: select OFFBOARD when the stream of targets has begun".into());
        }
        lines
    }

    fn altitude_m(&self) -> f32 {
        self.simulation.setup().altitude_m()
    }

    /// One line on the state of the flight.
    fn live_line(&self) -> String {
        let (truth, field) = (self.simulation.truth(), self.simulation.field());
        let cell = self.simulation.setup().frame.cell(&truth.position);
        format!(
            "{:6.0} s  {:<9} {:<8} {:5.1} m  {:4.1} m/s  battery {:5.1}  cell {:<9} {:5.1} % collected, {} decisions",
            (self.now - Instant::ZERO).as_secs_f32(),
            truth.mode.name(),
            if truth.armed { "armed" } else { "disarmed" },
            truth.height_m,
            truth.ground_speed_mps,
            truth.battery.0,
            cell.map_or("outside".into(), |cell| cell.to_string()),
            100.0 * field.collected_fraction(),
            self.simulation.referee().decisions(),
        )
    }

    /// Runs until it is stopped (`false`) or, with `--until-landed`, until the aircraft has landed (`true`).
    fn run(&mut self, order: &ServeOrder, stop: &AtomicBool) -> Result<bool, ProgramError> {
        let mut pace = Pace::new(order.speed);
        let mut grounded_since = None;
        // Live only for a person: a program reads the port lines and the result.
        let live = !order.json && std::io::stdout().is_terminal();
        let mut next_line = time::Instant::now();
        while !stop.load(Ordering::Relaxed) {
            for _ in 0..pace.due() {
                self.tick();
            }
            self.maintain();
            if live && time::Instant::now() >= next_line {
                next_line = time::Instant::now() + LIVE_INTERVAL;
                print!("\r{}\x1b[K", self.live_line());
                // A terminal that is gone ends the program elsewhere.
                let _ = std::io::stdout().flush();
            }
            let truth = self.simulation.truth();
            let over = truth.on_ground && !truth.armed && self.simulation.referee().decisions() > 0;
            grounded_since = if over { grounded_since.or(Some(self.now)) } else { None };
            if order.until_landed && grounded_since.is_some_and(|since| self.now - since > LAST_MESSAGES) {
                return Ok(true);
            }
            self.rest(pace.rest());
        }
        Ok(false)
    }

    fn tick(&mut self) {
        self.now = self.now + STEP;
        let simulation = &mut self.simulation;
        receive(&mut self.ground, |bytes| simulation.from_ground(bytes));
        simulation.step(self.now);
        match &mut self.pilot {
            Pilot::Inside(onboard, _) => onboard.exchange(simulation, self.now),
            Pilot::Outside(wired) => wired.exchange(simulation, self.now),
        }
        for frame in simulation.to_ground() {
            self.ground.send(&frame);
            if let Some(page) = &mut self.page {
                page.heard(&frame);
            }
        }
        if let Some(page) = &mut self.page {
            match &mut self.pilot {
                Pilot::Inside(onboard, _) => page.show_pilot(simulation, self.now, onboard),
                Pilot::Outside(_) => page.show_wire(simulation, self.now),
            }
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
        // The port reopens by itself.
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
        let policy_info = self.pilot.info();
        let picture = results::write_files(&order.out, &self.simulation, &figures, &policy_info.model)?;
        let wall_s = begun.elapsed().as_secs_f64();
        if order.json {
            println!("{}", results::json(&figures, &policy_info, wall_s));
        } else {
            let mut lines = results::summary(&self.simulation, &figures, &policy_info);
            lines.push(("preference", format!("switched {switches} times")));
            lines.push((
                "ended",
                if figures.landed { "landed on the terminal" } else { "not landed on the terminal" }.into(),
            ));
            results::print(&lines, &figures, wall_s, &picture);
        }
        // An interrupted flight has no verdict.
        Ok(!finished || figures.is_good())
    }
}
