//! From reset to the endless main loop, the same on every board.

use super::log::Defmt;
use super::{fault, flash, lines, now};
use crate::{Cause, Keeper, LastWords, ResetFlags, Runtime};
use core::fmt;
use core::mem::MaybeUninit;
use embedded_storage::nor_flash::NorFlash;
use gleaner_link::Severity;
use gleaner_pilot::{Onboard, Parameters, Settings, State, mission_image};
use gleaner_policy::native::{BlobError, Model, NativePolicy, Workspace};
use gleaner_policy::{Inference, Policy, SelfTestError, Timed, Tokens, self_test};
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
    let (keeper, news) = Keeper::open(board.flash());
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
    run::<B>(onboard, keeper)
}

/// The main loop. In a function of its own, so that its frame does not lie under those of the boot.
#[inline(never)]
fn run<B: Board>(onboard: &mut Onboard<Timed<Engine>>, mut keeper: Keeper<B::Flash>) -> ! {
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

/// The pilot with mission and model, and what there is against it. The pilot is built where it stays, and each step has
/// a frame that is gone before the next: the stack is shorter than a pilot is long.
#[inline(never)]
fn boot(parameters: &Parameters) -> (&'static mut Onboard<Timed<Engine>>, Vec<Doubt, 2>) {
    let mut doubts = Vec::new();
    let (Some(workspace), Some(place)) = (WORKSPACE.try_take(), ONBOARD.try_uninit()) else {
        fault::end(Cause::Panic { line: line!() })
    };
    let policy = engine(workspace).map_err(|doubt| doubts.push(doubt)).ok();
    let tested = if policy.is_some() { Ok(()) } else { Err(SelfTestError::NoGolden) };
    let onboard = ground(place, parameters.clone(), Engine(policy));
    if let Err(doubt) = load(onboard, tested) {
        let _ = doubts.push(doubt);
    }
    (onboard, doubts)
}

/// The engine, if it gives the answers that the model brings along.
#[inline(never)]
fn engine(workspace: &'static mut Workspace) -> Result<NativePolicy<'static>, Doubt> {
    let model = Model::read(flash::model()).map_err(Doubt::Model)?;
    let mut policy = NativePolicy::new(model, workspace);
    self_test(&mut policy, model.goldens()).map_err(|_| Doubt::SelfTest)?;
    Ok(policy)
}

/// A pilot without mission, in its place for good.
#[inline(never)]
fn ground(
    place: &'static mut MaybeUninit<Onboard<Timed<Engine>>>,
    parameters: Parameters,
    engine: Engine,
) -> &'static mut Onboard<Timed<Engine>> {
    let Ok(ids) = Settings::default().checked() else { fault::end(Cause::Panic { line: line!() }) };
    place.write(Onboard::grounded(parameters, ids, Timed::new(engine, now)))
}

/// The mission in flash to the pilot, which without one speaks but does not fly.
#[inline(never)]
fn load(onboard: &mut Onboard<Timed<Engine>>, tested: Result<(), SelfTestError>) -> Result<(), Doubt> {
    let mission = mission_image::decode(flash::mission()).map_err(Doubt::Mission)?;
    onboard.load(&mission, tested).map_err(|_| Doubt::Impossible)
}
