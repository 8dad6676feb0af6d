use super::*;
use gleaner_pilot::OnStop;

const TEXT: &str = r#"model = "policy.onnx"
mission = "missions/city.toml"
autopilot = "udpin:127.0.0.1:14540"
radio = "serial:/dev/ttyUSB0:115200"
log_dir = "/var/log/gleaner"
component_id = 192
system_id = 7

[parameters]
GLN_W_DATA = 1
GLN_ALT = 75.5
"#;

fn merged(setup: &Setup, text: &str) -> Result<Config, String> {
    merge(setup, &Source { path: Path::new("/etc/gleaner/gleaner.toml"), text }, |_| None)
        .map_err(|error| error.to_string())
}

fn fault(text: &str) -> String {
    let error = merged(&Setup::default(), text).err().unwrap();
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

#[test]
fn paths_are_relative_to_the_file_and_flags_go_first() {
    let config = merged(&Setup::default(), TEXT).unwrap();
    assert_eq!(config.model.as_deref(), Some(Path::new("/etc/gleaner/policy.onnx")));
    assert_eq!(config.engine, None);
    assert_eq!(config.mission, Path::new("/etc/gleaner/missions/city.toml"));
    assert_eq!(config.log_dir.as_deref(), Some(Path::new("/var/log/gleaner")));
    assert_eq!(config.settings, Settings { system_id: Some(7), component_id: 192, ..Settings::default() });
    assert_eq!(config.parameters.altitude().0, 75.5);
    let setup = Setup {
        model: Some("other.onnx".into()),
        engine: Some(EngineKind::Tract),
        autopilot: Some("tcpout:127.0.0.1:5760".parse().unwrap()),
        ..Setup::default()
    };
    let config = merged(&setup, TEXT).unwrap();
    assert_eq!(config.model.as_deref(), Some(Path::new("other.onnx")));
    assert_eq!(config.engine, Some(EngineKind::Tract));
    assert_eq!(config.autopilot.to_string(), "tcpout:127.0.0.1:5760");
    assert_eq!(config.radio.unwrap().to_string(), "serial:/dev/ttyUSB0:115200");
}

#[test]
fn faults_name_file_line_and_key_and_say_what_to_do() {
    let file = "config /etc/gleaner/gleaner.toml: ";
    let cases = [
        (
            "component_id = 192",
            "component_id = 1",
            "line 6: component_id = 1: it must be a number from 2 to 254, 191 to 194 are usual",
        ),
        (
            "system_id = 7",
            "system_id = 256",
            "line 7: system_id = 256: it must be a number from 1 to 254, or leave it out to adopt the autopilot's",
        ),
        (
            "GLN_W_DATA = 1",
            "GLN_ENABLE = 1",
            "line 10: GLN_ENABLE = 1: only a request in flight may engage: remove this line",
        ),
        (
            "GLN_W_DATA = 1",
            "GLN_DATA = 1",
            "line 10: GLN_DATA = 1: no such parameter: correct or remove this line",
        ),
    ];
    for (from, to, expected) in cases {
        assert_eq!(fault(&TEXT.replace(from, to)), format!("{file}{expected}"));
    }
    for (from, to, start) in [
        ("model =", "modle =", "line 1: unknown field `modle`, expected one of `model`, `models`, `engine`"),
        ("udpin:127.0.0.1:14540", "udpin:14540", "line 3: autopilot: 'udpin:14540' is not an endpoint: "),
        (
            "component_id",
            "engine = \"onnx\"\ncomponent_id",
            "line 6: engine = \"onnx\": unknown engine: choose tract or native",
        ),
        ("GLN_W_DATA = 1", "GLN_W_DATA = nan", "line 10: GLN_W_DATA = NaN: "),
        ("GLN_W_DATA = 1", "GLN_W_DATA = -1", "line 10: GLN_W_DATA = -1: "),
        ("GLN_ALT = 75.5", "GLN_ALT = 1e300", "line 11: GLN_ALT = 1"),
        ("system_id = 7", "system_id = \"7\"", "line 7: invalid type: string \"7\""),
        ("[parameters]", "[parameters", "line 9: "),
    ] {
        let error = fault(&TEXT.replace(from, to));
        assert!(error.starts_with(&format!("{file}{start}")), "{error}");
    }
    assert_eq!(
        fault(""),
        "no mission is set: give --mission, or write `mission = \"mission.toml\"` into the file given with --config"
    );
}

#[test]
fn systemd_gives_the_folders_that_are_not_set() {
    let text = "mission = \"m\"\nautopilot = \"udpin:0.0.0.0:1\"\nlog_dir = \"own\"";
    let source = Source { path: Path::new("/etc/gleaner.toml"), text };
    let config = merge(&Setup::default(), &source, |name| Some(Path::new("/var").join(name))).unwrap();
    assert_eq!(config.log_dir.as_deref(), Some(Path::new("/etc/own")));
    assert_eq!(config.state_dir.as_deref(), Some(Path::new("/var/STATE_DIRECTORY")));
    assert_eq!((config.model, config.ground.len()), (None, 0));
}

#[test]
fn several_ground_ports_and_log_limits_are_read() {
    let more = "ground = [\"udpout:10.0.0.2:14550\", \"tcpin:0.0.0.0:5760\"]\n";
    let log = "\n[log]\nfile_mb = 8\ntelemetry = false\n";
    let config = merged(&Setup::default(), &format!("{more}{TEXT}{log}")).unwrap();
    assert_eq!(config.ground.len(), 2);
    assert!(!config.telemetry_log);
    let limits = Limits { file_bytes: 8 << 20, min_free_bytes: 256 << 20 };
    assert_eq!(config.log_limits, limits);
    let error = fault(&format!("{TEXT}\n[log]\nfile_mb = 0\n"));
    assert!(
        error.ends_with("line 14: file_mb = 0: it must be a number from 1 to 4096, in megabytes"),
        "{error}"
    );
}

#[test]
fn the_signing_table_is_read() {
    let config = merged(&Setup::default(), &format!("{TEXT}\n[signing]\nkey = \"signing.key\"\n")).unwrap();
    let signing = SigningConfig { key: "/etc/gleaner/signing.key".into(), ports: vec!["ground".into()] };
    assert_eq!(config.signing, Some(signing));
    let error = fault(&format!("{TEXT}\n[signing]\nkey = \"k\"\nports = [\"radio\"]\n"));
    assert!(error.ends_with("line 15: signing.ports: \"radio\": a port is autopilot or ground"), "{error}");
}

#[test]
fn operators_and_the_radio_format_are_read() {
    // Top-level keys stand before the first table.
    let with = |lines: &str| format!("{lines}\n{TEXT}");
    let config =
        merged(&Setup::default(), &with("operators = [\"250/100\"]\nradio_format = \"semtech_udp\""))
            .unwrap();
    assert!(config.settings.operators.allow(gleaner_link::Address::new(250, 100)));
    assert!(!config.settings.operators.allow(gleaner_link::Address::new(255, 190)));
    assert_eq!(config.radio_format, RadioFormat::SemtechUdp(Calibration::LORA));
    assert!(
        fault(&with("operators = [\"gcs\"]")).contains("line 1: operators: \"gcs\": an operator is SYSTEM")
    );
    assert!(
        fault(&with("radio_format = \"nmea\"")).contains("line 1: radio_format = \"nmea\": there are cobs")
    );
}

#[test]
fn what_a_stop_in_flight_requests_is_return_or_hold() {
    let on_stop = |line: &str| {
        let config = merged(&Setup::default(), &format!("{line}\n{TEXT}"));
        config.map(|config| config.settings.rules.on_stop)
    };
    assert_eq!(on_stop(""), Ok(OnStop::Return));
    assert_eq!(on_stop("on_stop = \"hold\""), Ok(OnStop::Hold));
    let refused = on_stop("on_stop = \"land\"").unwrap_err();
    assert!(refused.contains("line 1: on_stop = \"land\": there are return and hold"), "{refused}");
}

/// The shipped file, cut, with parts repeated, left out or changed: nothing panics, and a fault is one line.
#[test]
fn damaged_files_are_refused_in_one_line() {
    let valid = include_str!("../../dist/gleaner.toml").replace("\n# ", "\n");
    // Marsaglia's xorshift: the crate has no generator.
    let mut state = 0x9E37_79B9_u32;
    let mut draw = |below: usize| {
        for (left, by) in [(true, 13), (false, 17), (true, 5)] {
            state ^= if left { state << by } else { state >> by };
        }
        state as usize % below
    };
    // More for a long run: GLEANER_FUZZ_INPUTS=100000000.
    let inputs = std::env::var("GLEANER_FUZZ_INPUTS").map_or(3_000_u64, |inputs| inputs.parse().unwrap());
    for _ in 0..inputs {
        let mut bytes = valid.clone().into_bytes();
        for _ in 0..1 + draw(4) {
            let at = draw(bytes.len());
            let part = bytes[at..bytes.len().min(at + 1 + draw(40))].to_vec();
            match draw(4) {
                0 => bytes.truncate(at.max(1)),
                1 => drop(bytes.splice(at..at + part.len(), [])),
                2 => drop(bytes.splice(at..at, part)),
                _ => bytes[at] = draw(128) as u8,
            }
            if bytes.is_empty() {
                bytes.push(b'=');
            }
        }
        if let Err(error) = merged(&Setup::default(), &String::from_utf8_lossy(&bytes)) {
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
