//! Whatever happens, some things never do: random flights with random trouble, every output checked.

use crate::rig::{DOWN_M, Rig, TERMINAL};
use gleaner_link::{AutopilotCommand, Firmware, FlightMode, PositionTarget};
use gleaner_pilot::{Outputs, Request, State};
use gleaner_units::{Action, Cell, Duration, Metres, Ned};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// One thing that happens to a flight.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    Request(Request),
    Mode(Option<FlightMode>),
    BriefMode,
    Armed(bool),
    Failsafe(bool),
    Ready(bool),
    Position(Option<Cell>),
    NotFinite,
    Battery(Option<u8>),
    Preference(f32),
    Reserve(f32),
    Altitude(f32),
    PolicyFails(bool),
    Logit(f32),
    Accepts(Option<bool>),
    Obeys(bool),
    Pause(u64),
    Home(bool),
    Origin(bool),
}

fn trouble() -> impl Strategy<Value = Trouble> {
    use prop::option;
    use prop::sample::select;
    let request = select(vec![Request::Off, Request::Engage, Request::Shadow, Request::Return]);
    let mode = select(vec![FlightMode::Guided, FlightMode::Hold, FlightMode::Land, FlightMode::Return]);
    prop_oneof![
        4 => Just(Trouble::Request(Request::Engage)),
        1 => request.prop_map(Trouble::Request),
        3 => Just(Trouble::Mode(Some(FlightMode::Guided))),
        2 => option::weighted(0.9, mode).prop_map(Trouble::Mode),
        1 => Just(Trouble::BriefMode),
        2 => any::<bool>().prop_map(Trouble::Armed),
        2 => prop::bool::weighted(0.2).prop_map(Trouble::Failsafe),
        2 => prop::bool::weighted(0.8).prop_map(Trouble::Ready),
        3 => option::weighted(0.9, (0i16..8, 0i16..6).prop_map(|(x, y)| Cell::new(x, y))).prop_map(Trouble::Position),
        1 => Just(Trouble::NotFinite),
        2 => option::weighted(0.9, 0u8..=100).prop_map(Trouble::Battery),
        2 => (0.0f32..=1.0).prop_map(Trouble::Preference),
        1 => (0.0f32..=10.0).prop_map(Trouble::Reserve),
        1 => select(vec![60.0f32, 61.0, 90.0]).prop_map(Trouble::Altitude),
        1 => prop::bool::weighted(0.2).prop_map(Trouble::PolicyFails),
        1 => select(vec![1.0f32, -1.0, f32::NAN, f32::INFINITY]).prop_map(Trouble::Logit),
        2 => option::of(any::<bool>()).prop_map(Trouble::Accepts),
        2 => prop::bool::weighted(0.7).prop_map(Trouble::Obeys),
        1 => (50u64..1_500).prop_map(Trouble::Pause),
        1 => prop::bool::weighted(0.9).prop_map(Trouble::Home),
        1 => prop::bool::weighted(0.9).prop_map(Trouble::Origin),
    ]
}

impl Trouble {
    fn happen(self, rig: &mut Rig) -> Duration {
        let here = rig.vehicle.position;
        match self {
            Trouble::Request(request) => rig.request = Some(request),
            Trouble::Mode(mode) => {
                rig.other_mode_seen |= mode.is_some_and(|mode| mode != FlightMode::Guided);
                rig.vehicle.mode = mode;
            }
            Trouble::BriefMode => rig.other_mode_seen = true,
            Trouble::Armed(armed) => rig.vehicle.armed = armed,
            Trouble::Failsafe(failsafe) => rig.vehicle.failsafe = failsafe,
            Trouble::Ready(ready) => rig.vehicle.ready = ready,
            Trouble::Position(None) => rig.vehicle.position = None,
            Trouble::Position(Some(cell)) => rig.place(cell, 4.0),
            Trouble::NotFinite => rig.vehicle.position = here.map(|here| Ned { east_m: f32::NAN, ..here }),
            Trouble::Battery(percent) => rig.vehicle.battery_percent = percent,
            Trouble::Preference(w_data) => rig.set("GLN_W_DATA", w_data),
            Trouble::Reserve(reserve) => rig.set("GLN_RESERVE", reserve),
            Trouble::Altitude(altitude) => rig.set("GLN_ALT", altitude),
            Trouble::PolicyFails(fails) => rig.policy.fails = fails,
            Trouble::Logit(logit) => rig.policy.logit = logit,
            Trouble::Accepts(accepts) => rig.accepts = accepts,
            Trouble::Obeys(obeys) => rig.obeys = obeys,
            Trouble::Pause(millis) => return Duration::from_millis(millis),
            Trouble::Home(known) => rig.vehicle.home_down_m = known.then_some(crate::rig::HOME_DOWN_M),
            Trouble::Origin(known) => {
                rig.vehicle.origin =
                    known.then(|| crate::rig::CORNER.offset_by(Metres(-100.0), Metres(50.0)));
            }
        }
        Duration::from_millis(50)
    }
}

