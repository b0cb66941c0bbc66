//! `--replay`: the name of a photon, and what both worlds say of it.

use super::nonfinite_values::NonfiniteValues;
use crate::error::{Error, Result};

/// Which photon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PhotonName {
    pub round: u32,
    pub photon: u32,
    /// Of the caustic map.
    pub caustic: bool,
}

impl std::fmt::Display for PhotonName {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}:{}{}", self.round, self.photon, if self.caustic { ":caustic" } else { "" })
    }
}

/// One photon of a run by itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Replayed<Start, Vertex> {
    pub name: PhotonName,
    /// As a light emits it.
    pub start: Start,
    pub vertices: Vec<Vertex>,
    pub fate: &'static str,
    /// Nonfinite values that `--paranoid` found on this path; `None` without it.
    pub nonfinite_values: Option<NonfiniteValues>,
}

impl PhotonName {
    /// Refuses what `--replay` cannot trace.
    pub(crate) fn refused(self, allowed: impl Into<String>) -> Error {
        Error::setting("replay", self, allowed.into())
    }

    pub(crate) fn check_round(self, rounds: u32) -> Result<()> {
        if self.round < rounds { Ok(()) } else { Err(self.refused(format!("the run has rounds 0 to {}", rounds - 1))) }
    }

    /// `map` says which of several has so many photons.
    pub(crate) fn check_photon(self, photons: u32, map: &str) -> Result<()> {
        if self.photon < photons { Ok(()) } else { Err(self.refused(format!("a round has photons 0 to {}{map}", photons - 1))) }
    }
}
