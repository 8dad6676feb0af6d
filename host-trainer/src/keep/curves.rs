//! Learning curves, written during the training: JSON lines for scripts and the report, and TensorBoard events.
//!
//! `curve.jsonl` is the primary file: one object per line with `update`, `unix_s` and named numbers. The event file
//! beside it is written again from it whenever a run is opened, so that a run that continues from an older checkpoint
//! has no point twice.

use crate::judge::validation::Tables;
use crate::keep::whole;
use prost::Message;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// File name of the learning curve inside the output folder: one JSON object per line.
pub const CURVE: &str = "curve.jsonl";
/// File name of the event file; TensorBoard looks for `tfevents`.
pub const EVENTS: &str = "events.out.tfevents.gleaner";
/// CRC-32C, as TensorBoard's record format requires.
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);

/// Why a curve cannot be written or read.
#[derive(Debug, Error)]
pub enum CurvesError {
    /// The file system.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// A line is not a point of a curve.
    #[error("{}: line {line} is not a point of a learning curve; move the file away", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
    },
}

/// The numbers of a run at one update.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Updates done.
    pub update: u64,
    /// Time, seconds since 1970; 0 if the file has none.
    pub unix_s: f64,
    /// The numbers by name, such as `rd/hypervolume`.
    pub scalars: BTreeMap<String, f64>,
}

impl Point {
    /// Environment steps flown; `None` where the file has no number of them.
    #[must_use]
    pub fn steps(&self) -> Option<u64> {
        self.scalars.get("steps").map(|&steps| steps as u64)
    }

    fn line(&self) -> String {
        let mut object = Map::new();
        object.insert("update".into(), self.update.into());
        object.insert("unix_s".into(), self.unix_s.into());
        object.extend(self.scalars.iter().map(|(name, &value)| (name.clone(), value.into())));
        Value::Object(object).to_string()
    }

    fn parse(line: &str) -> Option<Point> {
        let value: Value = serde_json::from_str(line).ok()?;
        let update = value.get("update")?.as_u64()?;
        let unix_s = value.get("unix_s").and_then(Value::as_f64).unwrap_or(0.0);
        Some(Point { update, unix_s, scalars: scalars_in(&value)?.into_iter().collect() })
    }
}

/// The named numbers in an object: its own, those of nested objects such as the losses, and the metrics of the validation
/// `tables`. `None` if the value is not an object or its tables cannot be read.
#[must_use]
pub fn scalars_in(value: &Value) -> Option<Vec<(String, f64)>> {
    let mut scalars = Vec::new();
    for (name, value) in value.as_object()? {
        match (name.as_str(), value) {
            ("update" | "unix_s", _) => {}
            ("tables", tables) => scalars.extend(scalars_of(&serde_json::from_value(tables.clone()).ok()?)),
            (_, Value::Object(parts)) => {
                scalars.extend(parts.iter().filter_map(|(name, part)| Some((name.clone(), part.as_f64()?))));
            }
            _ => scalars.extend(value.as_f64().map(|number| (name.clone(), number))),
        }
    }
    Some(scalars)
}

/// The metrics of a validation, by scenario.
#[must_use]
pub fn scalars_of(tables: &Tables) -> Vec<(String, f64)> {
    let of_one = |(scenario, table): &(String, crate::judge::evaluation::Table)| {
        let mut scalars = vec![
            (format!("{scenario}/hypervolume"), table.hypervolume),
            (format!("{scenario}/utility"), f64::from(table.utility)),
            (format!("{scenario}/coverage_percent"), f64::from(table.coverage())),
            (format!("{scenario}/least_energy"), f64::from(table.least_energy())),
            (format!("{scenario}/least_energy_std"), f64::from(table.least_energy_std())),
        ];
        // Older curves have no hypervolume of single realizations.
        if table.mean_hypervolume > 0.0 {
            scalars.push((format!("{scenario}/mean_hypervolume"), table.mean_hypervolume));
        }
        scalars
    };
    tables.0.iter().flat_map(of_one).collect()
}

/// The open curve of a run.
#[derive(Debug)]
pub struct Curves {
    folder: PathBuf,
    lines: File,
    events: File,
}

