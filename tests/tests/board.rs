//! The image of the shipped board in QEMU, flown by the simulator over the board's serial lines.
//!
//! Run it alone, after the programs are built, with
//! `cargo test --release --workspace --test board -- --nocapture`.

use gleaner_harness::{
    AircraftFault, Ending, FlightResult, FlightRun, FlightScript, Incident, IncidentKind, MissionPlan,
    MissionSetup, Pace, Slot, Switch, Wired, fly_wired,
};
use gleaner_pilot::State;
use gleaner_policy::native::{AlignedBytes, Model, NativePolicy, Workspace};
use gleaner_policy::onnx::TractPolicy;
use gleaner_policy::{GOLDEN_TOLERANCE, Policy};
use gleaner_tests::board::{Board, Heard, Image, Options, heard};
use gleaner_tests::programs::repository;
use gleaner_units::{Duration, Instant};
use gleaner_world::{ScenarioKind, World};
use std::sync::Arc;

/// The pilot's component.
const PILOT: u8 = 191;
const HEARTBEAT: u32 = 0;
const SET_POSITION_TARGET_LOCAL_NED: u32 = 84;

const COMMAND_ACK: u32 = 77;
/// `MAV_CMD_USER_2`: engage.
const ENGAGE: u16 = 31011;

/// Aircraft seconds per second of board time. At 6 the board misses deadlines on a busy machine.
const HASTE: f32 = 4.0;

fn staged(kind: ScenarioKind, seed: u64, devices: usize, speedup: f32) -> MissionSetup {
    let plan = MissionPlan { devices: Some(devices), speedup, ..MissionPlan::new(kind, seed) };
    MissionSetup::new(Arc::new(World::default_world()), plan).unwrap()
}

/// RB for energy alone: two decisions, twenty seconds.
fn out_and_back() -> MissionSetup {
    staged(ScenarioKind::ReturnBase, 5, 6, HASTE)
}

/// Seconds of the board's clock as aircraft time.
fn board_seconds(seconds: u64) -> Duration {
    after(seconds * HASTE as u64)
}

fn image() -> Image {
    Image::build().unwrap_or_else(|cause| panic!("{cause:#}"))
}

fn boot(image: &Image, options: &Options<'_>) -> Board {
    Board::boot(image, options).unwrap_or_else(|cause| panic!("{cause:#}"))
}

fn flight(staged: MissionSetup, script: FlightScript) -> FlightRun {
    FlightRun::new(staged, script, PILOT).unwrap()
}

fn after(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn said(flown: &FlightResult, part: &str) -> bool {
    flown.texts.iter().any(|(_, text)| text.contains(part))
}

fn assert_good(flown: &FlightResult) {
    let figures = flown.figures();
    assert_eq!(flown.ending, Ending::OnTheGround, "waited for {}: {:?}", flown.waiting_for, flown.texts);
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, flown.texts);
}

/// The pilot's frames after this time.
fn since(flown: &FlightResult, message_id: u32, at: Instant) -> Vec<Heard> {
    let mut frames = heard(flown.simulation.journal(), PILOT, message_id);
    frames.retain(|heard| heard.at > at);
    frames
}

/// The host's engines with the board's model.
struct Judge {
    tract: TractPolicy,
    blob: AlignedBytes,
}

impl Judge {
    fn new(image: &Image) -> Judge {
        let onnx = std::fs::read(repository().join("models/gleaner.onnx")).unwrap();
        let blob = AlignedBytes::new(image.section(Image::MODEL).unwrap());
        Judge { tract: TractPolicy::load_checked(&onnx).unwrap(), blob }
    }

    /// Repeats every decision of the flight from the radio's reports and the pilot's records; returns how many.
    fn judge(&mut self, flown: &FlightResult) -> usize {
        let mut workspace = Workspace::new();
        let mut native = NativePolicy::new(Model::read(self.blob.as_slice()).unwrap(), &mut workspace);
        let staged = flown.simulation.setup();
        let guard = staged.mission.guard(staged.plan.reserve).unwrap();
        let mut judged = 0;
        for slot in flown.simulation.journal().slots() {
            let Slot { record, .. } = slot;
            let Some(told) = record.logits else {
                assert_eq!(record.state, State::Homing, "{record:?}");
                continue;
            };
            let (tokens, slots) = slot.observation(&staged.mission).unwrap();
            let expected = native.infer(&tokens).unwrap();
            assert_eq!(told, expected.logits, "another observation or another engine: {record:?} {tokens:?}");
            assert_eq!(record.attended, expected.attention.most_attended(&slots));
            let linux = self.tract.infer(&tokens).unwrap();
            for (board, linux) in told.iter().zip(linux.logits) {
                assert!((board - linux).abs() <= GOLDEN_TOLERANCE, "{record:?}: {linux} by tract");
            }
            assert_eq!(record.mask, guard.mask(record.cell, record.battery), "{record:?}");
            assert_eq!(Some(record.action), record.mask.argmax(&linux.logits), "{record:?}");
            judged += 1;
        }
        judged
    }
}

