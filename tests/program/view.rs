//! `photonmill view`: what it shows is what the run holds, and the window does what its user asks of it.

use std::cell::{Cell, RefCell};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use photonmill::constants::{SHOW_ALL, SHOW_DIRECT, SHOW_ERROR};
use photonmill::engine::room::film::estimate_walls;
use photonmill::engine::room::live::LiveRoom;
use photonmill::engine::scene::live::LiveScene;
use photonmill::engine::scene::{Viewpoint, trial};
use photonmill::output::colour::{ColourImage, Format, Tone, png_codes};
use photonmill::settings::stop::LEAST_BLOCKS;
use photonmill::window::display::{DisplayImage, Exposure};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConfigureWindowAux, ConnectionExt, EventMask, ImageFormat, InputFocus, KEY_PRESS_EVENT, KEY_RELEASE_EVENT, Window,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

use crate::common::prelude::*;
use crate::common::program::PATIENCE;

static NEVER: AtomicBool = AtomicBool::new(false);
const SIZE: [u32; 2] = [12, 8];

/// What a window of `cornell-spheres` is made of.
fn spheres(gpu: &Gpu) -> (Geometry, Camera, ScenePlan) {
    let scene = scene("cornell-spheres");
    let (geometry, camera) = (Geometry::new(&scene).unwrap(), scene.first_camera());
    let few = SceneSettings { photons: 1 << 10, caustic_photons: 1 << 10, ..SceneSettings::default() };
    let settings = SceneSettings { rounds: 1 << 16, keeps_parts: true, ..few };
    let viewpoint = Viewpoint { geometry: &geometry, camera: Some(&camera), phases: &[] };
    let plan = trial::plan(gpu, &scene, &viewpoint, &settings, Sensor::Picture { width: SIZE[0], height: SIZE[1] }).unwrap();
    (geometry, camera, plan)
}

/// A camera that moves sees the photons that are kept, and what it sees is to the bit what a run of its own would.
#[test]
fn a_moved_camera_sees_kept_photons_and_the_picture_of_its_own_run() {
    let Some(gpu) = device() else { return };
    let (geometry, first, plan) = spheres(&gpu);
    let moved = Camera { eye: first.eye + 0.3 * first.right + 0.2 * first.forward, ..first.clone() };
    let rounds = |live: &mut LiveScene, count: u32| (0..count).for_each(|_| live.round().unwrap());

    let mut live = LiveScene::new(&gpu, &geometry, &first, &plan, &NEVER).unwrap();
    rounds(&mut live, 4);
    let before = live.run.look().unwrap().0;
    live.look_from(&moved).unwrap();
    // Half of these rounds have kept photons.
    rounds(&mut live, 8);
    assert_eq!((live.run.state.rounds(), live.cached().0), (8, 8));
    let after = live.run.look().unwrap().0;
    let mut own = LiveScene::new(&gpu, &geometry, &moved, &plan, &NEVER).unwrap();
    rounds(&mut own, 8);
    assert!(after == own.run.look().unwrap().0);
    assert_eq!(live.run.state.ledger(), own.run.state.ledger());
    assert!(live.run.state.ledger().closes() && live.run.state.ledger().emitted == (8 * 2) << 10);
    assert!(before.of_blocks.sums != after.of_blocks.sums);
    // Back again, from kept photons alone.
    live.look_from(&first).unwrap();
    rounds(&mut live, 4);
    assert!(live.run.look().unwrap().0 == before);
}

