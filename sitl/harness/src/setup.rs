//! One mission to simulate: from a scenario and a seed, or from a mission file, to what every part needs.

use crate::autopilot::{AircraftSettings, AutopilotKind, EnergyModel, Pack};
use crate::modem::device_id;
use gleaner_pilot::{DeviceSite, MAX_DEVICES, Mission, MissionError};
use gleaner_units::{
    BatteryUnits, Cell, CellSet, Degrees, GeoPoint, GridFrame, GridPose, Metres, MetresPerSecond, Ned,
};
use gleaner_world::{
    Channel, City, CityError, Placement, Realization, Scenario, ScenarioError, ScenarioKind, Seed, World,
};
use std::sync::Arc;
use thiserror::Error;

/// South-west corner of a drawn city: the field where ArduPilot's own simulation starts.
const CORNER: GeoPoint = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
/// Where the aircraft stands relative to its estimator's origin: it was carried there after it was switched on. A pilot
/// that takes home for the origin flies beside its cells, and the referee reports it.
const STAND: Ned = Ned { north_m: 12.0, east_m: -7.0, down_m: 0.5 };
/// Default of `GLN_SPEED`: the autopilot's `WPNAV_SPEED`.
const CRUISE: MetresPerSecond = MetresPerSecond(10.0);
/// The highest `GLN_SPEED`, for a sped-up aircraft: a slot of hovering then lasts a second.
const TOP_SPEED: MetresPerSecond = MetresPerSecond(20.0);
/// Flight altitude: the world's channel is computed for it.
const ALTITUDE_M: f32 = gleaner_world::City::ALTITUDE_M as f32;

/// Parameters of one simulated mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionPlan {
    /// RD or RB.
    pub kind: ScenarioKind,
    /// Random seed for devices, data and shadowing. An evaluation seed: training never uses it.
    pub seed: u64,
    /// How many devices; the scenario's number when `None`.
    pub devices: Option<usize>,
    /// The mission's battery budget; the scenario's when `None`.
    pub battery: Option<BatteryUnits>,
    /// Kept back on top of the way home (`GLN_RESERVE`). 0 is the paper's safety controller.
    pub reserve: BatteryUnits,
    /// Standard deviation of the position estimate's wander, m.
    pub wander_m: f32,
    /// Aircraft seconds per second of the pilot's clock. A pilot in this process shares the aircraft's clock: 1. An
    /// emulated board runs on the wall clock, and a whole mission would take ten minutes.
    pub speedup: f32,
    /// `GLN_SPEED`.
    pub speed: MetresPerSecond,
    /// Which autopilot is simulated.
    pub autopilot: AutopilotKind,
    /// How much power flying takes.
    pub energy: EnergyModel,
    /// Rotation of a drawn city's grid, clockwise from true north.
    pub rotation: Degrees,
}

impl MissionPlan {
    /// The default scenario of a kind.
    #[must_use]
    pub const fn new(kind: ScenarioKind, seed: u64) -> MissionPlan {
        let reserve = BatteryUnits(0.0);
        MissionPlan {
            kind,
            seed,
            devices: None,
            battery: None,
            reserve,
            wander_m: 0.0,
            speedup: 1.0,
            speed: CRUISE,
            autopilot: AutopilotKind::ArduPilot,
            energy: EnergyModel::Nominal,
            rotation: Degrees(0.0),
        }
    }
}

