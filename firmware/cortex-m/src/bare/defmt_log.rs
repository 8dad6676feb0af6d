//! defmt over a serial port that never blocks: a frame that does not fit is dropped as a whole and counted.
#![allow(unsafe_code)]

use super::serial::{LOG, gleaner_wake_log};
use crate::{EventLog, PortStats};
use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicU32, Ordering};
use critical_section::{CriticalSection, Mutex, RestoreState};
use defmt::Encoder;
use gleaner_pilot::{Decision, State};
use gleaner_units::Duration;
use heapless::Vec;

/// The longest frame.
const FRAME_BYTES: usize = 256;
/// Dropped frames.
static DROPPED: AtomicU32 = AtomicU32::new(0);

/// A frame that is being written. One critical section covers the whole frame, so that frames do not interleave.
struct Writing {
    encoder: RefCell<Encoder>,
    frame: RefCell<Vec<u8, FRAME_BYTES>>,
    whole: Cell<bool>,
    restore: Cell<Option<RestoreState>>,
}

static WRITING: Mutex<Writing> = Mutex::new(Writing {
    encoder: RefCell::new(Encoder::new()),
    frame: RefCell::new(Vec::new()),
    whole: Cell::new(true),
    restore: Cell::new(None),
});

#[defmt::global_logger]
struct Log;

/// Runs `body` on the frame. Callers hold the critical section.
fn with(body: impl FnOnce(&Writing, &mut Encoder)) {
    // SAFETY: called only between `acquire` and `release`, inside the critical section.
    let section = unsafe { CriticalSection::new() };
    let writing = WRITING.borrow(section);
    if let Ok(mut encoder) = writing.encoder.try_borrow_mut() {
        body(writing, &mut encoder);
    }
}

fn append(writing: &Writing, bytes: &[u8]) {
    let fits = writing.frame.try_borrow_mut().is_ok_and(|mut frame| frame.extend_from_slice(bytes).is_ok());
    if !fits {
        writing.whole.set(false);
    }
}

// SAFETY: `acquire` disables interrupts until `release`, so calls neither nest nor overlap; defmt pairs them.
unsafe impl defmt::Logger for Log {
    fn acquire() {
        // SAFETY: released in `release`, which defmt calls after each `acquire`.
        let restore = unsafe { critical_section::acquire() };
        with(|writing, encoder| {
            writing.restore.set(Some(restore));
            writing.whole.set(true);
            if let Ok(mut frame) = writing.frame.try_borrow_mut() {
                frame.clear();
            }
            encoder.start_frame(|bytes| append(writing, bytes));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        with(|writing, encoder| {
            encoder.end_frame(|bytes| append(writing, bytes));
            if let Ok(frame) = writing.frame.try_borrow() {
                if writing.whole.get() && LOG.outgoing().room() >= frame.len() {
                    LOG.outgoing().push_from(&frame);
                    gleaner_wake_log();
                } else {
                    DROPPED.store(DROPPED.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
                }
            }
            if let Some(restore) = writing.restore.take() {
                // SAFETY: the state that `acquire` returned.
                unsafe { critical_section::release(restore) };
            }
        });
    }

    unsafe fn write(bytes: &[u8]) {
        with(|writing, encoder| encoder.write(bytes, |encoded| append(writing, encoded)));
    }
}

defmt::timestamp!("{=u64:us}", super::now().as_micros());

/// The event log of a board.
pub(super) struct Defmt;

impl EventLog for Defmt {
    fn state(&mut self, from: State, to: State) {
        defmt::info!("{=str} -> {=str}", from.name(), to.name());
    }

    fn decision(&mut self, decision: &Decision, took: Option<Duration>) {
        defmt::info!(
            "decision {=u32}: {=str} at ({=i16}, {=i16}), battery {=f32}, inference {=u64} us",
            decision.sequence,
            decision.action.name(),
            decision.cell.x,
            decision.cell.y,
            decision.battery.0,
            took.map_or(0, Duration::as_micros)
        );
    }

    fn losses(&mut self, port: &'static str, stats: PortStats) {
        defmt::warn!(
            "{=str} port lost {=u32}, damaged {=u32}; {=u32} log lines dropped",
            port,
            stats.lost,
            stats.damaged,
            DROPPED.load(Ordering::Relaxed)
        );
    }
}
