//! `--display`: the viewer that shows a run while it goes on.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use super::complain;
use crate::engine::run::saved::{SavedRun, WorldFilm};
use crate::engine::run::watch::Lazy;
use crate::engine::scene::SceneFilm;
use crate::error::Result;
use crate::output::show::{Layer, Show};
use crate::output::tev::{Address, PORT, Viewer};

#[derive(Args)]
pub(super) struct DisplayArgs {
    /// Also show the picture so far, its parts and its standard error in the viewer tev, which listens there, every second and at the
    /// end [default port: 14158]
    #[arg(long, value_name = "HOST[:PORT]", value_parser = parse_address, allow_hyphen_values = true, requires = "output", help_heading = "Output")]
    display: Option<Address>,
}

/// Between two pictures.
pub(super) const EVERY: Duration = Duration::from_secs(1);

impl DisplayArgs {
    pub(super) fn is_given(&self) -> bool {
        self.display.is_some()
    }

    /// The viewer, for the picture of a file; fails where nobody listens.
    pub(super) fn connect(&self, file: Option<&Path>, show: &Show) -> Result<Option<Display>> {
        let Some(address) = &self.display else { return Ok(None) };
        // A viewer shows nothing of surfaces.
        let show = Show { layers: Layer::ALL.into_iter().filter(|layer| !layer.is_of_surface()).collect(), ..show.clone() };
        let name = file.map_or_else(String::new, |file| file.display().to_string());
        Ok(Some(Display { viewer: Viewer::connect(address, name, show.size)?, show }))
    }
}

/// A viewer and what it shows.
pub(super) struct Display {
    viewer: Viewer,
    show: Show,
}

impl Display {
    /// The picture so far.
    pub(super) fn send(&mut self, run: Lazy<Arc<SavedRun>>) -> Result<()> {
        let show = self.show.clone();
        self.viewer.show(Box::new(move || show.channels(SceneFilm::of(&run().film), &[])))
    }

    /// The last picture.
    pub(super) fn finish(self, film: &SceneFilm) {
        if let Err(error) = self.viewer.finish(self.show.channels(film, &[])) {
            complain(&format!("warning: {error}"));
        }
    }
}

fn parse_address(text: &str) -> std::result::Result<Address, String> {
    // An IPv6 address has colons of its own, and stands in brackets before a port.
    let (host, port) = match text.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        Some((host, "")) => (host, None),
        Some((host, rest)) => (host, Some(rest.strip_prefix(':').unwrap_or_default())),
        None if text.matches(':').count() == 1 => text.split_once(':').map(|(host, port)| (host, Some(port))).unwrap_or_default(),
        None => (text, None),
    };
    let port = port.map_or(Some(PORT), |port| port.parse().ok().filter(|port| *port > 0));
    match port {
        Some(port) if !host.is_empty() && !host.contains(['[', ']', ' ']) => {
            Ok(Address { typed: text.to_owned(), host: host.to_owned(), port })
        }
        _ => Err("must be HOST or HOST:PORT, as in localhost:14158 or [::1]:14158; the port from 1 to 65535".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_hosts_and_ports() {
        let read = |text: &str| parse_address(text).map(|address| (address.host, address.port)).ok();
        let is = |host: &str, port: u16| Some((host.to_owned(), port));
        assert_eq!(read("localhost"), is("localhost", 14158));
        assert_eq!(read("viewer.lan:14159"), is("viewer.lan", 14159));
        assert_eq!(read("::1"), is("::1", 14158));
        assert_eq!(read("[::1]"), is("::1", 14158));
        assert_eq!(read("[fe80::2]:9"), is("fe80::2", 9));
        for text in ["", ":14158", "host:", "host:0", "host:65536", "host:port", "[::1", "[::1]9", "[]:9", "a b"] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
