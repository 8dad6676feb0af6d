//! The whole pilot from outside: MAVLink and radio bytes in, MAVLink bytes out.

// Whether a message has fields beyond those named here depends on a feature of the MAVLink crate (extensions),
// which another member of the workspace may switch on.
#![allow(clippy::needless_update)]

use crate::bench::{AUTOPILOT, Bench, STATION, hovering};
use crate::rig::{START, TERMINAL, mission};
use gleaner_guard::Guard;
use gleaner_link::{Component, TUNNEL_RADIO_REPORT};
use gleaner_pilot::{Mission, Onboard, OnboardError, Parameters, Settings, State};
use gleaner_policy::SelfTestError;
use gleaner_radio::{Report, encode, encode_body};
use gleaner_units::{Db, Duration, Instant};
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::{MavCmd, MavResult, MavState};

#[test]
fn a_mission_is_flown_from_bytes_to_bytes() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    assert_eq!(bench.onboard.state(), State::Idle, "GLN_ENABLE of a settings file engages nothing");
    assert!(bench.all::<dialect::SET_POSITION_TARGET_LOCAL_NED_DATA>().is_empty());
    bench.engage();
    bench.run(5);
    bench.command(MavCmd::MAV_CMD_USER_1, 0.25);
    bench.run(5);
    bench.command(MavCmd::MAV_CMD_USER_3, 0.0);
    bench.run(30);
    assert_eq!(bench.onboard.state(), State::Done, "{:?}", bench.texts());
    bench.armed = false;
    bench.run(2);
    assert!(bench.onboard.stats().landed);
    assert!(bench.position.horizontal_distance(&Bench::centre(TERMINAL)).0 < 2.0);

    let records = bench.records();
    assert_eq!(records.len(), bench.onboard.stats().decisions as usize);
    assert!(records.iter().enumerate().all(|(index, record)| record.sequence as usize == index));
    assert_eq!((records[0].cell, records[0].w_data, records[0].state), (START, 0.5, State::Engaged));
    assert!(records.iter().any(|record| record.w_data == 0.25 && record.logits.is_some()));
    assert_eq!(records.last().unwrap().state, State::Homing);
    for text in ["engaged at (1, 1)", "w_data 0.25", "return requested", "landing", "landed"] {
        assert!(bench.texts().iter().any(|line| line.contains(text)), "{text}: {:?}", bench.texts());
    }
    let names: Vec<String> = bench
        .all::<dialect::NAMED_VALUE_FLOAT_DATA>()
        .iter()
        .map(|data| data.name.to_str().unwrap().to_owned())
        .collect();
    for name in ["w_data", "collected", "spare_bat"] {
        assert!(names.iter().any(|sent| sent == name), "{name}");
    }
}

#[test]
fn heartbeat_and_targets_end_with_the_polls() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.sent.clear();
    for _ in 0..100 {
        bench.streams();
        bench.now = bench.now + Duration::from_millis(100);
        bench.carry_away();
    }
    assert!(bench.sent.is_empty());
    bench.tick();
    assert_eq!(bench.onboard.state(), State::Fault, "and the next poll knows that it is late");
}

#[test]
fn a_take_over_that_is_over_before_the_next_poll_still_counts() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.mode = 5;
    bench.heartbeat();
    bench.mode = 4;
    bench.heartbeat();
    bench.tick();
    assert_eq!(bench.onboard.state(), State::Passive);
    bench.sent.clear();
    bench.run(10);
    assert!(bench.all::<dialect::SET_POSITION_TARGET_LOCAL_NED_DATA>().is_empty());
    let commands = bench.all::<dialect::COMMAND_LONG_DATA>();
    assert!(
        commands.iter().all(|asked| {
            matches!(asked.command, MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL | MavCmd::MAV_CMD_REQUEST_MESSAGE)
        }),
        "it still listens, and asks for what it listens to"
    );
}

#[test]
fn reports_count_from_the_radio_and_from_the_tunnel() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    let report =
        |device, snr, remaining| Report { device, snr: Db(snr), remaining: Some(remaining), age_ms: 100 };
    bench.onboard.receive_radio(bench.now, &encode(&report(7, 11.0, 3000.0)));
    bench.onboard.receive_radio(bench.now, &encode(&report(300, 11.0, 3000.0)));
    let mut modem = Component::new(gleaner_link::Settings::new(Some(3), 192).unwrap(), Parameters::default());
    modem.tunnel(TUNNEL_RADIO_REPORT, &encode_body(&report(9, 6.0, 1000.0)));
    modem.tunnel(TUNNEL_RADIO_REPORT, &[0xFF; 9]);
    let mut bytes = [0; 512];
    let used = modem.transmit(&mut bytes);
    bench.onboard.receive_link(bench.now, &bytes[..used]);
    bench.run(4);
    let stats = bench.onboard.stats();
    assert_eq!(stats.collected, 0.5, "4000 of 8000 are left");
    assert_eq!((stats.tunnel_refused, stats.reports.unknown, stats.radio.reports), (1, 1, 2));
    let asked = bench.onboard.policy().asked.last().unwrap();
    assert_eq!([asked.devices[0][3], asked.devices[1][3]], [11.0, 6.0], "each in its own token");
    bench.run(15);
    let stale = bench.onboard.policy().asked.last().unwrap();
    assert_eq!([stale.devices[0][4], stale.devices[1][4]], [0.0, 0.0], "older than GLN_SNR_AGE");
    assert_eq!(stale.devices[0][2], 3000.0, "what remains is remembered");
}

