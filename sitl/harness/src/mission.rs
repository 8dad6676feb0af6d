//! One mission to simulate: from a scenario and a seed to everything that the parts need.

use crate::autopilot::{CopterSettings, Pack};
use crate::modem::device_id;
use gleaner_pilot::{DeviceSite, MAX_DEVICES, Mission, MissionError};
use gleaner_units::{
    BatteryUnits, CellSet, Degrees, GeoPoint, GridFrame, GridPose, Metres, MetresPerSecond, Ned,
};
use gleaner_world::{Realization, Scenario, ScenarioError, ScenarioKind, Seed, World};
use std::sync::Arc;
use thiserror::Error;

/// South-west corner of the simulated city: the field where ArduPilot's own simulation starts.
const CORNER: GeoPoint = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
/// Where the aircraft stands, seen from its estimator's origin: it was carried there after it was switched on. So whoever
/// takes home for the origin is found out.
const STAND: Ned = Ned { north_m: 12.0, east_m: -7.0, down_m: 0.5 };
/// `GLN_SPEED`, by default the autopilot's `WPNAV_SPEED`.
const CRUISE: MetresPerSecond = MetresPerSecond(10.0);
/// The highest `GLN_SPEED`, for an aircraft in haste: a slot of hovering then lasts a second.
const TOP_SPEED: MetresPerSecond = MetresPerSecond(20.0);
/// Flight altitude: the world's channel is computed for it.
const ALTITUDE_M: f32 = gleaner_world::City::ALTITUDE_M as f32;

/// What distinguishes one simulated mission from another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionPlan {
    /// RD or RB.
    pub kind: ScenarioKind,
    /// Names devices, data and shadowing. An evaluation seed: never one that the policy has learned from.
    pub seed: u64,
    /// How many devices; the scenario's number when `None`.
    pub devices: Option<usize>,
    /// The mission's battery budget; the scenario's when `None`.
    pub battery: Option<BatteryUnits>,
    /// Kept back on top of the way home (`GLN_RESERVE`). 0 is the paper's safety controller.
    pub reserve: BatteryUnits,
    /// Standard deviation of the position estimate's wander, m.
    pub wander_m: f32,
    /// How many seconds the aircraft lives while its pilot's clock counts one. A pilot in this process shares the
    /// aircraft's clock: 1. An emulated board keeps the wall's, and nobody waits ten minutes for a flight.
    pub haste: f32,
    /// Rotation of the city's grid, clockwise from true north.
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
            haste: 1.0,
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

/// Everything that is fixed before a simulated mission.
#[derive(Clone, Debug)]
pub struct Staged {
    /// What it was made from.
    pub plan: MissionPlan,
    /// City and channel.
    pub world: Arc<World>,
    /// Devices and zones.
    pub realization: Realization,
    /// The mission as the pilot gets it.
    pub mission: Mission,
    /// The aircraft.
    pub copter: CopterSettings,
    /// Where the grid lies in the estimator's frame.
    pub frame: GridFrame,
}

impl Staged {
    /// What the pack holds, per unit of the mission's budget. The budget pays for the decisions; taking off takes
    /// another 5 units and landing 9, whatever the budget. So with a budget of 60 or more the measured charge stays above
    /// the account of the decisions all the way, and the flight is limited by that account, as an episode is.
    pub const PACK_PER_BUDGET: f32 = 1.25;

    /// Draws the realization and lays everything out.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn new(world: Arc<World>, plan: MissionPlan) -> Result<Staged, PlanError> {
        let mut scenario: Scenario = plan.kind.scenario();
        scenario.device_count = plan.devices.unwrap_or(scenario.device_count);
        scenario.battery = plan.battery.unwrap_or(scenario.battery);
        if scenario.device_count > MAX_DEVICES {
            return Err(PlanError::TooManyDevices);
        }
        let capacity = BatteryUnits(scenario.battery.0 * Staged::PACK_PER_BUDGET);
        let most = gleaner_pilot::ParameterId::FullBattery.spec().max;
        if capacity.0 > most {
            return Err(PlanError::BatteryTooLarge(scenario.battery.0));
        }
        let realization = Realization::draw(world.city(), &scenario, Seed::evaluation(plan.seed))?;
        let pose = GridPose { corner: CORNER, rotation: plan.rotation };
        let mission = Staged::mission(&world, &realization, pose)?;
        let grid = mission.grid();
        // The origin lies so that the stand is the centre of the start cell.
        let start = GridFrame::new(grid, pose, CORNER).centre(realization.start(), STAND.down_m);
        let [north_m, east_m] = [start.north_m - STAND.north_m, start.east_m - STAND.east_m];
        let origin = CORNER.offset_by(Metres(north_m), Metres(east_m));
        let mut pack = Pack::new(capacity);
        // A slot of hovering is a time on the pilot's clock: it must not cost the aircraft more for its haste.
        pack.hover_per_s /= plan.haste;
        let (wander_m, seed) = (plan.wander_m, plan.seed);
        let copter = CopterSettings { system_id: 1, origin, stand: STAND, pack, wander_m, seed };
        let frame = GridFrame::new(grid, pose, origin);
        Ok(Staged { plan, world, realization, mission, copter, frame })
    }

    fn mission(world: &World, realization: &Realization, pose: GridPose) -> Result<Mission, MissionError> {
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

    /// The names that evaluation draws are made from.
    #[must_use]
    pub const fn seed(&self) -> Seed {
        Seed::evaluation(self.plan.seed)
    }

    /// The pilot's parameters for this mission, besides the preference.
    #[must_use]
    pub fn parameters(&self) -> Vec<(&'static str, f32)> {
        vec![
            ("GLN_BAT_UNITS", self.copter.pack.capacity.0),
            ("GLN_RESERVE", self.plan.reserve.0),
            ("GLN_ALT", ALTITUDE_M),
            ("GLN_SPEED", if self.plan.haste > 1.0 { TOP_SPEED.0 } else { CRUISE.0 }),
        ]
    }

    /// Flight altitude above the take-off point, m.
    #[must_use]
    pub const fn altitude_m(&self) -> f32 {
        ALTITUDE_M
    }
}
