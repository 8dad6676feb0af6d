//! Whole missions under look-ahead, with the guard on, over a small city.

use gleaner_guard::Guard;
use gleaner_lookahead::{Budget, ChannelModel, Choice, FitSettings, LookAhead, Source, View};
use gleaner_policy::{DeviceState, Preference};
use gleaner_units::{Action, BatteryUnits, Cell, CellSet, Db, Grid, HeightMap, Metres, Rays, Sight};

const CHANNEL: ChannelModel = ChannelModel::NOMINAL;
const BUDGET: Budget = Budget { tours: 120 };
/// A network without an opinion: it hovers where that is allowed.
const LOGITS: [f32; Action::COUNT] = [1.0, 0.0, 0.0, 0.0, 0.0];

/// 20 x 15 cells with a wall, three devices, a fence without the two rows in the north.
struct Mission {
    heights: HeightMap,
    guard: Guard,
    cell: Cell,
    battery: f32,
    w_data: f32,
    devices: Vec<DeviceState>,
    over: bool,
}

impl Mission {
    fn new(start: Cell, terminal: Cell, battery: f32, w_data: f32) -> Mission {
        let grid = Grid::new(20, 15, Metres(20.0)).unwrap();
        let mut heights = HeightMap::flat(grid);
        for y in 3..10 {
            heights.set(Cell::new(9, y), 50);
        }
        let mut fence = CellSet::full(grid);
        for x in 0..20 {
            for y in [13, 14] {
                fence.remove(Cell::new(x, y));
            }
        }
        let guard = Guard::new(&fence, terminal, BatteryUnits(2.0)).unwrap();
        let device = |x, y| DeviceState { cell: Cell::new(x, y), remaining: 4_000.0, snr: None };
        let devices = vec![device(2, 12), device(14, 7), device(18, 1)];
        let mut mission = Mission { heights, guard, cell: start, battery, w_data, devices, over: false };
        mission.listen(0.0);
        mission
    }

    fn sight(&self) -> Rays<'_> {
        Rays { heights: &self.heights, altitude_m: 60 }
    }

    fn snr_db(&self, device: Cell) -> f32 {
        let (dx, dy) = (f32::from(device.x - self.cell.x), f32::from(device.y - self.cell.y));
        let distance_m = (400.0 * (dx * dx + dy * dy) + 3600.0).sqrt();
        CHANNEL.mean_snr_db(self.sight().sees(device, self.cell), distance_m.log10())
    }

    fn listen(&mut self, offset_db: f32) {
        let snr: Vec<f32> = self.devices.iter().map(|device| self.snr_db(device.cell) + offset_db).collect();
        for (device, snr_db) in self.devices.iter_mut().zip(snr) {
            device.snr = Some(Db(snr_db));
        }
    }

    fn view(&self) -> View<'_> {
        View {
            cell: self.cell,
            battery: BatteryUnits(self.battery),
            preference: Preference::new(self.w_data).unwrap(),
            guard: &self.guard,
            devices: &self.devices,
        }
    }

    fn begin(&self) -> LookAhead<4> {
        let mut lookahead = LookAhead::new(CHANNEL, FitSettings::DEFAULT);
        lookahead.begin(Some(&self.sight()), &self.devices, 7);
        lookahead
    }

    fn propose(&self, lookahead: &mut LookAhead<4>, budget: Budget) -> Choice {
        let mask = self.guard.mask(self.cell, BatteryUnits(self.battery));
        let choice = lookahead.propose(&self.view(), &LOGITS, mask, budget).unwrap();
        assert!(mask.allows(choice.action), "{choice:?} at {} is outside the mask", self.cell);
        choice
    }

    fn step(&mut self, action: Action, offset_db: f32) {
        let strongest = self.devices.iter_mut().filter(|device| device.remaining > 0.0).max_by(|a, b| {
            let snr_db = |device: &DeviceState| device.snr.map_or(f32::MIN, |snr| snr.0);
            snr_db(a).total_cmp(&snr_db(b))
        });
        if let Some(device) = strongest {
            let units = CHANNEL.units_per_slot(device.snr.map_or(f32::MIN, |snr| snr.0));
            device.remaining = (device.remaining - units).max(0.0);
        }
        self.cell = self.cell.after(action);
        self.battery -= action.cost().0;
        self.over = action != Action::Hover && self.cell == self.guard.terminal();
        self.listen(offset_db);
    }

    fn left(&self) -> f32 {
        self.devices.iter().map(|device| device.remaining).sum()
    }
}

