//! City files as spreadsheets and surveys save them. Host only: the board reads a mission image.
//!
//! A city file is a table of building heights in metres, rows from north to south, columns from west to east.
//! Accepted: a UTF-8 byte order mark, CRLF, comment lines that begin with `#`, commas, semicolons (then with decimal
//! commas) or tabs as delimiter, padding delimiters at the end of rows, and decimals, which are rounded up because a
//! building must never be lower than it is. Refused by name: empty cells, no-data values, UTF-16, GeoJSON.

use crate::{Cell, Grid, GridError, HeightMap, Metres};
use core::fmt;
use csv::{ReaderBuilder, StringRecord, Trim};
use std::borrow::ToOwned;
use std::string::String;
use std::vec::Vec;

/// A city file that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct CityFile {
    /// Building heights.
    pub heights: HeightMap,
    /// How many heights had decimals and were rounded up.
    pub rounded: usize,
}

/// What is wrong with a city file, and where: line and column count from 1, columns in values. Line 0 is the file as a
/// whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CityFileError {
    /// Line of the text.
    pub line: usize,
    /// Value within the line.
    pub column: usize,
    /// The fault.
    pub fault: CityFault,
}

/// The kinds of fault in a city file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CityFault {
    /// UTF-16, by its byte order mark or its zero bytes.
    Utf16,
    /// Not UTF-8.
    NotUtf8,
    /// JSON instead of a table.
    Json,
    /// A cell without a value.
    Empty,
    /// A value that surveys write where they have no data.
    NoData(String),
    /// Not a number.
    NotANumber(String),
    /// A height outside 0 to 255 m.
    OutOfRange(String),
    /// Another number of values than in the first row.
    RowLength {
        /// Values of the first row.
        expected: usize,
        /// Values of this row.
        found: usize,
    },
    /// The size is impossible.
    Grid(GridError),
}

/// The beginning of a value on one line: a quoted value may contain line breaks and be as long as the file.
struct Excerpt<'a>(&'a str);

impl fmt::Display for Excerpt<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const CHARACTERS: usize = 40;
        let mut characters = self.0.chars();
        for character in characters.by_ref().take(CHARACTERS) {
            write!(f, "{}", character.escape_debug())?;
        }
        if characters.next().is_some() { f.write_str("...") } else { Ok(()) }
    }
}

