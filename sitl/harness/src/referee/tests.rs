//! The referee against made-up truths and frames.

use super::*;
use crate::autopilot::AutopilotKind;
use crate::setup::{MissionPlan, MissionSetup};
use crate::wire::Speaker;
use gleaner_link::{Address, FrameDecoder};
use gleaner_units::{Action, Cell, Ned};
use gleaner_world::{ScenarioKind, World};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavCmd, MavState, SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use std::sync::Arc;

const PILOT: u8 = 191;

struct Stand {
    referee: Referee,
    kind: AutopilotKind,
    pilot: Speaker,
    autopilot: Speaker,
    operator: Speaker,
}

fn at(ms: u64) -> Instant {
    Instant::from_millis(ms)
}

impl Stand {
    fn new(kind: AutopilotKind) -> Stand {
        let plan = MissionPlan { autopilot: kind, ..MissionPlan::new(ScenarioKind::ReachDestination, 4) };
        let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
        Stand {
            referee: Referee::new(&setup, PILOT),
            kind,
            pilot: Speaker::new(Address::new(1, PILOT)),
            autopilot: Speaker::new(Address::new(1, 1)),
            operator: Speaker::new(Address::new(255, 190)),
        }
    }

    /// Engaged at 10 s, with a fresh heartbeat.
    fn engaged(kind: AutopilotKind) -> Stand {
        let mut stand = Stand::new(kind);
        stand.request(at(9_000), 1.0, 0);
        stand.heartbeat(at(9_900), VehicleMode::Guided, MavState::MAV_STATE_ACTIVE);
        assert_eq!(stand.referee.custody.decided(at(10_000)), None);
        stand
    }

    fn request(&mut self, now: Instant, param1: f32, confirmation: u8) {
        let frame = self.operator.frame(&COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_USER_2,
            param1,
            confirmation,
            target_system: 1,
            target_component: PILOT,
            ..COMMAND_LONG_DATA::DEFAULT
        });
        self.referee.delivered(now, &frame);
    }

    fn heartbeat(&mut self, left_at: Instant, mode: VehicleMode, system_status: MavState) {
        let custom_mode = mode.custom_mode(self.kind).unwrap();
        let frame =
            self.autopilot.frame(&HEARTBEAT_DATA { custom_mode, system_status, ..HEARTBEAT_DATA::DEFAULT });
        self.referee.delivered(left_at, &frame);
    }

    fn send<D: MessageData>(&mut self, now: Instant, data: &D) {
        let bytes = self.pilot.frame(data);
        let mut rest = &bytes[..];
        let frame = FrameDecoder::new().read(&mut rest).unwrap();
        assert!(rest.is_empty());
        self.referee.sent(now, &frame);
    }

    fn target(&mut self, now: Instant) {
        self.send(now, &SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT);
    }

    fn command(&mut self, now: Instant, command: MavCmd) {
        let data = COMMAND_LONG_DATA {
            command,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        self.send(now, &data);
    }

    fn rules(&self) -> Vec<Rule> {
        self.referee.violations().iter().map(|violation| violation.rule.clone()).collect()
    }
}

#[test]
fn an_engaged_pilot_may_steer_land_and_return() {
    for command in [MavCmd::MAV_CMD_NAV_LAND, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH] {
        let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
        stand.target(at(10_020));
        stand.command(at(10_500), command);
        assert_eq!(stand.rules(), []);
    }
}

#[test]
fn no_frame_may_move_the_aircraft_after_another_mode_arrived() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    stand.heartbeat(at(10_400), VehicleMode::Hold, MavState::MAV_STATE_ACTIVE);
    stand.target(at(10_400));
    stand.command(at(10_420), MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH);
    assert_eq!(stand.rules(), [Rule::TargetAfterTakeOver, Rule::CommandAfterTakeOver]);
}

/// The length of a damaged frame hides the heartbeat behind it until that many bytes have come.
#[test]
fn a_heartbeat_behind_a_damaged_frame_is_not_yet_received() {
    for is_noisy in [true, false] {
        let mut stand = Stand::engaged(AutopilotKind::Px4);
        if is_noisy {
            stand.referee.noisy_until(at(11_000));
        }
        let mut damaged = stand.autopilot.frame(&HEARTBEAT_DATA::DEFAULT);
        damaged[1] = 200;
        stand.referee.delivered(at(10_900), &damaged);
        stand.heartbeat(at(10_920), VehicleMode::Hold, MavState::MAV_STATE_ACTIVE);
        stand.target(at(10_930));
        assert_eq!(stand.rules().is_empty(), is_noisy, "{:?}", stand.rules());
        for _ in 0..10 {
            let frame = stand.operator.frame(&HEARTBEAT_DATA::DEFAULT);
            stand.referee.delivered(at(11_100), &frame);
        }
        stand.target(at(11_200));
        assert_eq!(stand.rules(), [Rule::TargetAfterTakeOver]);
    }
}

