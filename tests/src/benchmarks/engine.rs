//! The policy on board: inference in each engine, and the observation.

use super::peer::Peer;
use super::timing::{Contender, in_turns};
use crate::observations::random;
use crate::programs::repository;
use crate::python;
use anyhow::{Context, Result};
use gleaner_guard::Guard;
use gleaner_policy::native::{AlignedBytes, Model, NativePolicy, SimdPolicy, WeightFormat, Workspace};
use gleaner_policy::onnx::{TractPolicy, convert};
use gleaner_policy::{ChannelOffset, DeviceState, Policy, Preference, Situation, TokenTable, Tokens};
use gleaner_units::{BatteryUnits, Cell, CellSet, Db};
use gleaner_world::City;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::cell::RefCell;
use std::fmt::Write;
use std::hint::black_box;

const DEVICES: [usize; 3] = [1, 6, 12];
const REPETITIONS: usize = 200;
const CALLS: usize = 10;
/// Other data between two inferences, bytes: more than the second-level cache holds.
const COLD_BYTES: usize = 4 << 20;
/// Observations of a batch.
const BATCH: usize = 32;

fn sample(devices: usize) -> Result<Tokens> {
    let drawn = random(&mut ChaCha8Rng::seed_from_u64(7), 13);
    drawn.into_iter().find(|tokens| tokens.devices.len() == devices).context("13 sizes in turn")
}

/// One inference, by engine and number of devices.
pub(super) fn inference(page: &mut String) -> Result<()> {
    let path = repository().join("models/gleaner.onnx");
    let onnx = std::fs::read(&path).context("models/gleaner.onnx cannot be read")?;
    let blob = AlignedBytes::new(&convert(&onnx, WeightFormat::F32)?);
    let model = Model::read(blob.as_slice())?;
    let simd = SimdPolicy::new(&model).context("this processor has no supported vector unit")?;
    let mut workspace = Workspace::new();
    let mut engines = Engines {
        simd,
        portable: NativePolicy::new(model, &mut workspace),
        tract: TractPolicy::load_checked(&onnx)?,
    };
    let mut arguments = vec![path.display().to_string(), CALLS.to_string()];
    arguments.extend(DEVICES.map(|devices| devices.to_string()));
    let runtime = RefCell::new(Peer::start(&python::interpreter()?, "onnxruntime_bench.py", &arguments)?);
    writeln!(
        page,
        "## Inference\n\nThe shipped model on one thread, the vectorised engine with {}. Each repetition is {CALLS} calls. \
         {} runs from Python. The row of the batch is the time of one of {BATCH} observations.\n",
        engines.simd.instruction_set(),
        runtime.borrow().about()
    )?;
    writeln!(
        page,
        "| devices | engine | time | onnxruntime / engine | tract / engine |\n|---|---|---|---|---|"
    )?;
    let mut vectorised = Vec::new();
    for devices in DEVICES {
        vectorised.push(engines.alone(page, &sample(devices)?, &runtime)?);
    }
    writeln!(
        page,
        "\nThe vectorised engine with cold caches, as in flight, where a decision is due every two seconds:\n\n\
         | devices | before each inference | time | times the time above |\n|---|---|---|---|"
    )?;
    for (devices, warm) in DEVICES.into_iter().zip(vectorised) {
        engines.cold(page, &sample(devices)?, warm)?;
    }
    Ok(())
}

/// Calls one engine with twelve devices.
pub(super) fn count(engine: &str, calls: u64) -> Result<()> {
    let onnx = std::fs::read(repository().join("models/gleaner.onnx"))?;
    let tokens = sample(12)?;
    if engine == "tract" {
        let mut tract = TractPolicy::load_checked(&onnx)?;
        (0..calls).for_each(|_| drop(black_box(tract.infer(black_box(&tokens)))));
        return Ok(());
    }
    let blob = AlignedBytes::new(&convert(&onnx, WeightFormat::F32)?);
    let model = Model::read(blob.as_slice())?;
    if engine == "portable" {
        let mut workspace = Workspace::new();
        let mut portable = NativePolicy::new(model, &mut workspace);
        (0..calls).for_each(|_| drop(black_box(portable.infer(black_box(&tokens)))));
        return Ok(());
    }
    let mut simd = SimdPolicy::new(&model).context("this processor has no supported vector unit")?;
    for _ in 0..calls {
        let _ = black_box(simd.logits(black_box(&tokens)));
    }
    Ok(())
}

/// The engines with the shipped model.
struct Engines<'a> {
    simd: SimdPolicy,
    portable: NativePolicy<'a>,
    tract: TractPolicy,
}