impl Curves {
    /// Continues the curve in `folder`. Points beyond `update`, which the run lost when it was killed, are dropped.
    ///
    /// # Errors
    /// See [`CurvesError`]; the old curve is then still there.
    pub fn open(folder: &Path, update: u64) -> Result<Curves, CurvesError> {
        let mut points = points(folder)?;
        points.retain(|(_, point)| point.update <= update);
        let lines = folder.join(CURVE);
        let text: String = points.iter().map(|(line, _)| format!("{line}\n")).collect();
        replace(&lines, text.as_bytes())?;
        let events = folder.join(EVENTS);
        let mut bytes = Vec::new();
        for event in [Event::first()].into_iter().chain(points.iter().map(|(_, point)| Event::of(point))) {
            record(&event, &mut bytes).expect("writing to memory cannot fail");
        }
        replace(&events, &bytes)?;
        let append = |path: &Path| OpenOptions::new().append(true).open(path).map_err(|e| io_error(path, e));
        Ok(Curves { folder: folder.to_owned(), lines: append(&lines)?, events: append(&events)? })
    }

    /// Appends a point without its non-finite numbers.
    ///
    /// # Errors
    /// The disk.
    pub fn log(&mut self, update: u64, scalars: &[(impl AsRef<str>, f64)]) -> Result<(), CurvesError> {
        let finite = scalars.iter().filter(|(_, value)| value.is_finite());
        let point = Point {
            update,
            unix_s: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64()),
            scalars: finite.map(|(name, value)| (name.as_ref().to_owned(), *value)).collect(),
        };
        // One write each, so that a kill damages at most the last line.
        self.lines
            .write_all((point.line() + "\n").as_bytes())
            .map_err(|error| io_error(&self.folder.join(CURVE), error))?;
        let mut bytes = Vec::new();
        record(&Event::of(&point), &mut bytes).expect("writing to memory cannot fail");
        self.events.write_all(&bytes).map_err(|error| io_error(&self.folder.join(EVENTS), error))
    }
}

/// The curve in `folder`; empty if there is none. An incomplete last line is left out.
///
/// # Errors
/// See [`CurvesError`].
pub fn read(folder: &Path) -> Result<Vec<Point>, CurvesError> {
    Ok(points(folder)?.into_iter().map(|(_, point)| point).collect())
}

/// The lines of the file with their points.
fn points(folder: &Path) -> Result<Vec<(String, Point)>, CurvesError> {
    let path = folder.join(CURVE);
    let text = match fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(io_error(&path, error)),
    };
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let parse = |(index, line): (usize, &str)| match Point::parse(line) {
        Some(point) => Ok((line.to_owned(), point)),
        None => Err(CurvesError::Damaged { path: path.clone(), line: index + 1 }),
    };
    whole.lines().enumerate().map(parse).collect()
}

fn io_error(path: &Path, source: io::Error) -> CurvesError {
    CurvesError::Io { path: path.to_owned(), source }
}

fn replace(path: &Path, bytes: &[u8]) -> Result<(), CurvesError> {
    whole::write(path, bytes).map_err(|error| io_error(path, error))
}

/// One record of an event file: length, its masked checksum, the message, its masked checksum.
fn record(event: &Event, to: &mut impl Write) -> io::Result<()> {
    let masked = |bytes: &[u8]| CRC.checksum(bytes).rotate_right(15).wrapping_add(0xa282_ead8).to_le_bytes();
    let message = event.encode_to_vec();
    let length = (message.len() as u64).to_le_bytes();
    let mut to = BufWriter::new(to);
    to.write_all(&length)?;
    to.write_all(&masked(&length))?;
    to.write_all(&message)?;
    to.write_all(&masked(&message))?;
    to.flush()
}

/// The part of TensorBoard's `Event` message that scalars need.
#[derive(Clone, PartialEq, prost::Message)]
struct Event {
    /// Seconds since 1970.
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    value: Vec<Scalar>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Scalar {
    #[prost(string, tag = "1")]
    tag: String,
    #[prost(float, tag = "2")]
    simple_value: f32,
}

impl Event {
    fn first() -> Event {
        Event { wall_time: 0.0, step: 0, file_version: Some("brain.Event:2".into()), summary: None }
    }

