//! Flight modes of ArduCopter, as far as they are simulated.

/// A mode with ArduCopter's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum CopterMode {
    /// The human pilot flies by attitude. Simulated as a pilot who holds the place.
    Stabilize = 0,
    /// The human pilot flies; the altitude is held.
    AltHold = 2,
    /// Position targets are obeyed.
    Guided = 4,
    /// Holds its place, sticks centred.
    Loiter = 5,
    /// Flies home and lands.
    Rtl = 6,
    /// Lands here.
    Land = 9,
    /// Stops and holds.
    Brake = 17,
}

impl CopterMode {
    const ALL: [CopterMode; 7] = [
        CopterMode::Stabilize,
        CopterMode::AltHold,
        CopterMode::Guided,
        CopterMode::Loiter,
        CopterMode::Rtl,
        CopterMode::Land,
        CopterMode::Brake,
    ];

    /// The mode with this `custom_mode`.
    #[must_use]
    pub fn from_number(custom_mode: u32) -> Option<CopterMode> {
        CopterMode::ALL.into_iter().find(|mode| mode.number() == custom_mode)
    }

    /// `custom_mode`.
    #[must_use]
    pub const fn number(self) -> u32 {
        self as u32
    }

    /// Whether motors may be armed in it.
    pub(crate) const fn allows_arming(self) -> bool {
        !matches!(self, CopterMode::Rtl | CopterMode::Land | CopterMode::Brake)
    }

    /// Whether it can only be entered with a position estimate.
    pub(crate) const fn needs_position(self) -> bool {
        matches!(self, CopterMode::Loiter | CopterMode::Rtl | CopterMode::Brake)
    }

    /// As ArduPilot spells it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            CopterMode::Stabilize => "Stabilize",
            CopterMode::AltHold => "AltHold",
            CopterMode::Guided => "Guided",
            CopterMode::Loiter => "Loiter",
            CopterMode::Rtl => "RTL",
            CopterMode::Land => "Land",
            CopterMode::Brake => "Brake",
        }
    }
}
