//! A mission with whatever goes wrong in it, drawn from a number.

use crate::autopilot::CopterMode;
use crate::flight::{Incident, IncidentKind, Wishes};
use crate::mission::MissionPlan;
use crate::operator::Switch;
use crate::wires::WireFault;
use gleaner_units::{BatteryUnits, Duration};
use gleaner_world::{ScenarioKind, Seed, Stream};
use rand::{Rng, RngExt};

/// One flight of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The mission.
    pub plan: MissionPlan,
    /// Preference, switches, incidents.
    pub wishes: Wishes,
}

/// Modes in which the human pilot takes the aircraft over.
const TAKE_OVERS: [CopterMode; 6] = [
    CopterMode::Stabilize,
    CopterMode::AltHold,
    CopterMode::Loiter,
    CopterMode::Rtl,
    CopterMode::Land,
    CopterMode::Brake,
];
/// The most that `GLN_RESERVE` takes.
const RESERVE_MAX: f32 = 50.0;
/// Battery units that take-off and landing take from the pack and no decision pays for.
const UNPAID: f32 = 12.0;

impl Trial {
    /// The trial with this number: RD or RB, 1 to 12 devices, 60 to 120 battery units, up to three switches of the
    /// preference, and none, one or two incidents unless it is to be `calm`.
    ///
    /// Its reserve covers what the incidents take: nobody flies home without energy.
    #[must_use]
    pub fn draw(number: u64, calm: bool) -> Trial {
        let mut rng = Seed::evaluation(number).rng(Stream::Choices);
        let rng = &mut rng;
        let kind = ScenarioKind::ALL[rng.random_range(0..ScenarioKind::ALL.len())];
        let devices = rng.random_range(1..=12);
        let wander_m = if rng.random() { 0.3 } else { 0.0 };
        let budget: u16 = rng.random_range(60..=120);
        let preference = weight(rng);
        let mut switches: Vec<Switch> = (0..rng.random_range(0..=3))
            .map(|_| Switch { after: seconds(rng, 1..=300), w_data: weight(rng) })
            .collect();
        switches.sort_by_key(|switch| switch.after);
        let mut incidents = Vec::new();
        let mut reserve = 0.0;
        let wanted = if calm { 0 } else { [0, 1, 1, 2][rng.random_range(0..4)] };
        for _ in 0..wanted {
            let happens = happens(rng);
            let takes: f32 = happens.iter().map(|incident| incident.kind.takes().0).sum();
            let more = if takes > 0.0 && reserve == 0.0 { takes + UNPAID } else { takes };
            if reserve + more <= RESERVE_MAX {
                reserve += more;
                incidents.extend(happens);
            }
        }
        incidents.sort_by_key(|incident| incident.after);
        // Enough for the way, whatever is kept back.
        let battery = BatteryUnits(f32::from(budget).max(reserve + 40.0));
        let plan = MissionPlan {
            devices: Some(devices),
            battery: Some(battery),
            reserve: BatteryUnits(reserve),
            wander_m,
            ..MissionPlan::new(kind, number)
        };
        Trial { plan, wishes: Wishes { preference, switches, incidents } }
    }
}

fn weight(rng: &mut impl Rng) -> f32 {
    f32::from(rng.random_range(0..=20_u8)) / 20.0
}

fn seconds(rng: &mut impl Rng, range: std::ops::RangeInclusive<u64>) -> Duration {
    Duration::from_secs(rng.random_range(range))
}

/// An incident, and what belongs to it.
fn happens(rng: &mut impl Rng) -> Vec<Incident> {
    let after = seconds(rng, 1..=250);
    let fails = |fault, rng: &mut _| IncidentKind::Wire(fault, seconds(rng, 1..=30));
    let kind = match rng.random_range(0..9) {
        0 => IncidentKind::PilotSelects(TAKE_OVERS[rng.random_range(0..TAKE_OVERS.len())]),
        1 => IncidentKind::Fence(f32::from(rng.random_range(100..=600_u16))),
        2 => IncidentKind::Voltage(10.2),
        3 => IncidentKind::LosesBattery(BatteryUnits(f32::from(rng.random_range(1..=20_u8)))),
        4 => IncidentKind::AutopilotReboots,
        5 => IncidentKind::EstimatorFails(Duration::from_millis(rng.random_range(200..=10_000))),
        6 => fails(WireFault::LineCut, rng),
        8 => fails(WireFault::RadioSilent, rng),
        _ => {
            let one_in = [30, 100, 1000][rng.random_range(0..3)];
            fails(WireFault::LineNoise(one_in), rng)
        }
    };
    let mut incidents = vec![Incident { after, kind }];
    if matches!(kind, IncidentKind::PilotSelects(_)) && rng.random() {
        // Giving GUIDED back is no request to engage; the human pilot sees that nobody flies.
        let given = after + seconds(rng, 5..=30);
        let back = IncidentKind::PilotSelects(CopterMode::Guided);
        incidents.push(Incident { after: given, kind: back });
        incidents.push(Incident { after: given + seconds(rng, 5..=30), kind });
    }
    incidents
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn the_same_number_is_the_same_trial_and_all_kinds_come() {
        let names: HashSet<&str> = (0..200)
            .flat_map(|number| {
                let trial = Trial::draw(number, false);
                assert_eq!(trial, Trial::draw(number, false));
                assert!(trial.wishes.incidents.is_sorted_by_key(|incident| incident.after));
                trial.wishes.incidents.into_iter().map(|incident| incident.kind.name())
            })
            .collect();
        assert_eq!(names.len(), 9, "{names:?}");
    }

    #[test]
    fn a_calm_trial_has_the_same_place_and_devices_and_no_incidents() {
        for number in 0..50 {
            let (calm, other) = (Trial::draw(number, true), Trial::draw(number, false));
            assert_eq!(calm.wishes.incidents, []);
            assert_eq!((calm.plan.kind, calm.plan.devices), (other.plan.kind, other.plan.devices));
        }
    }
}
