//! Prepares the linker script and the mission image for a board. Does nothing on a host.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(any(feature = "f405", feature = "h743"))]
    board::prepare();
}

#[cfg(any(feature = "f405", feature = "h743"))]
mod board {
    use gleaner_pilot::{mission_file, mission_image};
    use gleaner_units::BOARD_CELLS;
    use std::path::{Path, PathBuf};
    use std::{env, fs};

    /// The mission used without `GLEANER_MISSION`.
    const EXAMPLE: &str = "../companion/dist/mission.toml";

    /// The panic handler has a section of its own, which is empty when no panic is reachable.
    const NO_PANIC: &str = "ASSERT(SIZEOF(.gleaner_panic) == 0, \"a panic is reachable in the image: \
        build with GLEANER_ALLOW_PANIC=1, then firmware/cortex-m/panics.sh IMAGE lists its callers\")\n";

    pub fn prepare() {
        let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
        // The linker reads `memory.x` in the workspace root; a change must link again.
        println!("cargo::rerun-if-changed=../../memory.x");
        let mut script = read(Path::new("gleaner.x"));
        println!("cargo::rerun-if-env-changed=GLEANER_ALLOW_PANIC");
        if env::var("PROFILE").is_ok_and(|profile| profile == "release")
            && env::var_os("GLEANER_ALLOW_PANIC").is_none()
        {
            script += NO_PANIC;
        }
        fs::write(out.join("gleaner.x"), script).expect("OUT_DIR can be written");
        let mission = env::var_os("GLEANER_MISSION").map_or(PathBuf::from(EXAMPLE), PathBuf::from);
        println!("cargo::rerun-if-env-changed=GLEANER_MISSION");
        fs::write(out.join("mission.bin"), image(&mission)).expect("OUT_DIR can be written");
        // defmt's default level is `error`.
        println!("cargo::rerun-if-env-changed=DEFMT_LOG");
        println!("cargo::rustc-env=DEFMT_LOG={}", env::var("DEFMT_LOG").unwrap_or("info".to_owned()));
        println!("cargo::rustc-link-search={}", out.display());
        if cfg!(feature = "h743") {
            println!("cargo::rustc-link-arg-bins=--defsym=h743=1");
        }
        for argument in ["--nmagic", "-Tlink.x", "-Tgleaner.x", "-Tdefmt.x"] {
            println!("cargo::rustc-link-arg-bins={argument}");
        }
    }

    /// The mission file as a mission image.
    fn image(path: &Path) -> Vec<u8> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let city = |name: &str| {
            let path = folder.join(name);
            println!("cargo::rerun-if-changed={}", path.display());
            fs::read_to_string(path).map_err(|error| error.to_string())
        };
        match mission_file::read(&read(path), city) {
            Ok(mission) if mission.grid().len() > BOARD_CELLS => stop(&format!(
                "{}: {} cells, and a board has memory for {BOARD_CELLS}: choose larger cells, or fly it with a companion \
                 computer",
                path.display(),
                mission.grid().len()
            )),
            Ok(mission) => mission_image::encode(&mission).to_vec(),
            Err(error) => stop(&format!("{}: {error}", path.display())),
        }
    }

    fn read(path: &Path) -> String {
        println!("cargo::rerun-if-changed={}", path.display());
        fs::read_to_string(path).unwrap_or_else(|error| stop(&format!("{}: {error}", path.display())))
    }

    fn stop(cause: &str) -> ! {
        println!("cargo::error={cause}");
        std::process::exit(1)
    }
}