#[test]
fn the_board_flies_the_mission_with_linux_decisions() {
    let image = image();
    let staged = staged(ScenarioKind::ReachDestination, 3, 12, HASTE);
    let image = image.with_mission(&staged.mission).unwrap();
    let mut board = boot(&image, &Options::default());
    // The first change is a command, the second a parameter.
    let switches = vec![Switch { after: after(40), w_data: 0.5 }, Switch { after: after(80), w_data: 0.1 }];
    let script = FlightScript { switches, ..FlightScript::plain(1.0) };
    let flown = fly_wired(flight(staged, script), &mut board.wired, |_, _| None);
    assert_good(&flown);
    let figures = flown.figures();
    assert_eq!(figures.switches, 2, "{:?}", flown.texts);
    let mut weights: Vec<f32> = flown.simulation.journal().slots().iter().map(|s| s.record.w_data).collect();
    weights.dedup();
    assert_eq!(weights, [1.0, 0.5, 0.1]);
    let judged = Judge::new(&image).judge(&flown);
    println!("{judged} decisions of {figures:?}");
    assert!(judged >= 32, "{judged} decisions by the policy");
    assert!(figures.collected > 0.2, "{figures:?}");
}

/// xorshift64: reproducible noise.
struct Noise(u64);

impl Noise {
    fn fill(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            *byte = self.0 as u8;
        }
    }
}

#[test]
fn garbage_partial_frames_and_a_flood_do_no_harm() {
    let staged = out_and_back();
    let image = image().with_mission(&staged.mission).unwrap();
    let mut board = boot(&image, &Options::default());
    let mut noise = Noise(7);
    // Half a frame of the autopilot: a heartbeat that ends after its sixth byte of payload.
    let half = [0xFD, 9, 0, 0, 1, 1, 1, 0, 0, 0, 4, 0, 0, 0, 2, 3];
    let disturb = |flight: &FlightRun, wired: &mut Wired| {
        let mut bytes = [0; 256];
        noise.fill(&mut bytes);
        match flight.operator().engaged_at() {
            // Both lines saturated before the flight: 13 kB/s, the emulator's limit.
            None if flight.simulation().now() < Instant::ZERO + after(12) => {
                wired.disturb(&bytes[..64], &bytes[..64]);
            }
            // In flight the autopilot's frames arrive between partial ones; radio noise continues.
            _ => wired.disturb(&half[..half.len() * usize::from(bytes[0] < 64)], &bytes[..16]),
        }
        None
    };
    let flown = fly_wired(flight(staged, FlightScript::plain(0.0)), &mut board.wired, disturb);
    assert_good(&flown);
    assert_eq!(Judge::new(&image).judge(&flown), 2);
    let heartbeats = heard(flown.simulation.journal(), PILOT, HEARTBEAT);
    let longest = heartbeats.windows(2).map(|pair| pair[1].at - pair[0].at).max().unwrap();
    assert!(longest < board_seconds(3), "{longest:?} without a heartbeat");
}

#[test]
fn an_autopilot_that_reboots_gets_no_more_targets() {
    let staged = out_and_back();
    let image = image().with_mission(&staged.mission).unwrap();
    let mut board = boot(&image, &Options::default());
    let incidents = vec![Incident { after: after(2), kind: IncidentKind::Aircraft(AircraftFault::Reboot) }];
    let script = FlightScript { incidents, ..FlightScript::plain(0.0) };
    let mut flight = flight(staged, script);
    let mut pace = Pace::new(HASTE);
    let mut rebooted_at = None;
    // After the landing the pilot is watched until the autopilot has been back for a while.
    while rebooted_at.is_none_or(|at| flight.simulation().now() < at + board_seconds(15)) {
        for _ in 0..pace.due() {
            flight.step(&mut board.wired);
        }
        board.wired.rest(pace.rest());
        let (now, truth) = (flight.simulation().now(), flight.simulation().truth());
        if flight.operator().engaged_at().is_some() && truth.on_ground {
            rebooted_at.get_or_insert(now);
        }
        assert!(now < Instant::ZERO + after(200), "waited for {}", flight.operator().waiting_for());
    }
    let flown = flight.end(Ending::TakenOver, None);
    let rebooted_at = rebooted_at.expect("it was flying");
    assert!(flown.figures().violations.is_empty(), "{:?}", flown.figures());
    let settled = rebooted_at + board_seconds(2);
    assert!(since(&flown, SET_POSITION_TARGET_LOCAL_NED, settled).is_empty(), "{:?}", flown.texts);
    assert!(since(&flown, HEARTBEAT, settled).len() > 10, "the pilot still sends heartbeats");
}