    fn of(point: &Point) -> Event {
        let scalar = |(tag, &value): (&String, &f64)| Scalar { tag: tag.clone(), simple_value: value as f32 };
        let summary = Summary { value: point.scalars.iter().map(scalar).collect() };
        Event {
            wall_time: point.unix_s,
            step: point.update as i64,
            file_version: None,
            summary: Some(summary),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads an event file by the rules of the format, without the code of the writer.
    fn events(path: &Path) -> Vec<Event> {
        let bytes = fs::read(path).unwrap();
        let (mut rest, mut events) = (&bytes[..], Vec::new());
        let unmasked = |four: &[u8]| {
            let masked = u32::from_le_bytes(four.try_into().unwrap()).wrapping_sub(0xa282_ead8);
            masked.rotate_left(15)
        };
        while !rest.is_empty() {
            let length = u64::from_le_bytes(rest[..8].try_into().unwrap()) as usize;
            assert_eq!(unmasked(&rest[8..12]), CRC.checksum(&rest[..8]));
            let message = &rest[12..12 + length];
            assert_eq!(unmasked(&rest[12 + length..16 + length]), CRC.checksum(message));
            events.push(Event::decode(message).unwrap());
            rest = &rest[16 + length..];
        }
        events
    }

    #[test]
    fn resumed_curve_has_no_point_twice() {
        let folder = tempfile::tempdir().unwrap();
        let mut curves = Curves::open(folder.path(), 0).unwrap();
        for update in [100, 200, 300] {
            let numbers = [("rd/hypervolume", update as f64 + 0.5), ("critic", f64::NAN)];
            curves.log(update, &numbers).unwrap();
        }
        drop(curves);
        // The last line is incomplete, and the last checkpoint was at 200.
        let path = folder.path().join(CURVE);
        fs::write(&path, fs::read_to_string(&path).unwrap() + "{\"update\":40").unwrap();
        let mut curves = Curves::open(folder.path(), 200).unwrap();
        curves.log(300, &[("rd/hypervolume", 7.0)]).unwrap();

        let points = read(folder.path()).unwrap();
        let logged: Vec<_> = points.iter().map(|p| (p.update, p.scalars["rd/hypervolume"])).collect();
        assert_eq!(logged, [(100, 100.5), (200, 200.5), (300, 7.0)]);
        assert!(points[0].unix_s > 1.6e9 && points[0].scalars.len() == 1);
        let events = events(&folder.path().join(EVENTS));
        assert_eq!(events[0].file_version.as_deref(), Some("brain.Event:2"));
        let logged: Vec<_> = events[1..]
            .iter()
            .map(|event| {
                let value = &event.summary.as_ref().unwrap().value;
                (event.step, value.len(), value[0].tag.as_str(), value[0].simple_value)
            })
            .collect();
        let name = "rd/hypervolume";
        assert_eq!(logged, [(100, 1, name, 100.5), (200, 1, name, 200.5), (300, 1, name, 7.0)]);
    }

    #[test]
    fn nested_lines_are_read_and_damage_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let row = r#"{"w_data":1.0,"data_percent":47.5,"energy":80.0,"energy_std":0.0}"#;
        let line = format!(
            r#"{{"update":2500,"steps":9,"losses":{{"critic":0.5}},"tables":[["rd",{{"rows":[{row}],"hypervolume":5848.5,"utility":-18.0}}]]}}"#
        );
        fs::write(folder.path().join(CURVE), format!("{line}\n")).unwrap();
        let point = &read(folder.path()).unwrap()[0];
        assert_eq!((point.update, point.scalars["critic"], point.scalars["steps"]), (2500, 0.5, 9.0));
        assert_eq!((point.scalars["rd/hypervolume"], point.scalars["rd/coverage_percent"]), (5848.5, 47.5));

        fs::write(folder.path().join(CURVE), format!("{line}\nno JSON\n{line}\n")).unwrap();
        assert!(matches!(read(folder.path()), Err(CurvesError::Damaged { line: 2, .. })));
        assert_eq!(read(Path::new("/no/such/folder")).unwrap(), []);
    }
}
