//! A mission with its incidents, drawn from a number.

use crate::autopilot::{AircraftFault, AutopilotKind, EnergyModel, VehicleMode, Wind};
use crate::intruder::Intrusion;
use crate::line::{Lane, LineFault};
use crate::operator::Switch;
use crate::radio_fault::RadioFault;
use crate::script::{ComputerFault, FlightScript, Incident, IncidentKind};
use crate::setup::MissionPlan;
use gleaner_pilot::Parameters;
use gleaner_units::{BatteryUnits, Duration};
use gleaner_world::{ScenarioKind, Seed, Stream};
use rand::{Rng, RngExt};

/// One flight of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The mission.
    pub plan: MissionPlan,
    /// Preference, switches, incidents.
    pub script: FlightScript,
}

/// Modes in which the human pilot takes the aircraft over.
const TAKE_OVERS: [VehicleMode; 6] = [
    VehicleMode::Stabilize,
    VehicleMode::AltitudeHold,
    VehicleMode::Hold,
    VehicleMode::Return,
    VehicleMode::Land,
    VehicleMode::Brake,
];
/// Highest value of `GLN_RESERVE`.
const RESERVE_MAX: f32 = 50.0;
/// Battery units of take-off and landing, which no decision pays for.
const UNPAID: f32 = 12.0;
/// Fault classes that [`draw_incidents`] draws from.
const CLASSES: u32 = 29;

impl Trial {
    /// The trial with this number: RD or RB, 1 to 12 devices (30 in one of sixteen), 60 to 120 battery units, up to
    /// three switches of the preference, and one or two fault classes, or none in one of eight. `calm` draws none.
    ///
    /// The reserve covers the energy that the incidents take. It is never below the default of `GLN_RESERVE`, which covers
    /// what a wind or a consumption that begins in flight takes until it is learned.
    #[must_use]
    pub fn draw(number: u64, autopilot: AutopilotKind, calm: bool) -> Trial {
        let mut rng = Seed::evaluation(number).rng(Stream::Choices);
        let rng = &mut rng;
        let kind = ScenarioKind::ALL[rng.random_range(0..ScenarioKind::ALL.len())];
        // Beyond the twelve that the policy sees at a time.
        let devices = if rng.random_ratio(1, 16) { 30 } else { rng.random_range(1..=12) };
        let wander_m = if rng.random() { 0.3 } else { 0.0 };
        let budget: u16 = rng.random_range(60..=120);
        let preference = weight(rng);
        let mut switches: Vec<Switch> = (0..rng.random_range(0..=3))
            .map(|_| Switch { after: seconds(rng, 1..=300), w_data: weight(rng) })
            .collect();
        switches.sort_by_key(|switch| switch.after);
        let mut incidents = Vec::new();
        let mut reserve = 0.0;
        let count = if calm { 0 } else { [0, 1, 1, 1, 1, 1, 2, 2][rng.random_range(0..8)] };
        for _ in 0..count {
            let drawn = draw_incidents(rng);
            let cost: f32 = drawn.iter().map(|incident| incident.kind.cost().0).sum();
            let more = if cost > 0.0 && reserve == 0.0 { cost + UNPAID } else { cost };
            if reserve + more <= RESERVE_MAX {
                reserve += more;
                incidents.extend(drawn);
            }
        }
        incidents.sort_by_key(|incident| incident.after);
        let reserve = Parameters::default().reserve().0.max(reserve);
        // Enough for the shortest mission, whatever is kept back.
        let battery = BatteryUnits(f32::from(budget).max(reserve + 40.0));
        let plan = MissionPlan {
            devices: Some(devices),
            battery: Some(battery),
            reserve: BatteryUnits(reserve),
            wander_m,
            autopilot,
            energy: EnergyModel::Nominal,
            ..MissionPlan::new(kind, number)
        };
        Trial { plan, script: FlightScript { preference, switches, incidents } }
    }

    /// The same flight with only some of its incidents, by their index.
    #[must_use]
    pub fn with_incidents(mut self, kept: &[usize]) -> Trial {
        let all = std::mem::take(&mut self.script.incidents);
        self.script.incidents =
            all.into_iter().enumerate().filter(|(index, _)| kept.contains(index)).map(|(_, i)| i).collect();
        self
    }