#[test]
fn a_reset_in_flight_silences_the_board_and_does_not_engage() {
    let staged = out_and_back();
    let image = image().with_mission(&staged.mission).unwrap();
    let Board { mut wired, mut emulator } = boot(&image, &Options::default());
    let (mut hung_at, mut reset_at) = (None, None);
    // The operator repeats the engage request until the first decision. The program hangs later than that, so that no
    // request is left on the line.
    let flown = fly_wired(flight(staged, FlightScript::plain(1.0)), &mut wired, |flight, _| {
        let now = flight.simulation().now();
        let engaged_at = flight.operator().engaged_at()?;
        if hung_at.is_none() && now > engaged_at + board_seconds(3) {
            // The watchdog resets after a second of board time without the decision loop.
            emulator.freeze().unwrap();
            hung_at = Some(now);
        }
        if reset_at.is_none() && hung_at.is_some_and(|at| now > at + board_seconds(1)) {
            emulator.reset().unwrap();
            emulator.thaw().unwrap();
            reset_at = Some(now);
        }
        let over = reset_at.is_some_and(|at| now > at + board_seconds(15));
        over.then_some(Ending::TakenOver)
    });
    let (hung_at, reset_at) = (hung_at.unwrap(), reset_at.expect("it was flying"));
    let ours = |message_id| since(&flown, message_id, hung_at + after(1));
    assert!(ours(SET_POSITION_TARGET_LOCAL_NED).is_empty(), "{:?}", flown.texts);
    let heartbeats = ours(HEARTBEAT);
    assert!(heartbeats.iter().all(|heartbeat| heartbeat.at > reset_at), "no heartbeat while it hangs");
    assert!(heartbeats.len() >= 8, "heartbeats after the reset: {:?}", flown.texts);
    assert!(said(&flown, "restarted in flight"), "{:?}", flown.texts);
    assert_eq!(flown.figures().violations, []);
}

/// Boots an image that must not fly, and requests engaging for ten seconds of board time.
fn refused(image: &Image, staged: MissionSetup) -> FlightResult {
    let mut board = boot(image, &Options::default());
    let mut asked_at = None;
    let flown = fly_wired(flight(staged, FlightScript::plain(0.0)), &mut board.wired, |flight, _| {
        let now = flight.simulation().now();
        if flight.operator().waiting_for() == "the first decision" {
            asked_at.get_or_insert(now);
        }
        asked_at.is_some_and(|at| now > at + board_seconds(10)).then_some(Ending::NeverEngaged)
    });
    assert!(asked_at.is_some(), "it communicates and accepts parameters: waited for {}", flown.waiting_for);
    assert!(flown.simulation.journal().slots().is_empty());
    assert!(heard(flown.simulation.journal(), PILOT, SET_POSITION_TARGET_LOCAL_NED).is_empty());
    assert!(said(&flown, "will not engage"), "{:?}", flown.texts);
    let answers = heard(flown.simulation.journal(), PILOT, COMMAND_ACK);
    let answers: Vec<&[u8]> = answers.iter().map(|heard| heard.frame.payload()).collect();
    assert!(answers.len() >= 3, "{answers:?}");
    for answer in answers {
        assert!(answer.starts_with(&ENGAGE.to_le_bytes()) && answer[2] != 0, "accepted: {answer:?}");
    }
    flown
}

#[test]
fn a_damaged_model_is_reported_and_never_engages() {
    let staged = out_and_back();
    let image =
        image().with_mission(&staged.mission).unwrap().with_flipped_bit(Image::MODEL, 100_000).unwrap();
    let flown = refused(&image, staged);
    assert!(said(&flown, "damaged model"), "{:?}", flown.texts);
}

#[test]
fn a_damaged_mission_is_reported_and_never_engages() {
    let staged = out_and_back();
    let image = image().with_mission(&staged.mission).unwrap().with_flipped_bit(Image::MISSION, 200).unwrap();
    let flown = refused(&image, staged);
    assert!(said(&flown, "mission damaged"), "{:?}", flown.texts);
}

#[test]
fn damaged_parameters_fall_back_to_the_defaults() {
    let staged = out_and_back();
    let image = image().with_mission(&staged.mission).unwrap();
    let mut noise = vec![0; image.parameters().unwrap().len()];
    Noise(11).fill(&mut noise);
    let mut board = boot(&image, &Options { parameters: Some(&noise), ..Options::default() });
    let flown = fly_wired(flight(staged, FlightScript::plain(0.0)), &mut board.wired, |_, _| None);
    assert_good(&flown);
    assert!(said(&flown, "parameters damaged, defaults hold"), "{:?}", flown.texts);
    assert_eq!(Judge::new(&image).judge(&flown), 2);
}