/// Flies a mission to its end and returns its choices.
fn fly(mission: &mut Mission, budget: Budget, offset_db: f32) -> Vec<Choice> {
    mission.listen(offset_db);
    let mut lookahead = mission.begin();
    let mut choices = Vec::new();
    while !mission.over {
        let choice = mission.propose(&mut lookahead, budget);
        mission.step(choice.action, offset_db);
        choices.push(choice);
        assert!(choices.len() < 300, "the mission does not end");
    }
    assert!(mission.battery >= 2.0, "the reserve is kept");
    choices
}

#[test]
fn missions_end_on_the_terminal_inside_the_envelope() {
    for (start, terminal) in [((0, 0), (19, 12)), ((5, 5), (5, 5)), ((19, 12), (0, 12))] {
        for (battery, w_data) in [(36.0, 1.0), (60.0, 1.0), (45.0, 0.5), (60.0, 0.1)] {
            let [start, terminal] = [start, terminal].map(|(x, y)| Cell::new(x, y));
            fly(&mut Mission::new(start, terminal, battery, w_data), BUDGET, 0.0);
        }
    }
}

#[test]
fn with_energy_alone_the_shortest_way_is_flown() {
    for (start, terminal, least) in [((0, 0), (19, 12), 31.0), ((5, 5), (5, 5), 2.0)] {
        let [start, terminal] = [start, terminal].map(|(x, y)| Cell::new(x, y));
        let mut mission = Mission::new(start, terminal, 60.0, 0.0);
        fly(&mut mission, BUDGET, 0.0);
        assert_eq!(60.0 - mission.battery, least);
    }
}

#[test]
fn equal_inputs_give_equal_choices() {
    let once = || fly(&mut Mission::new(Cell::new(0, 0), Cell::new(19, 12), 60.0, 1.0), BUDGET, 0.0);
    assert_eq!(once(), once());
}

#[test]
fn expected_data_and_energy_come_true_without_noise() {
    let mut mission = Mission::new(Cell::new(0, 0), Cell::new(19, 12), 60.0, 1.0);
    let held = mission.left();
    let choices = fly(&mut mission, Budget { tours: 600 }, 0.0);
    let expected = choices[0].expected.unwrap();
    let (data, energy) = (held - mission.left(), 60.0 - mission.battery);
    assert!(data > 0.9 * held, "{data} of {held}");
    assert!(data >= 0.97 * expected.data_units, "{data} {expected:?}");
    assert!(energy <= 58.0, "{energy} {expected:?}");
    assert!(choices.iter().any(|choice| choice.source == Source::KeptPlan));
}

#[test]
fn the_network_decides_without_budget_map_or_trust() {
    let mission = Mission::new(Cell::new(0, 0), Cell::new(19, 12), 60.0, 1.0);
    let network = |choice: Choice| {
        assert_eq!((choice.action, choice.source), (Action::Hover, Source::Network));
        assert_eq!(choice.expected, None);
    };
    network(mission.propose(&mut mission.begin(), Budget::NONE));
    let mut blind = LookAhead::<4>::new(CHANNEL, FitSettings::DEFAULT);
    blind.begin(None, &mission.devices, 0);
    network(mission.propose(&mut blind, BUDGET));
    let mut small = LookAhead::<2>::new(CHANNEL, FitSettings::DEFAULT);
    small.begin(Some(&mission.sight()), &mission.devices, 0);
    let mask = mission.guard.mask(mission.cell, BatteryUnits(60.0));
    network(small.propose(&mission.view(), &LOGITS, mask, BUDGET).unwrap());

    // SNR that jumps by 60 dB from slot to slot is explained by no channel.
    let mut mission = mission;
    let mut lookahead = mission.begin();
    for slot in 0..100 {
        mission.listen(if slot % 2 == 0 { 30.0 } else { -30.0 });
        mission.propose(&mut lookahead, BUDGET);
    }
    assert!(!lookahead.fit().is_trusted(&FitSettings::DEFAULT), "{:?}", lookahead.fit());
    network(mission.propose(&mut lookahead, BUDGET));
}

