//! Telemetry: one `NAMED_VALUE_FLOAT` per value, once a second.

/// The values of one second; a value that is `None` or not finite is not sent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telemetry {
    /// `w_data`: weight of data in the preference, 0..1.
    pub data_weight: Option<f32>,
    /// `collected`: fraction of the initial data that is collected, 0..1.
    pub collected: Option<f32>,
    /// `spare_bat`: battery units beyond the way to the terminal and the reserve.
    pub spare_units: Option<f32>,
    /// `infer_us`: time of the last decision, network and look-ahead, us.
    pub inference_us: Option<f32>,
    /// `attn_dev`: index of the device that the last decision attended to most.
    pub attended_device: Option<f32>,
    /// `unit_pct`: battery percent that a unit really costs.
    pub unit_percent: Option<f32>,
    /// `land_pct`: battery percent expected at touchdown.
    pub landing_percent: Option<f32>,
    /// `snr_off`: fitted offset of the channel model, dB.
    pub snr_offset_db: Option<f32>,
}

impl Telemetry {
    /// Names on the wire, at most 10 characters, with their values.
    #[must_use]
    pub const fn values(&self) -> [(&'static str, Option<f32>); 8] {
        [
            ("w_data", self.data_weight),
            ("collected", self.collected),
            ("spare_bat", self.spare_units),
            ("infer_us", self.inference_us),
            ("attn_dev", self.attended_device),
            ("unit_pct", self.unit_percent),
            ("land_pct", self.landing_percent),
            ("snr_off", self.snr_offset_db),
        ]
    }
}