#[test]
fn guided_again_gives_nothing_back_but_a_new_request_does() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    stand.heartbeat(at(10_400), VehicleMode::Hold, MavState::MAV_STATE_ACTIVE);
    stand.heartbeat(at(11_400), VehicleMode::Guided, MavState::MAV_STATE_ACTIVE);
    assert_eq!(stand.referee.custody.decided(at(11_500)), Some(Rule::TookItBack));
    stand.request(at(12_000), 1.0, 1);
    assert_eq!(stand.referee.custody.decided(at(12_100)), Some(Rule::TookItBack), "a retransmission");
    stand.request(at(13_000), 1.0, 0);
    assert_eq!(stand.referee.custody.decided(at(13_100)), None);
}

#[test]
fn the_pilots_own_landing_is_no_take_over() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    stand.command(at(10_500), MavCmd::MAV_CMD_NAV_LAND);
    stand.heartbeat(at(10_600), VehicleMode::Land, MavState::MAV_STATE_ACTIVE);
    stand.target(at(10_600));
    assert_eq!(stand.rules(), []);
    stand.heartbeat(at(12_000), VehicleMode::Hold, MavState::MAV_STATE_ACTIVE);
    stand.target(at(12_000));
    assert_eq!(stand.rules(), [Rule::TargetAfterTakeOver]);
}

#[test]
fn commands_need_recent_evidence() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    stand.command(at(11_950), MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH);
    assert_eq!(stand.rules(), [Rule::StaleEvidence], "the last heartbeat is 2 s old");
}

#[test]
fn what_arrived_during_a_stall_is_no_evidence() {
    let mut stand = Stand::engaged(AutopilotKind::Px4);
    stand.referee.companion_stalls_until(at(13_500));
    stand.heartbeat(at(12_900), VehicleMode::Guided, MavState::MAV_STATE_ACTIVE);
    stand.command(at(13_520), MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH);
    assert_eq!(stand.rules(), [Rule::StaleEvidence]);
    stand.heartbeat(at(13_900), VehicleMode::Guided, MavState::MAV_STATE_ACTIVE);
    stand.command(at(13_920), MavCmd::MAV_CMD_NAV_LAND);
    assert_eq!(stand.rules().len(), 1, "a heartbeat after the stall is");
}

#[test]
fn px4_may_be_streamed_to_before_offboard_but_not_in_a_failsafe() {
    let mut stand = Stand::new(AutopilotKind::Px4);
    stand.target(at(1_000));
    assert_eq!(stand.rules(), [Rule::NeverAsked]);
    stand.request(at(2_000), 1.0, 0);
    stand.heartbeat(at(2_500), VehicleMode::Hold, MavState::MAV_STATE_ACTIVE);
    stand.target(at(3_000));
    assert_eq!(stand.rules().len(), 1);
    stand.heartbeat(at(3_500), VehicleMode::Return, MavState::MAV_STATE_CRITICAL);
    stand.target(at(3_600));
    assert_eq!(stand.rules()[1], Rule::StreamInFailsafe);
}

#[test]
fn asking_for_guided_is_a_violation_on_both_autopilots() {
    for (kind, params) in [(AutopilotKind::ArduPilot, [4.0, 0.0]), (AutopilotKind::Px4, [6.0, 0.0])] {
        let mut stand = Stand::engaged(kind);
        let [param2, param3] = params;
        stand.send(
            at(10_100),
            &COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_DO_SET_MODE,
                param1: 1.0,
                param2,
                param3,
                target_system: 1,
                target_component: 1,
                ..COMMAND_LONG_DATA::DEFAULT
            },
        );
        assert_eq!(stand.rules(), [Rule::AskedForGuided]);
    }
}

#[test]
fn a_restarted_pilot_has_no_permission() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    stand.referee.companion_restarts();
    stand.target(at(12_000));
    assert_eq!(stand.rules(), [Rule::TargetAfterTakeOver]);
}

#[test]
fn a_request_expires() {
    let mut stand = Stand::new(AutopilotKind::ArduPilot);
    stand.request(at(1_000), 1.0, 0);
    assert_eq!(stand.referee.custody.decided(at(80_000)), Some(Rule::RequestExpired));
}

