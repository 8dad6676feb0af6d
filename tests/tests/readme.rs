//! The README's paths exist, its commands name real packages and flags, and CI runs the command that it names.

use gleaner_tests::programs::{self, repository};
use std::fs;
use std::process::Command;

const TEST_COMMAND: &str = "cargo test --release --workspace";

fn readme() -> String {
    fs::read_to_string(repository().join("README.md")).unwrap()
}

/// The lines of the shell blocks, with continuation lines joined.
fn commands(text: &str) -> Vec<String> {
    let mut commands = Vec::new();
    for block in text.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap().replace("\\\n", " ");
        commands.extend(block.lines().map(str::to_owned));
    }
    commands
}

#[test]
fn every_path_exists() {
    let text = readme();
    let mut checked = 0;
    for quoted in text.split('`').skip(1).step_by(2) {
        let is_path = ["firmware", "sitl", "host-trainer", "models", "tests"]
            .iter()
            .any(|top| quoted == *top || quoted.strip_prefix(top).is_some_and(|rest| rest.starts_with('/')));
        if is_path {
            assert!(repository().join(quoted).exists(), "README names {quoted}, which is not there");
            checked += 1;
        }
    }
    assert!(checked > 15, "only {checked} paths were found: the reading is broken");
    for link in text.split("](").skip(1) {
        let target = link.split(')').next().unwrap();
        if !target.contains("://") {
            assert!(repository().join(target).exists(), "README links {target}, which is not there");
        }
    }
}

#[test]
fn every_command_names_a_real_program_and_real_flags() {
    let programs = [("gleaner-host-trainer", "gleaner-train"), ("gleaner-companion", "gleaner")];
    let mut checked = 0;
    for command in commands(&readme()) {
        let words: Vec<&str> = command.split_whitespace().collect();
        let (program, words) = match words[..] {
            ["cargo", "run", "--release", "-p", package, "--", ref rest @ ..] => {
                let known = programs.iter().find(|(name, _)| *name == package);
                (known.unwrap_or_else(|| panic!("{command}: no package {package}")).1, rest.to_vec())
            }
            ["cargo", "run", "--release", "--", ref rest @ ..] => ("gleaner-sitl", rest.to_vec()),
            ["target/release/gleaner", ref rest @ ..] => ("gleaner", rest.to_vec()),
            _ => continue,
        };
        let help = Command::new(programs::path(program)).args([words[0], "--help"]).output().unwrap();
        assert!(help.status.success(), "{command}: {program} has no command {}", words[0]);
        let help = String::from_utf8(help.stdout).unwrap();
        for flag in words.iter().filter(|word| word.starts_with("--")) {
            assert!(help.contains(flag), "{command}: {program} {} has no {flag}", words[0]);
        }
        checked += 1;
    }
    assert!(checked >= 6, "only {checked} commands were found: the reading is broken");
}

#[test]
fn ci_runs_the_test_command_of_the_readme() {
    assert!(commands(&readme()).iter().any(|command| command == TEST_COMMAND));
    let ci = fs::read_to_string(repository().join(".ci/run")).unwrap();
    assert!(ci.trim_end().ends_with(&format!("exec {TEST_COMMAND}")), ".ci/run ends with another command");
}