/// What must hold after every poll. `other_mode` is what the heartbeats said before it.
fn check(rig: &Rig, out: &Outputs, other_mode: bool, preferences: &mut Vec<[f32; 2]>) {
    let state = rig.state();
    let guided = rig.vehicle.is_guided();
    let flying = matches!(state, State::Engaged | State::Homing);
    if let Some(PositionTarget { position: target, velocity }) = out.setpoint {
        let speed = velocity.unwrap_or_default();
        assert!(target.is_finite() && speed.is_finite());
        let px4_waits = state == State::Waiting && rig.vehicle.firmware == Some(Firmware::Px4);
        assert!(flying || px4_waits, "a target in {state:?}");
        if flying {
            assert!(guided && !other_mode && rig.vehicle.armed, "a target while someone else steers");
            let cell = rig.frame().cell(&target).expect("inside the grid");
            assert!(rig.mission.fence.contains(cell), "inside the fence");
            assert!(velocity.is_some() || target == Ned { down_m: target.down_m, ..rig.centre(cell) });
            let mps = speed.north_mps.hypot(speed.east_mps);
            assert!(mps <= rig.parameters.speed().0 + 1e-3 && speed.down_mps == 0.0, "{mps} m/s");
            assert!((target.down_m - DOWN_M).abs() < 3.5, "the altitude at which it was engaged");
        }
    }
    match out.command {
        None => {}
        Some(AutopilotCommand::ReturnToLaunch | AutopilotCommand::Hold(_)) => {
            assert!(state == State::Fault && guided && !other_mode && rig.vehicle.armed);
        }
        Some(AutopilotCommand::Land) => {
            assert!(state == State::Homing && guided && !other_mode);
            assert!(rig.said("battery empty") > 0 || rig.machine.target() == Some(TERMINAL));
        }
        Some(AutopilotCommand::ChangeSpeed(speed)) => {
            assert!(flying && guided && !other_mode && speed.0.is_finite());
        }
    }
    if out.decided {
        let decision = rig.machine.decision().expect("was decided");
        assert!(decision.mask.allows(decision.action));
        assert_eq!(decision.preference.w_data(), rig.parameters.data_weight(), "what holds now");
        let guard = rig.guard();
        if decision.state == State::Homing {
            assert_eq!(guard.homeward(decision.cell), Some(decision.action));
        } else {
            assert_eq!(decision.mask, guard.mask(decision.cell, decision.battery), "the guard's mask");
            preferences.push([decision.preference.w_data(), decision.preference.w_energy()]);
        }
    } else if flying {
        let target = rig.machine.target();
        assert!(target.is_some_and(|cell| rig.guard().distance(cell).is_some()));
    }
    let seen: Vec<[f32; 2]> = rig.policy.asked.iter().map(|tokens| tokens.preference).collect();
    assert!(preferences.iter().all(|preference| seen.contains(preference)));
}

proptest! {
    // The same cases in every run.
    #![proptest_config(ProptestConfig {
        cases: 400,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn nothing_of_ours_goes_out_when_it_must_not(
        px4 in any::<bool>(),
        script in prop::collection::vec(0usize..Action::COUNT, 0..40),
        happenings in prop::collection::vec((trouble(), 0u32..80), 1..60),
    ) {
        let mut rig = Rig::new();
        if px4 {
            rig.vehicle.firmware = Some(Firmware::Px4);
        }
        rig.policy.actions = script.into_iter().filter_map(Action::from_index).collect();
        rig.request = Some(Request::Engage);
        let mut preferences = Vec::new();
        let mut pause = Duration::from_millis(50);
        for (trouble, polls) in happenings {
            for _ in 0..=polls {
                let other_mode = rig.other_mode_seen || rig.vehicle.is_taken();
                // The aircraft's answer to a command belongs to the next poll, so it is looked at before.
                let vehicle = rig.vehicle;
                let out = rig.step_after(pause);
                let after = std::mem::replace(&mut rig.vehicle, vehicle);
                check(&rig, &out, other_mode, &mut preferences);
                rig.vehicle = after;
                pause = Duration::from_millis(50);
            }
            pause = trouble.happen(&mut rig);
        }
    }

    #[test]
    fn without_trouble_every_policy_ends_on_the_terminal_with_the_reserve(
        script in prop::collection::vec(0usize..Action::COUNT, 0..60),
        then in 0usize..Action::COUNT,
        x in 0i16..8,
        y in 0i16..6,
        reserve in 0.0f32..8.0,
    ) {
        let mut rig = Rig::new();
        prop_assume!(rig.mission.fence.contains(Cell::new(x, y)));
        rig.place(Cell::new(x, y), 5.0);
        rig.set("GLN_RESERVE", reserve);
        rig.policy.actions = script.into_iter().filter_map(Action::from_index).collect();
        rig.policy.then = Action::ALL[then];
        rig.engage();
        rig.run_to(State::Done);
        prop_assert!(rig.machine.spent().0 <= 30.0 - reserve);
        prop_assert_eq!(rig.commanded(AutopilotCommand::Land), 1);
        let away = rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(TERMINAL));
        prop_assert!(away.0 < 2.0);
    }
}
