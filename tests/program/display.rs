//! `--display`: what a viewer gets that speaks tev's protocol, read here by rules of its own, and what becomes of a run whose viewer is
//! absent or goes away.

use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver};
use std::thread::JoinHandle;

use crate::common::prelude::*;
use crate::common::program::{PATIENCE, on_device};
use photonmill::output::exr_file;

const SMALL: &str = "render cornell --size 8x5 --photons 500 -q";
/// A run that goes on until a signal ends it.
const ENDLESS: &str = "render cornell --size 8x5 --photons 500 -q -o a.exr --rounds 1000000";

/// A packet of the protocol: a length of 32 bits that counts itself, a type, and little-endian fields.
struct Packet(std::vec::IntoIter<u8>);

impl Packet {
    /// `None` where the sender has ended.
    fn receive(stream: &mut TcpStream) -> Option<Packet> {
        let mut length = [0; 4];
        stream.read_exact(&mut length).ok()?;
        let mut content = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut content).expect("the packet is whole");
        Some(Packet(content.into_iter()))
    }

    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| self.0.next().expect("the packet is longer"))
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    fn number(&mut self) -> usize {
        u32::from_le_bytes(self.bytes()) as usize
    }

    fn long_numbers(&mut self, count: usize) -> Vec<usize> {
        (0..count).map(|_| u64::from_le_bytes(self.bytes()) as usize).collect()
    }

    /// Ends with a zero byte.
    fn text(&mut self) -> String {
        String::from_utf8(self.0.by_ref().take_while(|byte| *byte != 0).collect()).unwrap()
    }

    fn texts(&mut self) -> Vec<String> {
        let count = self.number();
        (0..count).map(|_| self.text()).collect()
    }
}

/// What a viewer shows at the end, and how many packets brought it.
#[derive(Default)]
struct Shown {
    name: String,
    size: (usize, usize),
    channels: BTreeMap<String, Vec<f32>>,
    created: usize,
    updated: usize,
}

const CREATE: u8 = 4;
const UPDATE: u8 = 6;

impl Shown {
    fn take(&mut self, mut packet: Packet) {
        match (packet.byte(), packet.byte()) {
            (CREATE, grabs) => {
                self.name = packet.text();
                self.size = (packet.number(), packet.number());
                let empty = vec![0.0; self.size.0 * self.size.1];
                self.channels = packet.texts().into_iter().map(|channel| (channel, empty.clone())).collect();
                self.created += 1;
                assert_eq!(grabs, 1);
            }
            (UPDATE, grabs) => {
                assert_eq!((packet.text(), grabs), (self.name.clone(), 0));
                let names = packet.texts();
                let [x, y, width, height] = [0; 4].map(|_: u8| packet.number());
                let (offsets, strides) = (packet.long_numbers(names.len()), packet.long_numbers(names.len()));
                let values: Vec<f32> =
                    packet.0.as_slice().chunks_exact(4).map(|word| f32::from_le_bytes(word.try_into().unwrap())).collect();
                for (channel, name) in names.iter().enumerate() {
                    let shown = self.channels.get_mut(name).expect("the channel was created");
                    for pixel in 0..width * height {
                        let place = (y + pixel / width) * self.size.0 + x + pixel % width;
                        shown[place] = values[offsets[channel] + pixel * strides[channel]];
                    }
                }
                self.updated += 1;
                return;
            }
            (other, _) => panic!("packet of type {other}"),
        }
        assert!(packet.0.next().is_none(), "the packet has more");
    }
}

