//! Checks of the documents: paths and links exist, commands name existing programs, commands and flags, tables are
//! complete, the README is short, and CI runs the command that it names.

use gleaner_tests::programs::{self, repository};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const TEST_COMMAND: &str = "cargo test --release --workspace";
/// Most lines of the README: the rest is in `docs`.
const README_LINES: usize = 170;

/// Every Markdown document, as a path from the repository's root, with its text.
fn documents() -> Vec<(PathBuf, String)> {
    let root = repository();
    let mut found = Vec::new();
    for folder in ["", "docs", "models", "models/paper"] {
        for entry in fs::read_dir(root.join(folder)).unwrap().flatten() {
            if entry.path().extension().is_some_and(|kind| kind == "md") {
                found.push(Path::new(folder).join(entry.file_name()));
            }
        }
    }
    found.sort();
    assert!(found.len() >= 10, "only {found:?}: the reading is broken");
    found.into_iter().map(|path| (path.clone(), fs::read_to_string(root.join(&path)).unwrap())).collect()
}

/// The text without its fenced blocks.
fn prose(text: &str) -> String {
    let mut fenced = false;
    let mut kept = Vec::new();
    for line in text.lines() {
        if line.starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            kept.push(line);
        }
    }
    assert!(!fenced, "a fenced block is open at the end");
    kept.join("\n")
}

/// The lines of the shell blocks, with continuation lines joined.
fn commands(text: &str) -> Vec<String> {
    let mut commands = Vec::new();
    for block in text.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap().replace("\\\n", " ");
        commands.extend(block.lines().map(|line| line.trim().to_owned()));
    }
    commands
}

/// Whether quoted text looks like a path of this repository.
fn is_path(quoted: &str) -> bool {
    let tops = ["firmware", "sitl", "host-trainer", "models", "tests", "docs"];
    let below =
        |top: &str| quoted == top || quoted.strip_prefix(top).is_some_and(|rest| rest.starts_with('/'));
    tops.into_iter().any(below) && !quoted.contains(['*', '<', ' '])
}

#[test]
fn every_path_and_link_exists() {
    let mut checked = 0;
    for (document, text) in documents() {
        let text = prose(&text);
        for quoted in text.split('`').skip(1).step_by(2).filter(|quoted| is_path(quoted)) {
            assert!(repository().join(quoted).exists(), "{}: {quoted} is not there", document.display());
            checked += 1;
        }
        let folder = repository().join(&document).parent().unwrap().to_owned();
        for link in text.split("](").skip(1) {
            let target = link.split([')', '#']).next().unwrap();
            if !target.is_empty() && !target.contains("://") {
                assert!(
                    folder.join(target).exists(),
                    "{}: link to {target}, which is not there",
                    document.display()
                );
                checked += 1;
            }
        }
    }
    assert!(checked > 80, "only {checked} paths were found: the reading is broken");
}

/// The program that a command line runs and the words after it; `None` for programs that are not ours.
fn ours(command: &str) -> Option<(&'static str, Vec<&str>)> {
    let programs = [
        ("gleaner-host-trainer", "gleaner-train"),
        ("gleaner-companion", "gleaner"),
        ("gleaner-harness", "gleaner-sitl"),
    ];
    let words: Vec<&str> = command.split_whitespace().collect();
    match words[..] {
        ["cargo", "run", "--release", "-p", package, "--", ref rest @ ..] => {
            let known = programs.iter().find(|(name, _)| *name == package);
            Some((known.unwrap_or_else(|| panic!("{command}: no package {package}")).1, rest.to_vec()))
        }
        ["cargo", "run", "--release", "-p", ..] => None,
        ["cargo", "run", "--release", "--", ref rest @ ..] => Some(("gleaner-sitl", rest.to_vec())),
        [program, ref rest @ ..] => {
            let name = program.rsplit('/').next()?;
            let known = programs.iter().find(|(_, known)| *known == name)?;
            Some((known.1, rest.to_vec()))
        }
        [] => None,
    }
}

#[test]
fn every_command_names_a_real_program_and_real_flags() {
    let mut helps: BTreeMap<String, String> = BTreeMap::new();
    let mut help = |program: &str, words: &[&str], command: &str| {
        let key = format!("{program} {}", words.join(" "));
        let text = helps.entry(key).or_insert_with(|| {
            let output = Command::new(programs::path(program)).args(words).arg("--help").output().unwrap();
            assert!(output.status.success(), "{command}: {program} has no command {}", words.join(" "));
            String::from_utf8(output.stdout).unwrap()
        });
        text.clone()
    };
    let mut checked = 0;
    for (document, text) in documents() {
        for command in commands(&text) {
            let Some((program, words)) = ours(&command) else { continue };
            let at = format!("{}: {command}", document.display());
            // Commands are `gleaner check` or, in two words, `gleaner-sitl city make`.
            let is_word = |word: &&&str| word.chars().all(|c| c.is_ascii_lowercase());
            let first: Vec<&str> = words.iter().take_while(is_word).take(1).copied().collect();
            let mut text = help(program, &first, &at);
            if let (Some(second), true) =
                (words.get(1).filter(|word| is_word(word)), text.contains("Commands:"))
            {
                text = help(program, &[first[0], second], &at);
            }
            for flag in words.iter().filter(|word| word.starts_with("--")) {
                let flag = flag.split('=').next().unwrap();
                assert!(text.contains(flag), "{at}: {program} {} has no {flag}", first.join(" "));
            }
            checked += 1;
        }
    }
    assert!(checked >= 25, "only {checked} commands were found: the reading is broken");
}

#[test]
fn every_table_has_as_many_cells_as_headers() {
    let mut tables = 0;
    for (document, text) in documents() {
        let text = prose(&text);
        let mut width = None;
        for line in text.lines() {
            if !line.starts_with('|') {
                width = None;
                continue;
            }
            let cells = line.replace("\\|", "").matches('|').count() - 1;
            let expected = *width.get_or_insert(cells);
            tables += usize::from(line.starts_with("|---"));
            assert_eq!(cells, expected, "{}: cells of {line}", document.display());
            assert!(line.trim_end().ends_with('|'), "{}: {line} has no end", document.display());
        }
    }
    assert!(tables >= 15, "only {tables} tables were found: the reading is broken");
}

#[test]
fn the_readme_is_short_and_names_the_command_that_ci_runs() {
    let readme = fs::read_to_string(repository().join("README.md")).unwrap();
    let lines = readme.lines().count();
    assert!(lines <= README_LINES, "README.md has {lines} lines: move something to docs");
    assert!(commands(&readme).iter().any(|command| command == TEST_COMMAND));
    let ci = fs::read_to_string(repository().join(".ci/run")).unwrap();
    assert!(ci.trim_end().ends_with(&format!("exec {TEST_COMMAND}")), ".ci/run ends with another command");
}

#[test]
fn every_parameter_and_command_stands_in_the_flying_guide() {
    let guide = fs::read_to_string(repository().join("docs/flying.md")).unwrap();
    for spec in &gleaner_link::PARAMETERS {
        assert!(guide.contains(&format!("| `{}` |", spec.name)), "docs/flying.md: no row for {}", spec.name);
    }
    let rows = guide
        .split("## What happens when")
        .nth(1)
        .unwrap()
        .lines()
        .filter(|line| line.starts_with("| "))
        .count();
    assert!(rows > 20, "what happens when has {rows} rows");
}
