//! Arguments of `city` and `radio`.

use super::order::{CityOrder, ImportOrder, RadioFormat, RadioOrder};
use super::values::{Rotation, bounds, cell_size, height, point, radio_format, rotation, units};
use crate::city::placement::BoundingBox;
use clap::{Args, Subcommand};
use gleaner_ports::Endpoint;
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(super) enum CityCommand {
    /// Make a random city of 40 x 30 cells.
    Make {
        /// Random seed.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// The city file to write.
        #[arg(long, value_name = "FILE", default_value = "city.csv")]
        out: PathBuf,
    },
    /// Print size, built share and a map of a city file.
    Show {
        /// The city file.
        #[arg(value_name = "FILE")]
        path: PathBuf,
    },
    /// Turn building outlines (GeoJSON, as OpenStreetMap tools export them) into a city file, and with devices and a
    /// terminal into a mission file.
    Import(ImportArguments),
}

#[derive(Debug, Args)]
pub(super) struct ImportArguments {
    /// GeoJSON polygons with `height` or `building:levels`.
    #[arg(value_name = "FOOTPRINTS")]
    footprints: PathBuf,
    /// The city file to write.
    #[arg(long, value_name = "FILE", default_value = "city.csv")]
    out: PathBuf,
    /// Side of a cell in metres. The shipped policy was trained at 20.
    #[arg(long, value_name = "METRES", default_value = "20", value_parser = cell_size)]
    cell: f32,
    /// The grid's north axis, degrees clockwise from true north; `auto` follows the walls.
    #[arg(long, value_name = "DEGREES|auto", default_value = "0", value_parser = rotation, allow_hyphen_values = true)]
    rotation: Rotation,
    /// South,west,north,east in degrees [default: around all outlines].
    #[arg(long, value_name = "S,W,N,E", value_parser = bounds, allow_hyphen_values = true)]
    bbox: Option<BoundingBox>,
    /// Height of one level for `building:levels`, metres.
    #[arg(long, value_name = "METRES", default_value = "3", value_parser = height)]
    level_height: f32,
    /// Height of a building that names none, metres.
    #[arg(long, value_name = "METRES", default_value = "10", value_parser = height)]
    default_height: f32,
    /// Devices: GeoJSON points with `id` and `data`, or CSV with lat, lon, id, data.
    #[arg(long, value_name = "FILE", requires = "mission_out")]
    devices: Option<PathBuf>,
    /// Fence and rally point of a QGroundControl plan.
    #[arg(long, value_name = "FILE", requires = "mission_out")]
    plan: Option<PathBuf>,
    /// Where the mission ends [default: the plan's first rally point].
    #[arg(long, value_name = "LAT,LON", requires = "mission_out", value_parser = point, allow_hyphen_values = true)]
    terminal: Option<[f64; 2]>,
    /// The mission's battery budget in units.
    #[arg(long, value_name = "UNITS", default_value = "80", value_parser = units)]
    battery: f32,
    /// Write a mission file too.
    #[arg(long, value_name = "FILE")]
    mission_out: Option<PathBuf>,
}

impl CityCommand {
    pub fn order(self) -> CityOrder {
        match self {
            CityCommand::Make { seed, out } => CityOrder::Make { seed, out },
            CityCommand::Show { path } => CityOrder::Show { path },
            CityCommand::Import(arguments) => CityOrder::Import(ImportOrder {
                footprints: arguments.footprints,
                out: arguments.out,
                cell_m: arguments.cell,
                rotation_deg: match arguments.rotation {
                    Rotation::Auto => None,
                    Rotation::Degrees(degrees) => Some(degrees),
                },
                bounds: arguments.bbox,
                level_m: arguments.level_height,
                default_m: arguments.default_height,
                devices: arguments.devices,
                plan: arguments.plan,
                terminal: arguments.terminal,
                battery: arguments.battery,
                mission_out: arguments.mission_out,
            }),
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct RadioArguments {
    /// The mission file with the devices.
    #[arg(long, value_name = "FILE")]
    mission: PathBuf,
    /// Random seed of the shadowing.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where the vehicle's MAVLink arrives.
    #[arg(long, value_name = "ENDPOINT", default_value = "udpin:127.0.0.1:14551")]
    vehicle: Endpoint,
    /// Where the reports go.
    #[arg(long, value_name = "ENDPOINT", default_value = "udpout:127.0.0.1:14600")]
    reports: Endpoint,
    /// cobs, json_lines or semtech_udp.
    #[arg(long, value_name = "FORMAT", default_value = "cobs", value_parser = radio_format)]
    format: RadioFormat,
}

impl RadioArguments {
    pub fn order(self) -> RadioOrder {
        let RadioArguments { mission, seed, vehicle, reports, format } = self;
        RadioOrder { mission, seed, vehicle, reports, format }
    }
}
