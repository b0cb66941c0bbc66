//! Every option of a request, a row each. From the rows come the arguments of the commands and their help, the keys of `--config`, what a
//! picture's metadata keeps and `repeat` takes, Python's keyword arguments, and what errors call a field.

use super::request::RenderRequest;
use super::values::{Form, Value};

/// Under which heading of the help an option stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    Output,
    Scene,
    WhenToStop,
    Photons,
    LightTransport,
    DensityEstimate,
    Implementation,
    Checks,
}

impl Group {
    pub fn heading(self) -> &'static str {
        match self {
            Group::Output => "Output",
            Group::Scene => "Scene",
            Group::WhenToStop => "When to stop",
            Group::Photons => "Photons",
            Group::LightTransport => "Light transport",
            Group::DensityEstimate => "Density estimate",
            Group::Implementation => "Implementation",
            Group::Checks => "Checks",
        }
    }
}

/// What an option decides of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decides {
    /// Its values, or its file: metadata keep it as it was given.
    Image,
    /// How much work is done: metadata have what came of it.
    Work,
    /// Neither: how and when it is computed.
    Nothing,
}

/// The commands that have options of a request; each as its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Command {
    Render = 1,
    View = 1 << 1,
    Bake = 1 << 2,
    Probe = 1 << 3,
    Map = 1 << 4,
    Plan = 1 << 5,
    /// Without a name: the paper's box.
    Box = 1 << 6,
    Study = 1 << 7,
    Merge = 1 << 8,
}

const R: u32 = Command::Render as u32;
const V: u32 = Command::View as u32;
const B: u32 = Command::Bake as u32;
const P: u32 = Command::Probe as u32;
const M: u32 = Command::Map as u32;
const L: u32 = Command::Plan as u32;
const X: u32 = Command::Box as u32;
const S: u32 = Command::Study as u32;
const G: u32 = Command::Merge as u32;
/// Those that light a scene to its end, and what they share with `plan`, which shows what they would do.
const ESTIMATES: u32 = R | B | P;
const RUNS: u32 = ESTIMATES | L;
const SEEN: u32 = R | V | L;
const SCENES: u32 = RUNS | V | M;
const ALL: u32 = ESTIMATES | V | M | X;

pub struct Row {
    /// As a field is called; a command's option has `-` for `_`.
    pub field: &'static str,
    /// What its value is called in the help; empty of a flag.
    pub value: &'static str,
    pub group: Group,
    pub decides: Decides,
    commands: u32,
    help: &'static str,
    /// What holds where it is not given, in words; empty where the help says enough.
    default: &'static str,
    /// Both of the paper's box, where they are others.
    of_box: &'static [(&'static str, &'static str)],
    /// Fields without which it means nothing, and fields that exclude it.
    pub requires: &'static [&'static str],
    pub conflicts: &'static [&'static str],
    pub of: fn(&mut RenderRequest) -> &mut dyn Value,
}

macro_rules! rows {
    ($($group:ident { $($field:ident $value:literal $decides:ident $commands:tt $help:literal
        $(default $default:literal)? $(box $help_of_box:literal default $default_of_box:literal)? $(requires $requires:literal)? $(conflicts [$($conflict:literal),*])?;)* })*) => {
        &[$($(Row {
            field: stringify!($field),
            value: $value,
            group: Group::$group,
            decides: Decides::$decides,
            commands: $commands,
            help: $help,
            default: concat!($($default)?),
            of_box: &[$(($help_of_box, $default_of_box))?],
            requires: &[$($requires)?],
            conflicts: &[$($($conflict),*)?],
            of: |request| &mut request.$field,
        }),*),*]
    };
}

