//! The independent watchdog (RM0090, chapter 21; RM0433, chapter 46).
#![allow(unsafe_code)]

const KEY: usize = 0;
const PRESCALER: usize = 1;
const RELOAD: usize = 2;

const START: u32 = 0xCCCC;
const UNLOCK: u32 = 0x5555;
const FEED: u32 = 0xAAAA;
/// Division by 32.
const DIVIDE_BY_32: u32 = 3;
/// With that prescaler one second of the 32 kHz oscillator, whose tolerance is 17 to 47 kHz.
const STEPS: u32 = 1000;

/// Starts the watchdog with a period of one second.
///
/// # Safety
/// `registers` is the base address of the independent watchdog.
pub unsafe fn start(registers: *const ()) {
    for (register, value) in
        [(KEY, START), (KEY, UNLOCK), (PRESCALER, DIVIDE_BY_32), (RELOAD, STEPS), (KEY, FEED)]
    {
        // SAFETY: by the caller's promise a register of the watchdog.
        unsafe { write(registers, register, value) };
    }
}

/// Feeds the watchdog.
///
/// # Safety
/// As [`start`].
pub unsafe fn feed(registers: *const ()) {
    // SAFETY: by the caller's promise a register of the watchdog.
    unsafe { write(registers, KEY, FEED) };
}

unsafe fn write(registers: *const (), register: usize, value: u32) {
    // SAFETY: by the caller's promise.
    unsafe { registers.cast_mut().cast::<u32>().wrapping_add(register).write_volatile(value) };
}