/// Why a mission cannot be simulated.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PlanError {
    /// The scenario does not fit the city.
    #[error("{0}")]
    Scenario(#[from] ScenarioError),
    /// The city of the mission cannot be simulated.
    #[error("{0}")]
    City(#[from] CityError),
    /// The pilot refuses the mission.
    #[error("mission: {0}")]
    Mission(#[from] MissionError),
    /// More devices than the pilot can hold.
    #[error("the pilot holds at most {MAX_DEVICES} devices: ask for fewer")]
    TooManyDevices,
    /// The pack for this battery is more than `GLN_BAT_UNITS` can say.
    #[error("a mission of {0} battery units needs a pack beyond GLN_BAT_UNITS: ask for 400 at most")]
    BatteryTooLarge(f32),
}

/// A mission that is ready to be simulated.
#[derive(Clone, Debug)]
pub struct MissionSetup {
    /// The parameters that it was made from.
    pub plan: MissionPlan,
    /// City and channel.
    pub world: Arc<World>,
    /// Devices and zones.
    pub realization: Realization,
    /// The mission as the pilot gets it.
    pub mission: Mission,
    /// The aircraft.
    pub aircraft: AircraftSettings,
    /// Where the grid lies in the estimator's frame.
    pub frame: GridFrame,
}

impl MissionSetup {
    /// Pack capacity per unit of the mission's budget. The budget pays for the decisions; taking off takes another 5
    /// units and landing 9 under the nominal energy model. With a budget of 60 or more, the measured charge therefore
    /// stays above the account of the decisions during the whole flight, and the account limits it, as in an episode.
    pub const PACK_PER_BUDGET: f32 = 1.25;

    /// Draws the realization of a plan in a city.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn new(world: Arc<World>, plan: MissionPlan) -> Result<MissionSetup, PlanError> {
        let mut scenario: Scenario = plan.kind.scenario().in_city(world.city());
        scenario.device_count = plan.devices.unwrap_or(scenario.device_count);
        scenario.battery = plan.battery.unwrap_or(scenario.battery);
        if scenario.device_count > MAX_DEVICES {
            return Err(PlanError::TooManyDevices);
        }
        let realization = Realization::draw(world.city(), &scenario, Seed::evaluation(plan.seed))?;
        let pose = GridPose { corner: CORNER, rotation: plan.rotation };
        let mission = drawn_mission(&world, &realization, pose)?;
        MissionSetup::assemble(world, plan, realization, mission)
    }

    /// Sets up a mission file: its city, devices, fence and terminal. The aircraft starts over the terminal for RB,
    /// otherwise over the open cell that is farthest from the terminal within half the budget.
    ///
    /// # Errors
    /// See [`PlanError`]. The simulated channel needs devices on open ground.
    pub fn of_mission(mission: Mission, plan: MissionPlan) -> Result<MissionSetup, PlanError> {
        mission.check()?;
        let city = City::new(mission.heights.clone())?;
        let reach = mission.budget.0 * 0.5;
        let within =
            |cell: &Cell| mission.fence.contains(*cell) && cell.manhattan(mission.terminal) as f32 <= reach;
        let start = match plan.kind {
            ScenarioKind::ReturnBase => mission.terminal,
            ScenarioKind::ReachDestination => city
                .open_cells()
                .iter()
                .copied()
                .filter(within)
                .max_by_key(|cell| cell.manhattan(mission.terminal))
                .unwrap_or(mission.terminal),
        };
        let scenario = Scenario {
            start,
            terminal: mission.terminal,
            battery: mission.budget,
            device_count: mission.devices.len(),
        };
        let placements =
            mission.devices.iter().map(|site| Placement { cell: site.cell, data_units: site.data });
        let realization = Realization::new(&city, &scenario, placements.collect())?;
        let world = Arc::new(World::new(city, Channel::default()));
        MissionSetup::assemble(world, plan, realization, mission)
    }

    fn assemble(
        world: Arc<World>,
        plan: MissionPlan,
        realization: Realization,
        mission: Mission,
    ) -> Result<MissionSetup, PlanError> {
        let capacity = BatteryUnits(mission.budget.0 * MissionSetup::PACK_PER_BUDGET);
        let most = gleaner_pilot::ParameterId::FullBattery.spec().max;
        if capacity.0 > most {
            return Err(PlanError::BatteryTooLarge(mission.budget.0));
        }
        let grid = mission.grid();
        // The origin lies so that the stand is the centre of the start cell.
        let at_corner = GridFrame::new(grid, mission.pose, mission.pose.corner);
        let start = at_corner.centre(realization.start(), 0.0);
        let (north_m, east_m) = (start.north_m - STAND.north_m, start.east_m - STAND.east_m);
        let origin = mission.pose.corner.offset_by(Metres(north_m), Metres(east_m));
        let mut pack = Pack::new(capacity, plan.energy);
        // A slot of hovering is a time on the pilot's clock: its price must not grow with the speed-up.
        pack.hover_per_s /= plan.speedup;
        let (wander_m, seed) = (plan.wander_m, plan.seed);
        let aircraft = AircraftSettings { system_id: 1, origin, stand: STAND, pack, wander_m, seed };
        let frame = GridFrame::new(grid, mission.pose, origin);
        Ok(MissionSetup { plan, world, realization, mission, aircraft, frame })
    }

    /// The seed of the draws.
    #[must_use]
    pub const fn seed(&self) -> Seed {
        Seed::evaluation(self.plan.seed)
    }

    /// The pilot's parameters for this mission, besides the preference.
    #[must_use]
    pub fn parameters(&self) -> Vec<(&'static str, f32)> {
        vec![
            ("GLN_BAT_UNITS", self.aircraft.pack.capacity.0),
            ("GLN_RESERVE", self.plan.reserve.0),
            ("GLN_ALT", ALTITUDE_M),
            ("GLN_SPEED", if self.plan.speedup > 1.0 { TOP_SPEED.0 } else { self.plan.speed.0 }),
        ]
    }

    /// Flight altitude above the take-off point, m.
    #[must_use]
    pub const fn altitude_m(&self) -> f32 {
        ALTITUDE_M
    }

    /// Device ids in the order of the mission.
    #[must_use]
    pub fn device_ids(&self) -> Vec<u32> {
        self.mission.devices.iter().map(|site| site.id).collect()
    }
}

fn drawn_mission(world: &World, realization: &Realization, pose: GridPose) -> Result<Mission, MissionError> {
    let sites = realization.devices().iter().enumerate().map(|(index, placement)| DeviceSite {
        id: device_id(index),
        cell: placement.cell,
        data: placement.data_units,
    });
    let mission = Mission {
        heights: world.city().heights().clone(),
        fence: CellSet::full(world.city().grid()),
        pose,
        terminal: realization.terminal(),
        budget: realization.battery(),
        devices: sites.collect(),
    };
    mission.check()?;
    Ok(mission)
}
