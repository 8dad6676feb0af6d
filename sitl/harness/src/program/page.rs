//! The page of a flight: live, beside `serve`, or written as one file by `fly`.

use super::arguments::ServeOrder;
use super::results::PolicyInfo;
use super::{ProgramError, model};
use crate::{
    AircraftFault, AutopilotKind, IncidentKind, LineFault, MissionSetup, RadioFault, Simulation, VehicleMode,
};
use gleaner_dashboard::{
    Access, Command, Dashboard, DeviceState, Live, Question, Recording, Scene, Server, ServerError, explain,
    live, render, scene, shown, shown_logged,
};
use gleaner_link::Address;
use gleaner_pilot::{Deliberator, LoggedDecision, Onboard, Settings};
use gleaner_policy::schema::REACHABLE_SNR_DB;
use gleaner_policy::{Engine, Policy};
use gleaner_units::{BatteryUnits, Duration, Instant, Metres};
use std::net::SocketAddr;
use std::path::Path;
use std::time;

/// The live page of one simulation.
pub(super) struct Page {
    dashboard: Dashboard,
    incidents: Vec<(String, IncidentKind)>,
    /// Explains the decisions of a pilot outside this process.
    policy: Engine,
    /// Slots of the journal that were shown.
    slots: usize,
}

impl Page {
    /// Serves the page at `address`.
    pub fn open(
        address: SocketAddr,
        order: &ServeOrder,
        simulation: &Simulation,
        policy_info: &PolicyInfo,
    ) -> Result<Page, ProgramError> {
        let setup = simulation.setup();
        let incidents = incidents(setup.plan.autopilot);
        let scene = Scene {
            controls: true,
            incidents: incidents.iter().map(|(name, _)| name.clone()).collect(),
            ..fixed(setup, title(setup, policy_info))
        };
        let access = Access::of(address, None).map_err(ServerError::from)?;
        let server = Server::start(address, access, scene)?;
        let altitude = Metres(setup.altitude_m());
        let policy = model::load(order.model.as_deref(), order.engine)?;
        let dashboard = Dashboard::new(server, &setup.mission, altitude, pilot(setup));
        Ok(Page { dashboard, incidents, policy, slots: 0 })
    }

    /// The addresses to open.
    pub fn links(&self) -> Vec<(&'static str, String)> {
        self.dashboard.server().links()
    }

    /// A frame that the vehicle sends to ground stations.
    pub fn heard(&mut self, frame: &[u8]) {
        self.dashboard.heard(frame);
    }

    /// Shows what a pilot in this process knows.
    pub fn show_pilot<P: Deliberator>(
        &mut self,
        simulation: &mut Simulation,
        now: Instant,
        onboard: &mut Onboard<P>,
    ) {
        if let Some(decision) = onboard.decision().cloned() {
            let question = Question {
                decision: LoggedDecision::new(0, &decision, None),
                devices: onboard.device_states(now).to_vec(),
                reserve: onboard.parameters().reserve(),
            };
            self.dashboard.decided(shown(&decision), Some(question));
        }
        self.turn(simulation, now, |station| live(now, onboard, station));
    }

    /// Shows what the wire and the simulation show of a pilot outside this process.
    pub fn show_wire(&mut self, simulation: &mut Simulation, now: Instant) {
        let setup = simulation.setup();
        let new = simulation.journal().slots().get(self.slots..).unwrap_or_default();
        self.slots += new.len();
        for slot in new {
            let Some(decision) = slot.logged(setup) else { continue };
            let inference = explain(&mut self.policy, &decision);
            let shown = shown_logged(&decision, inference.as_ref());
            let (devices, reserve) = (slot.heard.clone(), setup.plan.reserve);
            self.dashboard.decided(shown, Some(Question { decision, devices, reserve }));
        }
        let (truth, devices) = (simulation.truth(), devices(simulation));
        let cell_m = setup.mission.grid().cell().0;
        let (east_m, north_m) = simulation.on_grid(&truth.position);
        self.turn(simulation, now, |station| {
            station.set_devices(devices);
            Live {
                x: Some(east_m / cell_m),
                y: Some(north_m / cell_m),
                height_m: Some(truth.height_m),
                ..station.live(seconds(now))
            }
        });
    }

