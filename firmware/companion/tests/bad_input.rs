//! Every bad input at the start: exit code 2, nothing on stdout, one line on stderr: what, where, what to do.

mod fixture;

use fixture::{Fixture, model, outcome};
use gleaner_policy::onnx::pb::{ModelProto, StringStringEntryProto};
use prost::Message;
use sha2::{Digest, Sha256};
use std::net::{TcpListener, UdpSocket};
use std::process::Command;

/// Runs with one thing spoiled, and gives the one line without the program's name.
#[track_caller]
fn refusal(fixture: &Fixture, spoil: impl FnOnce(&Fixture, &mut Command)) -> String {
    let mut gleaner = fixture.gleaner("run");
    spoil(fixture, &mut gleaner);
    refused(&mut gleaner)
}

#[track_caller]
fn refused(gleaner: &mut Command) -> String {
    let (code, stdout, stderr) = outcome(&gleaner.output().unwrap());
    assert_eq!((code, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1), "{stderr}");
    stderr.strip_prefix("gleaner: ").expect("the program's name").trim_end().to_owned()
}

#[track_caller]
fn says(line: &str, parts: &[&str]) {
    let mut rest = line;
    for part in parts {
        let Some(at) = rest.find(part) else { panic!("no {part:?} in {line:?}") };
        rest = &rest[at + part.len()..];
    }
}

/// The model with one metadata entry changed, sealed again.
fn with_entry(key: &str, value: &str) -> Vec<u8> {
    let mut model = ModelProto::decode(&model(fixture::LOGITS)[..]).unwrap();
    model.metadata_props.retain(|entry| entry.key != "sha256");
    model.metadata_props.iter_mut().find(|entry| entry.key == key).unwrap().value = value.into();
    let digest = Sha256::digest(model.encode_to_vec()).iter().map(|byte| format!("{byte:02x}")).collect();
    model.metadata_props.push(StringStringEntryProto { key: "sha256".into(), value: digest });
    model.encode_to_vec()
}

#[test]
fn models() {
    let fixture = Fixture::new();
    let whole = model(fixture::LOGITS);
    let mut altered = whole.clone();
    let middle = altered.len() / 2;
    altered[middle] ^= 0x55;
    let wrong_golden = model([5.0, 4.0, 3.0, 2.0, 1.5]);
    let half = &whole[..whole.len() / 2];
    let random: Vec<u8> = (0..5000u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let cases: [(&str, &[u8], &[&str]); 6] = [
        ("empty", b"", &["copy the file again"]),
        ("truncated", half, &["damaged, or not an ONNX model", "copy the file again"]),
        ("garbage", &random, &["damaged, or not an ONNX model", "copy the file again"]),
        ("altered", &altered, &["altered after sealing", "copy the file again"]),
        (
            "golden mismatch",
            &wrong_golden,
            &["self-test failed: golden pair 0 differs by 5e-1", "do not fly"],
        ),
        (
            "schema mismatch",
            &with_entry("schema_hash", "0x0000000000000001"),
            &["schema 0x0000000000000001", "retrain"],
        ),
    ];
    for (name, bytes, parts) in cases {
        fixture.write("policy.onnx", bytes);
        let line = refusal(&fixture, |_, _| {});
        assert!(line.starts_with("model "), "{name}: {line}");
        says(&line, &["policy.onnx: "]);
        says(&line, parts);
    }
    let line = refusal(&fixture, |_, gleaner| {
        gleaner.args(["--model", "no/such.onnx"]);
    });
    says(&line, &["model no/such.onnx: cannot be read: ", "correct the path"]);
}

#[test]
fn missions() {
    let cases: [(&str, &str, &str, &[&str]); 7] = [
        (
            "mission.toml",
            "terminal = [3, 2]",
            "terminal = [9, 2]",
            &["mission.toml: line 1: ", "move the terminal"],
        ),
        ("mission.toml", "[2, 1]", "[2, 9]", &["mission.toml: line 10: device 1 stands outside the city"]),
        (
            "mission.toml",
            "battery_units = 20.0",
            "battery_units = nan",
            &["mission.toml: line 2: ", "give one"],
        ),
        ("mission.toml", "cell_m", "cell_metres", &["mission.toml: line 7: unknown field `cell_metres`"]),
        ("mission.toml", "[grid]", "[grid", &["mission.toml: line 4: "]),
        (
            "mission.toml",
            "city.csv",
            "town.csv",
            &["line 8: heights \"town.csv\": cannot be read", "put the city beside"],
        ),
        (
            "city.csv",
            "33",
            "cheese",
            &["mission.toml: heights \"city.csv\", line 2, column 2: \"cheese\" is no height in metres"],
        ),
    ];
    for (file, from, to, parts) in cases {
        let fixture = Fixture::new();
        fixture.edit(file, from, to);
        says(&refusal(&fixture, |_, _| {}), parts);
    }
    let line = refusal(&Fixture::new(), |_, gleaner| {
        gleaner.args(["--mission", "no/such.toml"]);
    });
    says(&line, &["mission no/such.toml: cannot be read: ", "correct the path"]);
}

#[test]
fn configurations() {
    let cases: [(&str, &str, &[&str]); 7] = [
        ("model =", "modle =", &["gleaner.toml: line 1: unknown field `modle`, expected one of `model`"]),
        ("\"policy.onnx\"", "\"policy.onnx", &["gleaner.toml: line 1: "]),
        (
            "udpin:127.0.0.1:0",
            "udpin:0",
            &[
                "line 3: autopilot: 'udpin:0' is not an endpoint: ",
                "write HOST:PORT: did you mean udpin:0.0.0.0:14550?",
            ],
        ),
        (
            "GLN_W_DATA = 0.25",
            "GLN_W_DATA = 2",
            &["line 7: GLN_W_DATA = 2: ", "0..1", "correct or remove this line"],
        ),
        (
            "GLN_W_DATA = 0.25",
            "GLN_W_DATA = nan",
            &["line 7: GLN_W_DATA = NaN: ", "correct or remove this line"],
        ),
        ("GLN_W_DATA = 0.25", "GLN_FOO = 1", &["line 7: GLN_FOO = 1: no such parameter: "]),
        (
            "log_dir = \"log\"",
            "component_id = 300",
            &["line 4: component_id = 300: it must be a number from 2 to 254"],
        ),
    ];
    for (from, to, parts) in cases {
        let fixture = Fixture::new();
        fixture.edit("gleaner.toml", from, to);
        let line = refusal(&fixture, |_, _| {});
        assert!(line.starts_with("config "), "{line}");
        says(&line, parts);
    }
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "mission = \"mission.toml\"\n", "");
    says(
        &refusal(&fixture, |_, _| {}),
        &["no mission is set: give --mission, or write `mission = \"mission.toml\"`"],
    );
    std::fs::remove_file(fixture.path("gleaner.toml")).unwrap();
    says(
        &refusal(&fixture, |_, _| {}),
        &["gleaner.toml: cannot be read: ", "correct the path after --config"],
    );
}

