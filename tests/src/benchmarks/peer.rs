//! A peer in Python that runs its rounds when it is told to, in turns with ours.

use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A running script of `tests/python` that speaks the lines of `rounds.py`. It ends when this is dropped.
pub(super) struct Peer {
    child: Child,
    input: ChildStdin,
    lines: std::io::Lines<BufReader<ChildStdout>>,
    about: String,
}

impl Peer {
    /// Starts the script with this interpreter and waits until it is ready.
    pub fn start(python: &Path, script: &str, arguments: &[String]) -> Result<Peer> {
        let mut child = Command::new(python)
            .arg(crate::python::scripts().join(script))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {script}"))?;
        let input = child.stdin.take().context("a pipe")?;
        let lines = BufReader::new(child.stdout.take().context("a pipe")?).lines();
        let mut peer = Peer { child, input, lines, about: String::new() };
        peer.about = peer.line().with_context(|| format!("{script} does not start"))?;
        Ok(peer)
    }

    /// Name and version.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// One round of a contender, microseconds per call.
    pub fn round(&mut self, name: &str) -> Result<f64> {
        writeln!(self.input, "{name}")?;
        let line = self.line().with_context(|| format!("the round `{name}`"))?;
        line.trim().parse().with_context(|| format!("the peer printed `{line}`"))
    }

    fn line(&mut self) -> Result<String> {
        if let Some(line) = self.lines.next() {
            return Ok(line?);
        }
        let mut said = String::new();
        if let Some(mut error) = self.child.stderr.take() {
            std::io::Read::read_to_string(&mut error, &mut said)?;
        }
        bail!("the peer ended: {}", said.lines().next_back().unwrap_or("without a message"))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // Fails only when it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
