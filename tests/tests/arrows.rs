//! Which crate may depend on which: only on crates of lower rank.

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Folder and rank of every member.
const RANKS: [(&str, u8); 15] = [
    ("firmware/units", 0),
    ("firmware/ports", 0),
    ("firmware/guard", 1),
    ("firmware/policy", 1),
    ("firmware/link", 1),
    ("firmware/radio", 1),
    ("firmware/lookahead", 2),
    ("firmware/pilot", 3),
    ("firmware/dashboard", 4),
    ("firmware/companion", 5),
    ("firmware/cortex-m", 5),
    ("sitl/world", 1),
    ("sitl/harness", 5),
    ("host-trainer", 5),
    ("tests", 6),
];

/// Every dependency between members, as folders: (dependent, dependency). Those of tests and benches count too.
fn edges() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .current_dir(root)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let folder = |package: &Value| {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap());
        manifest.parent().unwrap().strip_prefix(root).unwrap().to_str().unwrap().to_owned()
    };
    let folders: BTreeMap<&str, String> =
        packages.iter().map(|package| (package["name"].as_str().unwrap(), folder(package))).collect();
    let mut members: Vec<&str> = folders.values().map(String::as_str).collect();
    let mut ranked = RANKS.map(|(folder, _)| folder);
    members.sort_unstable();
    ranked.sort_unstable();
    assert_eq!(members, ranked, "a member without a rank, or a rank without a member");
    packages
        .iter()
        .flat_map(|package| {
            let from = folder(package);
            package["dependencies"]
                .as_array()
                .unwrap()
                .iter()
                .filter_map(|dependency| folders.get(dependency["name"].as_str().unwrap()))
                .map(move |to| (from.clone(), to.clone()))
                .collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn dependencies_point_to_lower_ranks() {
    let rank = |folder: &str| RANKS.iter().find(|(known, _)| *known == folder).unwrap().1;
    let edges = edges();
    assert!(edges.len() > 20, "cargo metadata was not understood: {edges:?}");
    let wrong: Vec<_> = edges.iter().filter(|(from, to)| rank(to) >= rank(from)).collect();
    assert!(wrong.is_empty(), "dependencies on the same or a higher rank: {wrong:?}");
}

#[test]
fn firmware_depends_on_nothing_outside_firmware() {
    let wrong: Vec<_> = edges()
        .into_iter()
        .filter(|(from, to)| from.starts_with("firmware/") && !to.starts_with("firmware/"))
        .collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn the_guard_does_not_know_that_learning_exists() {
    let known: Vec<_> =
        edges().into_iter().filter(|(from, _)| from == "firmware/guard").map(|(_, to)| to).collect();
    assert_eq!(known, ["firmware/units"]);
}

#[test]
fn trainer_and_aircraft_share_observation_builder_and_mask() {
    let edges = edges();
    for (user, owner) in [
        ("host-trainer", "firmware/policy"),
        ("host-trainer", "firmware/guard"),
        ("firmware/pilot", "firmware/policy"),
        ("firmware/pilot", "firmware/guard"),
        ("sitl/harness", "firmware/pilot"),
    ] {
        assert!(edges.contains(&(user.into(), owner.into())), "{user} does not use {owner}");
    }
}

/// `cargo run --release` flies the native engine; tract would multiply the time of a newcomer's first build.
#[test]
fn the_demo_is_built_without_tract() {
    let crates = |features: &[&str]| {
        let output = Command::new(env!("CARGO"))
            .args(["tree", "-p", "gleaner-harness", "-e", "normal,build", "--prefix", "none"])
            .args(features)
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let has_tract = |tree: &str| tree.lines().any(|line| line.starts_with("tract"));
    assert!(has_tract(&crates(&["--features", "tract"])), "cargo tree was not understood");
    assert!(!has_tract(&crates(&[])));
}
