//! QEMU as the board: serial lines on loopback, memory access, reset.

use super::image::Image;
use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::SocketAddr;
use std::ops::Range;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub(super) const PROGRAM: &str = "qemu-system-arm";
/// The first version whose STM32F405 stores what is written to the clock control. With older ones the program runs on
/// the slow clock and its time is ten times too fast.
const OLDEST: u32 = 10;
/// A board with that chip, its UARTs in order: 1, 2 (autopilot), 3 (radio), 4 (log).
pub(super) const MACHINE: &str = "olimex-stm32-h405";
/// The stack's contents before the start.
pub const STACK_PAINT: u8 = 0xC5;
/// Longest time for an answer of the emulator.
const ANSWER_LIMIT: Duration = Duration::from_secs(20);

/// Boot options.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'o> {
    /// Contents of the parameters' flash; erased otherwise.
    pub parameters: Option<&'o [u8]>,
    /// One nanosecond of board time per instruction, so that its clock counts instructions. Slower.
    pub count_instructions: bool,
}

/// Stack use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StackUse {
    /// Bytes used at the deepest point.
    pub used: u32,
    /// Size in bytes.
    pub room: u32,
}

/// A running emulator. Dropping it ends the process.
pub struct Emulator {
    child: Child,
    monitor: BufReader<UnixStream>,
    folder: TempDir,
    stack: Range<u32>,
}

impl Emulator {
    pub(super) fn start(
        image: &Image,
        link: SocketAddr,
        radio: SocketAddr,
        options: &Options<'_>,
    ) -> Result<Emulator> {
        check_version()?;
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name);
        fs::write(at("board.elf"), image.bytes())?;
        let stack = image.stack()?;
        fs::write(at("paint.bin"), vec![STACK_PAINT; stack.len()])?;
        let parameters = image.parameters()?;
        let erased = vec![0xFF; parameters.len()];
        fs::write(at("parameters.bin"), options.parameters.unwrap_or(&erased))?;
        let load = |name: &str, to: &Range<u32>| {
            format!("loader,file={},addr={:#x},force-raw=on", at(name).display(), to.start)
        };
        let mut command = Command::new(PROGRAM);
        command
            // Without this, QEMU has no memory to load files into.
            .args(["-M", MACHINE, "-m", "64M", "-display", "none", "-monitor", "none", "-kernel"])
            .arg(at("board.elf"))
            .args(["-device", &load("paint.bin", &stack), "-device", &load("parameters.bin", &parameters)])
            .args(["-serial", "null", "-serial", &format!("tcp:{link},nodelay=on")])
            .args(["-serial", &format!("tcp:{radio},nodelay=on")])
            .args(["-serial", &format!("file:{}", at("log.bin").display())])
            .args(["-qmp", &format!("unix:{},server=on,wait=off", at("monitor").display())]);
        if options.count_instructions {
            command.args(["-icount", "shift=0"]);
        }
        let said = fs::File::create(at("said"))?;
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(said).spawn()?;
        let monitor = match connect(&at("monitor"), &mut child) {
            Ok(monitor) => monitor,
            Err(error) => {
                let _ = child.kill();
                let _ = child.wait();
                bail!("{error}; it printed: {}", fs::read_to_string(at("said")).unwrap_or_default());
            }
        };
        let mut emulator = Emulator { child, monitor, folder, stack };
        emulator.ask("qmp_capabilities", &json!({}))?;
        Ok(emulator)
    }

    /// Whether it is still running.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|ended| ended.is_none())
    }

    /// Its standard error so far.
    #[must_use]
    pub fn said(&self) -> String {
        fs::read_to_string(self.folder.path().join("said")).unwrap_or_default()
    }

    /// Resets the board.
    ///
    /// # Errors
    /// The emulator does not answer.
    pub fn reset(&mut self) -> Result<()> {
        self.ask("system_reset", &json!({})).map(drop)
    }

    /// Stops the processor, its clock and its timers, like a program that hangs.
    ///
    /// # Errors
    /// The emulator does not answer.
    pub fn freeze(&mut self) -> Result<()> {
        self.ask("stop", &json!({})).map(drop)
    }

    /// Ends [`Emulator::freeze`].
    ///
    /// # Errors
    /// The emulator does not answer.
    pub fn thaw(&mut self) -> Result<()> {
        self.ask("cont", &json!({})).map(drop)
    }

    /// The present contents of memory.
    ///
    /// # Errors
    /// The emulator does not answer.
    pub fn memory(&mut self, range: Range<u32>) -> Result<Vec<u8>> {
        let file = self.folder.path().join("memory.bin");
        self.ask("pmemsave", &json!({ "val": range.start, "size": range.len(), "filename": file }))?;
        Ok(fs::read(&file)?)
    }

    /// Stack use since the start.
    ///
    /// # Errors
    /// The emulator does not answer, or the stack was not filled before the start.
    pub fn stack_use(&mut self) -> Result<StackUse> {
        let stack = self.memory(self.stack.clone())?;
        let untouched = stack.iter().take_while(|&&byte| byte == STACK_PAINT).count();
        ensure!(untouched > 0, "the stack is full");
        let room = stack.len() as u32;
        Ok(StackUse { used: room - untouched as u32, room })
    }

    /// One request of the QEMU Machine Protocol.
    fn ask(&mut self, command: &str, arguments: &Value) -> Result<Value> {
        let request = json!({ "execute": command, "arguments": arguments });
        writeln!(self.monitor.get_mut(), "{request}")?;
        loop {
            let mut line = String::new();
            let read = self.monitor.read_line(&mut line).with_context(|| format!("{PROGRAM}: {command}"))?;
            ensure!(read > 0, "{PROGRAM} has ended: {}", self.said());
            let mut answer: Value = serde_json::from_str(&line)?;
            if let Some(fault) = answer.get("error") {
                bail!("{PROGRAM}: {command}: {fault}");
            }
            // Events may arrive before the answer.
            if answer.get("return").is_some() {
                return Ok(answer["return"].take());
            }
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // Fails only when it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn connect(path: &Path, child: &mut Child) -> Result<BufReader<UnixStream>> {
    let begun = Instant::now();
    loop {
        if let Ok(stream) = UnixStream::connect(path) {
            stream.set_read_timeout(Some(ANSWER_LIMIT))?;
            let mut monitor = BufReader::new(stream);
            let mut greeting = String::new();
            monitor.read_line(&mut greeting)?;
            return Ok(monitor);
        }
        ensure!(child.try_wait()?.is_none(), "{PROGRAM} has ended");
        ensure!(begun.elapsed() < ANSWER_LIMIT, "{PROGRAM} does not open its monitor");
        std::thread::sleep(Duration::from_millis(10));
    }
}

pub(super) fn check_version() -> Result<()> {
    let advice = format!(
        "install {PROGRAM} {OLDEST} or newer (Debian 12: from bookworm-backports), or type bash .ci/run"
    );
    let output = Command::new(PROGRAM).arg("--version").output();
    let output = output.with_context(|| format!("{PROGRAM} is missing: {advice}"))?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let number = text.split("version ").nth(1).and_then(|rest| rest.split('.').next());
    let major: u32 = number.and_then(|number| number.parse().ok()).unwrap_or(0);
    ensure!(major >= OLDEST, "{PROGRAM} is too old ({}): {advice}", text.lines().next().unwrap_or_default());
    Ok(())
}
