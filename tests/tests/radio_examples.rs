//! The encoders that `docs/radio.md` shows, in C and in Python, against the decoder that flies.

use gleaner_radio::{Report, ReportDecoder, encode};
use gleaner_tests::programs::repository;
use gleaner_units::Db;
use std::process::Command;

/// Short and long varints, negative SNR, zeros inside, and no remaining amount.
fn reports() -> Vec<Report> {
    [
        (300, 2.5, Some(1000.0), 250),
        (0, 0.0, None, 0),
        (127, -12.25, Some(0.0), 127),
        (128, 31.5, None, 16_384),
        (u32::MAX, -1.1, Some(1.1), u32::MAX),
    ]
    .map(|(device, snr, remaining, age_ms)| Report { device, snr: Db(snr), remaining, age_ms })
    .to_vec()
}

/// Runs an encoder once for each report and decodes what it wrote.
fn judge(encoder: &dyn Fn() -> Command) {
    for report in reports() {
        let remaining = report.remaining.map_or("-".to_owned(), |units| units.to_string());
        let words =
            [report.device.to_string(), report.snr.0.to_string(), remaining, report.age_ms.to_string()];
        let output = encoder().args(words).output().unwrap();
        assert!(output.status.success(), "{report:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.stdout, encode(&report).as_slice(), "{report:?}");
        let mut decoded = Vec::new();
        ReportDecoder::new().push(&output.stdout, |report| decoded.push(report));
        assert_eq!(decoded, [report]);
    }
}

#[test]
fn the_example_in_c_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("report");
    let output = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-o"])
        .arg(&program)
        .arg(repository().join("docs/radio/report.c"))
        .output()
        .expect("a C compiler is installed as cc");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    judge(&|| Command::new(&program));
}

#[test]
fn the_example_in_python_is_decoded() {
    judge(&|| {
        let mut python = Command::new("python3");
        python.arg(repository().join("docs/radio/report.py"));
        python
    });
}