/// In the order of the help.
pub const ROWS: &[Row] = rows! {
    Output {
        exposure "STOPS" Image (R | G)
            "Exposure of a PNG in stops, each of which doubles the brightness" default "what makes the mean middle grey";
        tone "CURVE" Image (R | G) "Tone curve of a PNG" default "neutral";
        white_balance "KELVIN" Image (R | G) "Show light of this colour temperature as white in a PNG" default "daylight, sRGB's own white";
        layers "all|none|LAYER,..." Image R
            "Layers of an EXR beside the light: all, none, or some of direct, specular, caustic, indirect, standard_error, unseen, albedo, normal and depth"
            default "all";
        denoise "" Image R
            "Remove noise from direct light in the picture with Open Image Denoise, which must be installed. Other light, layers and errors stay as they were rendered"
            requires "output";
    }
    Scene {
        radiometric "" Image (SCENES | S)
            "Take the intensities of the lights of a glTF file as W/sr and W/m2" default "candela and lux, divided by 683 lm/W";
        at "SECONDS" Image (SCENES | S)
            "Take nodes, skins and morph targets as the file's first animation has them at this time" default "at rest";
        environment "R,G,B|FILE" Image (SCENES | S)
            "Light from beyond the scene in place of the file's own: W/m2/sr, one number or three for red, green and blue, or a picture of all directions (equirectangular, .hdr or .exr)"
            default "the file's; 1 if nothing in the file emits light";
        sun "AZIMUTH,ELEVATION" Image (SCENES | S)
            "Add a sun, degrees clockwise from -z as seen from above and above the horizon, and the clear sky that belongs to it unless `environment` is given";
        environment_rotate "DEGREES" Image (SCENES | S)
            "Turn the environment's picture about the vertical, degrees, counter-clockwise as seen from above; not the sky of `sun`";
        environment_strength "FACTOR" Image (SCENES | S) "Multiply the environment's light, or that of `sun` and its sky";
        camera "NAME" Image (SEEN | S) "Camera by name" default "the first one; one that sees the whole scene if it has none";
        eye "X,Y,Z" Image (SEEN | X | S) "Where the camera stands, metres, in place of where the scene has it"
            box "Position of the eye for the Phong weight, metres"
            default "0,0,1";
        look_at "X,Y,Z" Image (SEEN | S) "What it looks at, metres" default "straight on, as the scene's camera does";
        up "X,Y,Z" Image (SEEN | S) "What is up in its picture, as a direction" default "0,1,0 with `look_at`";
        fov "DEGREES" Image (SEEN | S)
            "Angle between the picture's lower and upper edge, degrees" default "that of the scene's camera";
        orthographic "METRES" Image (SEEN | S) "Height of what the picture shows by parallel rays, metres" conflicts ["fov"];
        size "WIDTH[xHEIGHT]" Image SEEN
            "Size of the picture in pixels; a width alone takes its height from the camera's aspect ratio"
            default "about 307200 pixels in the camera's aspect ratio, 640x480 if it has none";
        aperture "METRES" Image (SEEN | S)
            "Diameter of the camera's lens, metres: what is not in focus is blurred" default "0, a pinhole";
        focus "METRES" Image (SEEN | S)
            "Distance of the plane in focus, metres" default "that of what the middle of the picture shows" requires "aperture";
        emission "LAW" Image X
            "Angular distribution of emission: constant over the hemisphere, or proportional to the cosine" default "uniform";
        shininess "N|N,N,N,N,N" Image X
            "Phong exponent of all walls, or five of them for left,right,floor,ceiling,back"
            default "none, the walls are Lambertian; 2 with `preset` phong, 5 with `preset` rounds";
        phong_direction "DIRECTION" Image X
            "Direction that the Phong weight compares with the direction to the eye: the mirror direction, or the sampled one"
            default "mirror";
        reflectance "SHARE" Image X "Probability that a wall reflects a photon" default "0.75";
        light_radius "METRES" Image X "Radius of the two disc lights, metres" default "0.05";
        light_power "W,W" Image X
            "Power of the light on the floor and of the light on the left wall, watts" default "1,1";
    }
    WhenToStop {
        error "PERCENT" Nothing (ESTIMATES | X)
            "Stop once the relative error is at most this: 2%. It is of light that surfaces scatter; lamps, the sky and unlit surfaces that are seen directly are left out";
        measure "MEASURE" Image (ESTIMATES | X)
            "What the error is: the RMSE over the mean, or the root of relMSE, whose epsilon is (1 % of the mean)^2" default "rmse";
        confidence "PERCENT" Image (ESTIMATES | X) "Confidence level of the error bound" default "95%";
        time "TIME" Nothing (ESTIMATES | X) "Stop after rounds of this time: 2s, 500ms, 3m. Does not include start-up and the pilot";
        total_photons "N" Nothing (ESTIMATES | X) "Stop once this many photons have been traced, summed over all rounds and maps";
        bias "" Nothing (ESTIMATES | X)
            "Measure the bias, which is the blur by the search radius, in extra runs: of the paper's box, and where `measure` is relmse. Otherwise it is estimated from the run's own blocks. With `error` it counts as part of the error";
        checkpoint "FILE" Nothing (ESTIMATES | X)
            "Write all sums into this file from time to time and at the end, so that `resume` can go on with them";
        every "TIME" Nothing (ESTIMATES | X) "Time between two checkpoints" default "30s" requires "checkpoint";
        resume "FILE" Nothing (ESTIMATES | X)
            "Go on with the blocks of rounds that a checkpoint holds; the result is that of a run without a break, to the bit";
        shard "K/N" Nothing (ESTIMATES | X)
            "Do every N-th block of rounds, from the K-th on (K from 1 to N); `photonmill merge` adds the checkpoints of all of them"
            requires "checkpoint";
    }
    Photons {
        preset "NAME" Image X "Experiment of the paper that sets the defaults" default "modified";
        photons "N" Work (SCENES | X)
            "Photons of the global map, per round" default "131072; what a pilot finds best of a picture that ends at an error or a time"
            box "Photons per round, summed over all lights"
            default "5000";
        caustic_photons "N" Work SCENES
            "Photons of the caustic map, per round" default "the same as `photons`; what a pilot finds best";
        bounces "N" Image (SCENES | X) "Cut photons off after this many bounces" default "none; Russian roulette ends paths"
            box "Maximum number of bounces of a photon"
            default "15; 2 with `preset` naive";
        aim "SWITCH" Image SCENES
            "Aim photons of the caustic map at mirrors and glass (projection maps), and light of a sky or sun at the openings that it comes in through"
            default "on";
        map "FILE" Image RUNS
            "Take the photons from a file of `photonmill map` instead of tracing them: the same light for another camera, radius or kernel"
            conflicts ["photons", "caustic_photons", "bounces", "aim", "illumination"];
        rounds "N" Work (RUNS | X)
            "Number of independent rounds, of which the result is the mean"
            default "as many as the goals take, up to 65536; 32 of points, texels and shards without a goal"
            box "Number of rounds, whose photons are summed"
            default "1; 100 with `preset` rounds; as many as needed with `error`, `time` or `total_photons`, 1048576 at most";
        block "N" Image RUNS
            "Rounds of a block, a power of two. Samples are stratified over a block, and errors come from the spread of blocks; `rounds` is rounded up to whole blocks"
            default "4, less with more `samples`";
        rng "GENERATOR" Image X
            "Random number generator" default "rand48 with the paper's 5000 photons per round, otherwise philox";
        seed "N" Image ALL "Seed of the random numbers" default "1";
    }
    LightTransport {
        illumination "METHOD" Image SCENES "Source of direct light and caustics" default "split";
        settings "FILE" Work SCENES
            "Take what a pilot has chosen from a file of `save_settings`, and run no pilot; options that are given go before it";
        with "EFFECT" Image SCENES "Simulate an effect even if the scene does not need it; `photonmill plan` lists them";
        without "EFFECT" Image SCENES "Leave an effect out even if the scene needs it";
        shadow_rays "N" Work RUNS
            "Shadow rays per visible point and round" default "4; what a pilot finds best of a picture that ends at an error or a time";
        final_gather "" Image RUNS
            "Final gathering: take indirect light from one ray to the next surface, not from the map at the visible point";
        part "PART" Image (R | L) "Compute only this part of the light; the four parts sum to `all` exactly";
        samples "N" Work R
            "Camera paths per pixel and round, a power of two. Every path queries the caustic map; where all of them end on the first surface, only one queries the global map"
            default "1; what a pilot finds best of a run that ends at an error or a time";
        save_settings "FILE" Work R "Write what the pilot has chosen for `settings`. Without -o, only the pilot runs";
        filter "FILTER" Image R "Reconstruction filter of the pixels" default "box";
    }
    DensityEstimate {
        neighbours "N" Work RUNS
            "Photons of a round within the first radius of the global map at the median pixel, texel or point, as a trial round finds it"
            default "24; what a pilot finds best of a picture that ends at an error or a time";
        caustic_neighbours "N" Work RUNS
            "The same for the caustic map" default "6, or a quarter of `neighbours`; or what a pilot finds best";
        radius "METRES" Image (RUNS | X)
            "Radius of the density estimate of the global map in the first round, metres" default "what holds `neighbours`"
            box "Radius of the density estimate, metres"
            default "0.05; 0.025 with `preset` rounds";
        caustic_radius "METRES" Image RUNS "The same for the caustic map" default "what holds `caustic_neighbours`";
        alpha "ALPHA" Image ESTIMATES
            "How the radius shrinks from round to round, as alpha of Knaus and Zwicker (2011): above 0 and at most 1, which keeps the radius"
            default "0.667" conflicts ["fixed_radius"];
        fixed_radius "" Image ESTIMATES "Keep the radius, like `alpha` 1";
        kernel "KERNEL" Image ESTIMATES "Kernel of the density estimate: weight of a photon by its distance" default "box";
        edge_correction "SWITCH" Image (RUNS | X)
            "Divide by the part of the search disc that lies on the surface, not by the whole disc" default "on"
            box "Divide by the part of the search disc that lies on the wall, not by the whole disc, for irradiance and radiosity; the paper's illumination stays uncorrected"
            default "on";
        full_light "N" Image X
            "Photons within the radius, per round, that are shown as full illumination"
            default "90 per 5000 photons of a round; 10 per 5000 with `preset` rounds";
        nearest "K" Image X
            "Use only the K nearest photons of each round, 2 to 1024, none farther away than the radius; needs `gather` kdtree"
            default "all within the radius";
        mesh "N" Image X "Texels along each side of a wall" default "64";
    }
    Implementation {
        variant "BUILDER" Nothing (RUNS | V | X) "Builder of the photon maps; all give bit-identical results" default "auto"
            box "Builder of the photon map; all GPU builders give bit-identical results"
            default "atomic; naive with `preset` naive";
        gather "SEARCH" Image X
            "How photons near a point are found; all give bit-identical results" default "grid";
        sums "NUMBERS" Image X "Number format of the film's sums" default "integer";
        counters "N" Nothing X
            "Counters of `variant` atomic, a power of two up to 64, which work groups use round-robin; the result is the same to the bit"
            default "1; on a GPU 8 from two million photons at once";
        threads "N|all" Nothing X "Threads of `variant` cpu, or `all`" default "1, as in the paper";
        math "ROUNDING" Image ALL "Rounding of the arithmetic" default "fast";
        chunk "N" Nothing (SCENES | X)
            "Most photons traced at once; the result is the same to the bit" default "what fits on the device";
        group_size "N" Nothing (SCENES | X) "Invocations per work group, a power of two" default "128";
    }
    Checks {
        paranoid "" Nothing ALL "Detect NaN and infinity, and print which photon, pixel, texel or point they come from";
    }
};

