//! The process as a service: memory, priority, and the messages to systemd.

use rustix::mm::{MlockAllFlags, mlockall};
use sd_notify::NotifyState;
use std::time::{Duration, Instant};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Above every thread of normal programs, below the kernel's own (50 and more).
const PRIORITY: u8 = 10;

/// Keeps the decision loop on time where the system permits it: memory that is not paged out, and a real-time priority.
/// Threads that were started before keep their priority. Returns a line for each that is not permitted.
pub fn become_real_time() -> Vec<String> {
    let mut refused = Vec::new();
    // On fault: the thread stacks and arenas that are never used need no memory.
    if let Err(error) = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT) {
        refused.push(format!(
            "memory is not locked ({error}): set LimitMEMLOCK=infinity, or run as the service"
        ));
    }
    let priority = ThreadPriorityValue::try_from(PRIORITY).map(ThreadPriority::Crossplatform);
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set = priority.map_err(|error| error.to_string()).and_then(|priority| {
        set_thread_priority_and_policy(thread_native_id(), priority, policy)
            .map_err(|error| format!("{error:?}"))
    });
    if let Err(error) = set {
        refused.push(format!(
            "no real-time priority ({error}): set LimitRTPRIO={PRIORITY}, or run as the service"
        ));
    }
    refused
}

/// The connection to systemd; does nothing when the program was started otherwise.
pub struct Service {
    /// The watchdog expects a message within this time.
    watchdog: Option<Duration>,
    fed_at: Option<Instant>,
}

impl Service {
    /// Reads from the environment what systemd expects.
    pub fn new() -> Service {
        Service { watchdog: sd_notify::watchdog_enabled(), fed_at: None }
    }

    /// The ports are open and the decision loop begins.
    pub fn ready(&self) {
        notify(&NotifyState::Ready);
    }

    /// Feeds the watchdog. Called by the decision loop, and by nothing else: when the loop stops, systemd restarts the
    /// program.
    pub fn feed(&mut self, now: Instant) {
        let Some(watchdog) = self.watchdog else { return };
        let due = self.fed_at.is_none_or(|at| now.saturating_duration_since(at) >= watchdog / 4);
        if due {
            self.fed_at = Some(now);
            notify(&NotifyState::Watchdog);
        }
    }

    /// One line for `systemctl status`.
    pub fn status(&self, text: &str) {
        notify(&NotifyState::Status(text));
    }

    /// The program ends as asked.
    pub fn stopping(&self) {
        notify(&NotifyState::Stopping);
    }
}

fn notify(state: &NotifyState<'_>) {
    // Without systemd there is no socket. A full one means that systemd is late; the next message is the same.
    let _ = sd_notify::notify(std::slice::from_ref(state));
}
