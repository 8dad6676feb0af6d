//! From reset to the endless main loop, the same on every board.

use super::defmt_log::Defmt;
use super::{fault, images, now, serial};
use crate::{Board, Cause, Parts, Pilot, ResetRecord, Runtime, Services};
use core::fmt;
use core::mem::MaybeUninit;
use gleaner_link::Severity;
use gleaner_pilot::{ChannelAware, Onboard, Parameters, Settings, mission_image};
use gleaner_policy::native::{BlobError, Model, NativePolicy, Workspace};
use gleaner_policy::{Inference, Policy, SelfTestError, Timed, Tokens, self_test};
use heapless::Vec;
use static_cell::{ConstStaticCell, StaticCell};

/// The engine; `None` when the model is damaged.
struct BoardEngine(Option<NativePolicy<'static>>);

impl Policy for BoardEngine {
    type Error = ();

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        self.0.as_mut().ok_or(())?.infer(tokens).map_err(|_| ())
    }
}

static WORKSPACE: ConstStaticCell<Workspace> = ConstStaticCell::new(Workspace::new());
static ONBOARD: StaticCell<Pilot<BoardEngine>> = StaticCell::new();

/// Boots the pilot and runs it forever.
pub fn fly<B: Board>(parts: Parts<B>) -> ! {
    let report = fault::reset_record().report(parts.reset_flags);
    fault::keep(ResetRecord::alive(false));
    let (services, notice) = Services::<B>::open(parts);
    let (onboard, faults) = boot(services.parameters());
    defmt::info!("gleaner {=str} boots", env!("CARGO_PKG_VERSION"));
    if let Some(report) = report {
        onboard.say(Severity::Critical, format_args!("gleaner: {report}"));
    }
    for fault in &faults {
        onboard.say(Severity::Critical, format_args!("gleaner: {fault}"));
    }
    if let Some(notice) = notice {
        onboard.say(notice.severity(), format_args!("{notice}"));
    }
    run(onboard, services)
}

/// The main loop. Not inlined, so that its stack frame is not added to those of the boot.
#[inline(never)]
fn run<B: Board>(onboard: &mut Pilot<BoardEngine>, mut services: Services<B>) -> ! {
    let mut runtime = Runtime::new(onboard, serial::link(), serial::radio());
    B::start_watchdog();
    loop {
        if runtime.pass(now(), serial::losses(), &mut Defmt) {
            let commanding = services.poll(now(), runtime.onboard());
            fault::keep(ResetRecord::alive(commanding));
        }
        cortex_m::asm::wfi();
    }
}

/// Why the pilot communicates but does not engage.
enum BootFault {
    Mission(mission_image::ImageError),
    Impossible,
    Model(BlobError),
    SelfTest,
}

impl fmt::Display for BootFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BootFault::Mission(error) => write!(f, "{}, flash one", error.text()),
            BootFault::Impossible => f.write_str("mission cannot be flown, flash one"),
            BootFault::Model(error) => write!(f, "model: {error}"),
            BootFault::SelfTest => f.write_str("model fails its own examples, flash one"),
        }
    }
}

/// Builds the pilot and loads mission and model. The pilot is built in its final place, and each step has a stack
/// frame that ends before the next one starts: the stack is smaller than a pilot.
#[inline(never)]
fn boot(parameters: &Parameters) -> (&'static mut Pilot<BoardEngine>, Vec<BootFault, 2>) {
    let mut faults = Vec::new();
    let (Some(workspace), Some(place)) = (WORKSPACE.try_take(), ONBOARD.try_uninit()) else {
        fault::end(Cause::Panic { line: line!() })
    };
    let policy = engine(workspace).map_err(|fault| faults.push(fault)).ok();
    let tested = if policy.is_some() { Ok(()) } else { Err(SelfTestError::NoGolden) };
    let onboard = ground(place, parameters.clone(), BoardEngine(policy));
    if let Err(fault) = load(onboard, tested) {
        let _ = faults.push(fault);
    }
    (onboard, faults)
}

/// The engine, after it has reproduced the model's golden pairs.
#[inline(never)]
fn engine(workspace: &'static mut Workspace) -> Result<NativePolicy<'static>, BootFault> {
    let model = Model::read(images::model()).map_err(BootFault::Model)?;
    let mut policy = NativePolicy::new(model, workspace);
    self_test(&mut policy, model.goldens()).map_err(|_| BootFault::SelfTest)?;
    Ok(policy)
}

/// Builds a pilot without mission in `place`.
#[inline(never)]
fn ground(
    place: &'static mut MaybeUninit<Pilot<BoardEngine>>,
    parameters: Parameters,
    engine: BoardEngine,
) -> &'static mut Pilot<BoardEngine> {
    let Ok(ids) = Settings::default().checked() else { fault::end(Cause::Panic { line: line!() }) };
    place.write(Onboard::grounded(parameters, ids, ChannelAware::new(Timed::new(engine, now))))
}

/// Loads the mission from flash. A pilot without mission communicates but does not engage.
#[inline(never)]
fn load(onboard: &mut Pilot<BoardEngine>, tested: Result<(), SelfTestError>) -> Result<(), BootFault> {
    let mission = mission_image::decode(images::mission()).map_err(BootFault::Mission)?;
    onboard.load(&mission, tested).map_err(|_| BootFault::Impossible)
}