impl Row {
    /// What it is, and what holds where it is not given, in a command.
    pub fn help(&self, command: u32) -> String {
        let own = (self.help, self.default);
        let (help, default) = if command == Command::Box as u32 { self.of_box.first().copied().unwrap_or(own) } else { own };
        if default.is_empty() { help.to_owned() } else { format!("{help} [default: {default}]") }
    }

    /// Whether metadata keep what a request says of it. The paper's box has as many photons as are asked for, as no pilot chooses.
    pub fn is_kept(&self, request: &RenderRequest) -> bool {
        let is_of_box = request.scene.is_empty();
        self.decides == Decides::Image || (is_of_box && self.field == "photons")
    }

    /// Whether a command has it, by the command's number.
    pub fn is_of(&self, command: u32) -> bool {
        self.commands & command != 0
    }

    pub fn form(&self) -> Form {
        (self.of)(&mut RenderRequest::default()).form()
    }

    /// As a command's option, without dashes in front.
    pub fn option(&self) -> String {
        self.field.replace('_', "-")
    }

    /// The value in a request as a command line has it; `None` where none is given.
    pub fn text(&self, request: &RenderRequest) -> Option<String> {
        (self.of)(&mut request.clone()).text()
    }
}

/// The row of a field, or of a command's option without its dashes.
pub(crate) fn row(name: &str) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.field == name || row.option() == name)
}

