//! `gleaner-train export`.

use super::evaluate::render;
use super::{oracle, snapshot_of, write_whole};
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::export::{ModelCard, export, golden_pairs};
use gleaner_host_trainer::judge::evaluation::{
    Engine, Network, Table, evaluate, evaluate_greedy, realizations,
};
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::keep::snapshot::{LAST, Snapshot};
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::planner::oracle::OracleSetting;
use gleaner_host_trainer::settings::Settings;
use gleaner_host_trainer::systems::System;
use gleaner_policy::Tokens;
use gleaner_policy::onnx::TractPolicy;
use gleaner_world::{ScenarioKind, World};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The folder of the run.
    #[arg(long)]
    run: PathBuf,
    /// The model to write. Its card is written beside it with the extension `md`; the folder is made if needed.
    #[arg(long)]
    model: PathBuf,
    /// Name of the model in its card [default: the name of the run's folder].
    #[arg(long)]
    name: Option<String>,
    /// The commit that trained it [default: that of the git repository here, else "unknown"].
    #[arg(long)]
    commit: Option<String>,
    /// Evaluation realizations per setting in the card.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// A file of `gleaner-train oracle`, for the card [default: the shipped one].
    #[arg(long, value_name = "FILE")]
    oracle: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 {
        bail!("--realizations 0: the card needs measurements; give at least 1");
    }
    let snapshot = snapshot_of(System::Gleaner, &arguments.run)?;
    let world = Arc::new(World::default_world());
    let commit = arguments.commit.clone().or_else(head_commit).unwrap_or_else(|| "unknown".to_owned());
    let card = ModelCard {
        name: arguments.name.clone().unwrap_or_else(|| run_name(&arguments.run)),
        version: env!("CARGO_PKG_VERSION").into(),
        commit,
        command: snapshot.command_line("RUN"),
        seed: snapshot.settings.seed,
        steps: snapshot.steps,
        scenario: scenario_name(&snapshot.settings),
        city_hash: world.city().fingerprint(),
    };
    let (shape, actor) = (Shape::actor(), &snapshot.actor);
    let goldens = golden_pairs(actor, shape, &golden_observations(&world)?);
    let bytes = export(actor, shape, &card, &goldens)?;
    // The card measures the written bytes in the engine that flies them.
    let mut policy =
        TractPolicy::load_checked(&bytes).context("the exported model fails its golden pairs")?;
    let text = card_text(&card, &snapshot, &mut policy, &world, arguments)?;
    write_whole(&arguments.model, &bytes)?;
    let card_path = arguments.model.with_extension("md");
    write_whole(&card_path, text.as_bytes())?;
    println!("wrote {} and {}", arguments.model.display(), card_path.display());
    Ok(())
}

/// The name of the run's folder; of its parent for FOLDER/last.
fn run_name(folder: &Path) -> String {
    let named = if folder.ends_with(LAST) { folder.parent().unwrap_or(folder) } else { folder };
    let whole = named.canonicalize().unwrap_or_else(|_| named.to_owned());
    whole.file_name().map_or_else(|| "gleaner".to_owned(), |name| name.display().to_string())
}

/// States from early and later slots of flights with 1, 6 and 12 devices.
fn golden_observations(world: &Arc<World>) -> Result<Vec<Tokens>> {
    let mut observations = Vec::new();
    for (index, devices) in [1, 6, 12].into_iter().enumerate() {
        let scenario = ScenarioKind::ALL[index % 2].scenario().with_devices(devices);
        let drawn = realizations(world, &scenario, 1)?;
        for (preference, slots) in [(1.0, 0), (0.5, 20), (0.0, 1)] {
            let preference = gleaner_policy::Preference::new(preference).context("a preference")?;
            let mut flight = Flight::new(world, &drawn[0].1, drawn[0].0, preference)?;
            let mut greedy = gleaner_host_trainer::env::greedy::Greedy::new(devices);
            for _ in 0..slots {
                flight.step(greedy.decide(&flight));
            }
            observations.push(flight.tokens());
        }
    }
    Ok(observations)
}

