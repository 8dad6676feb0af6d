//! The examples of the library crates run and print the documented output. `cargo test --release --workspace` builds them.

use gleaner_tests::programs::{self, repository};
use std::process::Command;

fn run(example: &str, arguments: &[&str]) -> String {
    let program = programs::path(&format!("examples/{example}"));
    let output = Command::new(program).args(arguments).current_dir(repository()).output().unwrap();
    assert!(output.status.success(), "{example}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn one_observation_prints_five_logits_and_a_decision() {
    let printed = run("one_observation", &[]);
    assert_eq!(printed.lines().count(), 6, "{printed}");
    // For data alone: a move towards a device with high SNR, or hovering in its range.
    let decision = printed.lines().last().unwrap().strip_prefix("decision: ").unwrap();
    assert!(["east", "hover"].contains(&decision), "{printed}");
}

#[test]
fn a_pilot_in_a_loop_of_its_own_sends_bytes_and_stays_idle() {
    let printed = run("own_loop", &[]);
    assert!(printed.contains("state idle, "), "{printed}");
    let sent: usize =
        printed.split("state idle, ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(sent > 100, "heartbeats are sent: {printed}");
}

#[test]
fn a_city_of_its_own_is_flown_to_the_terminal() {
    let printed = run("own_city", &[]);
    assert!(printed.starts_with("32 slots, 48 battery units left\n"), "{printed}");
}

#[test]
fn the_picture_of_the_readme_shows_three_flights() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("preference.svg");
    let output = Command::new(programs::path("preference-picture")).arg(&file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let picture = std::fs::read_to_string(file).unwrap();
    assert_eq!(picture.matches("<svg").count(), 4, "a page and three flights");
    for caption in ["w = 1<", "w = 0.5<", "w = 0<"] {
        assert!(picture.contains(caption), "no caption {caption}");
    }
}