    /// The fault class of the flight: that of its incidents if they share one.
    #[must_use]
    pub fn class(&self) -> &'static str {
        let mut classes: Vec<&str> =
            self.script.incidents.iter().map(|incident| incident.kind.class()).collect();
        classes.sort_unstable();
        classes.dedup();
        match classes[..] {
            [] if self.plan.devices.is_some_and(|devices| devices > 12) => "many devices",
            [] => "none",
            ["pilot takes over", other] | [other, "pilot takes over"] if other != "second station" => other,
            [one] => one,
            _ => "several",
        }
    }
}

fn weight(rng: &mut impl Rng) -> f32 {
    f32::from(rng.random_range(0..=20_u8)) / 20.0
}

fn seconds(rng: &mut impl Rng, range: std::ops::RangeInclusive<u64>) -> Duration {
    Duration::from_secs(rng.random_range(range))
}

fn millis(rng: &mut impl Rng, range: std::ops::RangeInclusive<u64>) -> Duration {
    Duration::from_millis(rng.random_range(range))
}

/// Metres north and east: a distance from the range in a random one of eight directions.
fn offset(rng: &mut impl Rng, range: std::ops::RangeInclusive<u16>) -> [f32; 2] {
    let metres = f32::from(rng.random_range(range));
    let [north, east] =
        [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]][rng.random_range(0..8)];
    [metres * north as f32, metres * east as f32]
}

/// The incidents of one fault class.
fn draw_incidents(rng: &mut impl Rng) -> Vec<Incident> {
    let after = seconds(rng, 1..=250);
    let kind = draw_kind(rng);
    let mut incidents = vec![Incident { after, kind }];
    if needs_witness(&kind) && rng.random() {
        // Meanwhile the human pilot takes the aircraft over.
        let mode = TAKE_OVERS[rng.random_range(0..TAKE_OVERS.len())];
        let taken = after + millis(rng, 100..=4_000);
        incidents.push(Incident { after: taken, kind: IncidentKind::pilot_selects(mode) });
    }
    if matches!(kind, IncidentKind::Aircraft(AircraftFault::PilotSelects(_))) && rng.random() {
        // Selecting GUIDED again is no request to engage; the human pilot notices that nothing flies the aircraft.
        let given = after + seconds(rng, 5..=30);
        incidents.push(Incident { after: given, kind: IncidentKind::pilot_selects(VehicleMode::Guided) });
        incidents.push(Incident { after: given + seconds(rng, 5..=30), kind });
        if rng.random() {
            // A ground station repeats the request to engage of long ago.
            let kind = IncidentKind::Intrusion(Intrusion::Retransmission, Duration::from_secs(3));
            incidents.push(Incident { after: given + Duration::from_secs(2), kind });
        }
    }
    incidents
}

/// Faults during which a take-over is dangerous: the pilot may not see it.
const fn needs_witness(kind: &IncidentKind) -> bool {
    matches!(
        kind,
        IncidentKind::Line(LineFault::Cut(_) | LineFault::Delay(_) | LineFault::AcksLost, _)
            | IncidentKind::Computer(_)
    )
}

