//! The theorem of the crate's page, by exhaustion on small grids and by random walks on large ones.

use gleaner_guard::{Guard, GuardError};
use gleaner_units::{Action, BatteryUnits, Cell, CellSet, Grid, Metres};
use proptest::prelude::*;

fn grid(width: u16, height: u16) -> Grid {
    Grid::new(width, height, Metres(20.0)).unwrap()
}

/// What must hold in one state; returns the feasible states that allowed actions lead to.
fn check_state(guard: &Guard, cell: Cell, battery: f32) -> Vec<(Cell, f32)> {
    assert!(guard.is_feasible(cell, BatteryUnits(battery)), "{cell} {battery}");
    let mask = guard.mask(cell, BatteryUnits(battery));
    assert!(!mask.is_empty(), "no action at {cell} with {battery}");
    let mut next_states = Vec::new();
    for action in mask.iter() {
        let next = cell.after(action);
        let left = battery - action.cost().0;
        assert!(guard.grid().contains(next), "{action:?} leaves the map at {cell}");
        assert!(guard.distance(next).is_some(), "{action:?} leaves the fence at {cell}");
        assert!(left >= guard.reserve().0, "{action:?} eats the reserve at {cell} with {battery}");
        if !(action != Action::Hover && next == guard.terminal()) {
            assert!(
                guard.is_feasible(next, BatteryUnits(left)),
                "{action:?} at {cell} with {battery} leads to a dead end"
            );
            next_states.push((next, left));
        }
    }
    next_states
}

/// Every state reachable from every feasible start: each is feasible and has an allowed action, and the battery
/// falls with every action, so every sequence of allowed actions ends on the terminal with b >= reserve.
fn exhaust(fence: &CellSet, terminal: Cell, reserve: f32, battery_half_units: u16) {
    let Ok(guard) = Guard::new(fence, terminal, BatteryUnits(reserve)) else { return };
    let grid = fence.grid();
    let levels = usize::from(battery_half_units) + 1;
    let mut seen = vec![false; grid.len() * levels];
    let mut stack: Vec<(Cell, f32)> = Vec::new();
    for cell in grid.cells() {
        for level in 0..levels {
            let battery = level as f32 / 2.0;
            if guard.is_feasible(cell, BatteryUnits(battery)) {
                stack.push((cell, battery));
            }
        }
    }
    while let Some((cell, battery)) = stack.pop() {
        let place = grid.index(cell).unwrap() * levels + (battery * 2.0) as usize;
        if !std::mem::replace(&mut seen[place], true) {
            stack.extend(check_state(&guard, cell, battery));
        }
    }
}

#[test]
fn every_state_of_every_fence_of_a_3_by_3_grid() {
    let grid = grid(3, 3);
    for fence_bits in 0u32..512 {
        let mut fence = CellSet::empty(grid);
        for (bit, cell) in grid.cells().enumerate() {
            if fence_bits & (1 << bit) != 0 {
                fence.insert(cell);
            }
        }
        for terminal in grid.cells() {
            exhaust(&fence, terminal, 0.0, 24);
            exhaust(&fence, terminal, 1.5, 24);
        }
    }
}

#[test]
fn every_state_of_open_grids() {
    for (width, height) in [(1, 2), (2, 1), (1, 7), (4, 3), (5, 5)] {
        let fence = CellSet::full(grid(width, height));
        for terminal in fence.grid().cells() {
            for reserve in [0.0, 0.5, 2.0, 3.3] {
                exhaust(&fence, terminal, reserve, 40);
            }
        }
    }
}

proptest! {
    /// Random walks over the full grid with random holes, odd batteries and reserves, from a random feasible
    /// start, choosing among the allowed actions by a random stream until the terminal is entered.
    #[test]
    fn random_walks_end_on_the_terminal(
        holes in prop::collection::vec((0i16..40, 0i16..30), 0..400),
        terminal in (0i16..40, 0i16..30),
        start in (0i16..40, 0i16..30),
        reserve in 0.0f32..10.0,
        spare in 0.0f32..60.0,
        choices in prop::collection::vec(0usize..5, 64),
    ) {
        let mut fence = CellSet::full(grid(40, 30));
        for (x, y) in holes {
            fence.remove(Cell::new(x, y));
        }
        let (terminal, mut cell) = (Cell::new(terminal.0, terminal.1), Cell::new(start.0, start.1));
        let Ok(guard) = Guard::new(&fence, terminal, BatteryUnits(reserve)) else { return Ok(()) };
        let Some(needed) = guard.way_home(cell) else { return Ok(()) };
        // The next float up: the sum of needed and reserve may round down.
        let mut battery = (needed.0 + reserve + spare).next_up();
        let mut choices = choices.iter().cycle();
        let mut steps = 0;
        loop {
            prop_assert!(guard.is_feasible(cell, BatteryUnits(battery)));
            let allowed: Vec<Action> = guard.mask(cell, BatteryUnits(battery)).iter().collect();
            prop_assert!(!allowed.is_empty());
            let action = allowed[choices.next().unwrap() % allowed.len()];
            cell = cell.after(action);
            battery -= action.cost().0;
            prop_assert!(fence.contains(cell));
            prop_assert!(battery >= reserve);
            if action != Action::Hover && cell == terminal {
                break;
            }
            steps += 1;
            prop_assert!(steps < 3000);
        }
    }
}

