//! Gleaner's own programs as processes.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};

/// The program of this name, built by the same cargo command as the calling test.
///
/// # Panics
/// When it is not built, with the command to type.
#[must_use]
pub fn path(name: &str) -> PathBuf {
    // Tests are in the `deps` folder beside the programs; a program of this package is beside them.
    let own = std::env::current_exe().expect("a program knows where it is");
    let folder =
        own.ancestors().skip(1).find(|folder| !folder.ends_with("deps")).expect("a program is in a folder");
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
    /// Starts a program; its standard error goes to the test's.
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

    /// Its process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Reads standard output until a line begins with `prefix`; returns the rest of that line.
    ///
    /// # Panics
    /// When the program ends before that.
    pub fn line(&mut self, prefix: &str) -> String {
        for line in self.lines.by_ref() {
            let line = line.unwrap_or_default();
            if let Some(rest) = line.strip_prefix(prefix) {
                return rest.trim().to_owned();
            }
            self.seen.push(line);
        }
        panic!("{} ended before it printed {prefix:?}; it printed {:?}", self.name, self.seen);
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Fails only when it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