/// Takes one connection at this address, and stops after so many packets, of each of which it sends word.
fn recorder(address: &str, most: usize) -> (u16, Receiver<()>, JoinHandle<Shown>) {
    let (taken, packets) = mpsc::channel();
    let listener = TcpListener::bind((address, 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let record = move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut shown = Shown::default();
        for _ in 0..most {
            let Some(packet) = Packet::receive(&mut stream) else { break };
            shown.take(packet);
            // A test may have heard enough.
            let _ = taken.send(());
        }
        shown
    };
    (port, packets, std::thread::spawn(record))
}

/// The run is ended once a picture on the way is there, however long that takes.
#[test]
fn a_viewer_shows_the_picture_its_parts_and_its_error() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let (port, packets, recorded) = recorder("127.0.0.1", usize::MAX);
    let run = place.start(&on_device(&format!("{ENDLESS} --display 127.0.0.1:{port}")));
    for what in ["a name", "a picture"] {
        packets.recv_timeout(PATIENCE).unwrap_or_else(|_| panic!("{what} does not come"));
    }
    run.signal("INT");
    let (code, said, _) = run.end();
    assert_eq!(code, Some(130), "{said:?}");
    let shown = recorded.join().unwrap();
    assert_eq!((shown.name.as_str(), shown.size, shown.created), ("a.exr", (8, 5), 1));
    // The last one is that of the file.
    assert!(shown.updated >= 2, "{}", shown.updated);
    let (_, of_file) = exr_file::decode(&std::fs::read(place.at("a.exr")).unwrap()).unwrap();
    let of_file: BTreeMap<String, Vec<f32>> = of_file.into_iter().map(|channel| (channel.name, channel.values)).collect();
    let expected: BTreeSet<&String> =
        of_file.keys().filter(|name| !["albedo", "normal", "depth"].iter().any(|layer| name.starts_with(layer))).collect();
    assert_eq!(shown.channels.keys().collect::<BTreeSet<_>>(), expected);
    assert_eq!(expected.len(), 21);
    for (name, values) in &shown.channels {
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert!(bits(values) == bits(&of_file[name]), "{name}");
    }
}

/// A PNG has no parts of its own, and a host may be an IPv6 address. What is shown changes no bit of the file.
#[test]
fn a_png_is_shown_with_its_parts() {
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("{SMALL} --rounds 4 -o a.png"));
    let has_ipv6 = TcpListener::bind("[::1]:0").is_ok();
    let (port, _, recorded) = recorder(if has_ipv6 { "::1" } else { "127.0.0.1" }, usize::MAX);
    let host = if has_ipv6 { "[::1]" } else { "localhost" };
    place.succeed(&format!("{SMALL} --rounds 4 -o b.png --display {host}:{port}"));
    let shown = recorded.join().unwrap();
    assert!(shown.channels.contains_key("caustic.G") && shown.channels["R"].iter().any(|value| *value > 0.0));
    assert!(std::fs::read(place.at("a.png")).unwrap() == std::fs::read(place.at("b.png")).unwrap());
}

#[test]
fn a_viewer_that_goes_away_ends_no_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let (port, _, recorded) = recorder("localhost", 1);
    let mut run = place.start(&on_device(&format!("{ENDLESS} --display localhost:{port}")));
    run.line_with(&format!("warning: --display localhost:{port}: the viewer has gone ("));
    assert_eq!(recorded.join().unwrap().updated, 0);
    run.signal("INT");
    let (code, said, _) = run.end();
    assert!(code == Some(130) && place.at("a.exr").exists(), "{said:?}");
    assert!(said.iter().all(|line| !line.contains("--display")), "{said:?}");
}

#[test]
fn a_viewer_that_is_absent_is_refused_before_the_run() {
    // Nobody listens there any more.
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let absent = format!("--display 127.0.0.1:{port}");
    let place = Place::new();
    place.assert_refused([
        (
            format!("{SMALL} -o a.exr {absent}"),
            &[absent.as_str(), "no viewer answers at port", "start tev there, or check host and port"][..],
        ),
        (format!("{SMALL} -o a.exr --display nowhere.invalid"), &["--display nowhere.invalid", "port 14158", "the host is not known"]),
        (format!("{SMALL} -o a.exr --display localhost:0"), &["--display localhost:0", "must be HOST or HOST:PORT", "from 1 to 65535"]),
    ]);
}