#[test]
fn the_envelope_agrees_with_hand_counts() {
    let plan = MissionPlan::new(ScenarioKind::ReachDestination, 4);
    let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
    let envelope = Envelope::new(&setup.mission);
    // The terminal is (30, 18).
    let (cell, units) = (Cell::new(10, 6), BatteryUnits);
    assert_eq!(envelope.moves(cell), Some(32.0));
    assert!(envelope.allows(cell, Action::East, units(32.0), units(0.0)));
    assert!(!envelope.allows(cell, Action::Hover, units(32.0), units(0.0)));
    assert!(envelope.allows(cell, Action::Hover, units(32.5), units(0.0)));
    assert!(!envelope.allows(cell, Action::West, units(33.5), units(0.0)));
    assert!(envelope.allows(cell, Action::West, units(34.0), units(0.0)));
    assert!(!envelope.allows(cell, Action::West, units(34.0), units(0.5)));
    assert!(!envelope.allows(Cell::new(0, 0), Action::West, units(100.0), units(0.0)), "outside the map");
    assert!(!envelope.permits(cell, Action::West, units(20.0), units(0.0), true));
    assert!(envelope.permits(cell, Action::North, units(20.0), units(0.0), false), "the shortest way home");
}

#[test]
fn another_stations_target_takes_the_aircraft_after_5_s() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    let truth = Truth { target_by: Some(Commander::Operator), ..over(&stand, Cell::new(10, 6), 0.0) };
    for second in 11..=15 {
        stand.referee.watch(at(second * 1_000), &truth);
        assert!(!stand.referee.is_revoked(), "{second} s");
    }
    stand.target(at(15_900));
    assert_eq!(stand.rules(), []);
    stand.referee.watch(at(16_100), &truth);
    assert!(stand.referee.is_revoked());
    stand.target(at(16_200));
    assert_eq!(stand.rules(), [Rule::OverwroteTarget]);
}

#[test]
fn an_empty_pack_counts_only_if_the_way_home_was_covered() {
    for (battery, price, broken) in [(100.0, 1.0, true), (20.0, 1.0, false), (100.0, 2.5, false)] {
        let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
        let truth = Truth { battery: BatteryUnits(battery), ..over(&stand, Cell::new(10, 6), 0.0) };
        stand.referee.could_return = stand.referee.covers_return(&truth);
        stand.referee.price_changes(price, &truth);
        stand.referee.flying = true;
        stand.referee.watch(at(20_000), &Truth { battery: BatteryUnits(0.0), ..truth });
        assert_eq!(stand.rules().contains(&Rule::PackEmpty), broken);
    }
}

/// An aircraft in GUIDED, `east_m` east of the centre of `cell`.
fn over(stand: &Stand, cell: Cell, east_m: f32) -> Truth {
    let centre = stand.referee.frame.centre(cell, 0.0);
    Truth {
        position: Ned { east_m: centre.east_m + east_m, ..centre },
        ground_speed_mps: 0.0,
        height_m: 60.0,
        armed: true,
        on_ground: false,
        mode: VehicleMode::Guided,
        mode_by: Commander::Operator,
        target_by: None,
        battery: BatteryUnits(90.0),
        killed_by_nan: false,
        is_up: true,
        ignored_targets: 0,
    }
}

#[test]
fn a_forbidden_cell_may_be_entered_by_an_overshoot_only() {
    let plan = MissionPlan::new(ScenarioKind::ReachDestination, 4);
    let mut setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
    let forbidden = Cell::new(12, 6);
    setup.mission.fence.remove(forbidden);
    for (east_m, broken) in [(-9.0, false), (-7.0, true), (0.0, true), (11.0, false)] {
        let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
        stand.referee.envelope = Envelope::new(&setup.mission);
        stand.referee.flying = true;
        let truth = over(&stand, forbidden, east_m);
        stand.referee.watch(at(20_000), &truth);
        let rule = Rule::OverForbiddenCell { cell: Some(forbidden) };
        assert_eq!(stand.rules().contains(&rule), broken, "{east_m} m");
    }
}

#[test]
fn guided_during_the_pilots_landing_is_somebody_elses() {
    let mut stand = Stand::engaged(AutopilotKind::ArduPilot);
    stand.referee.flying = true;
    let guided = over(&stand, Cell::new(10, 6), 0.0);
    let landing = Truth { mode: VehicleMode::Land, mode_by: Commander::Companion, height_m: 30.0, ..guided };
    stand.referee.watch(at(20_000), &landing);
    // The altitude would be judged after 10 s.
    for second in 21..40 {
        stand.referee.watch(at(second * 1_000), &Truth { height_m: 4.0, ..guided });
    }
    assert_eq!(stand.rules(), []);
}
