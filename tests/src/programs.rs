//! Our own programs as processes.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};

/// The program of this name, built by the same command as the test that asks.
///
/// # Panics
/// When it is not there, with the line to type.
#[must_use]
pub fn path(name: &str) -> PathBuf {
    // Tests lie in the `deps` folder beside the programs.
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.parent().and_then(|deps| deps.parent()).expect("tests lie two folders deep");
    let program = folder.join(name);
    assert!(
        program.exists(),
        "{} is not built: type cargo test --release --workspace, which builds every program",
        program.display()
    );
    program
}

/// The repository's folder.
#[must_use]
pub fn repository() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// A program that runs until it is dropped.
#[derive(Debug)]
pub struct Running {
    name: String,
    child: Child,
    lines: std::io::Lines<BufReader<ChildStdout>>,
    seen: Vec<String>,
}

impl Running {
    /// Starts a program of ours; its standard error goes to the test's.
    ///
    /// # Panics
    /// When it cannot be started.
    pub fn start(name: &str, arguments: &[&str]) -> Running {
        let mut child = Command::new(path(name))
            .args(arguments)
            .current_dir(repository())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|cause| panic!("{name}: {cause}"));
        let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
        Running { name: name.into(), child, lines, seen: Vec::new() }
    }

    /// Reads standard output until a line begins with `prefix`; gives the rest of that line.
    ///
    /// # Panics
    /// When the program ends before it says so.
    pub fn line(&mut self, prefix: &str) -> String {
        for line in self.lines.by_ref() {
            let line = line.unwrap_or_default();
            if let Some(rest) = line.strip_prefix(prefix) {
                return rest.trim().to_owned();
            }
            self.seen.push(line);
        }
        panic!("{} ended without saying {prefix:?}; it said {:?}", self.name, self.seen);
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself; then there is nothing to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