fn card_text(
    card: &ModelCard,
    snapshot: &Snapshot,
    policy: &mut TractPolicy,
    world: &Arc<World>,
    arguments: &Arguments,
) -> Result<String> {
    let mut text = format!("# Model card: {}\n\n", card.name);
    writeln!(text, "| | |\n|---|---|")?;
    writeln!(text, "| file | `{}` |", arguments.model.file_name().unwrap_or_default().display())?;
    writeln!(text, "| SHA-256 of the content | `{}` |", policy.info().sha256)?;
    writeln!(text, "| parameters | {} |", policy.info().parameters)?;
    writeln!(text, "| schema hash | `{:#018x}` |", policy.info().schema_hash)?;
    writeln!(text, "| commit | `{}` |", card.commit)?;
    writeln!(text, "| seed | {} |", card.seed)?;
    writeln!(
        text,
        "| steps | {} slots flown, {} updates: the best of {} updates by mean hypervolume on 60 validation \
         realizations |",
        card.steps, snapshot.update, snapshot.settings.updates
    )?;
    writeln!(text, "| trained in | {} |", card.scenario)?;
    writeln!(text, "| city hash | `{:#018x}` |", card.city_hash)?;
    writeln!(text, "| golden pairs | {}, in the file |", policy.goldens().len())?;
    let steps = card.command.replace(" && ", "\n");
    writeln!(
        text,
        "\nTrained with these commands, each on the result of the one before:\n\n```text\n{steps}\n```"
    )?;
    writeln!(
        text,
        "\nMeasured on {} evaluation realizations that were used neither for training nor to choose parameters, in \
         the default city; K = 6 with the exported file in tract, the others with the trainer's forward pass, which \
         gives the same decisions. GREEDY flew the same realizations. The oracle is a planner with full knowledge of \
         map, channel and devices. The proven bound is an upper bound of the mean data of any policy. Reproduce one \
         setting with\n\n```sh\ncargo run --release -p gleaner-host-trainer -- evaluate --model {} --scenario \
         rd --devices 6 --battery 80\n```",
        arguments.realizations,
        arguments.model.display()
    )?;
    let mut summary = String::from(
        "\n| scenario | K | B | data % at w = (1, 0) | GREEDY | oracle | proven bound | energy at w = (0, 1) \
         | hypervolume | GREEDY | oracle |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut details = String::new();
    let lines = oracle::read_or_shipped(arguments.oracle.as_deref())?;
    for asked in Setting::ALL {
        let Setting { kind, devices, .. } = asked;
        let drawn = realizations(world, &asked.scenario(), arguments.realizations)?;
        let greedy = evaluate_greedy(world, &drawn);
        // The engine for the aircraft makes one decision at a time, the trainer's network a thousand.
        let table = match devices {
            6 => evaluate(world, &drawn, &mut Engine(policy))?,
            _ => evaluate(world, &drawn, &mut Network::new(Shape::actor(), &snapshot.actor))?,
        };
        let limit = oracle::known(&lines, asked, arguments.realizations);
        writeln!(summary, "{}", summary_row(asked, &table, &greedy, limit.as_ref()))?;
        if devices == 6 {
            writeln!(details, "\n## {kind}, K = 6, B = 80\n\n{}", render(&table))?;
        }
    }
    Ok(text + &summary + &details)
}

fn summary_row(asked: Setting, table: &Table, greedy: &Table, limit: Option<&OracleSetting>) -> String {
    let number = |number: Option<f64>, decimals: usize| {
        number.map_or_else(|| "-".to_owned(), |number| format!("{number:.decimals$}"))
    };
    let oracle = limit.map(|limit| limit.missions.table());
    let bound = limit.and_then(|limit| limit.limits(asked)).map(|limits| f64::from(limits.data_percent));
    let energy = table.rows.first().map_or((0.0, 0.0), |row| (row.energy, row.energy_std));
    format!(
        "| {} | {} | {} | {:.1} | {:.1} | {} | {} | {:.2} ± {:.2} | {:.0} | {:.0} | {} |",
        asked.kind.name(),
        asked.devices,
        asked.battery,
        table.coverage(),
        greedy.coverage(),
        number(oracle.as_ref().map(|oracle| f64::from(oracle.coverage())), 1),
        number(bound, 1),
        energy.0,
        energy.1,
        table.hypervolume,
        greedy.hypervolume,
        number(oracle.map(|oracle| oracle.hypervolume), 0),
    )
}

fn scenario_name(settings: &Settings) -> String {
    let usual = format!(
        "{}; RD {:.0} %, RB {:.0} %, other zones {:.0} % of the missions; {:.0} % of them with 1 to 12 \
         devices and 50 to 120 battery units, the others K = 6, B = 80",
        settings.site.as_ref().map_or_else(|| "default city".to_owned(), |site| format!("city {site}")),
        100.0 * settings.share_rd,
        100.0 * settings.share_rb,
        100.0 * (1.0 - settings.share_rd - settings.share_rb),
        100.0 * settings.share_varied
    );
    let mut all = usual;
    if settings.share_cities > 0.0 {
        all += &format!(
            "; {:.0} % of all over generated cities, under a channel that is off by up to 2 dB, half of them with \
             Rayleigh fading, a tenth of the reports missing",
            100.0 * settings.share_cities
        );
    }
    if settings.share_mismatched > 0.0 {
        all += &format!(
            "; {:.0} % of all with noise off by up to 6 dB or exponents by up to 0.3, half of them with a wrong map or none",
            100.0 * settings.share_mismatched * (1.0 - settings.share_cities)
        );
    }
    all
}

/// The commit of the git repository here, if there are both.
fn head_commit() -> Option<String> {
    let output = Command::new("git").args(["rev-parse", "HEAD"]).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn model_is_named_after_the_run() {
        assert_eq!(run_name(Path::new("runs/mine")), "mine");
        assert_eq!(run_name(Path::new("runs/mine/last")), "mine");
        assert_eq!(run_name(Path::new("..")), run_name(&Path::new("..").canonicalize().unwrap()));
    }
}
