//! The load on a pilot in flight: no heap after boot, decisions on time in a flood of hostile messages, and a day in flat
//! memory. Only the calls of the pilot are counted, not the simulation around it.

use gleaner_harness::{
    Companion, Ending, FlightResult, FlightRun, FlightScript, MissionPlan, MissionSetup, STEP, Simulation,
};
use gleaner_link::{Address, Packet};
use gleaner_pilot::{Onboard, Parameters, Settings};
use gleaner_policy::native::{AlignedBytes, Model, NativePolicy, Workspace};
use gleaner_radio::encode;
use gleaner_units::{Duration, Instant};
use gleaner_world::{ScenarioKind, World};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

thread_local! {
    static IS_COUNTING: Cell<bool> = const { Cell::new(false) };
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator; counts the allocations of a thread while the thread asks for it.
struct Counting;

fn count() {
    if IS_COUNTING.get() {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
    }
}

// SAFETY: every call goes to the system's allocator unchanged. The counters are thread-local without a destructor and
// need no allocation themselves.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs `work` and adds its allocations to this thread's count.
fn counted<T>(work: impl FnOnce() -> T) -> T {
    IS_COUNTING.set(true);
    let result = work();
    IS_COUNTING.set(false);
    result
}

#[test]
fn the_counter_counts() {
    let before = ALLOCATIONS.get();
    let kept = counted(|| vec![1_u8; 100]);
    assert_eq!((kept.len(), ALLOCATIONS.get() - before), (100, 1));
}

/// Frames that a station outside the allow-list and another vehicle may send.
fn hostile_frames() -> Vec<Vec<u8>> {
    let stranger = Address::new(66, 25);
    let command = |id: u16, first: f32, component: u8| {
        let mut payload = [0; 33];
        payload[..4].copy_from_slice(&first.to_le_bytes());
        payload[28..30].copy_from_slice(&id.to_le_bytes());
        (payload[30], payload[31]) = (1, component);
        Packet::from_payload(76, 152, &payload).unwrap().frame(stranger, 0).to_vec()
    };
    let mut enable = [0; 23];
    enable[..4].copy_from_slice(&1_f32.to_le_bytes());
    (enable[4], enable[5], enable[22]) = (1, 191, 9);
    enable[6..16].copy_from_slice(b"GLN_ENABLE");
    let mut frames: Vec<Vec<u8>> = [(31011, 1.0), (31011, 0.0), (31012, 0.0), (31010, f32::NAN)]
        .into_iter()
        .flat_map(|(id, first)| [command(id, first, 191), command(id, first, 0)])
        .collect();
    frames.push(Packet::from_payload(23, 168, &enable).unwrap().frame(stranger, 0).to_vec());
    // A copter with system id 2 in LOITER.
    let heartbeat = [5, 0, 0, 0, 2, 3, 0xD1, 4, 3];
    frames.push(Packet::from_payload(0, 50, &heartbeat).unwrap().frame(Address::new(2, 1), 0).to_vec());
    let mut damaged = command(31011, 0.0, 191);
    damaged[12] ^= 0x55;
    frames.push(damaged);
    frames
}

/// A pilot without a heap, its calls counted, and strangers on its line.
struct Watched<'m> {
    onboard: Onboard<NativePolicy<'m>>,
    hostile: Vec<Vec<u8>>,
    /// Hostile frames a step, once the first decision is made.
    flood: usize,
    sent: usize,
    decided_at: Vec<Instant>,
    /// When this flight began on the pilot's clock.
    begun: Duration,
}

impl Watched<'_> {
    fn turn(&mut self, now: Instant, mut carry: impl FnMut(&[u8])) {
        counted(|| self.onboard.poll(now));
        if counted(|| self.onboard.decision().is_some()) {
            self.decided_at.push(now);
        }
        let mut buffer = [0; 512];
        loop {
            let length = counted(|| self.onboard.transmit(&mut buffer));
            if length == 0 {
                return;
            }
            carry(&buffer[..length]);
        }
    }
}

impl Companion for Watched<'_> {
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant) {
        let at = now;
        let now = at + self.begun;
        for frame in simulation.to_companion() {
            simulation.delivered(at, &frame);
            counted(|| self.onboard.receive_link(now, &frame));
        }
        for report in simulation.radio() {
            let report = encode(&report);
            counted(|| self.onboard.receive_radio(now, &report));
        }
        if !self.decided_at.is_empty() {
            for _ in 0..self.flood {
                let frame = &self.hostile[self.sent % self.hostile.len()];
                counted(|| self.onboard.receive_link(now, frame));
                self.sent += 1;
            }
        }
        self.turn(now, |bytes| simulation.from_companion(bytes));
    }
}