#[test]
fn starting_on_the_terminal_is_no_trap() {
    // The published predecessor allows only hovering when 0 < spare < 2 here, and never ends.
    let guard = Guard::new(&CellSet::full(grid(40, 30)), Cell::new(20, 15), BatteryUnits(0.0)).unwrap();
    let at_start = |battery| guard.mask(guard.terminal(), BatteryUnits(battery));
    assert!(!at_start(2.0).allows(Action::Hover), "hovering would leave too little to go out and back");
    assert_eq!(at_start(2.0).len(), 4, "out to any side and back");
    assert!(at_start(2.5).allows(Action::Hover));
    assert!(!guard.is_feasible(guard.terminal(), BatteryUnits(1.5)));
}

#[test]
fn an_infeasible_state_goes_straight_home() {
    let guard = Guard::new(&CellSet::full(grid(40, 30)), Cell::new(30, 18), BatteryUnits(2.0)).unwrap();
    for battery in [0.0, 20.0, f32::NAN, f32::NEG_INFINITY] {
        let mask = guard.mask(Cell::new(10, 6), BatteryUnits(battery));
        assert_eq!(mask.iter().collect::<Vec<_>>(), [Action::North, Action::East], "{battery}");
    }
    assert_eq!(guard.homeward(Cell::new(10, 18)), Some(Action::East));
    assert_eq!(guard.homeward(Cell::new(30, 18)), None);
    assert!(guard.mask(Cell::new(-1, 0), BatteryUnits(80.0)).is_empty());
}

#[test]
fn the_way_home_goes_around_a_fence() {
    // A wall with one gap in the north.
    let grid = grid(5, 5);
    let mut fence = CellSet::full(grid);
    for y in 0..4 {
        fence.remove(Cell::new(2, y));
    }
    let guard = Guard::new(&fence, Cell::new(4, 0), BatteryUnits(0.0)).unwrap();
    assert_eq!(guard.distance(Cell::new(0, 0)), Some(12));
    assert_eq!(guard.spare(Cell::new(0, 0), BatteryUnits(15.0)), Some(BatteryUnits(3.0)));
    assert_eq!(guard.distance(Cell::new(2, 0)), None);
}

#[test]
fn impossible_envelopes_are_refused() {
    let full = CellSet::full(grid(3, 3));
    let terminal = Cell::new(1, 1);
    let error = |fence: &CellSet, reserve| Guard::new(fence, terminal, BatteryUnits(reserve)).unwrap_err();
    assert_eq!(error(&full, -1.0), GuardError::Reserve);
    assert_eq!(error(&full, f32::NAN), GuardError::Reserve);
    assert_eq!(error(&CellSet::empty(grid(3, 3)), 0.0), GuardError::TerminalOutsideFence);
    let mut lonely = CellSet::empty(grid(3, 3));
    lonely.insert(terminal);
    assert_eq!(error(&lonely, 0.0), GuardError::TerminalIsolated);
    let mut guard = Guard::new(&full, terminal, BatteryUnits(1.0)).unwrap();
    assert_eq!(guard.set_reserve(BatteryUnits(f32::INFINITY)), Err(GuardError::Reserve));
    assert_eq!(guard.reserve(), BatteryUnits(1.0));
}

#[test]
fn an_envelope_in_place_is_a_new_one_and_a_closed_one_allows_nothing() {
    let mut guard = Guard::closed();
    assert!(guard.mask(Cell::new(0, 0), BatteryUnits(100.0)).is_empty());
    guard.set_reserve(BatteryUnits(2.0)).unwrap();
    let large = CellSet::full(grid(40, 30));
    let mut small = CellSet::full(grid(7, 5));
    small.remove(Cell::new(3, 0));
    // The second is smaller: nothing of the first may be left.
    for (fence, terminal) in [(large, Cell::new(30, 18)), (small, Cell::new(0, 0))] {
        guard.enclose(&fence, terminal).unwrap();
        assert_eq!(guard.enclose(&fence, Cell::new(-1, 0)), Err(GuardError::TerminalOutsideFence));
        let fresh = Guard::new(&fence, terminal, BatteryUnits(2.0)).unwrap();
        for cell in grid(41, 31).cells() {
            assert_eq!(guard.distance(cell), fresh.distance(cell));
            assert_eq!(guard.mask(cell, BatteryUnits(20.0)), fresh.mask(cell, BatteryUnits(20.0)));
        }
        assert_eq!((guard.terminal(), guard.reserve()), (terminal, BatteryUnits(2.0)));
    }
}
