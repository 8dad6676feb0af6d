//! Authority through the whole pilot: parameters, commands, queues and texts.

#![allow(clippy::needless_update)]

use crate::bench::{Bench, STATION};
use gleaner_pilot::State;
use gleaner_units::Duration;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::{MavCmd, MavResult};

/// The values of a parameter that the pilot reported.
fn told(bench: &Bench, name: &str) -> Vec<f32> {
    let all = bench.all::<dialect::PARAM_VALUE_DATA>();
    all.iter().filter(|data| data.param_id.to_str() == Ok(name)).map(|data| data.param_value).collect()
}

fn set_enable(bench: &mut Bench, value: f32) {
    let set = dialect::PARAM_SET_DATA {
        param_value: value,
        target_system: bench.onboard.link().address().system,
        target_component: 191,
        param_id: "GLN_ENABLE".into(),
        ..dialect::PARAM_SET_DATA::DEFAULT
    };
    bench.hear(STATION, &set);
}

#[test]
fn a_set_that_is_repeated_after_a_take_over_engages_nothing() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    set_enable(&mut bench, 1.0);
    bench.run(2);
    assert_eq!(bench.onboard.state(), State::Engaged);
    bench.sent.clear();
    bench.mode = 5;
    bench.heartbeat();
    bench.run(1);
    assert_eq!(bench.onboard.state(), State::Passive);
    assert_eq!(told(&bench, "GLN_ENABLE"), [0.0], "the change is sent without a request");
    bench.mode = 4;
    bench.run(2);
    set_enable(&mut bench, 1.0);
    bench.run(5);
    assert_eq!(bench.onboard.state(), State::Passive, "the station saw no answer to its first set");
    bench.run(4);
    set_enable(&mut bench, 1.0);
    bench.run(2);
    assert_eq!(bench.onboard.state(), State::Engaged, "a new request");
}

#[test]
fn requests_of_one_poll_act_in_their_order() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    for value in [0.0, 1.0, 0.0] {
        bench.command(MavCmd::MAV_CMD_USER_2, value);
    }
    bench.tick();
    assert_eq!(bench.onboard.state(), State::Idle);
}

#[test]
fn a_take_over_revokes_what_was_transmitted() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    let before = bench.onboard.revocations();
    bench.run(3);
    assert_eq!(bench.onboard.revocations(), before);
    bench.mode = 5;
    bench.heartbeat();
    bench.tick();
    assert_eq!(bench.onboard.revocations(), before + 1);
}

#[test]
fn the_reason_of_a_fault_is_repeated_when_the_link_is_back() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.run(2);
    for _ in 0..20 * 20 {
        bench.onboard.poll(bench.now);
        bench.carry_away();
        bench.now = bench.now + Duration::from_millis(50);
    }
    assert_eq!(bench.onboard.state(), State::Fault);
    bench.sent.clear();
    bench.run(3);
    assert!(bench.texts().iter().any(|text| text.contains("fault: ")), "{:?}", bench.texts());
}

#[test]
fn a_return_is_denied_when_nothing_is_flown() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    bench.command(MavCmd::MAV_CMD_USER_3, 0.0);
    bench.run(1);
    let acks = bench.all::<dialect::COMMAND_ACK_DATA>();
    assert_eq!(acks[0].result, MavResult::MAV_RESULT_DENIED);
}
