//! Where missions take place: a world, and the zones and devices of a mission file if there is one.

use super::flight::SharedTable;
use gleaner_units::{BatteryUnits, Cell};
use gleaner_world::{Placement, Realization, Scenario, ScenarioError, ScenarioKind, Seed, World};
use std::sync::Arc;

/// The fixed part of a mission file: what does not change from flight to flight.
#[derive(Clone, Debug, PartialEq)]
pub struct MissionPlan {
    /// The cell where the mission ends.
    pub terminal: Cell,
    /// Battery at the start, units, B.
    pub battery: BatteryUnits,
    /// The devices and their data.
    pub devices: Vec<Placement>,
}

/// A world and, if given, a mission plan for it.
#[derive(Clone, Debug)]
pub struct Site {
    world: Arc<World>,
    plan: Option<MissionPlan>,
    table: SharedTable,
}

impl Site {
    /// The default city under the default channel, with random devices.
    #[must_use]
    pub fn default_site() -> Site {
        Site::new(Arc::new(World::default_world()))
    }

    /// A world with random devices.
    #[must_use]
    pub fn new(world: Arc<World>) -> Site {
        Site { world, plan: None, table: SharedTable::default() }
    }

    /// The same world with the terminal, battery and devices of a mission file.
    #[must_use]
    pub fn with_plan(self, plan: MissionPlan) -> Site {
        Site { plan: Some(plan), ..self }
    }

    /// The same plan in another world, such as one with another channel.
    #[must_use]
    pub fn in_world(&self, world: Arc<World>) -> Site {
        Site { world, plan: self.plan.clone(), table: SharedTable::default() }
    }

    /// City and channel.
    #[must_use]
    pub const fn world(&self) -> &Arc<World> {
        &self.world
    }

    /// The table of this city for [`Flight::with_table`](super::flight::Flight::with_table).
    #[must_use]
    pub const fn table(&self) -> &SharedTable {
        &self.table
    }

    /// The plan's devices; `None` where devices are drawn at random.
    #[must_use]
    pub fn devices(&self) -> Option<&[Placement]> {
        self.plan.as_ref().map(|plan| &plan.devices[..])
    }

    /// The scenario of this kind. With a plan, both kinds end at its terminal: RB starts there too, RD starts at the
    /// open cell farthest from it that leaves half of the battery for a detour.
    #[must_use]
    pub fn scenario(&self, kind: ScenarioKind) -> Scenario {
        let city = self.world.city();
        let Some(plan) = &self.plan else { return kind.scenario().in_city(city) };
        let farthest = || {
            let reach = (plan.battery.0 / 2.0) as u32;
            let near = city.open_cells().iter().copied();
            near.filter(|cell| cell.manhattan(plan.terminal) <= reach)
                .max_by_key(|cell| (cell.manhattan(plan.terminal), std::cmp::Reverse((cell.y, cell.x))))
        };
        let start = match kind {
            ScenarioKind::ReturnBase => plan.terminal,
            ScenarioKind::ReachDestination => farthest().unwrap_or(plan.terminal),
        };
        Scenario { start, terminal: plan.terminal, battery: plan.battery, device_count: plan.devices.len() }
    }

    /// The evaluation realization of `scenario` with this seed. With a plan, all realizations have its devices and
    /// differ in the shadowing only.
    ///
    /// # Errors
    /// The scenario does not fit the city.
    pub fn realization(&self, scenario: &Scenario, seed: Seed) -> Result<Realization, ScenarioError> {
        match self.devices() {
            None => Realization::draw(self.world.city(), scenario, seed),
            Some(devices) => Realization::new(self.world.city(), scenario, devices.to_vec()),
        }
    }
}
