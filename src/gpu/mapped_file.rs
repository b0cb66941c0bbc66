//! Files in memory without a copy, from which photons are uploaded: they may be larger than memory.

use std::fs::File;
use std::ops::Deref;

use memmap2::Mmap;

/// The bytes of a file.
#[derive(Debug)]
pub(crate) struct MappedFile(Mmap);

impl MappedFile {
    /// Nobody may change the file in place while it is mapped: one that is cut off then ends the program.
    pub(crate) fn new(file: &File) -> std::io::Result<MappedFile> {
        // SAFETY: files of photonmill are written under another name and renamed, never changed in place.
        unsafe { Mmap::map(file) }.map(MappedFile)
    }
}

impl Deref for MappedFile {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}
