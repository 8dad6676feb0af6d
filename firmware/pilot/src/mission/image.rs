//! The mission as bytes in flash, for a board without files.
//!
//! Little endian, one after the other:
//!
//! | bytes | what |
//! |---|---|
//! | 4 | `GLNM` |
//! | 2 | version, [`VERSION`] |
//! | 2 | length of the body |
//! | 4 | CRC-32 (ISO-HDLC) of the version and the body (in version 2 of the body) |
//! | body | in version 4: the highest roof or hill above the take-off point, m (2); grid: width, height (2 + 2), cell side m (f32); corner: latitude, longitude (1e-7 deg, 4 + 4); rotation, degrees clockwise from north (f32; not in version 2); terminal x, y (2 + 2); budget (f32); number of devices (2); per device id, x, y (4 + 2 + 2), data (f32); heights, one byte a cell in index order; fence, one bit a cell in index order, lowest bit first |
//!
//! Whatever follows the body is ignored, so the image may stand in a longer section of flash.

use crate::{DeviceSite, MAX_DEVICES, Mission};
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use gleaner_units::{
    BatteryUnits, Cell, CellSet, Degrees, GeoPoint, Grid, GridPose, HeightMap, MAX_CELLS, Metres,
};
use heapless::Vec;

/// The layout above, on flat ground.
pub const VERSION: u16 = 3;
/// The layout of a mission that states its highest point: an older program must refuse it.
const UNEVEN: u16 = 4;
/// The layout without the grid's rotation, which is still read: the rotation is then 0.
const UNROTATED: u16 = 2;
const MAGIC: [u8; 4] = *b"GLNM";
const HEADER_BYTES: usize = 12;
const FIXED_BYTES: usize = 32;
const DEVICE_BYTES: usize = 12;
/// The longest image.
pub const IMAGE_BYTES_MAX: usize =
    HEADER_BYTES + FIXED_BYTES + MAX_DEVICES * DEVICE_BYTES + MAX_CELLS + MAX_CELLS / 8;

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// An image, ready to be written.
pub type ImageBytes = Vec<u8, IMAGE_BYTES_MAX>;

/// Why bytes are no mission. Each of them ends with a new image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageError {
    /// No image begins here.
    Absent,
    /// The layout is another one than this program reads.
    Version(u16),
    /// The bytes end before the image does, or the image before its last number.
    Short,
    /// The checksum is wrong.
    Checksum,
    /// A number that cannot be: the grid, or more devices than [`MAX_DEVICES`].
    Value,
}

impl ImageError {
    /// What to say to the operator, at most 30 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            ImageError::Absent => "no mission in flash",
            ImageError::Version(_) => "mission of another version",
            ImageError::Short => "mission cut short",
            ImageError::Checksum => "mission damaged",
            ImageError::Value => "mission impossible to read",
        }
    }
}

/// Writes the image of a mission.
#[must_use]
pub fn encode(mission: &Mission) -> ImageBytes {
    let mut body = ImageBytes::new();
    // `ImageBytes` is as long as the longest image, so nothing is cut off here.
    let mut put = |bytes: &[u8]| {
        let _ = body.extend_from_slice(bytes);
    };
    let version = match mission.heights.stated_highest_m() {
        Some(highest_m) => {
            put(&highest_m.to_le_bytes());
            UNEVEN
        }
        None => VERSION,
    };
    let grid = mission.grid();
    put(&grid.width().to_le_bytes());
    put(&grid.height().to_le_bytes());
    put(&grid.cell().0.to_le_bytes());
    put(&mission.pose.corner.lat_deg_e7.to_le_bytes());
    put(&mission.pose.corner.lon_deg_e7.to_le_bytes());
    put(&mission.pose.rotation.0.to_le_bytes());
    put(&mission.terminal.x.to_le_bytes());
    put(&mission.terminal.y.to_le_bytes());
    put(&mission.budget.0.to_le_bytes());
    put(&(mission.devices.len() as u16).to_le_bytes());
    for site in &mission.devices {
        put(&site.id.to_le_bytes());
        put(&site.cell.x.to_le_bytes());
        put(&site.cell.y.to_le_bytes());
        put(&site.data.to_le_bytes());
    }
    put(mission.heights.as_slice());
    let mut cells = grid.cells();
    while let Some(first) = cells.next() {
        let eight = core::iter::once(first).chain(cells.by_ref().take(7));
        let byte = eight
            .enumerate()
            .fold(0, |byte, (bit, cell)| byte | u8::from(mission.fence.contains(cell)) << (bit & 7));
        put(&[byte]);
    }
    let mut image = ImageBytes::new();
    let header: [&[u8]; 4] = [
        &MAGIC,
        &version.to_le_bytes(),
        &(body.len() as u16).to_le_bytes(),
        &checksum(version, &body).to_le_bytes(),
    ];
    for part in header.into_iter().chain([body.as_slice()]) {
        let _ = image.extend_from_slice(part);
    }
    image
}

