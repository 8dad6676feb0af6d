//! Python, for the judges by other authors.
//!
//! They are installed into a virtual environment in the build folder, made once from `tests/python/requirements.txt` and
//! made again when an installed version differs. On a machine without Python the calling test fails; none is skipped.

use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Folder of the scripts and of the requirements.
#[must_use]
pub fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("python")
}

/// Runs a script of `tests/python` in the virtual environment; returns its standard output.
///
/// # Errors
/// No environment (the message says what to type), or the script ended with another code than 0.
pub fn run<A: AsRef<OsStr>>(script: &str, arguments: impl IntoIterator<Item = A>) -> Result<String> {
    let output = Command::new(interpreter()?)
        .arg(scripts().join(script))
        .args(arguments)
        .output()
        .with_context(|| format!("cannot start {script}"))?;
    if !output.status.success() {
        bail!("{script} ended with {}:\n{}", output.status, String::from_utf8_lossy(&output.stderr));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The Python of the virtual environment, with everything in the requirements. Safe to call from several tests and
/// processes at once: one makes the environment, the others wait.
///
/// # Errors
/// There is no `python3` on the PATH, or it cannot install: with the command to type.
pub fn interpreter() -> Result<PathBuf> {
    let target = target_folder();
    fs::create_dir_all(&target)?;
    let lock = File::create(target.join("venv.lock"))?;
    lock.lock().context("cannot lock the virtual environment")?;
    let environment = target.join("venv");
    let python = environment.join("bin/python");
    let requirements = scripts().join("requirements.txt");
    if !is_complete(&python, &requirements) {
        make(&environment, &python, &requirements, &["--no-deps"])?;
    }
    Ok(python)
    // Dropping the file releases the lock.
}

/// A Python with PyTorch: the one that `GLEANER_TORCH_PYTHON` names, or an environment of its own in the build folder,
/// installed once: several gigabytes.
///
/// # Errors
/// PyTorch cannot be installed here, with the cause.
pub fn pytorch() -> Result<PathBuf> {
    if let Some(python) = std::env::var_os("GLEANER_TORCH_PYTHON") {
        return Ok(python.into());
    }
    let environment = target_folder().join("venv-pytorch");
    let python = environment.join("bin/python");
    let requirements = scripts().join("pytorch-requirements.txt");
    if !is_complete(&python, &requirements) {
        make(&environment, &python, &requirements, &[])?;
    }
    Ok(python)
}

/// Cargo's target folder; a relative path starts at the workspace's folder.
fn target_folder() -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    workspace.join(std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// Whether the pinned versions are installed.
fn is_complete(python: &Path, requirements: &Path) -> bool {
    const COMPARE: &str = "
import importlib.metadata, sys
for line in open(sys.argv[1]):
    pin = line.split('#')[0].strip()
    if pin:
        name, version = pin.split('==')
        if importlib.metadata.version(name) != version:
            sys.exit(1)
";
    python.exists()
        && Command::new(python)
            .args(["-c", COMPARE])
            .arg(requirements)
            .output()
            .is_ok_and(|output| output.status.success())
}

fn make(environment: &Path, python: &Path, requirements: &Path, options: &[&str]) -> Result<()> {
    let advice = format!(
        "python3 -m venv --clear {} && {} -m pip install {} -r {}",
        environment.display(),
        python.display(),
        options.join(" "),
        requirements.display()
    );
    let made = Command::new("python3").args(["-m", "venv", "--clear"]).arg(environment).output();
    let made = made.with_context(|| {
        format!(
            "cannot start python3: install Python 3.11 or newer with its venv module, then type: {advice}"
        )
    })?;
    succeeded("python3 -m venv", &made, &advice)?;
    let installed = Command::new(python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
        .args(options)
        .arg("-r")
        .arg(requirements)
        .output()
        .with_context(|| format!("cannot start {}: type: {advice}", python.display()))?;
    succeeded("pip install", &installed, &advice)
}

fn succeeded(what: &str, output: &Output, advice: &str) -> Result<()> {
    if !output.status.success() {
        let said = [&output.stdout[..], &output.stderr[..]].concat();
        bail!("{what} failed: {}\ntype: {advice}", String::from_utf8_lossy(&said).trim());
    }
    Ok(())
}