#[test]
fn a_decision_is_handed_out_once_and_its_time_is_told() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.run(1);
    assert_eq!(bench.onboard.decision().map(|decision| decision.sequence), Some(0));
    assert!(bench.onboard.decision().is_none());
    bench.onboard.set_inference_time(Duration::from_micros(1234));
    bench.run(2);
    let told = bench.all::<dialect::NAMED_VALUE_FLOAT_DATA>();
    assert!(told.iter().any(|data| data.name.to_str() == Ok("infer_us") && data.value == 1234.0));
}

#[test]
fn a_pilot_that_failed_its_self_test_rejects_the_command_to_engage() {
    let mut bench = Bench::new(Err(SelfTestError::NoGolden));
    bench.run(8);
    bench.command(MavCmd::MAV_CMD_USER_2, 1.0);
    bench.run(5);
    assert_eq!(bench.onboard.state(), State::Fault);
    let acks = bench.all::<dialect::COMMAND_ACK_DATA>();
    assert_eq!(acks[0].result, MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
    assert_eq!(
        bench.all::<dialect::HEARTBEAT_DATA>().last().unwrap().system_status,
        MavState::MAV_STATE_CRITICAL
    );
}

#[test]
fn a_knob_sets_the_preference_for_everyone_to_see() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    let set = dialect::PARAM_SET_DATA {
        param_value: 6.0,
        target_system: bench.onboard.link().address().system,
        target_component: 191,
        param_id: "GLN_W_RC".into(),
        ..dialect::PARAM_SET_DATA::DEFAULT
    };
    bench.hear(STATION, &set);
    let mut turn = |pulse_us| {
        bench.sent.clear();
        let channels = dialect::RC_CHANNELS_DATA {
            time_boot_ms: bench.now.as_boot_ms(),
            chancount: 8,
            chan6_raw: pulse_us,
            ..dialect::RC_CHANNELS_DATA::DEFAULT
        };
        bench.hear(AUTOPILOT, &channels);
        bench.run(1);
        let echoes = bench.all::<dialect::PARAM_VALUE_DATA>();
        let echo = echoes.iter().rfind(|data| data.param_id.to_str() == Ok("GLN_W_DATA"));
        (echo.map(|data| data.param_value), bench.onboard.parameters().data_weight())
    };
    assert_eq!(turn(1750), (Some(0.75), 0.75));
    assert_eq!(turn(1756), (None, 0.75), "jitter is not reported");
    assert_eq!(turn(1000), (Some(0.0), 0.0));
}

#[test]
fn the_whole_pilot_fits_a_small_microcontroller() {
    // Mission and guard grow with the grid, which is smaller on a board: 8 KB there, as `tests/budget.rs` measures.
    let bytes = size_of::<Onboard<()>>() - size_of::<Mission>() - size_of::<Guard>();
    assert!(bytes <= 24 * 1024, "{bytes} bytes without the engine, mission and guard");
}

#[test]
fn a_grounded_pilot_takes_one_mission_and_only_before_its_first_poll() {
    let grounded =
        || Onboard::grounded(Parameters::default(), Settings::default().checked().unwrap(), hovering());
    let mut pilot = grounded();
    let mut spoilt = mission();
    spoilt.fence.remove(TERMINAL);
    assert!(matches!(pilot.load(&spoilt, Ok(())), Err(OnboardError::Mission(_))));
    assert_eq!(pilot.load(&mission(), Ok(())), Ok(()), "a refused mission leaves no trace");
    assert_eq!(pilot.load(&mission(), Ok(())), Err(OnboardError::Begun), "one is enough");
    pilot.poll(Instant::ZERO);
    assert_eq!(pilot.state(), State::Idle);
    assert_eq!(pilot.machine().mission(), &mission());

    let mut without = grounded();
    without.poll(Instant::ZERO);
    assert_eq!(without.state(), State::Fault, "speaks, never engages");
    assert_eq!(without.load(&mission(), Ok(())), Err(OnboardError::Begun));
}
