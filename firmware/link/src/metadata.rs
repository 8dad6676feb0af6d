//! Component metadata: JSON files from which a ground station learns names, units and ranges of the parameters
//! (MAVLink guide, "Component Metadata Protocol"; schemas `general.schema.json` and `parameter.schema.json`).
//!
//! The program serves both files, by MAVLink FTP or by HTTP, and gives the URI of the general one to
//! [`crate::Component::set_metadata`]. Its answers by MAVLink FTP leave through [`crate::Component::reply_file`].

use crate::parameters::{PARAMETERS, ParameterId, ParameterSpec};
use core::fmt::{self, Write};

/// Writes the general metadata file. `parameters_uri` is where [`write_parameters`]' text is served, `parameters_crc`
/// its [`checksum`].
///
/// # Errors
/// Those of `out`.
pub fn write_general(out: &mut impl Write, parameters_uri: &str, parameters_crc: u32) -> fmt::Result {
    let version = env!("CARGO_PKG_VERSION");
    write!(
        out,
        r#"{{"version":1,"vendorName":"Gleaner","modelName":"Gleaner","firmwareVersion":"{version}","#
    )?;
    // 1: COMP_METADATA_TYPE_PARAMETER.
    write!(out, r#""metadataTypes":[{{"type":1,"uri":"{parameters_uri}","fileCrc":{parameters_crc}}}]}}"#)
}

/// Writes the parameter metadata file.
///
/// # Errors
/// Those of `out`.
pub fn write_parameters(out: &mut impl Write) -> fmt::Result {
    out.write_str(r#"{"version":1,"parameters":["#)?;
    for (index, spec) in PARAMETERS.iter().enumerate() {
        if index > 0 {
            out.write_char(',')?;
        }
        write_parameter(out, spec)?;
    }
    out.write_str("]}")
}

fn write_parameter(out: &mut impl Write, spec: &ParameterSpec) -> fmt::Result {
    let ParameterSpec { name, min, max, default, unit, doc, .. } = spec;
    write!(out, r#"{{"name":"{name}","type":"Float","group":"Gleaner","category":"Standard","#)?;
    write!(out, r#""shortDesc":"{doc}","min":{min},"max":{max},"default":{default},"#)?;
    if !unit.is_empty() {
        write!(out, r#""units":"{unit}","#)?;
    }
    let values: &[(u8, &str)] = match spec.id {
        ParameterId::Enable => &[(0, "Off"), (1, "Engage"), (2, "Shadow")],
        ParameterId::Lookahead => &[(0, "Network alone"), (1, "Look-ahead")],
        _ => &[],
    };
    if !values.is_empty() {
        out.write_str(r#""values":["#)?;
        for (index, (value, description)) in values.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
            write!(out, r#"{comma}{{"value":{value},"description":"{description}"}}"#)?;
        }
        out.write_str("],")?;
    }
    let places = if spec.whole { 0 } else { 2 };
    write!(out, r#""decimalPlaces":{places}}}"#)
}

/// Checksum of a metadata file, by which a ground station recognises a cached copy: CRC-32 with the reflected polynomial
/// 0xEDB88320, initial value 0 and no final inversion, as MAVLink FTP computes it.
#[must_use]
pub fn checksum(text: &str) -> u32 {
    text.bytes().fold(0, |crc, byte| {
        (0..8).fold(
            crc ^ u32::from(byte),
            |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    #[test]
    fn the_parameter_file_names_every_parameter() {
        let mut text = String::new();
        write_parameters(&mut text).unwrap();
        for spec in &PARAMETERS {
            assert_eq!(text.matches(&std::format!(r#""name":"{}""#, spec.name)).count(), 1);
        }
        assert_eq!(text.matches('{').count(), text.matches('}').count());
        assert!(text.contains(r#""min":20,"max":120,"default":60,"units":"m""#), "{text}");
    }

    #[test]
    fn the_checksum_is_linear_and_starts_at_zero() {
        assert_eq!(checksum(""), 0);
        assert_eq!(checksum("\0\0\0"), 0);
        // Python: zlib.crc32(b"123456789", 0xFFFFFFFF) ^ 0xFFFFFFFF
        assert_eq!(checksum("123456789"), 0x2DFD_2D88);
    }
}