fn draw_kind(rng: &mut impl Rng) -> IncidentKind {
    use AircraftFault as Aircraft;
    let lasts = seconds(rng, 1..=30);
    match rng.random_range(0..CLASSES) {
        0 | 1 => IncidentKind::pilot_selects(TAKE_OVERS[rng.random_range(0..TAKE_OVERS.len())]),
        2 => IncidentKind::Aircraft(Aircraft::Fence(f32::from(rng.random_range(100..=600_u16)))),
        3 => IncidentKind::Aircraft(Aircraft::Voltage(10.2)),
        4 => {
            let units = f32::from(rng.random_range(1..=20_u8));
            IncidentKind::Aircraft(Aircraft::ChargeLost(BatteryUnits(units)))
        }
        5 => IncidentKind::Aircraft(Aircraft::BatteryUnknown(seconds(rng, 5..=60))),
        6 => {
            let factor = f32::from(rng.random_range(7..=25_u8)) / 10.0;
            IncidentKind::Aircraft(Aircraft::Consumption(factor))
        }
        7 => {
            let velocity_mps = offset(rng, 2..=9);
            let gust_mps = f32::from(rng.random_range(0..=4_u8));
            IncidentKind::Aircraft(Aircraft::Wind(Wind { velocity_mps, gust_mps }))
        }
        8 => IncidentKind::Aircraft(Aircraft::Reboot),
        9 => IncidentKind::Aircraft(Aircraft::EstimatorUntrusted(millis(rng, 200..=10_000))),
        10 => IncidentKind::Aircraft(Aircraft::OriginShift(offset(rng, 5..=60))),
        11 => {
            let jump = offset(rng, 5..=60);
            IncidentKind::Aircraft(Aircraft::PositionJump(jump, millis(rng, 500..=15_000)))
        }
        12 => IncidentKind::Aircraft(Aircraft::AltitudeLoss(f32::from(rng.random_range(5..=30_u8)))),
        13 => IncidentKind::Line(LineFault::Cut(None), lasts),
        14 => IncidentKind::Line(LineFault::Cut(Some(Lane::Up)), lasts),
        15 => IncidentKind::Line(LineFault::Cut(Some(Lane::Down)), lasts),
        16 => IncidentKind::Line(LineFault::Noise([30, 100, 1000][rng.random_range(0..3)]), lasts),
        17 => IncidentKind::Line(LineFault::Delay(millis(rng, 50..=400)), lasts),
        18 => IncidentKind::Line(LineFault::Duplication(rng.random_range(1..=5)), lasts),
        19 => IncidentKind::Line(LineFault::Reordering(rng.random_range(2..=10)), lasts),
        20 => IncidentKind::Line(LineFault::AcksLost, seconds(rng, 10..=300)),
        21 => IncidentKind::Computer(ComputerFault::Stall(millis(rng, 200..=8_000))),
        22 => IncidentKind::Computer(ComputerFault::Restart(millis(rng, 500..=8_000))),
        23 => IncidentKind::Intrusion(Intrusion::SecondVehicle, seconds(rng, 20..=200)),
        24 => {
            let at = offset(rng, 20..=120);
            IncidentKind::Intrusion(Intrusion::OtherStation(at), seconds(rng, 8..=30))
        }
        25 => IncidentKind::Intrusion(Intrusion::Hostile, seconds(rng, 10..=120)),
        26 => match rng.random::<bool>() {
            true => IncidentKind::Intrusion(Intrusion::ParameterStorm, seconds(rng, 5..=30)),
            false => IncidentKind::Intrusion(Intrusion::Retransmission, seconds(rng, 2..=10)),
        },
        27 => IncidentKind::Radio(RadioFault::Silent, lasts),
        _ => {
            let fault = match rng.random_range(0..6) {
                0 => RadioFault::Stale(rng.random_range(20..=120)),
                1 => RadioFault::Repeated(rng.random_range(2..=20)),
                2 => RadioFault::LyingEmpty,
                3 => RadioFault::LyingFull,
                4 => RadioFault::LyingStrong,
                _ => RadioFault::Unknown(rng.random_range(1..=100)),
            };
            IncidentKind::Radio(fault, seconds(rng, 5..=120))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn draw(number: u64, calm: bool) -> Trial {
        Trial::draw(number, AutopilotKind::ArduPilot, calm)
    }

    #[test]
    fn a_number_always_draws_the_same_trial() {
        for number in 0..200 {
            let trial = draw(number, false);
            assert_eq!(trial, draw(number, false));
            assert!(trial.script.incidents.is_sorted_by_key(|incident| incident.after));
        }
    }

    #[test]
    fn every_fault_class_is_drawn() {
        let trials = (0..1500).map(|number| draw(number, false));
        let classes: HashSet<&str> =
            trials.flat_map(|trial| trial.script.incidents).map(|incident| incident.kind.class()).collect();
        assert_eq!(classes.len(), 31, "{classes:?}");
    }

    #[test]
    fn a_calm_trial_has_the_same_mission_without_incidents() {
        for number in 0..50 {
            let (calm, other) = (draw(number, true), draw(number, false));
            assert_eq!(calm.script.incidents, []);
            assert_eq!((calm.plan.kind, calm.plan.devices), (other.plan.kind, other.plan.devices));
        }
    }
}