/// Calls `work` with a pilot that flies the shipped model as a microcontroller does.
fn with_pilot<T>(mission: gleaner_pilot::Mission, flood: usize, work: impl FnOnce(Watched<'_>) -> T) -> T {
    let blob = AlignedBytes::new(include_bytes!("../../../models/gleaner.gln"));
    let mut workspace = Box::<Workspace>::default();
    let policy = NativePolicy::new(Model::read(blob.as_slice()).unwrap(), &mut workspace);
    let settings = Settings::default();
    let onboard = Onboard::new(mission, Parameters::default(), settings, policy, Ok(())).unwrap();
    work(Watched {
        onboard,
        hostile: hostile_frames(),
        flood,
        sent: 0,
        decided_at: Vec::new(),
        begun: Duration::from_secs(0),
    })
}

/// Flies one mission to its end.
fn fly_once(setup: MissionSetup, watched: &mut Watched<'_>) -> FlightResult {
    let component = Settings::default().component_id;
    let mut flight = FlightRun::new(setup, FlightScript::plain(0.7), component).unwrap();
    let ending = loop {
        if let Some(ending) = flight.step(watched) {
            break ending;
        }
    };
    flight.end(ending, Some(watched.onboard.state()))
}

/// Flies a mission to its end: the result, the times of the decisions since the first, and the hostile frames.
fn fly(flood: usize) -> (FlightResult, Vec<Duration>, usize) {
    let plan = MissionPlan::new(ScenarioKind::ReachDestination, 5);
    let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
    with_pilot(setup.mission.clone(), flood, |mut watched| {
        let result = fly_once(setup, &mut watched);
        let first = watched.decided_at[0];
        let times = watched.decided_at.iter().map(|at| *at - first).collect();
        (result, times, watched.sent)
    })
}

#[test]
fn a_flight_allocates_nothing() {
    let before = ALLOCATIONS.get();
    let (result, times, _) = fly(0);
    assert!(result.figures().is_good() && times.len() > 30, "{:?}", result.texts);
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations by the pilot from boot to landing");
}

#[test]
fn decisions_are_on_time_in_a_flood_of_hostile_messages() {
    /// Messages a second.
    const FLOOD: usize = 10_000;
    let steps_per_s = Duration::from_secs(1).as_micros() / STEP.as_micros();
    let before = ALLOCATIONS.get();
    let (calm, calm_times, _) = fly(0);
    let (flooded, times, sent) = fly(FLOOD / steps_per_s as usize);
    assert_eq!(flooded.ending, Ending::OnTheGround);
    assert!(flooded.figures().is_good(), "{:?} {:?}", flooded.figures(), flooded.texts);
    assert_eq!(flooded.figures().energy, calm.figures().energy);
    assert!(sent > 1_000_000, "{sent} hostile messages");
    // Lateness against the flight without them, by step of the simulation.
    let mut histogram = [0_usize; 4];
    for (late, calm) in times.iter().zip(&calm_times) {
        let steps = late.as_micros().saturating_sub(calm.as_micros()) / STEP.as_micros();
        histogram[(steps as usize).min(3)] += 1;
    }
    println!("{sent} hostile messages; decisions late by 0, 1, 2, more steps of 20 ms: {histogram:?}");
    assert_eq!((times.len(), histogram[2] + histogram[3]), (calm_times.len(), 0), "{histogram:?}");
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations by the pilot");
}

/// The same pilot flies mission after mission, each with a vehicle that has just booted, and a stranger on the line.
#[test]
fn a_day_of_flights_takes_no_memory() {
    const DAY: Duration = Duration::from_secs(24 * 3_600);
    let world = Arc::new(World::default_world());
    let setup = || {
        let plan = MissionPlan::new(ScenarioKind::ReachDestination, 5);
        MissionSetup::new(Arc::clone(&world), plan).unwrap()
    };
    let before = ALLOCATIONS.get();
    let mut flights = 0;
    with_pilot(setup().mission, 1, |mut watched| {
        while watched.begun < DAY {
            let result = fly_once(setup(), &mut watched);
            let took = result.simulation.now() - Instant::ZERO;
            assert!(result.figures().is_good(), "flight {flights}: {:?}", result.figures());
            flights += 1;
            // The battery is changed, and the stranger is gone.
            watched.begun = watched.begun + took + Duration::from_secs(60);
            watched.decided_at.clear();
        }
        assert!(watched.sent > 1_000_000, "{} messages of the stranger", watched.sent);
    });
    println!("{flights} flights in a day");
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations by the pilot in a day");
}

#[test]
fn a_day_of_polls_takes_no_memory() {
    /// The pilot's slowest permitted poll.
    const POLL: Duration = Duration::from_millis(50);
    let plan = MissionPlan::new(ScenarioKind::ReachDestination, 5);
    let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
    let vehicle = Address::new(1, 1);
    // ArduCopter in GUIDED, armed.
    let heartbeat = Packet::from_payload(0, 50, &[4, 0, 0, 0, 2, 3, 0xD1, 4, 3]).unwrap().frame(vehicle, 0);
    let before = ALLOCATIONS.get();
    with_pilot(setup.mission.clone(), 0, |mut watched| {
        let (mut now, mut bytes) = (Instant::ZERO, 0);
        let end = Instant::ZERO + Duration::from_secs(24 * 3_600);
        let mut poll = 0_u32;
        while now < end {
            now = now + POLL;
            if poll.is_multiple_of(20) {
                counted(|| watched.onboard.receive_link(now, &heartbeat));
                let stranger = &watched.hostile[(poll / 20) as usize % watched.hostile.len()];
                counted(|| watched.onboard.receive_link(now, stranger));
            }
            poll += 1;
            watched.turn(now, |sent| bytes += sent.len());
        }
        assert!(bytes > 1_000_000, "{bytes} bytes sent in a day");
    });
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations by the pilot in a day");
}
