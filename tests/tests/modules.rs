//! The shape of the code inside the crates: no circular modules, no file over 400 lines.

use gleaner_tests::programs::repository;
use gleaner_tests::sources::{Crate, Module, circles, code_files};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Longest code file.
const MOST_LINES: usize = 400;

/// Folders of the workspace's crates.
fn crates() -> Vec<String> {
    let mut found = vec!["host-trainer".to_owned(), "tests".to_owned()];
    for group in ["firmware", "sitl"] {
        for entry in fs::read_dir(repository().join(group)).unwrap().flatten() {
            if entry.path().join("Cargo.toml").exists() {
                found.push(format!("{group}/{}", entry.file_name().to_str().unwrap()));
            }
        }
    }
    assert!(found.len() >= 13, "only {found:?}");
    found
}

fn names(circle: &BTreeSet<Module>) -> Vec<String> {
    circle.iter().map(|module| module.join("::")).collect()
}

#[test]
fn no_crate_has_circular_modules() {
    let mut edges_found = 0;
    let mut faults = Vec::new();
    for folder in crates() {
        let edges = Crate::read(&repository().join(&folder).join("src")).edges();
        edges_found += edges.len();
        let circles = circles(&edges);
        faults.extend(circles.iter().map(|circle| format!("{folder}: {}", names(circle).join(" <-> "))));
    }
    assert!(edges_found > 150, "only {edges_found} uses were found: the reading is broken");
    assert!(faults.is_empty(), "circular modules:\n{}", faults.join("\n"));
}

#[test]
fn no_code_file_is_over_400_lines() {
    let files = code_files();
    assert!(files.len() > 250, "only {} files were found: the reading is broken", files.len());
    let lines = |path: &Path| fs::read_to_string(repository().join(path)).unwrap().lines().count();
    let long: BTreeSet<String> = files
        .iter()
        .filter(|path| lines(path) > MOST_LINES)
        .map(|path| path.to_str().unwrap().to_owned())
        .collect();
    assert!(long.is_empty(), "over {MOST_LINES} lines: {long:?}");
}

#[test]
fn a_circle_is_found_through_uses_re_exports_and_inline_paths() {
    let found = |texts: &[(&str, &str)]| -> Vec<Vec<String>> {
        circles(&Crate::from_texts(texts).edges()).iter().map(names).collect()
    };
    let root = ("", "mod a;\nmod b;\npub use b::{Other, Thing as Renamed};\n");
    let circle = [vec!["a".to_owned(), "b".to_owned()]];
    assert_eq!(found(&[root, ("a", "use crate::b::X;"), ("b", "use super::a::{Y, Z};")]), circle);
    assert_eq!(
        found(&[root, ("a", "use crate::{\n    Other,\n};"), ("b", "fn f() { crate::a::g() }")]),
        circle
    );
    assert!(found(&[root, ("a", "use crate::Other;"), ("b", "// use crate::a::Y;")]).is_empty());
    assert!(found(&[root, ("a", ""), ("b", "#[cfg(test)]\nmod tests {\n use crate::a::Y;\n}")]).is_empty());
    // A child may use its parent; a cousin counts for its branch.
    assert!(found(&[root, ("a", "mod c;"), ("a::c", "use super::X;"), ("b", "")]).is_empty());
    let cousins = [root, ("a", "mod c;"), ("a::c", "use crate::b::X;"), ("b", "use crate::a::Y;")];
    assert_eq!(found(&cousins), circle);
}