    /// Sends what the page commands to the vehicle, and injects the incidents that it requests.
    fn turn(
        &mut self,
        simulation: &mut Simulation,
        now: Instant,
        live: impl FnOnce(&mut gleaner_dashboard::Station) -> Live,
    ) {
        for frame in self.dashboard.poll(time::Instant::now(), seconds(now), live) {
            simulation.from_ground(&frame);
        }
        let Some(order) = self.dashboard.incident() else { return };
        let kind = match &order.command {
            Command::Incident(name) => self.incidents.iter().find(|(known, _)| known == name),
            _ => None,
        };
        match kind {
            Some((_, kind)) => {
                simulation.inject(*kind);
                order.answer(format!("done: {kind}"));
            }
            None => order.answer("this simulation has no such incident"),
        }
    }
}

/// The incidents that the page can cause.
fn incidents(autopilot: AutopilotKind) -> Vec<(String, IncidentKind)> {
    let hold = match autopilot {
        AutopilotKind::ArduPilot => "pilot takes LOITER",
        AutopilotKind::Px4 => "pilot takes HOLD",
    };
    let cut = IncidentKind::Line(LineFault::Cut(None), Duration::from_secs(10));
    let sag = IncidentKind::Aircraft(AircraftFault::ChargeLost(BatteryUnits(10.0)));
    let silent = IncidentKind::Radio(RadioFault::Silent, Duration::from_secs(20));
    vec![
        (hold.into(), IncidentKind::pilot_selects(VehicleMode::Hold)),
        ("line cut for 10 s".into(), cut),
        ("battery loses 10 units".into(), sag),
        ("radio silent for 20 s".into(), silent),
    ]
}

/// The devices as the radio hears them.
fn devices(simulation: &Simulation) -> Vec<DeviceState> {
    let devices = simulation.field().devices().iter();
    devices
        .map(|device| DeviceState {
            remaining: device.remaining_units,
            snr_db: Some(device.snr.0).filter(|snr_db| snr_db.is_finite()),
            reachable: device.snr.0 >= REACHABLE_SNR_DB,
        })
        .collect()
}

/// Writes a finished flight as one file.
pub(super) fn write(
    path: &Path,
    simulation: &Simulation,
    title: String,
    policy: Engine,
) -> Result<(), ProgramError> {
    let mut recording = recording(simulation.setup(), title, policy);
    replay(&mut recording, simulation);
    let page = render(&recording.finish());
    std::fs::write(path, page).map_err(|source| ProgramError::Write { path: path.into(), source })
}

/// A recording of the flight of this mission, to be fed from its journal.
pub(super) fn recording<P: Policy>(setup: &MissionSetup, title: String, policy: P) -> Recording<P> {
    Recording::new(fixed(setup, title), &setup.mission, pilot(setup), setup.plan.reserve, policy)
}

/// Records the whole journal.
pub(super) fn replay<P: Policy>(recording: &mut Recording<P>, simulation: &Simulation) {
    let (journal, setup) = (simulation.journal(), simulation.setup());
    let decisions: Vec<_> = journal.slots().iter().filter_map(|slot| slot.logged(setup)).collect();
    recording.replay(&decisions, journal.frames().map(|(at, frame)| (seconds(at), frame)));
}

/// One line for the head of the page.
pub(super) fn title(setup: &MissionSetup, policy_info: &PolicyInfo) -> String {
    let plan = &setup.plan;
    let (scenario, seed, autopilot) = (plan.kind.name().to_uppercase(), plan.seed, plan.autopilot);
    format!("simulated {scenario}, seed {seed}, {autopilot}, model {}", policy_info.model)
}

fn fixed(setup: &MissionSetup, title: String) -> Scene {
    scene(&setup.mission, setup.altitude_m() as u16, title)
}

fn pilot(setup: &MissionSetup) -> Address {
    Address::new(setup.aircraft.system_id, Settings::default().component_id)
}

pub(super) fn seconds(at: Instant) -> f64 {
    at.as_micros() as f64 * 1e-6
}
