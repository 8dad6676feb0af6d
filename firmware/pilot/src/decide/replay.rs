//! Decisions with look-ahead, made again from a log.
//!
//! The look-ahead keeps a plan and a channel fit from slot to slot. A log therefore holds the mission with the first
//! decision of each mission, and with every decision what the look-ahead was given. Equal inputs in equal order give
//! equal choices, bit by bit.

use super::{
    Deliberator, LoggedDecision, LoggedLookAhead, LoggedMission, LookAheadRecord, LookingAhead, Place,
};
use gleaner_guard::Guard;
use gleaner_lookahead::Budget;
use gleaner_policy::{DeviceState, Inference, Policy, Preference, Tokens};
use gleaner_units::{Action, BatteryUnits, Cell, Db, HeightMap, Rays, Sight};

/// A decision made again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Replayed {
    /// The look-ahead's answer.
    Choice(Action, LookAheadRecord),
    /// The log begins in flight, or an earlier decision of the mission is missing.
    Incomplete,
}

/// Makes the decisions of a log again, in order.
#[derive(Debug, Default)]
pub struct LookAheadReplay {
    mission: Option<UnderWay>,
}

#[derive(Debug)]
struct UnderWay {
    run_s: u64,
    planner: LookingAhead<NoNetwork>,
    mission: LoggedMission,
    heights: HeightMap,
    guard: Guard,
    next: u16,
}

/// Stands where the network's logits come from the log.
#[derive(Debug)]
struct NoNetwork;

impl Policy for NoNetwork {
    type Error = ();

    fn infer(&mut self, _: &Tokens) -> Result<Inference, ()> {
        Err(())
    }
}

impl LookAheadReplay {
    /// Makes one decision again, with these logits of the network. To be called for every decision with look-ahead, in
    /// the order of the log.
    pub fn decide(
        &mut self,
        logged: &LoggedDecision,
        entry: &LoggedLookAhead,
        logits: &[f32; Action::COUNT],
    ) -> Replayed {
        if let Some(mission) = &entry.mission {
            self.mission = UnderWay::begin(logged.run_s, mission.clone(), entry);
        }
        let record = &entry.record;
        let follows =
            |under_way: &&mut UnderWay| under_way.run_s == logged.run_s && under_way.next == record.slot;
        match self.mission.as_mut().filter(follows).and_then(|it| it.decide(logged, entry, logits)) {
            Some((action, record)) => Replayed::Choice(action, record),
            None => {
                self.mission = None;
                Replayed::Incomplete
            }
        }
    }
}

impl UnderWay {
    fn begin(run_s: u64, mission: LoggedMission, entry: &LoggedLookAhead) -> Option<UnderWay> {
        let (heights, guard) = mission.restore()?;
        let rays = Rays { heights: &heights, altitude_m: mission.altitude_m };
        let has_map = heights.tallest().0 > 0.0;
        let mut planner = LookingAhead::new(NoNetwork, Budget::NONE);
        planner.begin(has_map.then_some(&rays as &dyn Sight), mission.sites(), entry.record.seed);
        Some(UnderWay { run_s, planner, mission, heights, guard, next: 0 })
    }

    fn decide(
        &mut self,
        logged: &LoggedDecision,
        entry: &LoggedLookAhead,
        logits: &[f32; Action::COUNT],
    ) -> Option<(Action, LookAheadRecord)> {
        self.guard.set_reserve(BatteryUnits(entry.reserve)).ok()?;
        let [x, y] = logged.cell;
        let place = Place {
            cell: Cell::new(x, y),
            battery: BatteryUnits(logged.battery),
            preference: Preference::new(logged.w_data)?,
            guard: &self.guard,
            sight: &Rays { heights: &self.heights, altitude_m: self.mission.altitude_m },
        };
        let devices = self.mission.sites().zip(&entry.devices).map(|(site, device)| DeviceState {
            remaining: device.remaining,
            snr: device.snr_db.map(Db),
            ..site
        });
        self.planner.set_budget(Budget { tours: entry.record.budget });
        self.next = self.next.saturating_add(1);
        self.planner.propose(&place, devices, logits, logged.mask, entry.record.budget > 0)
    }
}
