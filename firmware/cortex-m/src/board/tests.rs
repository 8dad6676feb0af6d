//! Everything that follows a poll, on a host double of a board.

use super::*;
use crate::doubles::{Controller, Delay, Input, Output};
use core::cell::Cell as StdCell;
use gleaner_pilot::{Mission, Settings};
use gleaner_policy::{Inference, Policy, SelfTestError, Tokens};
use gleaner_units::{BatteryUnits, Cell, CellSet, Degrees, GeoPoint, Grid, GridPose, HeightMap, Metres};
use std::thread_local;

thread_local! {
    /// `None` before the watchdog was started.
    static FEEDS: StdCell<Option<u32>> = const { StdCell::new(None) };
}

/// A board on a host.
struct Double;

impl Board for Double {
    type Flash = Controller;
    type Delay = Delay;
    type Led = Output;
    type Inhibit = Input;

    const LED_LIGHTS: PinState = PinState::Low;
    const INHIBIT_PERMITS: PinState = PinState::Low;

    fn start_watchdog() {
        FEEDS.set(Some(0));
    }

    fn feed_watchdog() {
        FEEDS.set(Some(FEEDS.get().expect("fed before it was started") + 1));
    }
}

struct NoEngine;

impl Policy for NoEngine {
    type Error = ();
    fn infer(&mut self, _: &Tokens) -> Result<Inference, ()> {
        Err(())
    }
}

fn pilot(parameters: &Parameters) -> Onboard<NoEngine> {
    let grid = Grid::new(4, 3, Metres(20.0)).unwrap();
    let mission = Mission {
        heights: HeightMap::flat(grid),
        fence: CellSet::full(grid),
        pose: GridPose { corner: GeoPoint { lat_deg_e7: 0, lon_deg_e7: 0 }, rotation: Degrees(0.0) },
        terminal: Cell::new(3, 1),
        budget: BatteryUnits(80.0),
        devices: heapless::Vec::new(),
    };
    let tested: Result<(), SelfTestError> = Ok(());
    Onboard::new(mission, parameters.clone(), Settings::default(), NoEngine, tested).unwrap()
}

#[test]
fn each_poll_feeds_the_watchdog_and_shows_the_inhibit_input() {
    let (led, line) = (Output::new(), Input::new(Some(PinState::High)));
    let parts = Parts::<Double> {
        reset_flags: ResetFlags::default(),
        flash: Controller::new(),
        delay: Delay::new(),
        led: led.clone(),
        inhibit: line.clone(),
    };
    let (mut services, notice) = Services::open(parts);
    assert_eq!(notice, None);
    assert_eq!(led.written(), [PinState::Low], "lit during boot");
    let mut onboard = pilot(services.parameters());
    Double::start_watchdog();
    // Two seconds at the rate of the decision loop; returns the number of flashes.
    let mut run = |from: u64| {
        let before = led.written().len();
        for tick in 0..100 {
            let now = Instant::from_millis(from + tick * 20);
            onboard.poll(now);
            assert!(!services.poll(now, &mut onboard), "nothing is commanded");
        }
        led.written()[before..].iter().filter(|&&level| level == PinState::Low).count()
    };
    run(100);
    assert_eq!(run(2100), 3, "inhibited");
    line.set(Some(PinState::Low));
    run(4100);
    assert_eq!(run(6100), 1, "idle");
    assert_eq!(FEEDS.get(), Some(400));
}
