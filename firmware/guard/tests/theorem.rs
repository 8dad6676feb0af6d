//! The theorem of the crate's page: exhaustive on small grids, random walks on large ones.

use gleaner_guard::{Guard, GuardError};
use gleaner_units::{Action, BatteryUnits, Cell, CellSet, Grid, Metres};
use proptest::prelude::*;

fn grid(width: u16, height: u16) -> Grid {
    Grid::new(width, height, Metres(20.0)).unwrap()
}

/// Checks one state and returns the feasible states after each allowed action.
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

/// Checks every state that is reachable from a feasible start. The battery decreases with every action, so every sequence of
/// allowed actions ends on the terminal with b >= reserve.
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
fn theorem_holds_for_every_fence_of_a_3_by_3_grid() {
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
fn theorem_holds_on_open_grids() {
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
    /// Random walks of allowed actions on grids with random holes, battery levels and reserves, from a random feasible
    /// start to the terminal.
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
fn missions_may_start_on_the_terminal() {
    // The published predecessor allows only hovering when 0 < spare < 2 here, and never ends.
    let guard = Guard::new(&CellSet::full(grid(40, 30)), Cell::new(20, 15), BatteryUnits(0.0)).unwrap();
    let at_start = |battery| guard.mask(guard.terminal(), BatteryUnits(battery));
    assert!(!at_start(2.0).allows(Action::Hover), "after hovering, a move out and back is no longer covered");
    assert_eq!(at_start(2.0).len(), 4, "one move out and back");
    assert!(at_start(2.5).allows(Action::Hover));
    assert!(!guard.is_feasible(guard.terminal(), BatteryUnits(1.5)));
}

#[test]
fn infeasible_states_allow_only_homeward_moves() {
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
fn way_home_avoids_the_fence() {
    // A wall with a gap in the north.
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
fn invalid_envelopes_are_refused() {
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
fn enclosing_in_place_equals_a_new_guard() {
    let mut guard = Guard::closed();
    assert!(guard.mask(Cell::new(0, 0), BatteryUnits(100.0)).is_empty());
    guard.set_reserve(BatteryUnits(2.0)).unwrap();
    let large = CellSet::full(grid(40, 30));
    let mut small = CellSet::full(grid(7, 5));
    small.remove(Cell::new(3, 0));
    // The second is smaller: no state of the first may remain.
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
