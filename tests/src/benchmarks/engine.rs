//! The policy on board: inference in each engine, and the observation.

use super::timing::in_turns;
use crate::observations::random;
use crate::programs::repository;
use crate::python;
use anyhow::{Context, Result};
use gleaner_guard::Guard;
use gleaner_policy::native::{AlignedBytes, Model, NativePolicy, SimdPolicy, WeightFormat, Workspace};
use gleaner_policy::onnx::{TractPolicy, convert};
use gleaner_policy::{DeviceState, Policy, Preference, Situation, TokenTable, Tokens};
use gleaner_units::{BatteryUnits, Cell, CellSet, Db};
use gleaner_world::City;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;
use std::hint::black_box;

const DEVICES: [usize; 3] = [1, 6, 12];
const REPETITIONS: usize = 200;
const CALLS: usize = 10;
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
    let mut simd = SimdPolicy::new(&model).context("this processor has no supported vector unit")?;
    let mut batched = SimdPolicy::new(&model).context("as above")?;
    let (mut workspace, mut second) = (Workspace::new(), Workspace::new());
    let mut portable = NativePolicy::new(model, &mut workspace);
    let mut alone = NativePolicy::new(model, &mut second);
    let mut tract = TractPolicy::load_checked(&onnx)?;
    let calls = (REPETITIONS * CALLS).to_string();
    let mut arguments = vec![path.display().to_string(), calls];
    arguments.extend(DEVICES.map(|devices| devices.to_string()));
    let runtime = python::run("onnxruntime_bench.py", arguments)?;
    let mut runtime = runtime.lines();
    writeln!(
        page,
        "## Inference\n\nThe shipped model, one observation at a time, one thread; the vectorised engine uses {}. \
         onnxruntime runs from Python, directly before. The batch row is the time of one of {BATCH} observations.\n",
        simd.instruction_set()
    )?;
    writeln!(page, "| devices | engine | time | tract / engine |\n|---|---|---|---|")?;
    for devices in DEVICES {
        let tokens = sample(devices)?;
        let batch = vec![tokens.clone(); BATCH];
        let by_itself = in_turns(
            &mut [("portable", Box::new(|| drop(black_box(alone.infer(black_box(&tokens))))))],
            REPETITIONS,
            CALLS,
        );
        let mut contenders: [super::timing::Contender<'_>; 4] = [
            (
                "native, vectorised",
                Box::new(|| {
                    let _ = black_box(simd.logits(black_box(&tokens)));
                }),
            ),
            ("native, vectorised, batch", Box::new(|| drop(black_box(batched.logits_of(black_box(&batch)))))),
            ("native, portable", Box::new(|| drop(black_box(portable.infer(black_box(&tokens)))))),
            ("tract", Box::new(|| drop(black_box(tract.infer(black_box(&tokens)))))),
        ];
        let mut times = in_turns(&mut contenders, REPETITIONS, CALLS);
        let names = contenders.iter().map(|(name, _)| *name).collect::<Vec<_>>();
        times[1].divide(BATCH as f64);
        let peer = times.last().context("four contenders")?;
        for (name, times) in names.iter().zip(&times) {
            writeln!(page, "| {devices} | {name} | {} | {} |", times.text(), times.ratio(peer))?;
        }
        writeln!(
            page,
            "| {devices} | native, portable, no other engine between | {} | |",
            by_itself[0].text()
        )?;
        let line = runtime.next().context("onnxruntime_bench.py printed too little")?;
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        let [_, minimum, median] = numbers[..] else {
            anyhow::bail!("onnxruntime_bench.py printed `{line}`")
        };
        writeln!(
            page,
            "| {devices} | onnxruntime | {median:.1} us (minimum {minimum:.1}) | {:.2}; / vectorised {:.2} |",
            peer.median() / median,
            median / times[0].median()
        )?;
    }
    Ok(())
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
        };
        let devices = |step: usize| {
            city.open_cells().iter().step_by(53).take(count).map(move |&cell| DeviceState {
                cell,
                remaining: 8000.0 - (step % 240) as f32 * 20.0,
                snr: Some(Db(3.0)),
            })
        };
        let mask = |situation: &Situation<'_>| guard.mask(situation.cell, situation.battery);
        let mut contenders: [super::timing::Contender<'_>; 2] = [
            (
                "`TokenTable`",
                Box::new(|| {
                    let situation = situation(first);
                    black_box((table.build(&situation, devices(first)), mask(&situation)));
                    first += 1;
                }),
            ),
            (
                "`Tokens::build`",
                Box::new(|| {
                    let situation = situation(second);
                    black_box((Tokens::build(&situation, devices(second)), mask(&situation)));
                    second += 1;
                }),
            ),
        ];
        // The second round over all cells is measured: every vantage is known then.
        in_turns(&mut contenders, 24, CALLS);
        let times = in_turns(&mut contenders, REPETITIONS, CALLS);
        let [table, direct] = &times[..] else { anyhow::bail!("two contenders") };
        writeln!(page, "| {count} | `TokenTable` | {} | {} |", table.text(), table.ratio(direct))?;
        writeln!(page, "| {count} | `Tokens::build` | {} | |", direct.text())?;
    }
    Ok(())
}
