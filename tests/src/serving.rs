//! `gleaner-sitl serve` and `gleaner run` as two processes with sockets between them, for a ground station to connect to.

use crate::programs::{Running, repository};
use std::path::PathBuf;
use tempfile::TempDir;

/// Kind of the autopilot's line.
#[derive(Clone, Copy, Debug)]
pub enum Link {
    /// A byte stream.
    Tcp,
    /// Datagrams.
    Udp,
}

/// A simulated city with a pilot that is connected to it. Both end when it is dropped.
pub struct Serving {
    /// `gleaner run`.
    pub pilot: Running,
    /// `HOST:PORT` of the UDP port for a ground station.
    pub station: String,
    _city: Running,
    folder: TempDir,
}

impl Serving {
    /// Starts RD with the realization of seed 3; `more` are further arguments of `serve`. The vehicle runs five times as fast
    /// as the wall clock, so that a take-off takes six seconds. The pilot keeps wall time, as always.
    ///
    /// # Panics
    /// When a program cannot be started or ends early.
    #[must_use]
    pub fn start(link: Link, more: &[&str]) -> Serving {
        Serving::at_speed("5", link, more)
    }

    /// The same with a vehicle that runs `speed` times as fast.
    ///
    /// # Panics
    /// See [`Serving::start`].
    #[must_use]
    pub fn at_speed(speed: &str, link: Link, more: &[&str]) -> Serving {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
        let (mission, out, log) = (at("mission.toml"), at("flight"), at("log"));
        let any = "tcpin:127.0.0.1:0";
        let (listen, connect) = match link {
            Link::Tcp => (any, "tcpout"),
            Link::Udp => ("udpin:127.0.0.1:0", "udpout"),
        };
        let mut words = vec!["serve", "--scenario", "rd", "--seed", "3", "--speed", speed];
        words.extend(["--companion", listen, "--radio", any, "--gcs", "udpin:127.0.0.1:0"]);
        words.extend(["--mission-out", &mission, "--out", &out]);
        words.extend(more);
        let mut city = Running::start("gleaner-sitl", &words);
        let address = |endpoint: String| endpoint.split_once(':').expect("KIND:HOST:PORT").1.to_owned();
        let companion = format!("{connect}:{}", address(city.line("companion")));
        let radio = format!("tcpout:{}", address(city.line("radio")));
        let station = address(city.line("gcs"));
        let model = repository().join("models/gleaner.onnx");
        let model = model.to_str().expect("UTF-8");
        let mut words = vec!["run", "--autopilot", &companion, "--radio", &radio, "--model", model];
        words.extend(["--mission", &mission, "--log", &log]);
        let pilot = Running::start("gleaner", &words);
        Serving { pilot, station, _city: city, folder }
    }

    /// The decision log.
    #[must_use]
    pub fn decisions(&self) -> PathBuf {
        self.folder.path().join("log/decisions.jsonl")
    }
}