/// Reads an image. It does not check whether the mission can be flown: see [`Mission::check`].
///
/// # Errors
/// See [`ImageError`].
pub fn decode(bytes: &[u8]) -> Result<Mission, ImageError> {
    let mut header = Reader(bytes);
    if header.array().ok() != Some(MAGIC) {
        return Err(ImageError::Absent);
    }
    let version = header.u16()?;
    if ![UNROTATED, VERSION, UNEVEN].contains(&version) {
        return Err(ImageError::Version(version));
    }
    let length = usize::from(header.u16()?);
    let stored = u32::from_le_bytes(header.array()?);
    let body = header.slice(length)?;
    if checksum(version, body) != stored {
        return Err(ImageError::Checksum);
    }
    Reader(body).mission(version)
}

/// Covers the version too: with one bit of it flipped, a body would be read in another layout.
fn checksum(version: u16, body: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    if version != UNROTATED {
        digest.update(&version.to_le_bytes());
    }
    digest.update(body);
    digest.finalize()
}

/// The bytes not yet read.
struct Reader<'b>(&'b [u8]);

impl<'b> Reader<'b> {
    fn slice(&mut self, length: usize) -> Result<&'b [u8], ImageError> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or(ImageError::Short)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ImageError> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(ImageError::Short)?;
        self.0 = rest;
        Ok(*taken)
    }

    fn u16(&mut self) -> Result<u16, ImageError> {
        self.array().map(u16::from_le_bytes)
    }

    fn i32(&mut self) -> Result<i32, ImageError> {
        self.array().map(i32::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32, ImageError> {
        self.array().map(f32::from_le_bytes)
    }

    fn cell(&mut self) -> Result<Cell, ImageError> {
        let x = self.array().map(i16::from_le_bytes)?;
        let y = self.array().map(i16::from_le_bytes)?;
        Ok(Cell::new(x, y))
    }

    fn mission(mut self, version: u16) -> Result<Mission, ImageError> {
        let highest_m = if version == UNEVEN { Some(self.u16()?) } else { None };
        let (width, height, cell_m) = (self.u16()?, self.u16()?, self.f32()?);
        let grid = Grid::new(width, height, Metres(cell_m)).map_err(|_| ImageError::Value)?;
        let mut mission = Mission {
            heights: HeightMap::flat(grid),
            fence: CellSet::empty(grid),
            pose: GridPose {
                corner: GeoPoint { lat_deg_e7: self.i32()?, lon_deg_e7: self.i32()? },
                rotation: Degrees(if version == UNROTATED { 0.0 } else { self.f32()? }),
            },
            terminal: self.cell()?,
            budget: BatteryUnits(self.f32()?),
            devices: Vec::new(),
        };
        for _ in 0..self.u16()? {
            let site =
                DeviceSite { id: u32::from_le_bytes(self.array()?), cell: self.cell()?, data: self.f32()? };
            mission.devices.push(site).map_err(|_| ImageError::Value)?;
        }
        if let Some(highest_m) = highest_m {
            mission.heights.set_highest(highest_m);
        }
        for (cell, &height_m) in grid.cells().zip(self.slice(grid.len())?) {
            mission.heights.set(cell, height_m);
        }
        let fence = self.slice(grid.len().div_ceil(8))?;
        let bits = fence.iter().flat_map(|&byte| (0..8).map(move |bit| byte & (1 << bit) != 0));
        for (cell, inside) in grid.cells().zip(bits) {
            if inside {
                mission.fence.insert(cell);
            }
        }
        Ok(mission)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mission(width: u16, height: u16, devices: u16) -> Mission {
        let grid = Grid::new(width, height, Metres(20.0)).unwrap();
        let mut heights = HeightMap::flat(grid);
        let mut fence = CellSet::full(grid);
        for (index, cell) in grid.cells().enumerate() {
            heights.set(cell, (index * 7 % 51) as u8);
            if index % 11 == 3 {
                fence.remove(cell);
            }
        }
        let site = |id: u16| DeviceSite {
            id: u32::from(id) + 0x2601_0000,
            cell: Cell::new((id % width) as i16, 0),
            data: f32::from(id),
        };
        Mission {
            heights,
            fence,
            pose: GridPose {
                corner: GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 },
                rotation: Degrees(-12.5),
            },
            terminal: Cell::new(1, 0),
            budget: BatteryUnits(80.0),
            devices: (0..devices).map(site).collect(),
        }
    }

    #[test]
    fn every_mission_comes_back_also_the_largest() {
        for mission in [
            mission(40, 30, 6),
            mission(3, 3, 0),
            mission(1, 2, 1),
            mission(64, 32, 64),
            mission(128, 128, 64),
        ] {
            let mut image = encode(&mission);
            assert_eq!(decode(&image), Ok(mission.clone()));
            let _ = image.push(0xFF);
            assert_eq!(decode(&image), Ok(mission), "what follows is ignored");
        }
        let mut uneven = mission(128, 128, 64);
        uneven.heights.set_highest(83);
        let image = encode(&uneven);
        assert_eq!((image[4], image.len()), (4, IMAGE_BYTES_MAX));
        assert_eq!(decode(&image), Ok(uneven));
    }

    #[test]
    fn images_without_rotation_are_still_read() {
        let mut mission = mission(12, 9, 6);
        let current = encode(&mission);
        // Version 2: the same body without the four bytes of the rotation.
        let rotation = HEADER_BYTES + 16;
        let body = [&current[HEADER_BYTES..rotation], &current[rotation + 4..]].concat();
        let mut old = MAGIC.to_vec();
        old.extend(UNROTATED.to_le_bytes());
        old.extend((body.len() as u16).to_le_bytes());
        old.extend(CRC.checksum(&body).to_le_bytes());
        old.extend(body);
        mission.pose.rotation = Degrees(0.0);
        assert_eq!(decode(&old), Ok(mission));
        old[4] = 1;
        assert_eq!(decode(&old), Err(ImageError::Version(1)));
    }

    #[test]
    fn each_kind_of_damage_has_its_reason() {
        let image = encode(&mission(40, 30, 6));
        assert_eq!(decode(&[0xFF; 64]), Err(ImageError::Absent));
        assert_eq!(decode(&[]), Err(ImageError::Absent));
        assert_eq!(decode(&image[..image.len() - 1]), Err(ImageError::Short));
        let with = |at: usize, value: u8| {
            let mut image = image.clone();
            image[at] = value;
            decode(&image)
        };
        assert_eq!(with(4, 9), Err(ImageError::Version(9)));
        assert_eq!(with(200, image[200] ^ 1), Err(ImageError::Checksum));
    }

    #[test]
    fn one_flipped_bit_is_never_another_mission() {
        let image = encode(&mission(12, 9, 6));
        for at in 0..image.len() {
            for bit in 0..8 {
                let mut image = image.clone();
                image[at] ^= 1 << bit;
                assert!(decode(&image).is_err(), "byte {at}, bit {bit}");
            }
        }
    }
}