#[test]
fn a_channel_offset_is_found_within_a_few_slots() {
    let mut mission = Mission::new(Cell::new(0, 0), Cell::new(19, 12), 60.0, 1.0);
    mission.listen(-6.0);
    let mut lookahead = mission.begin();
    for _ in 0..8 {
        let choice = mission.propose(&mut lookahead, BUDGET);
        mission.step(choice.action, -6.0);
    }
    assert!((lookahead.fit().offset_db() + 6.0).abs() < 1.5, "{:?}", lookahead.fit());
}

#[test]
fn two_reports_override_a_wrong_map() {
    let mission = Mission::new(Cell::new(7, 7), Cell::new(19, 12), 60.0, 1.0);
    // On board there are no buildings; the wall hides the second device.
    let flat = HeightMap::flat(mission.heights.grid());
    let mut lookahead = LookAhead::<4>::new(CHANNEL, FitSettings::DEFAULT);
    lookahead.begin(Some(&Rays { heights: &flat, altitude_m: 60 }), &mission.devices, 0);
    let is_hidden = |device: &&DeviceState| !mission.sight().sees(device.cell, mission.cell);
    let hidden = mission.devices.iter().filter(is_hidden).count() as u32;
    assert!((1..3).contains(&hidden), "{hidden}");
    mission.propose(&mut lookahead, BUDGET);
    assert_eq!(lookahead.overrides(), 0);
    for _ in 0..3 {
        mission.propose(&mut lookahead, BUDGET);
    }
    assert_eq!(lookahead.overrides(), hidden);
    assert!(lookahead.fit().offset_db().abs() < 2.0, "{:?}", lookahead.fit());
}

#[test]
fn what_if_shows_a_path_home_for_each_preference() {
    let mission = Mission::new(Cell::new(0, 0), Cell::new(19, 12), 60.0, 0.5);
    let mut lookahead = mission.begin();
    assert!(LookAhead::<4>::new(CHANNEL, FitSettings::DEFAULT).what_if(&mission.view(), BUDGET).is_none());
    let before = mission.propose(&mut lookahead, BUDGET);
    let outlooks = lookahead.what_if(&mission.view(), Budget { tours: 600 }).unwrap();
    assert_eq!(outlooks.each_ref().map(|outlook| outlook.w_data), [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert_eq!(outlooks[0].expected.energy, 31.0);
    assert!(outlooks[4].expected.data_units > outlooks[0].expected.data_units + 1_000.0);
    for outlook in &outlooks {
        assert_eq!(outlook.path[0].cell, mission.cell);
        assert_eq!(outlook.path.last().unwrap().cell, Cell::new(19, 12));
        // Legs are straight, and moves and hovers add up to the energy.
        let mut energy = 0.0;
        for pair in outlook.path.windows(2) {
            assert!(pair[0].cell.x == pair[1].cell.x || pair[0].cell.y == pair[1].cell.y, "{pair:?}");
            energy += pair[0].cell.manhattan(pair[1].cell) as f32;
        }
        energy += outlook.path.iter().map(|point| 0.5 * f32::from(point.slots)).sum::<f32>();
        assert_eq!(energy, outlook.expected.energy, "{outlook:?}");
        assert!(outlook.expected.energy <= 58.0);
    }
    // Asking changes no decision.
    let mut silent = mission.begin();
    assert_eq!(mission.propose(&mut silent, BUDGET), before);
    assert_eq!(mission.propose(&mut silent, BUDGET), mission.propose(&mut lookahead, BUDGET));
}
