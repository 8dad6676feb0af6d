//! The parameter table: names, ranges and defaults.

/// Id of a parameter. The order is that of the index on the wire and never changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ParameterId {
    /// `GLN_W_DATA`.
    DataWeight = 0,
    /// `GLN_ENABLE`.
    Enable = 1,
    /// `GLN_ALT`.
    Altitude = 2,
    /// `GLN_SPEED`.
    Speed = 3,
    /// `GLN_RESERVE`.
    Reserve = 4,
    /// `GLN_BAT_UNITS`.
    FullBattery = 5,
    /// `GLN_ARRIVE_R`.
    ArriveRadius = 6,
    /// `GLN_SNR_AGE`.
    SnrAge = 7,
    /// `GLN_W_RC`.
    DataWeightChannel = 8,
    /// `GLN_LOOKAHEAD`.
    Lookahead = 9,
    /// `GLN_MODEL`.
    Model = 10,
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterSpec {
    /// Id.
    pub id: ParameterId,
    /// Name on the wire and in files, at most 16 characters.
    pub name: &'static str,
    /// Smallest allowed value.
    pub min: f32,
    /// Largest allowed value.
    pub max: f32,
    /// Value of a fresh installation.
    pub default: f32,
    /// Whether only whole numbers are allowed. All travel as `REAL32`.
    pub whole: bool,
    /// Unit, empty for none.
    pub unit: &'static str,
    /// One sentence.
    pub doc: &'static str,
}

const fn row(
    id: ParameterId,
    name: &'static str,
    [min, max, default]: [f32; 3],
    whole: bool,
    unit: &'static str,
    doc: &'static str,
) -> ParameterSpec {
    ParameterSpec { id, name, min, max, default, whole, unit, doc }
}

/// Number of parameters.
pub(super) const COUNT: usize = 11;

/// All parameters, by index: `[min, max, default]`.
#[rustfmt::skip]
pub const PARAMETERS: [ParameterSpec; COUNT] = [
    row(ParameterId::DataWeight, "GLN_W_DATA", [0.0, 1.0, 0.5], false, "",
        "Preference: weight of data; energy gets 1 minus it. Takes effect at the next decision."),
    row(ParameterId::Enable, "GLN_ENABLE", [0.0, 2.0, 0.0], true, "",
        "0 off, 1 engage when the autopilot is in GUIDED or OFFBOARD, 2 shadow."),
    row(ParameterId::Altitude, "GLN_ALT", [20.0, 120.0, 60.0], false, "m",
        "Flight altitude above the take-off point."),
    row(ParameterId::Speed, "GLN_SPEED", [1.0, 20.0, 10.0], false, "m/s",
        "Horizontal speed, commanded to the autopilot."),
    row(ParameterId::Reserve, "GLN_RESERVE", [0.0, 50.0, 2.0], false, "units",
        "Battery units kept beyond the way home."),
    row(ParameterId::FullBattery, "GLN_BAT_UNITS", [1.0, 500.0, 100.0], false, "units",
        "Battery units that a full battery is worth."),
    row(ParameterId::ArriveRadius, "GLN_ARRIVE_R", [0.5, 10.0, 2.0], false, "m",
        "Arrival radius of a cell centre."),
    row(ParameterId::SnrAge, "GLN_SNR_AGE", [1.0, 600.0, 10.0], false, "s",
        "Radio reports older than this are masked."),
    row(ParameterId::DataWeightChannel, "GLN_W_RC", [0.0, 18.0, 0.0], true, "",
        "RC channel mapped to the preference; 0 none."),
    row(ParameterId::Lookahead, "GLN_LOOKAHEAD", [0.0, 1.0, 0.0], true, "",
        "0 the network alone decides, 1 it looks ahead in the on-board model."),
    row(ParameterId::Model, "GLN_MODEL", [-1.0, 16.0, 0.0], true, "",
        "Installed model that decides; 0 the configured one, -1 the one before. Not in flight."),
];

impl ParameterId {
    /// Its row in the table.
    #[must_use]
    pub const fn spec(self) -> ParameterSpec {
        match self {
            ParameterId::DataWeight => PARAMETERS[0],
            ParameterId::Enable => PARAMETERS[1],
            ParameterId::Altitude => PARAMETERS[2],
            ParameterId::Speed => PARAMETERS[3],
            ParameterId::Reserve => PARAMETERS[4],
            ParameterId::FullBattery => PARAMETERS[5],
            ParameterId::ArriveRadius => PARAMETERS[6],
            ParameterId::SnrAge => PARAMETERS[7],
            ParameterId::DataWeightChannel => PARAMETERS[8],
            ParameterId::Lookahead => PARAMETERS[9],
            ParameterId::Model => PARAMETERS[10],
        }
    }

    /// The parameter with this name; case matters.
    #[must_use]
    pub fn from_name(name: &str) -> Option<ParameterId> {
        PARAMETERS.iter().find(|spec| spec.name == name).map(|spec| spec.id)
    }

    /// The parameter with this index.
    #[must_use]
    pub fn from_index(index: u16) -> Option<ParameterId> {
        PARAMETERS.get(usize::from(index)).map(|spec| spec.id)
    }

    /// Its index on the wire.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }
}