/// What reaches the window is the film: light, its parts, its error, and the codes that a file would have.
#[test]
fn the_window_has_the_values_of_the_film_and_the_codes_of_its_file() {
    let Some(gpu) = device() else { return };
    let (geometry, camera, plan) = spheres(&gpu);
    let mut live = LiveScene::new(&gpu, &geometry, &camera, &plan, &NEVER).unwrap();
    let picture = DisplayImage::new(&gpu, SIZE, SIZE).unwrap();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    // Before a block is whole, and after several.
    for rounds in [1, 12] {
        (live.run.state.rounds()..rounds).for_each(|_| live.round().unwrap());
        let (film, error) = live.run.look().unwrap();
        assert_eq!(error.noise.is_finite(), film.blocks >= LEAST_BLOCKS, "{} blocks", film.blocks);
        let mut shown = |shows: u32| {
            live.show(shows, 2.0, &picture.shown).unwrap();
            live.run.recorder.read(&picture.shown, pixels).unwrap()
        };
        for part in [None, Some(0), Some(1), Some(2), Some(3)] {
            for (pixel, value) in shown(part.map_or(SHOW_ALL, |part| SHOW_DIRECT + part)).into_iter().enumerate() {
                let whole = film.mean(pixel);
                let mean = part.map_or(whole, |part| film.mean_of_part(part as usize, pixel).expect("parts are kept"));
                let rounding = if part.is_some() { 1e-5 } else { 1e-6 };
                let off = (value.truncate().as_dvec3() - mean).abs().max_element();
                assert!(off <= rounding * (1.0 + whole.max_element()), "part {part:?}, {pixel}: {value}, {mean}");
            }
        }
        let mut known_pixels = 0;
        for (pixel, value) in shown(SHOW_ERROR).into_iter().enumerate() {
            let variance = |channel: usize| film.of_blocks.variance(3 * pixel + channel);
            let sum = [0, 1, 2].map(variance).iter().sum::<f64>();
            let known = sum.is_finite() && sum > 0.0;
            let expected = if known { (sum / 3.0).sqrt() / (film.plan.scale * f64::from(film.of_blocks.rounds) * 2.0) } else { -1.0 };
            assert!((f64::from(value.x) - expected).abs() <= 1e-5 * expected.abs(), "{pixel}: {} is {expected}", value.x);
            known_pixels += usize::from(known);
        }
        assert!(if rounds > 1 { known_pixels > pixels / 2 } else { known_pixels == 0 }, "{known_pixels}");
    }
    let film = live.run.look().unwrap().0;
    let colours = ColourImage {
        width: SIZE[0],
        height: SIZE[1],
        pixels: film.means().map(|mean| Vec3::new(mean.x as f32, mean.y as f32, mean.z as f32)).collect(),
    };
    let stops = colours.usual_exposure();
    let of_file = png_codes(&colours.encode(Format::Png, stops, Tone::Neutral, None)).unwrap();
    for blue_first in [false, true] {
        live.show(SHOW_ALL, 1.0, &picture.shown).unwrap();
        let exposure = Exposure { shows: SHOW_ALL, stops, is_light: true };
        picture.expose(&mut live.run.recorder, exposure, 1, blue_first).unwrap();
        let codes = picture.codes(&mut live.run.recorder, blue_first).unwrap();
        let farthest = codes.as_flattened().iter().zip(&of_file).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(farthest <= 1, "{farthest}");
    }
}

/// The middle of the picture is the texel of the wall that the camera looks at.
#[test]
fn the_box_is_seen_with_the_illumination_of_its_walls() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { rounds: 64, mesh: 16, ..RoomSettings::default() };
    let room = open_box(&settings);
    let plan = LiveRoom::plan(&gpu, &room, &settings).unwrap();
    let mut live = LiveRoom::new(&gpu, &room, &plan, &NEVER).unwrap();
    (0..5).for_each(|_| live.round().unwrap());
    // Of fewer than eight blocks.
    assert!(live.look().unwrap().0.is_infinite());
    let film = live.run.film().unwrap();
    let middle = 0.5 * (room.min_corner + room.max_corner);
    for (place, (face, _)) in room.walls().enumerate() {
        let rectangle = room.rectangle(face);
        let (column, row) = (3, 11);
        let texel = rectangle.origin + (f64::from(column) + 0.5) / 16.0 * rectangle.u + (f64::from(row) + 0.5) / 16.0 * rectangle.v;
        let camera = Camera::looking_at("test", middle, texel, DVec3::new(0.1, 0.9, 0.2), 0.01);
        let picture = DisplayImage::new(&gpu, [3, 3], [3, 3]).unwrap();
        live.show(SHOW_ALL, 1.0, &camera, [3, 3], &picture.shown).unwrap();
        let seen = f64::from(live.run.recorder.read(&picture.shown, 9).unwrap()[4].x);
        let expected = estimate_walls(&film, &room, &plan)[place].illumination[(row * 16 + column) as usize];
        assert!((seen - expected).abs() <= 1e-5 * expected && expected > 0.0, "face {face}: {seen} is {expected}");
        live.show(SHOW_ERROR, 1.0, &camera, [3, 3], &picture.shown).unwrap();
        let error = f64::from(live.run.recorder.read(&picture.shown, 9).unwrap()[4].x);
        assert!(error > 0.0 && error < expected, "face {face}: {error} of {expected}");
        // From behind a wall is not there.
        let from_behind = Camera::looking_at("test", 2.0 * texel - middle, middle, DVec3::new(0.1, 0.9, 0.2), 0.01);
        live.show(SHOW_ALL, 1.0, &from_behind, [3, 3], &picture.shown).unwrap();
        let seen = f64::from(live.run.recorder.read(&picture.shown, 9).unwrap()[4].x);
        assert!((seen - expected).abs() > 1e-4 * expected, "face {face} is seen from behind");
    }
}

