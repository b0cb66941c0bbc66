//! The channels of a picture in, packets to the viewer tev out (<https://github.com/Tom94/tev>), beside the run that makes them: a
//! picture that finds the one before still on its way is left out.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::exr_file::Channel;
use crate::engine::run::watch::Lazy;
use crate::error::{Error, Result};

/// Where tev listens unless it is started with another `--hostname`.
pub(crate) const PORT: u16 = 14_158;
const OPTION: &str = "display";
/// Until a machine that does not answer counts as absent, and a viewer that takes nothing as gone.
const PATIENCE: Duration = Duration::from_secs(5);
/// Of a packet, whose bytes are counted in 32 bits.
const MOST_VALUES: usize = 1 << 22;

/// Where a viewer listens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Address {
    /// As it was typed.
    pub typed: String,
    pub host: String,
    pub port: u16,
}

/// A picture that is computed when it is sent.
type LazyChannels = Lazy<Vec<Channel>>;

/// A viewer that shows one picture.
pub(crate) struct Viewer {
    typed: String,
    /// And who sends; `None` once it has gone.
    sender: Option<(SyncSender<LazyChannels>, JoinHandle<io::Result<()>>)>,
}

impl Viewer {
    /// For a picture of this name and size. Fails where nobody listens.
    pub(crate) fn connect(address: &Address, name: String, size: (u32, u32)) -> Result<Viewer> {
        let Address { typed, host, port } = address;
        let absent = |why: String| {
            Error::setting(
                OPTION,
                typed,
                format!("no viewer answers at port {port} of {host} ({why}); start tev there, or check host and port"),
            )
        };
        let places = (host.as_str(), *port).to_socket_addrs().map_err(|_| absent("the host is not known".into()))?;
        let mut refused = "the host has no address".to_owned();
        for place in places {
            match TcpStream::connect_timeout(&place, PATIENCE) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(PATIENCE)).map_err(|error| absent(error.kind().to_string()))?;
                    // Without room: what is handed over is taken at once or not at all.
                    let (sender, pictures) = sync_channel(0);
                    let thread = std::thread::spawn(move || send_all(TevClient::wrap(stream), &name, size, &pictures));
                    return Ok(Viewer { typed: typed.clone(), sender: Some((sender, thread)) });
                }
                Err(error) => refused = error.kind().to_string(),
            }
        }
        Err(absent(refused))
    }

    /// Sends the picture, unless another is still on its way. Fails once, when the viewer has gone.
    pub(crate) fn show(&mut self, picture: LazyChannels) -> Result<()> {
        match &self.sender {
            Some((sender, thread)) if !thread.is_finished() => {
                // Not taken: busy, or just gone, which the next call shows.
                let _ = sender.try_send(picture);
                Ok(())
            }
            _ => self.end(),
        }
    }

    /// Sends the last picture, and waits until it is there. Fails where the viewer has gone and no call before has said so.
    pub(crate) fn finish(mut self, picture: Vec<Channel>) -> Result<()> {
        if let Some((sender, _)) = &self.sender {
            // Not taken where the viewer has gone.
            let _ = sender.send(Box::new(|| picture));
        }
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        let Some((sender, thread)) = self.sender.take() else { return Ok(()) };
        drop(sender);
        let gone = |error: io::Error| Error::setting(OPTION, &self.typed, format!("the viewer has gone ({})", error.kind()));
        thread.join().expect("sending pictures does not panic").map_err(gone)
    }
}

/// Until nobody has more, or the viewer has gone.
fn send_all(mut client: TevClient, name: &str, (width, height): (u32, u32), pictures: &Receiver<LazyChannels>) -> io::Result<()> {
    let mut shown: Vec<String> = Vec::new();
    for picture in pictures {
        let channels = picture();
        let names: Vec<String> = channels.iter().map(|channel| channel.name.clone()).collect();
        if names != shown {
            // In place of one of the same name.
            client.send(PacketCreateImage { image_name: name, grab_focus: shown.is_empty(), width, height, channel_names: &names })?;
            shown = names;
        }
        let rows = (MOST_VALUES / (width as usize * channels.len())).clamp(1, height as usize);
        for y in (0..height as usize).step_by(rows) {
            let rows = rows.min(height as usize - y);
            let pixels = rows * width as usize;
            let data: Vec<f32> = channels.iter().flat_map(|channel| &channel.values[y * width as usize..][..pixels]).copied().collect();
            let offsets: Vec<u64> = (0..channels.len()).map(|channel| (channel * pixels) as u64).collect();
            client.send(PacketUpdateImage {
                image_name: name,
                grab_focus: false,
                channel_names: &shown,
                channel_offsets: &offsets,
                channel_strides: &vec![1; channels.len()],
                x: 0,
                y: y as u32,
                width,
                height: rows as u32,
                data: &data,
            })?;
        }
    }
    Ok(())
}
