//! From reset to the endless main loop, the same on every board.

use super::log::Defmt;
use super::{fault, flash, lines, now};
use crate::{Cause, Keeper, LastWords, ResetFlags, Runtime, Timed};
use core::fmt;
use embedded_storage::nor_flash::NorFlash;
use gleaner_link::Severity;
use gleaner_pilot::{Mission, Onboard, Parameters, Settings, State, mission_image};
use gleaner_policy::native::{BlobError, Model, NativePolicy, Workspace};
use gleaner_policy::{Inference, Policy, SelfTestError, Tokens, self_test};
use gleaner_units::{BatteryUnits, Cell, CellSet, GeoPoint, Grid, HeightMap, Metres};
use heapless::Vec;
use static_cell::{ConstStaticCell, StaticCell};

/// What a board lends to the pilot.
pub trait Board {
    /// The flash for the parameters.
    type Flash: NorFlash;

    /// What the reset controller remembers of the last reset.
    fn reset_flags(&self) -> ResetFlags;
    /// The flash.
    fn flash(self) -> Self::Flash;
    /// Starts the watchdog: from now on a second without a feed is a reset.
    fn start_watchdog();
    /// Feeds the watchdog. Called after each poll of the pilot, and from nowhere else.
    fn feed_watchdog();
}

/// The engine, or none where the model is damaged.
struct Engine(Option<NativePolicy<'static>>);

impl Policy for Engine {
    type Error = ();

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        self.0.as_mut().ok_or(())?.infer(tokens).map_err(|_| ())
    }
}

static WORKSPACE: ConstStaticCell<Workspace> = ConstStaticCell::new(Workspace::new());
static ONBOARD: StaticCell<Onboard<Timed<Engine>>> = StaticCell::new();

/// Flies, for ever.
pub fn fly<B: Board>(board: B) -> ! {
    let before = fault::last_words().told(board.reset_flags());
    fault::keep(LastWords::alive(false));
    let (mut keeper, news) = Keeper::open(board.flash());
    let (onboard, doubts) = boot(keeper.saved());
    defmt::info!("gleaner {=str} boots", env!("CARGO_PKG_VERSION"));
    if let Some(before) = before {
        onboard.say(Severity::Critical, format_args!("gleaner: {before}"));
    }
    for doubt in &doubts {
        onboard.say(Severity::Critical, format_args!("gleaner: {doubt}"));
    }
    if let Some(news) = news {
        onboard.say(Severity::Warning, format_args!("{news}"));
    }
    let mut runtime = Runtime::new(onboard, lines::link(), lines::radio());
    B::start_watchdog();
    loop {
        if runtime.pass(now(), lines::losses(), &mut Defmt) {
            B::feed_watchdog();
            let onboard = runtime.onboard();
            fault::keep(LastWords::alive(matches!(onboard.state(), State::Engaged | State::Homing)));
            let (parameters, state) = (onboard.parameters(), onboard.state());
            if let Some(news) = keeper.poll(now(), parameters, state) {
                onboard.say(Severity::Warning, format_args!("{news}"));
            }
        }
        cortex_m::asm::wfi();
    }
}

/// Why the pilot speaks but does not fly.
enum Doubt {
    Mission(mission_image::ImageError),
    Impossible,
    Model(BlobError),
    SelfTest,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Doubt::Mission(error) => write!(f, "{}, flash one", error.text()),
            Doubt::Impossible => f.write_str("mission cannot be flown, flash one"),
            Doubt::Model(error) => write!(f, "model: {error}"),
            Doubt::SelfTest => f.write_str("model fails its own examples, flash one"),
        }
    }
}

/// The pilot with mission and model, and what there is against it. Its frame is gone when the main loop begins.
#[inline(never)]
fn boot(parameters: &Parameters) -> (&'static mut Onboard<Timed<Engine>>, Vec<Doubt, 3>) {
    let mut doubts = Vec::new();
    let mut engine = Engine(None);
    let (Some(workspace), Some(place)) = (WORKSPACE.try_take(), ONBOARD.try_uninit()) else {
        fault::end(Cause::Panic { line: line!() })
    };
    let tested = match Model::read(flash::model()) {
        Ok(model) => {
            let mut policy = NativePolicy::new(model, workspace);
            let tested = self_test(&mut policy, model.goldens());
            if tested.is_err() {
                let _ = doubts.push(Doubt::SelfTest);
            }
            engine = Engine(Some(policy));
            tested
        }
        Err(error) => {
            let _ = doubts.push(Doubt::Model(error));
            Err(SelfTestError::NoGolden)
        }
    };
    let mission = match mission_image::decode(flash::mission()) {
        Ok(mission) if mission.check().is_ok() => Some(mission),
        Ok(_) => {
            let _ = doubts.push(Doubt::Impossible);
            None
        }
        Err(error) => {
            let _ = doubts.push(Doubt::Mission(error));
            None
        }
    };
    let tested = if mission.is_some() { tested } else { Err(SelfTestError::NoGolden) };
    let Some(mission) = mission.or_else(nowhere) else { fault::end(Cause::Panic { line: line!() }) };
    let engine = Timed::new(engine, now);
    match Onboard::new(mission, parameters.clone(), Settings::default(), engine, tested) {
        Ok(onboard) => (place.write(onboard), doubts),
        Err(_) => fault::end(Cause::Panic { line: line!() }),
    }
}

/// The smallest mission, flown by nobody: without a mission of its own the pilot still speaks, but its self-test
/// counts as failed.
fn nowhere() -> Option<Mission> {
    let grid = Grid::new(2, 1, Metres(20.0)).ok()?;
    Some(Mission {
        heights: HeightMap::flat(grid),
        fence: CellSet::full(grid),
        corner: GeoPoint { lat_deg_e7: 0, lon_deg_e7: 0 },
        terminal: Cell::new(0, 0),
        budget: BatteryUnits(1.0),
        devices: Vec::new(),
    })
}