/// A display without a screen, and the program in a window on it.
struct Desktop {
    server: Child,
    name: String,
    connection: RustConnection,
    root: Window,
    program: RefCell<Option<Child>>,
    window: Cell<Window>,
}

impl Drop for Desktop {
    fn drop(&mut self) {
        for process in self.program.get_mut().iter_mut().chain([&mut self.server]) {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// Keys of the server's own keyboard.
const ESCAPE: u8 = 9;
const KEY_6: u8 = 15;
const KEY_R: u8 = 27;
const KEY_F: u8 = 41;
const KEY_H: u8 = 43;

const POLL: Duration = Duration::from_millis(50);
/// A key that has done nothing for so many polls is pressed again: one that comes while no window has the focus is lost.
const POLLS_OF_A_KEY: u32 = 200;

#[track_caller]
fn wait_for<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "{what} does not come");
        std::thread::sleep(POLL);
    }
}

impl Desktop {
    fn new(place: &Place) -> Desktop {
        let number = place.at("display");
        let reported = std::fs::File::create(&number).unwrap();
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "900x800x24", "-nolisten", "tcp"])
            .stdout(reported)
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts; tools/setup installs it");
        let name = wait_for("a display", || std::fs::read_to_string(&number).ok().filter(|text| text.ends_with('\n')));
        let name = format!(":{}", name.trim());
        let (connection, screen) = x11rb::connect(Some(&name)).unwrap();
        let root = connection.setup().roots[screen].root;
        Desktop { server, name, connection, root, program: RefCell::new(None), window: Cell::new(root) }
    }

    /// Starts the program, and waits for its window.
    fn start(&self, place: &Place, line: &str) {
        let mut command = place.command(line);
        command.env("DISPLAY", &self.name).env("LP_NUM_THREADS", "0").stdout(Stdio::null()).stderr(Stdio::piped());
        // With vectors of 128 bits Mesa 22.3 writes past its vertices where it draws; kernels have none.
        command.env_remove("LP_NATIVE_VECTOR_WIDTH");
        *self.program.borrow_mut() = Some(command.spawn().unwrap());
        self.find_window();
    }

    /// Waits while the program runs; where it ends before, the test fails with what it said.
    #[track_caller]
    fn wait_for<T>(&self, what: &str, mut found: impl FnMut() -> Option<T>) -> T {
        wait_for(what, || {
            let found = found();
            let ended = found.is_none() && self.program.borrow_mut().as_mut().expect("it was started").try_wait().unwrap().is_some();
            assert!(!ended, "the program ended before {what}: {:?}", self.output());
            found
        })
    }

    /// What the program has said, once it has ended.
    #[track_caller]
    fn output(&self) -> Output {
        wait_for("its end", || self.program.borrow_mut().as_mut().expect("it was started").try_wait().unwrap());
        self.program.take().expect("it was started").wait_with_output().unwrap()
    }

    /// The window that is on the screen.
    fn find_window(&self) {
        let window = self.wait_for("a window", || {
            let windows = self.connection.query_tree(self.root).unwrap().reply().unwrap().children;
            windows.into_iter().find(|window| {
                let attributes = self.connection.get_window_attributes(*window).unwrap().reply();
                let size = self.connection.get_geometry(*window).unwrap().reply();
                attributes.is_ok_and(|attributes| u8::from(attributes.map_state) == 2) && size.is_ok_and(|size| size.width > 100)
            })
        });
        self.window.set(window);
    }

    fn press(&self, key: u8) {
        self.connection.set_input_focus(InputFocus::PARENT, self.window.get(), x11rb::CURRENT_TIME).unwrap();
        for kind in [KEY_PRESS_EVENT, KEY_RELEASE_EVENT] {
            self.connection.xtest_fake_input(kind, key, x11rb::CURRENT_TIME, self.root, 0, 0, 0).unwrap().check().unwrap();
            std::thread::sleep(POLL);
        }
    }

    /// Presses a key, again where it was lost, until there is what it asks for.
    #[track_caller]
    fn press_for<T>(&self, key: u8, what: &str, found: impl Fn() -> Option<T>) -> T {
        let mut polls = 0..;
        self.wait_for(what, || {
            if polls.next()? % POLLS_OF_A_KEY == 0 {
                self.press(key);
            }
            found()
        })
    }

    /// Colours on the screen, row by row; none while the window is away or takes another size.
    fn colours(&self) -> Vec<[u8; 3]> {
        let read = || {
            let window = self.window.get();
            let size = self.connection.get_geometry(window).ok()?.reply().ok()?;
            self.connection.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, size.width, size.height, !0).ok()?.reply().ok()
        };
        read().map_or(Vec::new(), |image| image.data.chunks_exact(4).map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect())
    }

    /// Waits for more than the dark window of a run that is being prepared.
    #[track_caller]
    fn wait_for_picture(&self) {
        self.wait_for("a picture", || {
            let colours = self.colours();
            let is_bright = |colour: &&[u8; 3]| colour.iter().any(|code| *code > 60);
            (6 * colours.iter().filter(is_bright).count() > colours.len()).then_some(())
        });
    }

    /// Screenshots one after another until one is as wanted: its codes.
    #[track_caller]
    fn screenshot(&self, place: &Place, what: &str, is_wanted: impl Fn([u32; 2], &[u8]) -> bool) -> Vec<u8> {
        self.wait_for(what, || {
            let path = (1u32..).map(|number| place.at(&format!("photonmill-{number}.png"))).find(|path| !path.exists())?;
            let read = || image::load_from_memory(&std::fs::read(&path).ok()?).ok();
            let image = self.press_for(KEY_F, "a screenshot", read).into_rgb8();
            is_wanted([image.width(), image.height()], image.as_raw()).then(|| image.into_raw())
        })
    }
}