#[test]
fn ports() {
    let busy = UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = format!("udpin:{}", busy.local_addr().unwrap());
    let closed = format!("tcpout:{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap());
    let fixture = Fixture::new();
    for (flag, endpoint, parts) in [
        (
            "--autopilot",
            "serial:/dev/ttyNOSUCH:57600",
            ["autopilot port serial:/dev/ttyNOSUCH:57600: ", "plug the device in"],
        ),
        ("--autopilot", taken.as_str(), ["autopilot port udpin:127.0.0.1:", "stop the other program"]),
        ("--autopilot", closed.as_str(), ["autopilot port tcpout:127.0.0.1:", "start the other side first"]),
        (
            "--radio",
            "serial:/dev/null",
            ["radio port serial:/dev/null:57600: ", "check that this is a serial device"],
        ),
        ("--radio", "serial:/dev/ttyS0:fast", ["--radio", "the baud rate must be a whole number above 0"]),
    ] {
        let line = refusal(&fixture, |_, gleaner| {
            gleaner.args([flag, endpoint]);
        });
        says(&line, &parts);
    }
}

#[test]
fn logs_that_cannot_be_written() {
    let fixture = Fixture::new();
    let line = refusal(&fixture, |fixture, gleaner| {
        fixture.write("occupied", "a file, not a folder");
        gleaner.arg("--log").arg(fixture.path("occupied"));
    });
    says(&line, &["log ", "occupied/decisions.jsonl: ", "give another folder with --log"]);
}

#[test]
fn command_lines() {
    let gleaner = |args: &[&str]| {
        let mut gleaner = Command::new(env!("CARGO_BIN_EXE_gleaner"));
        gleaner.args(args);
        gleaner
    };
    says(&refused(&mut gleaner(&[])), &["no command: type one, for example `gleaner check`"]);
    says(&refused(&mut gleaner(&["fly"])), &["unrecognized subcommand 'fly'", "see `gleaner --help`"]);
    says(
        &refused(&mut gleaner(&["run", "--modle", "x"])),
        &["unexpected argument '--modle'", "did you mean --model?"],
    );
    says(&refused(&mut gleaner(&["run"])), &["no mission is set: give --mission"]);
    says(&refused(&mut gleaner(&["check", "--wait", "soon"])), &["--wait"]);
    let (code, stdout, stderr) = outcome(&gleaner(&["--help"]).output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    says(&stdout, &["run", "check"]);
}
