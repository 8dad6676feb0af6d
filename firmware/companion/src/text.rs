//! Text files as editors write them.

/// Why a file is not read as text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TextFault {
    /// Some editors and shells on Windows write it.
    #[error("the file is UTF-16: save as UTF-8")]
    Utf16,
    /// A byte that UTF-8 does not have.
    #[error("line {line} is not UTF-8: save as UTF-8")]
    NotUtf8 {
        /// Counted from 1.
        line: usize,
    },
}

/// The text of a file. A byte order mark is removed; both kinds of line ends are left as they are.
///
/// # Errors
/// See [`TextFault`].
pub fn decode(bytes: Vec<u8>) -> Result<String, TextFault> {
    const BOM: [u8; 3] = [0xEF, 0xBB, 0xBF];
    let is_utf16 = match bytes[..] {
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => true,
        // Without a mark: every other byte of ASCII text is zero.
        [first, second, ..] => (first == 0) != (second == 0),
        _ => false,
    };
    if is_utf16 {
        return Err(TextFault::Utf16);
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        TextFault::NotUtf8 { line: 1 + good.iter().filter(|&&byte| byte == b'\n').count() }
    })?;
    match text.as_bytes().strip_prefix(&BOM) {
        Some(_) => Ok(text[BOM.len()..].to_owned()),
        None => Ok(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_removed() {
        assert_eq!(decode(b"\xEF\xBB\xBFa = 1\r\n".to_vec()), Ok("a = 1\r\n".to_owned()));
        assert_eq!(decode("ü".into()), Ok("ü".to_owned()));
        assert_eq!(decode(Vec::new()), Ok(String::new()));
    }

    #[test]
    fn other_encodings_are_named() {
        let utf16 = |text: &str, mark: &[u16]| -> Vec<u8> {
            mark.iter().copied().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
        };
        assert_eq!(decode(utf16("a = 1", &[0xFEFF])), Err(TextFault::Utf16));
        assert_eq!(decode(utf16("a = 1", &[])), Err(TextFault::Utf16));
        assert_eq!(decode(b"a\nb\xFCc".to_vec()), Err(TextFault::NotUtf8 { line: 2 }));
    }
}
