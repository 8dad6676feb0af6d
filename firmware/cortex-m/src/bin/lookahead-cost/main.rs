//! What the parts of a decision cost on the board, and what look-ahead would: a program for the emulator, which prints
//! ticks of the system timer by semihosting. `tests/tests/lookahead_cost.rs` runs it. It is not flashed.
//!
//! Twelve devices, 40 x 30 cells, 100 tours per decision. The first line calibrates: a million instructions.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use gleaner_cortex_m::Cause;
use gleaner_cortex_m::bare::end;
use gleaner_guard::Guard;
use gleaner_link::{Component, Parameters, PositionTarget, Settings};
use gleaner_lookahead::{Budget, ChannelModel, FitSettings, LookAhead, View};
use gleaner_policy::{ChannelOffset, DeviceState, Preference, Situation, Tokens};
use gleaner_units::{
    Action, ActionMask, BatteryUnits, Cell, CellSet, Db, Duration, Grid, HeightMap, Instant, Metres, Ned,
    Rays, Sight,
};
use heapless::String;
use static_cell::StaticCell;
// The vector table.
use stm32f4 as _;

const DEVICES: usize = 12;
const BUDGET: Budget = Budget { tours: 100 };
const DECISIONS: u8 = 6;
/// The timer counts down from here: 0.1 s.
const RELOAD: u32 = 0x00FF_FFFF;
/// Semihosting: write a string that ends with a zero; exit, because the application ended.
const WRITE0: u32 = 0x04;
const EXIT: u32 = 0x18;
const APPLICATION_EXIT: u32 = 0x2_0026;

/// Of an ArduCopter in GUIDED, from `firmware/link/tests/golden/packets.txt`.
const HEARTBEAT: [u8; 21] = [
    0xFD, 0x09, 0x00, 0x00, 0x07, 0x2A, 0x01, 0x00, 0x00, 0x00, 0x04, 0x00, 0x00, 0x00, 0x02, 0x03, 0xD9,
    0x04, 0x03, 0x5B, 0x10,
];
/// `LOCAL_POSITION_NED` of the same vehicle.
const POSITION: [u8; 40] = [
    0xFD, 0x1C, 0x00, 0x00, 0x07, 0x2A, 0x01, 0x20, 0x00, 0x00, 0x40, 0xE2, 0x01, 0x00, 0x00, 0x00, 0x48,
    0x41, 0x00, 0x00, 0x09, 0xC2, 0x00, 0x00, 0x70, 0xC2, 0x00, 0x00, 0xC0, 0x3F, 0x00, 0x00, 0x20, 0xC0,
    0x00, 0x00, 0x80, 0x3E, 0x2A, 0xBC,
];
const MESSAGES: usize = 5;

static PLANNER: StaticCell<LookAhead<DEVICES>> = StaticCell::new();
static HEIGHTS: StaticCell<HeightMap> = StaticCell::new();
static GUARD: StaticCell<Guard> = StaticCell::new();
static COMPONENT: StaticCell<Component> = StaticCell::new();

fn print(name: &str, value: u32) {
    let mut line = String::<48>::new();
    let _ = writeln!(line, "{name} {value}");
    let _ = line.push('\0');
    // SAFETY: the string ends with a zero and outlives the call.
    unsafe { cortex_m::asm::semihosting_syscall(WRITE0, line.as_ptr() as u32) };
}

/// Ticks that the work takes.
fn ticks(work: impl FnOnce()) -> u32 {
    let begun = SYST::get_current();
    work();
    begun.wrapping_sub(SYST::get_current()) & RELOAD
}