impl Engines<'_> {
    /// Each engine in repetitions of its own calls, in turns. Returns the median of the vectorised engine.
    fn alone(&mut self, page: &mut String, tokens: &Tokens, runtime: &RefCell<Peer>) -> Result<f64> {
        let devices = tokens.devices.len();
        let batch = vec![tokens.clone(); BATCH];
        let simd = RefCell::new(&mut self.simd);
        let vectorised = || {
            let _ = black_box(simd.borrow_mut().logits(black_box(tokens)));
        };
        let batches = || {
            let _ = black_box(simd.borrow_mut().logits_of(black_box(&batch)));
        };
        let mut contenders = [
            Contender::ours("native, vectorised", CALLS, vectorised),
            Contender::ours("native, vectorised, batch", CALLS, batches),
            Contender::ours("native, portable", CALLS, || {
                drop(black_box(self.portable.infer(black_box(tokens))))
            }),
            Contender::ours("tract", CALLS, || drop(black_box(self.tract.infer(black_box(tokens))))),
            Contender::peer("onnxruntime", runtime, devices.to_string()),
        ];
        let mut times = in_turns(&mut contenders, REPETITIONS)?;
        times[1].divide(BATCH as f64);
        let [.., tract, onnxruntime] = &times[..] else { anyhow::bail!("five contenders") };
        for (contender, times) in contenders.iter().zip(&times) {
            let ratios = [times.ratio(onnxruntime), times.ratio(tract)];
            let [first, second] = ratios;
            writeln!(page, "| {devices} | {} | {} | {first} | {second} |", contender.name, times.text())?;
        }
        Ok(times[0].median())
    }

    /// The vectorised engine after a pass over other memory, and after an inference of tract.
    fn cold(&mut self, page: &mut String, tokens: &Tokens, warm: f64) -> Result<()> {
        let devices = tokens.devices.len();
        let mut memory = vec![0_u8; COLD_BYTES];
        let name = format!("a pass over {} MiB of other memory", COLD_BYTES >> 20);
        let mut pass = || black_box(&mut memory).iter_mut().for_each(|byte| *byte = byte.wrapping_add(1));
        let mut tract = || drop(black_box(self.tract.infer(black_box(tokens))));
        let before: [(&str, &mut dyn FnMut()); 2] =
            [(&name, &mut pass), ("an inference of tract on the same observation", &mut tract)];
        for (name, before) in before {
            let simd = &mut self.simd;
            let inference = || {
                let _ = black_box(simd.logits(black_box(tokens)));
            };
            let mut contenders =
                [Contender::ours("before", 1, before), Contender::ours("native", 1, inference)];
            let times = in_turns(&mut contenders, REPETITIONS)?;
            writeln!(page, "| {devices} | {name} | {} | {:.1} |", times[1].text(), times[1].median() / warm)?;
        }
        Ok(())
    }
}

/// Tokens and mask of one decision, along a flight across the default city.
pub(super) fn observation(page: &mut String) -> Result<()> {
    let city = City::default_city();
    let grid = city.grid();
    let terminal = Cell::new(30, 18);
    let guard = Guard::new(&CellSet::full(grid), terminal, BatteryUnits(0.0))?;
    writeln!(
        page,
        "## Observation\n\nTokens and the guard's mask of one decision, in a city with a table of line of sight; the aircraft moves \
         one cell each time and the devices lose data.\n"
    )?;
    writeln!(page, "| devices | builder | time | direct / builder |\n|---|---|---|---|")?;
    for count in DEVICES {
        let mut table = TokenTable::new();
        let [mut first, mut second] = [0_usize; 2];
        let situation = |step: usize| Situation {
            cell: Cell::new((step % 20) as i16 + 10, (step / 20 % 12) as i16 + 6),
            battery: BatteryUnits(80.0),
            spare: BatteryUnits(40.0),
            terminal,
            preference: Preference::DATA,
            sight: &city,
            channel: ChannelOffset::NONE,
        };
        let devices = |step: usize| {
            city.open_cells().iter().step_by(53).take(count).map(move |&cell| DeviceState {
                cell,
                remaining: 8000.0 - (step % 240) as f32 * 20.0,
                snr: Some(Db(3.0)),
            })
        };
        let mask = |situation: &Situation<'_>| guard.mask(situation.cell, situation.battery);
        let incremental = || {
            let situation = situation(first);
            black_box((table.build(&situation, devices(first)), mask(&situation)));
            first += 1;
        };
        let direct = || {
            let situation = situation(second);
            black_box((Tokens::build(&situation, devices(second)), mask(&situation)));
            second += 1;
        };
        let mut contenders = [
            Contender::ours("`TokenTable`", CALLS, incremental),
            Contender::ours("`Tokens::build`", CALLS, direct),
        ];
        // The second round over all cells is measured: every vantage is known then.
        in_turns(&mut contenders, 24)?;
        let times = in_turns(&mut contenders, REPETITIONS)?;
        let [table, direct] = &times[..] else { anyhow::bail!("two contenders") };
        writeln!(page, "| {count} | `TokenTable` | {} | {} |", table.text(), table.ratio(direct))?;
        writeln!(page, "| {count} | `Tokens::build` | {} | |", direct.text())?;
    }
    Ok(())
}
