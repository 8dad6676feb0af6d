//! Several installed models: chosen by `GLN_MODEL`, refused when bad, and back to the one before.

mod fixture;

use fixture::vehicle::{FakeAutopilot, Running};
use fixture::{Fixture, LOGITS, model, named_model, outcome};
use gleaner_link::Message;

/// Model 0 is "hover", 1 is "other", 2 does not reproduce its golden pair.
fn installed() -> Fixture {
    let fixture = Fixture::new();
    fixture.write("other.onnx", named_model("other", LOGITS));
    fixture.write("bad.onnx", model([9.0; 5]));
    let models = "models = [\"other.onnx\", \"bad.onnx\"]\nstate_dir = \"state\"\nlog_dir";
    fixture.edit("gleaner.toml", "log_dir", models);
    fixture
}

fn connected(fixture: &Fixture) -> (Running, FakeAutopilot) {
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    (running, autopilot)
}

fn choose(autopilot: &mut FakeAutopilot, number: f32, text: &str) {
    autopilot.set_parameter("GLN_MODEL", number);
    autopilot.await_text(text);
}

#[test]
fn a_model_is_chosen_by_parameter_and_the_one_before_returns() {
    let fixture = installed();
    let (running, mut autopilot) = connected(&fixture);
    choose(&mut autopilot, 1.0, "gleaner: model 1: other");
    choose(&mut autopilot, -1.0, "gleaner: model 0: hover");
    choose(&mut autopilot, -1.0, "gleaner: model 1: other");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");

    // The choice is kept.
    let mut running = Running::start(&mut fixture.gleaner("run"));
    running.says("with model other, engine tract (");
    assert_eq!(running.stop().0, Some(0));

    // A kept choice that cannot be used any more costs itself only.
    fixture.write("other.onnx", "no model");
    let mut running = Running::start(&mut fixture.gleaner("run"));
    running.says("with model hover, ");
    let line = running.says("GLN_MODEL 1 refused: model ");
    assert!(line.ends_with(": model 0 flies"), "{line}");
    assert_eq!(running.stop().0, Some(0));
}

#[test]
fn a_bad_model_is_refused_and_the_one_in_use_stays() {
    let fixture = installed();
    let (running, mut autopilot) = connected(&fixture);
    choose(&mut autopilot, 1.0, "gleaner: model 1: other");
    choose(&mut autopilot, 2.0, "gleaner: model 2 refused, see the log; 1 stays");
    choose(&mut autopilot, 7.0, "gleaner: model 7 refused, there are models 0..2; 1");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    let cause = rest.lines().filter(|line| line.contains("model 2 refused: model ")).count();
    assert_eq!(cause, 1, "{rest}");
    let kept = std::fs::read_to_string(fixture.path("state/parameters.toml")).unwrap();
    assert!(kept.contains("GLN_MODEL = 1.0"), "{kept}");
}

#[test]
fn no_model_is_replaced_while_it_decides() {
    let fixture = installed();
    let (running, mut autopilot) = connected(&fixture);
    autopilot.engage();
    choose(&mut autopilot, 1.0, "gleaner: model 1 refused, not in flight; 0 stays");
    autopilot.custom_mode = 5;
    autopilot.await_text("gleaner: passive");
    choose(&mut autopilot, 1.0, "gleaner: model 1: other");
    assert_eq!(running.stop().0, Some(0));
}

#[test]
fn check_tests_every_installed_model() {
    let fixture = installed();
    let (code, stdout, _) = outcome(&fixture.gleaner("check").args(["--wait", "0"]).output().unwrap());
    assert_eq!(code, Some(1));
    for start in ["ok    model      hover ", "ok    model 1    other ", "FAIL  model 2    model "] {
        assert!(stdout.lines().any(|line| line.starts_with(start)), "{start}: {stdout}");
    }
    let many = format!("models = [{}]\n", "\"other.onnx\", ".repeat(17));
    fixture.write("gleaner.toml", many + fixture::CONFIG);
    let (code, _, stderr) = outcome(&fixture.gleaner("check").output().unwrap());
    assert_eq!((code, stderr.lines().count()), (Some(2), 1), "{stderr}");
    assert!(stderr.contains("models: more than 16 entries"), "{stderr}");
}
