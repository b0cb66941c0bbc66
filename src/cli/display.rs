//! `--display`: the viewer that shows a run while it goes on.

use std::time::Duration;

use clap::Args;

use crate::error::Result;
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

    /// The viewer, for a picture of this name and size; fails where nobody listens.
    pub(super) fn connect(&self, name: String, size: (u32, u32)) -> Result<Option<Viewer>> {
        self.display.as_ref().map(|address| Viewer::connect(address, name, size)).transpose()
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
