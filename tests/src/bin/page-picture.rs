//! Takes the picture of the live page for the README: Chromium opens the page of a simulated flight.
//!
//! usage: page-picture FILE

use anyhow::{Context, Result, bail};
use gleaner_tests::{programs, python};
use std::fs;
use std::path::PathBuf;

fn main() -> Result<()> {
    let Some(file) = std::env::args_os().nth(1).map(PathBuf::from) else { bail!("usage: page-picture FILE") };
    let folder = tempfile::tempdir()?;
    let (sitl, gleaner) = (programs::path("gleaner-sitl"), programs::path("gleaner"));
    python::run("browser.py", [sitl.as_path(), gleaner.as_path(), folder.path()])?;
    fs::copy(folder.path().join("live.png"), &file).with_context(|| file.display().to_string())?;
    println!("{}", file.display());
    Ok(())
}