fn mean_difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

#[test]
fn a_window_opens_resizes_hides_shows_renders_and_closes() {
    if no_gpu() {
        return;
    }
    let place = Place::new();
    let desktop = Desktop::new(&place);
    desktop.start(&place, "view cornell --size 40x30 --photons 1024 --time 1s --validate");
    desktop.wait_for_picture();
    // Without the panel the window is the picture.
    desktop.press(KEY_H);
    let light = desktop.screenshot(&place, "the picture alone", |size, _| size == [760, 570]);
    desktop.wait_for("the picture of the file on the screen", || {
        let colours = desktop.colours();
        (3 * colours.len() == light.len() && mean_difference(&light, colours.as_flattened()) < 8.0).then_some(())
    });

    let is_another = |codes: &[u8]| codes.len() == light.len() && mean_difference(&light, codes) > 20.0;
    desktop.press_for(KEY_6, "the error on the screen", || is_another(desktop.colours().as_flattened()).then_some(()));
    desktop.screenshot(&place, "the error", |_, codes| is_another(codes));

    // Another size of the window.
    let window = desktop.window.get();
    desktop.connection.configure_window(window, &ConfigureWindowAux::new().width(210).height(170)).unwrap().check().unwrap();
    desktop.screenshot(&place, "the new size", |size, _| size == [210, 170]);

    // Away and back.
    desktop.connection.unmap_window(window).unwrap().check().unwrap();
    let is_shown = || u8::from(desktop.connection.get_window_attributes(window).unwrap().reply().unwrap().map_state) == 2;
    desktop.wait_for("the window to go", || (!is_shown()).then_some(()));
    // Some frames of it are asked for meanwhile.
    std::thread::sleep(Duration::from_millis(500));
    desktop.connection.map_window(window).unwrap().check().unwrap();
    desktop.find_window();
    desktop.wait_for_picture();
    desktop.screenshot(&place, "its size again", |size, _| size == [210, 170]);

    // The picture as it is seen, by the command that the window names. Pictures on the way and screenshots do not say how they were made.
    let image = desktop.press_for(KEY_R, "a rendered picture", || {
        let files = std::fs::read_dir(place.path()).unwrap().map(|file| file.unwrap().path());
        let pictures = files.filter(|path| path.extension().is_some_and(|ending| ending == "png"));
        let mut contents = pictures.filter_map(|path| std::fs::read(path).ok());
        contents.find(|content| content.windows(6).any(|text| text == b"--eye ")).and_then(|content| image::load_from_memory(&content).ok())
    });
    assert_eq!((image.width(), image.height()), (40, 30));

    // As the desktop closes windows.
    let atom = |name: &str| desktop.connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
    let close = [atom("WM_DELETE_WINDOW"), 0, 0, 0, 0];
    let event = ClientMessageEvent::new(32, window, atom("WM_PROTOCOLS"), close);
    desktop.connection.send_event(false, window, EventMask::NO_EVENT, event).unwrap().check().unwrap();
    let output = desktop.output();
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn the_box_is_viewed_and_escape_closes_its_window() {
    if no_gpu() {
        return;
    }
    let place = Place::new();
    let desktop = Desktop::new(&place);
    desktop.start(&place, "view box --photons 500 --size 60x40 --validate");
    // A key before the first picture waits for it.
    desktop.press(KEY_6);
    let is_coloured = |colour: [u8; 3]| colour[0].abs_diff(colour[1]) > 60;
    desktop.wait_for("the error in false colours", || desktop.colours().into_iter().any(is_coloured).then_some(()));
    desktop.press(ESCAPE);
    let output = desktop.output();
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn what_a_window_cannot_do_is_refused_before_it_opens() {
    if no_gpu() {
        return;
    }
    let place = Place::new();
    place.assert_refused([
        ("view box --eye 0,0,3", ["--eye", "is an option of scenes"]),
        ("view box --without direct", ["--without", "is an option of scenes"]),
        ("view cornell --error nan", ["--error", "must be"]),
        ("view box --time 0s", ["--time", "must be"]),
        ("view cornell --eye 1e30,0,0", ["--eye", "from -1e12 to 1e12"]),
        ("view cornell --eye 0,1,0 --look-at 0,1,0", ["--look-at", "must not be where --eye is"]),
        ("view cornell --up 0,0,0", ["--up", "must be a direction"]),
        ("view cornell --fov 180", ["--fov", "at most 179"]),
        ("view cornell --orthographic 0", ["--orthographic", "above 0"]),
    ]);
    // A camera behind a wall.
    let (_, said) = place.succeed("render cornell -o black.png --size 8x6 --photons 500 --rounds 4 --eye 0,20,3 --look-at 0,30,0");
    assert!(said.contains("the picture is black"), "{said}");
}

/// One clear line where there is no display, and where the device cannot show anything on it.
#[test]
fn a_window_that_cannot_be_is_refused_in_one_line() {
    if no_gpu() {
        return;
    }
    let place = Place::new();
    let line = |mut command: Command| {
        let output = command.output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!((output.status.code(), stderr.trim_end().lines().count()), (Some(1), 1), "{stderr}");
        stderr
    };
    let mut without_display = place.command("view cornell");
    without_display.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let said = line(without_display);
    assert!(said.contains("no window: there is no display") && said.contains("DISPLAY"), "{said}");

    let desktop = Desktop::new(&place);
    let mut without_support = place.command("view cornell");
    without_support.env("DISPLAY", &desktop.name).env("PHOTONMILL_FAULTS", "vkGetPhysicalDeviceSurfaceSupportKHR@1+=lost");
    let said = line(without_support);
    assert!(said.contains("cannot show pictures in a window"), "{said}");
}
