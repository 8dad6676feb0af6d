//! The source files of the workspace, and which module of a crate uses which.

use crate::programs::repository;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Folders at the repository's root that hold code.
const ROOTS: [&str; 6] = ["firmware", "sitl", "host-trainer", "tests", "fuzz", "examples"];

/// Every code file of the repository, as a path from its root.
#[must_use]
pub fn code_files() -> Vec<PathBuf> {
    let mut found = Vec::new();
    for root in ROOTS {
        walk(&repository().join(root), &mut found);
    }
    let code =
        |path: &PathBuf| path.extension().is_some_and(|kind| kind == "rs" || kind == "py" || kind == "c");
    let root = repository();
    let mut files: Vec<PathBuf> = found
        .into_iter()
        .filter(code)
        .map(|path| path.strip_prefix(&root).expect("below the root").to_owned())
        .collect();
    files.sort();
    files
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        if !path.is_dir() {
            found.push(path);
        } else if !["target", "corpus", "artifacts", "__pycache__"].iter().any(|skip| path.ends_with(skip)) {
            walk(&path, found);
        }
    }
}

/// A module's path inside its crate: `["flight", "leg"]`; empty for the root.
pub type Module = Vec<String>;

/// The modules of one crate.
#[derive(Debug)]
pub struct Crate {
    /// Code of each module, without comments and without its unit tests.
    modules: BTreeMap<Module, String>,
    /// What each module re-exports: a name and the path that it stands for, relative to the module.
    exports: BTreeMap<Module, Vec<(String, Vec<String>)>>,
}

impl Crate {
    /// Reads the crate below this `src` folder. `binary` files that stand beside the library are part of it.
    ///
    /// # Panics
    /// When a file cannot be read.
    #[must_use]
    pub fn read(src: &Path) -> Crate {
        let mut files = Vec::new();
        walk(src, &mut files);
        let mut modules = BTreeMap::new();
        for file in files.iter().filter(|file| file.extension().is_some_and(|kind| kind == "rs")) {
            let inside = file.strip_prefix(src).expect("below src").with_extension("");
            let mut module: Module = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            if module.last().is_some_and(|name| ["mod", "lib", "main"].contains(&name.as_str())) {
                module.pop();
            }
            let is_test = module.last().is_some_and(|name| name == "tests" || name.ends_with("_tests"));
            if !is_test {
                let text = fs::read_to_string(file).expect("a source file can be read");
                modules.entry(module).or_insert_with(String::new).push_str(&code_only(&text));
            }
        }
        let exports = modules.iter().map(|(module, code)| (module.clone(), exports(code))).collect();
        Crate { modules, exports }
    }

    /// A crate from texts, for tests of this reading.
    #[must_use]
    pub fn from_texts(texts: &[(&str, &str)]) -> Crate {
        let modules: BTreeMap<Module, String> = texts
            .iter()
            .map(|(path, text)| {
                (
                    path.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect(),
                    code_only(text),
                )
            })
            .collect();
        let exports = modules.iter().map(|(module, code)| (module.clone(), exports(code))).collect();
        Crate { modules, exports }
    }

    /// Which sibling uses which, at every level of the module tree. A parent and its child are one thing here: a child
    /// may use its parent.
    #[must_use]
    pub fn edges(&self) -> BTreeSet<(Module, Module)> {
        let mut edges = BTreeSet::new();
        for (module, code) in &self.modules {
            for path in paths(code) {
                let Some(target) = self.resolve(module, &path, 0) else { continue };
                let shared = module.iter().zip(&target).take_while(|(a, b)| a == b).count();
                if module.len() > shared && target.len() > shared {
                    edges.insert((module[..=shared].to_vec(), target[..=shared].to_vec()));
                }
            }
        }
        edges
    }

    /// The module that defines what `path` names, seen from `module`.
    fn resolve(&self, module: &Module, path: &[String], depth: usize) -> Option<Module> {
        let mut at = module.clone();
        for (index, part) in path.iter().enumerate() {
            match part.as_str() {
                "crate" => at.clear(),
                "super" => drop(at.pop()),
                "self" => {}
                name => {
                    let mut child = at.clone();
                    child.push(name.to_owned());
                    if self.modules.contains_key(&child) {
                        at = child;
                        continue;
                    }
                    let exported = self.exports.get(&at)?.iter().find(|(known, _)| known == name);
                    let (Some((_, to)), true) = (exported, depth < 8) else { return Some(at) };
                    let rest = [to.as_slice(), &path[index + 1..]].concat();
                    return self.resolve(&at, &rest, depth + 1);
                }
            }
        }
        Some(at)
    }
}

/// The circles among siblings: each a set of modules that reach each other.
#[must_use]
pub fn circles(edges: &BTreeSet<(Module, Module)>) -> BTreeSet<BTreeSet<Module>> {
    let reach = |from: &Module| {
        let mut seen = BTreeSet::new();
        let mut next = vec![from.clone()];
        while let Some(at) = next.pop() {
            let found = edges.iter().filter(|(user, _)| *user == at).map(|(_, used)| used.clone());
            next.extend(found.filter(|used| seen.insert(used.clone())));
        }
        seen
    };
    let reached: BTreeMap<&Module, BTreeSet<Module>> =
        edges.iter().map(|(from, _)| (from, reach(from))).collect();
    let mut circles = BTreeSet::new();
    for (module, others) in &reached {
        if others.contains(*module) {
            let circle: BTreeSet<Module> = others
                .iter()
                .filter(|other| reached.get(other).is_some_and(|back| back.contains(*module)))
                .cloned()
                .collect();
            circles.insert(circle);
        }
    }
    circles
}

/// The code without comments, up to its unit tests.
fn code_only(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    code.lines().map(|line| line.split("//").next().unwrap_or(line)).collect::<Vec<_>>().join("\n")
}

/// Every path that starts with `crate` or `super`, in `use` declarations and elsewhere.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            if !before.is_some_and(|c| c.is_alphanumeric() || "_:$".contains(c)) {
                tree(&code[at..], &[], &mut found);
            }
        }
    }
    found
}

/// The names that `pub use` declarations give to other modules' items.
fn exports(code: &str) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for line in code.match_indices("use ").map(|(at, _)| at) {
        let before = code[..line].rsplit(['\n', ';']).next().unwrap_or("").trim();
        if before.starts_with("pub") {
            let mut paths = Vec::new();
            tree(&code[line + 4..], &[], &mut paths);
            found.extend(paths.into_iter().filter_map(|path| Some((path.last()?.clone(), path))));
        }
    }
    found
}

/// Expands one path with its braces; returns how many bytes it took.
fn tree(text: &str, prefix: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = prefix.to_vec();
    let mut at = 0;
    loop {
        at += text[at..].len() - text[at..].trim_start().len();
        let rest = &text[at..];
        if rest.starts_with('{') {
            at += 1;
            loop {
                at += text[at..].len()
                    - text[at..].trim_start_matches(|c: char| c.is_whitespace() || c == ',').len();
                if text[at..].is_empty() || text[at..].starts_with('}') {
                    return at + 1;
                }
                let taken = tree(&text[at..], &path, found);
                at += taken.max(1);
            }
        }
        let name = rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or("");
        at += name.len();
        if !name.is_empty() {
            path.push(name.to_owned());
        }
        if !text[at..].starts_with("::") {
            found.push(path);
            let renamed = text[at..].trim_start().strip_prefix("as ");
            let skipped = renamed.map_or(0, |rest| {
                text[at..].len() - rest.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').len()
            });
            return at + skipped;
        }
        at += 2;
    }
}