fn measure() -> Option<()> {
    print("million", ticks(|| cortex_m::asm::delay(1_000_000)));
    let grid = Grid::new(40, 30, Metres(20.0)).ok()?;
    let heights = HEIGHTS.try_init(HeightMap::flat(grid))?;
    for (index, cell) in grid.cells().enumerate() {
        if index % 3 == 0 {
            heights.set(cell, 10 + (index % 40) as u8);
        }
    }
    let guard = Guard::new(&CellSet::full(grid), Cell::new(36, 20), BatteryUnits(2.0)).ok()?;
    let guard = GUARD.try_init(guard)?;
    let device = |index: i16| DeviceState {
        cell: Cell::new((7 * index + 3) % 40, (11 * index + 5) % 30),
        remaining: 6_000.0,
        snr: Some(Db(f32::from(index) - 4.0)),
    };
    let mut devices = heapless::Vec::<DeviceState, DEVICES>::new();
    for index in 0..DEVICES as i16 {
        let _ = devices.push(device(index));
    }
    let planner = PLANNER.try_init(LookAhead::new(ChannelModel::NOMINAL, FitSettings::DEFAULT))?;
    print("bytes", size_of::<LookAhead<DEVICES>>() as u32);
    let rays = Rays { heights, altitude_m: 60 };
    print("begin", ticks(|| planner.begin(Some(&rays as &dyn Sight), &devices, 1)));
    let (mut cell, mut battery) = (Cell::new(4, 6), 100.0);
    for slot in 0..DECISIONS {
        // A new report of each device: equal ones would be held ones.
        let change_db = if slot % 2 == 0 { 0.25 } else { -0.25 };
        for device in &mut devices {
            device.snr = device.snr.map(|snr| Db(snr.0 + change_db));
        }
        let view = View {
            cell,
            battery: BatteryUnits(battery),
            preference: Preference::DATA,
            guard,
            devices: &devices,
        };
        let situation = Situation {
            cell,
            battery: view.battery,
            spare: view.battery,
            terminal: Cell::new(36, 20),
            preference: view.preference,
            sight: &rays,
            channel: ChannelOffset::NONE,
        };
        print(
            "tokens",
            ticks(|| {
                let _ = black_box(Tokens::build(&situation, devices.iter().copied()));
            }),
        );
        let mut mask = ActionMask::default();
        print("mask", ticks(|| mask = black_box(guard.mask(cell, view.battery))));
        let mut action = Action::Hover;
        print(
            "decision",
            ticks(|| {
                let choice = planner.propose(&view, &[0.0; Action::COUNT], mask, BUDGET);
                action = choice.map_or(Action::Hover, |choice| choice.action);
            }),
        );
        cell = cell.after(action);
        battery -= if action == Action::Hover { 0.5 } else { 1.0 };
    }
    Some(())
}

/// One message read and taken in, and one target made, framed and handed out.
fn measure_wire() -> Option<()> {
    let settings = Settings::new(Some(42), 191).ok()?;
    let component = COMPONENT.try_init(Component::new(settings, Parameters::default()))?;
    let mut now = Instant::ZERO;
    component.receive(now, &HEARTBEAT);
    let target = PositionTarget::at(Ned { north_m: 10.0, east_m: -20.0, down_m: -60.0 });
    let mut out = [0; 280];
    for _ in 0..MESSAGES {
        now = now + Duration::from_millis(100);
        print("received", ticks(|| component.receive(now, &POSITION)));
        let mut length = 0;
        let work = || {
            let _ = component.steer(now, &target);
            length = component.transmit(&mut out);
        };
        print("sent", ticks(work));
        print("length", length as u32);
    }
    Some(())
}

/// The library needs it; there is no log here.
#[unsafe(no_mangle)]
fn gleaner_wake_log() {}

/// The library needs it; there is no transmitter here.
#[unsafe(no_mangle)]
fn gleaner_stop_transmitters() {}

#[entry]
fn main() -> ! {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(RELOAD);
        core.SYST.clear_current();
        core.SYST.enable_counter();
        let _ = measure();
        let _ = measure_wire();
        // SAFETY: ends the emulator.
        unsafe { cortex_m::asm::semihosting_syscall(EXIT, APPLICATION_EXIT) };
    }
    end(Cause::Panic { line: line!() })
}
