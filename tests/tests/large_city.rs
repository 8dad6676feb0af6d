//! A city of 128 x 128 cells, the largest of a computer: checked, shown and flown.

use gleaner_tests::programs::{path, repository};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Blocks of 4 x 4 cells between streets, one in three empty.
fn city(columns: usize, rows: usize) -> String {
    let height = |x: usize, y: usize| {
        let street = x.is_multiple_of(5) || y.is_multiple_of(5);
        if street || (x / 5 + y / 5).is_multiple_of(3) { "0" } else { "30" }
    };
    let row = |y: usize| (0..columns).map(|x| height(x, y)).collect::<Vec<_>>().join(",");
    (0..rows).map(|y| row(y) + "\n").collect()
}

const MISSION: &str = r#"terminal = [110, 110]
battery_units = 70.0

[grid]
corner_lat_deg = -35.3632621
corner_lon_deg = 149.1652374
cell_m = 20.0
heights = "city.csv"

[[device]]
id = 1
cell = [100, 110]
data = 3000.0

[[device]]
id = 2
cell = [110, 95]
data = 3000.0
"#;

fn run(program: &str, folder: &Path, words: &[&str]) -> Output {
    Command::new(path(program)).args(words).current_dir(folder).output().unwrap()
}

fn printed(output: &Output) -> String {
    String::from_utf8([&output.stdout[..], &output.stderr].concat()).unwrap()
}

#[test]
fn the_largest_city_is_checked_shown_and_flown() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("city.csv"), city(128, 128)).unwrap();
    fs::write(folder.join("mission.toml"), MISSION).unwrap();
    let config = repository().join("firmware/companion/dist/gleaner.toml");
    let mut words = vec!["check", "--wait", "0", "--config", config.to_str().unwrap()];
    words.extend(["--mission", "mission.toml"]);
    words.extend(["--autopilot", "udpin:127.0.0.1:0", "--radio", "udpin:127.0.0.1:0"]);
    let checked = run("gleaner", folder, &words);
    let said = printed(&checked);
    assert!(checked.status.success() && said.contains("128 x 128 cells"), "{said}");

    let shown = run("gleaner", folder, &["mission", "show", "mission.toml", "--html", "mission.html"]);
    assert!(printed(&shown).contains("fence       16384 of 16384 cells"), "{}", printed(&shown));
    assert!(fs::metadata(folder.join("mission.html")).unwrap().len() > 16_384);
    let shown = run("gleaner-sitl", folder, &["city", "show", "city.csv"]);
    assert!(shown.status.success() && printed(&shown).contains("128 x 128"), "{}", printed(&shown));

    let words = ["fly", "--json", "--mission", "mission.toml", "--out", "flight", "--lookahead", "0"];
    let flown = run("gleaner-sitl", folder, &words);
    let report: Value =
        serde_json::from_slice(&flown.stdout).unwrap_or_else(|_| panic!("{}", printed(&flown)));
    assert_eq!((&report["landed"], &report["violations"]), (&true.into(), &0.into()), "{report}");
    assert!(report["collected"].as_f64().unwrap() > 0.2, "{report}");

    fs::write(folder.join("city.csv"), city(129, 128)).unwrap();
    let refused = printed(&run("gleaner", folder, &["mission", "show", "mission.toml"]));
    assert!(refused.contains("more than 16384 cells"), "{refused}");
}
