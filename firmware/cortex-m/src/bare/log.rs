//! defmt on a serial port that never waits: a frame that finds no room is dropped whole and counted.
#![allow(unsafe_code)]

use super::lines::{LOG, gleaner_wake_log};
use crate::{Journal, PortStats};
use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicU32, Ordering};
use critical_section::{CriticalSection, Mutex, RestoreState};
use defmt::Encoder;
use gleaner_pilot::{Decision, State};
use gleaner_units::Duration;
use heapless::Vec;

/// The longest frame.
const FRAME_BYTES: usize = 256;
/// Frames dropped for want of room.
static DROPPED: AtomicU32 = AtomicU32::new(0);

/// A frame while it is written. The critical section spans it, so that none is torn by an interrupt's.
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

/// Runs `body` on the frame. Nothing else holds it: a critical section is on.
fn with(body: impl FnOnce(&Writing, &mut Encoder)) {
    // SAFETY: only called between `acquire` and `release`, where the critical section is on.
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

// SAFETY: `acquire` turns interrupts off until `release`, so calls never nest and never overlap; defmt pairs them.
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
                // SAFETY: the state that `acquire` got.
                unsafe { critical_section::release(restore) };
            }
        });
    }

    unsafe fn write(bytes: &[u8]) {
        with(|writing, encoder| encoder.write(bytes, |encoded| append(writing, encoded)));
    }
}

defmt::timestamp!("{=u64:us}", super::now().as_micros());

/// The journal of a board.
pub(super) struct Defmt;

impl Journal for Defmt {
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