impl RenderRequest {
    /// The same with these options alone.
    pub(super) fn only(&self, is_kept: impl Fn(&Row) -> bool) -> RenderRequest {
        let mut kept = RenderRequest::of(self.scene.clone());
        for row in ROWS.iter().filter(|row| is_kept(row)) {
            if let Some(text) = row.text(self) {
                (row.of)(&mut kept).read(&text).expect("a value is read as it is written");
            }
        }
        kept
    }

    /// The same without settings that are as usual anyway. A preset stays, of which others are changes, and so does a generator that is named.
    pub fn brief(&self) -> RenderRequest {
        let is_box = self.scene.is_empty();
        let is_setting = |row: &&Row| match row.group {
            Group::Output | Group::WhenToStop => false,
            Group::Scene => is_box,
            _ => row.form() != Form::File && !["preset", "rng"].contains(&row.field),
        };
        let are_same = |a: &RenderRequest, b: &RenderRequest| match is_box {
            true => a.room_settings() == b.room_settings(),
            false => a.settings(None) == b.settings(None),
        };
        ROWS.iter().filter(is_setting).fold(self.clone(), |brief, row| {
            let without = brief.only(|other| other.field != row.field);
            if are_same(&without, &brief) { without } else { brief }
        })
    }

    /// What is given, as words of a command line, the scene first.
    pub fn words(&self) -> Vec<String> {
        let option = |row: &'static Row| {
            let value = row.text(self)?;
            Some(if row.form() == Form::Flag { format!("--{}", row.option()) } else { format!("--{}={value}", row.option()) })
        };
        [self.scene.clone()].into_iter().filter(|scene| !scene.is_empty()).chain(ROWS.iter().filter_map(option)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::image::kept;

    /// A value of each row, as it is written.
    fn sample(row: &Row) -> &'static str {
        match (row.field, row.form()) {
            ("environment", _) => "1,2,0.5",
            ("size", _) => "64x48",
            ("shard", _) => "2/3",
            ("layers", _) => "direct,depth",
            ("shininess", _) => "1,2,3,4,5",
            ("threads", _) => "3",
            ("white_balance", _) => "3000",
            (_, Form::Flag | Form::Switch) => "on",
            (_, Form::Integer) => "7",
            (_, Form::Number) => "0.25",
            (_, Form::Percent) => "2%",
            (_, Form::Time) => "1.5s",
            (_, Form::Text | Form::Other | Form::File) => "name",
            (_, Form::Numbers(2)) => "10,20",
            (_, Form::Numbers(_)) => "1,-2,0.5",
            (_, Form::Choice(choices)) => choices[0].0,
            (_, Form::Names(names)) => names[3],
        }
    }

    #[test]
    fn every_value_is_read_as_it_is_written() {
        for row in ROWS {
            let mut request = RenderRequest::of("scene.glb");
            assert_eq!(row.text(&request), None, "{}", row.field);
            (row.of)(&mut request).read(sample(row)).unwrap_or_else(|reason| panic!("{}: {reason}", row.field));
            assert_eq!(row.text(&request).as_deref(), Some(sample(row)), "{}", row.field);
            // Metadata keep what decides the picture, and give it back.
            let words = kept(&request).words();
            assert_eq!(words.len() == 2, row.decides == Decides::Image, "{words:?}");
            assert_eq!(RenderRequest::of_words(&words), Ok(kept(&request)), "{words:?}");
        }
        let given = |name: &&'static str| *name == "output" || row(name).is_some();
        assert!(ROWS.iter().all(|row| row.requires.iter().chain(row.conflicts).all(given)));
    }
}
