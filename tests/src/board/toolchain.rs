//! Builds the image with rustup's toolchain, or with the system's.

use crate::programs::repository;
use anyhow::{Context, Result, bail};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The board's processor: Cortex-M4 with its floating-point unit.
const TARGET: &str = "thumbv7em-none-eabihf";
/// The program that is shipped, and its features.
pub(super) const SHIPPED: [&str; 2] = ["gleaner-f405", "f405"];
/// The program that measures the cost of look-ahead.
pub(super) const LOOKAHEAD_COST: [&str; 2] = ["lookahead-cost", "f405,lookahead-cost"];

/// Builds a program for the board; returns its path. Safe to call from several tests and processes at once: one
/// builds, the others wait. It has a build folder of its own, so it never waits for the cargo that runs the tests.
///
/// # Errors
/// The core library for the board is missing (the message says what to type), or the image does not build.
pub(super) fn build([program, features]: [&str; 2]) -> Result<PathBuf> {
    let target_folder = repository().join("target/board");
    fs::create_dir_all(&target_folder)?;
    let lock = File::create(target_folder.join("build.lock"))?;
    lock.lock().context("cannot lock the board's build folder")?;
    let mut cargo = cargo()?;
    let output = cargo
        .current_dir(repository())
        .args(["build", "--quiet", "--profile", "board", "--package", "gleaner-cortex-m"])
        .args(["--bin", program, "--features", features, "--target", TARGET, "--target-dir"])
        .arg(&target_folder)
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_TARGET_DIR")
        .env_remove("GLEANER_MISSION")
        .output()
        .context("cannot start cargo")?;
    if !output.status.success() {
        bail!("the board image does not build:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(target_folder.join(TARGET).join("board").join(program))
    // Dropping the file releases the lock.
}

/// The cargo that runs this test, if its compiler has the board's core library; else the system's own.
fn cargo() -> Result<Command> {
    if has_core("rustc") {
        return Ok(Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())));
    }
    if has_core("/usr/bin/rustc") {
        let path = std::env::var("PATH").unwrap_or_default();
        let mut cargo = Command::new("/usr/bin/cargo");
        cargo.env("PATH", format!("/usr/bin:{path}")).env_remove("RUSTC").env_remove("RUSTUP_TOOLCHAIN");
        return Ok(cargo);
    }
    bail!("Rust's core library for {TARGET} is missing: type rustup target add {TARGET}, or bash .ci/run");
}

fn has_core(rustc: &str) -> bool {
    let output = Command::new(rustc).args(["--print", "target-libdir", "--target", TARGET]).output();
    let Ok(output) = output else { return false };
    let folder = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let Ok(files) = fs::read_dir(Path::new(&folder)) else { return false };
    files.flatten().any(|file| file.file_name().to_string_lossy().starts_with("libcore-"))
}