impl fmt::Display for CityFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line > 0 {
            write!(f, "line {}, column {}: ", self.line, self.column)?;
        }
        match &self.fault {
            CityFault::Utf16 => write!(f, "UTF-16: save as UTF-8"),
            CityFault::NotUtf8 => write!(f, "not UTF-8: save as UTF-8"),
            CityFault::Json => {
                write!(f, "GeoJSON is no table of heights: convert it with `gleaner-sitl city import`")
            }
            CityFault::Empty => write!(f, "empty cell: write 0 for open ground"),
            CityFault::NoData(value) => {
                write!(f, "no-data value {}: fill in the height, 0 for open ground", Excerpt(value))
            }
            CityFault::NotANumber(value) => write!(f, "\"{}\" is no height in metres", Excerpt(value)),
            CityFault::OutOfRange(value) => write!(f, "height {} is not from 0 to 255 m", Excerpt(value)),
            CityFault::RowLength { expected, found } => {
                write!(f, "{found} values where the first row has {expected}")
            }
            CityFault::Grid(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for CityFileError {}

/// The text of a file without its byte order mark.
///
/// # Errors
/// [`CityFault::Utf16`] and [`CityFault::NotUtf8`], with the line of the first wrong byte.
pub fn decode_text(bytes: &[u8]) -> Result<&str, CityFileError> {
    let utf16 = matches!(bytes, [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] | [0, _, 0, _, ..] | [_, 0, _, 0, ..]);
    if utf16 {
        return Err(CityFileError { line: 0, column: 0, fault: CityFault::Utf16 });
    }
    let text = core::str::from_utf8(bytes).map_err(|error| {
        let before = bytes.get(..error.valid_up_to()).unwrap_or(&[]);
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        CityFileError { line, column: 1, fault: CityFault::NotUtf8 }
    })?;
    Ok(text.strip_prefix('\u{FEFF}').unwrap_or(text))
}

/// Values that geographic tools write for missing data.
const NO_DATA_NUMBERS: [f64; 5] = [-9999.0, -99999.0, -32768.0, -32767.0, -3.402_823_5e38];
const NO_DATA_WORDS: [&str; 7] = ["nan", "na", "n/a", "nodata", "no data", "null", "none"];

/// One row of the table: its line and its values, without padding at the end.
struct Row {
    line: usize,
    values: Vec<String>,
}

/// Reads a city file.
///
/// # Errors
/// The first fault with its place, see [`CityFileError`].
pub fn read_city(bytes: &[u8], cell: Metres) -> Result<CityFile, CityFileError> {
    let text = decode_text(bytes)?;
    if text.trim_start().starts_with(['{', '[']) {
        return Err(CityFileError { line: 0, column: 0, fault: CityFault::Json });
    }
    let delimiter = delimiter(text);
    let rows = rows(text, delimiter)?;
    let width = rows.first().map_or(0, |row| row.values.len());
    let side = |count: usize| u16::try_from(count).unwrap_or(u16::MAX);
    let grid = Grid::new(side(width), side(rows.len()), cell).map_err(|error| CityFileError {
        line: 0,
        column: 0,
        fault: CityFault::Grid(error),
    })?;
    let mut city = CityFile { heights: HeightMap::flat(grid), rounded: 0 };
    for (row, Row { line, values }) in rows.iter().enumerate() {
        let found = values.len();
        if found != width {
            let (column, fault) = (found.min(width) + 1, CityFault::RowLength { expected: width, found });
            return Err(CityFileError { line: *line, column, fault });
        }
        for (column, value) in values.iter().enumerate() {
            let (height_m, rounded) = height(value, delimiter).map_err(|fault| CityFileError {
                line: *line,
                column: column + 1,
                fault,
            })?;
            city.heights.set(Cell::new(column as i16, (rows.len() - 1 - row) as i16), height_m);
            city.rounded += usize::from(rounded);
        }
    }
    Ok(city)
}

/// The delimiter of the first row.
fn delimiter(text: &str) -> u8 {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or("");
    match first {
        _ if first.contains(';') => b';',
        _ if first.contains('\t') => b'\t',
        _ => b',',
    }
}

/// The rows, without the padding that spreadsheets add on the right and below.
fn rows(text: &str, delimiter: u8) -> Result<Vec<Row>, CityFileError> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    let mut record = StringRecord::new();
    loop {
        match reader.read_record(&mut record) {
            Ok(false) => break,
            Ok(true) => {
                let line = record.position().map_or(0, |position| position.line() as usize);
                rows.push(Row { line, values: record.iter().map(ToOwned::to_owned).collect() });
            }
            Err(_) => return Err(CityFileError { line: 0, column: 0, fault: CityFault::NotUtf8 }),
        }
    }
    let used = |row: &Row| row.values.iter().rposition(|value| !value.is_empty()).map_or(0, |last| last + 1);
    while rows.last().is_some_and(|row| used(row) == 0) {
        rows.pop();
    }
    // Columns that are empty in every row are padding; an empty cell inside the table is not.
    let width = rows.iter().map(used).max().unwrap_or(0);
    rows.iter_mut().for_each(|row| row.values.truncate(width));
    Ok(rows)
}

/// Whole metres, and whether they were rounded up.
fn height(value: &str, delimiter: u8) -> Result<(u8, bool), CityFault> {
    if value.is_empty() {
        return Err(CityFault::Empty);
    }
    if NO_DATA_WORDS.contains(&value.to_lowercase().as_str()) {
        return Err(CityFault::NoData(value.to_owned()));
    }
    let decimal_point = if delimiter == b';' { value.replace(',', ".") } else { value.to_owned() };
    let metres: f64 = decimal_point.parse().map_err(|_| CityFault::NotANumber(value.to_owned()))?;
    let close = |marker: f64| (metres - marker).abs() <= marker.abs() * 1e-6;
    if !metres.is_finite() || NO_DATA_NUMBERS.into_iter().any(close) {
        return Err(CityFault::NoData(value.to_owned()));
    }
    let whole = libm::ceil(metres);
    if !(0.0..=255.0).contains(&whole) || metres < 0.0 {
        return Err(CityFault::OutOfRange(value.to_owned()));
    }
    Ok((whole as u8, whole > metres))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<CityFile, CityFileError> {
        read_city(text.as_bytes(), Metres(20.0))
    }

    fn fault(text: &str) -> (usize, usize, CityFault) {
        let CityFileError { line, column, fault } = read(text).unwrap_err();
        (line, column, fault)
    }

    #[test]
    fn marks_line_ends_padding_and_delimiters_are_accepted() {
        let plain = read("1,2,3\n4,5,6\n").unwrap();
        assert_eq!(plain.heights.as_slice(), [4, 5, 6, 1, 2, 3]);
        for text in [
            "\u{FEFF}# heights\n1,2,3\n4,5,6\n",
            "1,2,3\r\n4,5,6\r\n",
            "# heights,,,\n1,2,3,,\n4,5,6,,\n,,,,\n",
            "1;2;3\r\n4;5;6\r\n",
            "1\t2\t3\n4\t5\t6\n",
            "\n1, 2, 3\n\n4, 5, 6\n",
        ] {
            assert_eq!(read(text).unwrap(), plain, "{text:?}");
        }
    }

    #[test]
    fn decimals_are_rounded_up_and_counted() {
        let city = read("17.4,0.0\n0,3.01\n").unwrap();
        assert_eq!((city.heights.as_slice(), city.rounded), ([0, 4, 18, 0].as_slice(), 2));
        assert_eq!(read("17,4;0\n0;3,01\n").unwrap(), city, "decimal commas");
    }

    #[test]
    fn faults_name_their_place_and_cause() {
        assert_eq!(fault("0,0\n0,1,0\n"), (2, 3, CityFault::RowLength { expected: 2, found: 3 }));
        assert_eq!(fault("0,1,0\n0,,0\n"), (2, 2, CityFault::Empty));
        assert_eq!(fault("0,-9999\n"), (1, 2, CityFault::NoData("-9999".into())));
        assert_eq!(fault("0,nan\n"), (1, 2, CityFault::NoData("nan".into())));
        assert_eq!(fault("0,x\n"), (1, 2, CityFault::NotANumber("x".into())));
        let told = |text: &str| std::format!("{}", read(text).unwrap_err());
        assert_eq!(told("0,\"a\nb\"\n"), "line 1, column 2: \"a\\nb\" is no height in metres");
        let long = told(&std::format!("0,-{}\n", "7".repeat(5_000)));
        assert!(long.len() < 120 && long.contains("777..."), "{long}");
        assert_eq!(fault("0,256\n"), (1, 2, CityFault::OutOfRange("256".into())));
        assert_eq!(fault("0,-3\n"), (1, 2, CityFault::OutOfRange("-3".into())));
        assert_eq!(fault("0,0\n0\n"), (2, 2, CityFault::RowLength { expected: 2, found: 1 }));
        assert_eq!(fault("{\"type\":1}").2, CityFault::Json);
        assert_eq!(fault("").2, CityFault::Grid(GridError::Empty));
    }

    #[test]
    fn utf16_is_named() {
        for bytes in [&[0xFF, 0xFE, b'0', 0][..], &[0xFE, 0xFF, 0, b'0'], &[b'0', 0, b',', 0]] {
            assert_eq!(read_city(bytes, Metres(20.0)).unwrap_err().fault, CityFault::Utf16);
        }
        let latin1 = read_city(b"# H\xF6hen\n0,0\n", Metres(20.0)).unwrap_err();
        assert_eq!((latin1.line, latin1.fault), (1, CityFault::NotUtf8));
    }
}
