//! Whole files, with what is wrong in plain words.

use std::path::Path;

use crate::text::refusal;

/// Larger files are refused: what they hold would not fit a device's buffers either.
const MAX_BYTES: u64 = 4 << 30;

/// The content of a file, or what is wrong with it.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, String> {
    let unreadable = |error: std::io::Error| format!("cannot be read ({})", refusal(&error));
    let facts = std::fs::metadata(path).map_err(unreadable)?;
    if !facts.is_file() {
        return Err("is no file".into());
    }
    if facts.len() > MAX_BYTES {
        return Err(format!("has {} bytes, and at most {MAX_BYTES} are read", facts.len()));
    }
    std::fs::read(path).map_err(unreadable)
}
