//! Arbitrary bytes on the radio's port, in every format: nothing panics, and the table holds only possible values.

use gleaner_radio::{DeviceTable, Format, JsonLines, Report, ReportDecoder, SemtechUdp};
use gleaner_units::{Duration, Instant};

/// Data of each device at the start, units.
const INITIAL: f32 = 6_000.0;

pub fn run(data: &[u8]) {
    let mut table = DeviceTable::<4>::empty();
    for id in [0, 1, 2, 0x2601_1BDA] {
        table.add(id, INITIAL).expect("four devices fit");
    }
    let formats: [&mut dyn Format; 3] =
        [&mut ReportDecoder::new(), &mut JsonLines::default(), &mut SemtechUdp::default()];
    for format in formats {
        let mut count = 0;
        for piece in data.chunks(64).chain([data]) {
            let mut apply = |report: Report| {
                count += 1;
                table.apply(Instant::ZERO, &report);
            };
            format.receive(piece, &mut apply, &mut |reply| assert!(reply.len() <= 12));
        }
        assert_eq!(format.stats().reports, count);
    }
    for index in 0..table.len() {
        let snr = table.snr(index, Instant::ZERO, Duration::from_secs(1_000_000_000));
        assert!(snr.is_none_or(|snr| snr.0.is_finite()));
        assert!(table.remaining(index).is_none_or(|units| (0.0..=INITIAL).contains(&units)));
    }
}
