//! The user interface over the picture: what is shown, with which settings, at what error and in what time.

use egui::{Color32, ComboBox, Context, Key, RichText, Slider, Ui};

use super::camera::Motion;
use super::choices::{Choices, RunChoices};
use crate::constants::{SHOW_ALL, SHOW_CAUSTIC, SHOW_DIRECT, SHOW_ERROR, SHOW_INDIRECT, SHOW_SPECULAR};
use crate::ledger::Ledger;
use crate::settings::Builder;
use crate::settings::scene::Effect;

/// Keys, what they show and what it is called.
const SHOWN: [(Key, u32, &str); 6] = [
    (Key::Num1, SHOW_ALL, "all light"),
    (Key::Num2, SHOW_DIRECT, "direct"),
    (Key::Num3, SHOW_SPECULAR, "specular"),
    (Key::Num4, SHOW_CAUSTIC, "caustic"),
    (Key::Num5, SHOW_INDIRECT, "indirect"),
    (Key::Num6, SHOW_ERROR, "standard error"),
];
/// Of the effects of the scene, in the order of the plan.
const EFFECT_KEYS: [Key; 12] =
    [Key::F1, Key::F2, Key::F3, Key::F4, Key::F5, Key::F6, Key::F7, Key::F8, Key::F9, Key::F10, Key::F11, Key::F12];
/// Relative errors of 0.1 %, 0.56 %, 3.2 %, 18 % and 100 %. Twin of `COLOURS` in glsl/kernels/display.comp.
const ERROR_COLOURS: [[f32; 3]; 5] = [[0.27, 0.0, 0.33], [0.23, 0.32, 0.55], [0.13, 0.57, 0.55], [0.37, 0.79, 0.38], [0.99, 0.91, 0.14]];
const ERROR_LABELS: [&str; 5] = ["0.1 %", "", "3 %", "", "100 %"];
/// Less of it changes no digit of the noise that is shown.
const LEAST_UNSEEN: f64 = 5e-5;
const MESSAGE_COLOUR: Color32 = Color32::from_rgb(255, 200, 90);
/// Dots of photons of the global and of the caustic map.
pub(crate) const PHOTON_COLOURS: [[u8; 3]; 2] = [[255, 176, 0], [86, 180, 233]];

/// What is said of the run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Status {
    pub title: String,
    pub device: String,
    pub size: [u32; 2],
    pub rounds: u32,
    pub rounds_per_second: f64,
    /// Standard error of the picture over its mean, and the bias of the radius; infinite where nothing is known yet.
    pub noise: f64,
    pub bias: Option<f64>,
    /// Light that none of its paths and photons has met is at most this of it.
    pub unseen: f64,
    /// Of the global and of the caustic map in the latest round, metres.
    pub radii: [Option<f64>; 2],
    pub cached_rounds: usize,
    pub cached_bytes: u64,
    pub ledger: Ledger,
    /// Name, depth and milliseconds of passes of the latest round.
    pub passes: Vec<(String, usize, f64)>,
    /// Of the scene, needed or not.
    pub effects: Vec<(Effect, String)>,
    pub has_parts: bool,
    pub is_box: bool,
    pub message: String,
    /// The command that makes this picture.
    pub command: String,
}

/// What the user asks for, beside choices.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct PanelActions {
    pub motion: Motion,
    pub screenshot: bool,
    pub render: bool,
    pub close: bool,
    pub usual_exposure: bool,
    pub first_camera: bool,
}

/// Radians of a turn for a pointer that crosses the window.
const TURN: f64 = 3.0;
/// Per point of a wheel's turn.
const APPROACH: f64 = 0.003;
/// Pivot distances per second.
const SPEED: f64 = 0.6;
/// Of a radius, at a press of a key.
const NARROWER: f64 = 0.8;
/// Stops per second, by keys.
const STOPS_PER_SECOND: f32 = 3.0;

/// Draws the panel, and takes what the user does in it, on the picture and on keys.
pub(crate) fn show(context: &Context, choices: &mut Choices, status: &Status, pivot: f64) -> PanelActions {
    let mut actions = PanelActions::default();
    if choices.is_open {
        egui::Window::new(&status.title).default_size([270.0, 640.0]).default_pos([12.0, 12.0]).show(context, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| panel(ui, choices, status, &mut actions));
        });
    }
    if !context.egui_wants_keyboard_input() {
        keys(context, choices, status, &mut actions);
    }
    actions.motion = motion(context, pivot);
    actions
}

fn panel(ui: &mut Ui, choices: &mut Choices, status: &Status, actions: &mut PanelActions) {
    ui.label(&status.device);
    let noise = if status.noise.is_finite() { format!("{:.2} %", 100.0 * status.noise) } else { "not known yet".to_owned() };
    let bias = status.bias.map_or_else(String::new, |bias| format!(", bias {:.2} %", 100.0 * bias));
    ui.label(RichText::new(format!("{} rounds, {:.1} per second", status.rounds, status.rounds_per_second)).strong());
    ui.label(RichText::new(format!("noise {noise}{bias}")).strong());
    if status.unseen >= LEAST_UNSEEN {
        let most = if status.unseen.is_finite() { format!("at most {:.1} %", 100.0 * status.unseen) } else { "not known".to_owned() };
        ui.colored_label(MESSAGE_COLOUR, format!("light that no photon has met yet: {most}"));
    }
    if !status.message.is_empty() {
        ui.colored_label(MESSAGE_COLOUR, &status.message);
    }
    ui.separator();
    for (key, shows, name) in SHOWN {
        if matches!(shows, SHOW_ALL | SHOW_ERROR) || status.has_parts {
            ui.radio_value(&mut choices.shows, shows, format!("{name}  ({})", key.symbol_or_name()));
        }
    }
    if choices.shows == SHOW_ERROR {
        legend(ui);
    }
    if !status.is_box {
        ui.checkbox(&mut choices.has_photons, "photons of the latest round  (P)");
        if choices.has_photons {
            for (name, colour) in ["global map", "caustic map"].into_iter().zip(PHOTON_COLOURS) {
                ui.colored_label(Color32::from_rgb(colour[0], colour[1], colour[2]), format!("dots: {name}"));
            }
        }
    }
    ui.add(Slider::new(&mut choices.stops, -20.0..=20.0).text("stops  (- +)"));
    actions.usual_exposure |= ui.button("Exposure by the mean  (X)").clicked();
    ui.separator();
    settings(ui, &mut choices.run, status);
    ui.add(Slider::new(&mut choices.zoom, 1..=8).text("window pixels per pixel"));
    ui.separator();
    ui.horizontal(|ui| {
        actions.screenshot |= ui.button("Screenshot  (F)").clicked();
        actions.render |= ui.button("Render this  (R)").clicked();
    });
    ui.horizontal(|ui| {
        if ui.button("Copy command").clicked() {
            ui.ctx().copy_text(status.command.clone());
        }
        actions.first_camera |= ui.button("First camera  (Home)").clicked();
    });
    ui.label(RichText::new(&status.command).monospace());
    let keys = if status.is_box {
        "Drag: orbit. Wheel: nearer. H hides this, Esc quits."
    } else {
        "Drag: orbit. Right: turn. Middle: shift. Wheel: nearer. W A S D Q E: fly, with Shift faster. H hides this, Esc quits."
    };
    ui.label(RichText::new(keys).small());
    ui.separator();
    let section = |title: &str| egui::CollapsingHeader::new(title).default_open(true);
    section("Times of the latest round").show(ui, |ui| {
        egui::Grid::new("times").striped(true).show(ui, |ui| {
            for (name, depth, ms) in &status.passes {
                ui.label(format!("{}{name}", "   ".repeat(*depth)));
                ui.label(format!("{ms:.2} ms"));
                ui.end_row();
            }
        });
    });
    section("Photon ledger").show(ui, |ui| {
        let Ledger { emitted, absorbed, escaped, cut_off, dropped, stored } = status.ledger;
        egui::Grid::new("ledger").show(ui, |ui| {
            let rows =
                [("emitted", emitted), ("= absorbed", absorbed), ("+ escaped", escaped), ("+ cut off", cut_off), ("+ dropped", dropped)];
            for (name, count) in rows.into_iter().chain([("stored", stored)]) {
                ui.label(name);
                ui.label(count.to_string());
                ui.end_row();
            }
        });
        if !status.is_box {
            ui.label(format!("maps of {} rounds kept, {} MiB", status.cached_rounds, status.cached_bytes >> 20));
        }
    });
}

fn settings(ui: &mut Ui, run: &mut RunChoices, status: &Status) {
    let name = |builder: Option<Builder>| builder.map_or("auto", Builder::name);
    ComboBox::from_label("builder  (B)").selected_text(name(run.builder)).show_ui(ui, |ui| {
        for builder in builders() {
            ui.selectable_value(&mut run.builder, builder, name(builder));
        }
    });
    // Each change is another run: it begins when the slider is let go.
    let mut photons = run.photons;
    let slider = ui.add(Slider::new(&mut photons, 1..=1 << 24).logarithmic(true).text("photons per round"));
    if slider.drag_stopped() || slider.lost_focus() {
        run.photons = photons;
    }
    ui.horizontal(|ui| {
        for (label, factor) in [("-", NARROWER), ("+", 1.0 / NARROWER)] {
            if ui.button(label).clicked() {
                run.scale_radius(factor);
            }
        }
        let radii: Vec<String> = status.radii.iter().flatten().map(|radius| format!("{radius:.4} m")).collect();
        ui.label(if radii.is_empty() {
            "no map".to_owned()
        } else {
            format!("radius x{:.2}: {}  ([ ])", run.radius_factor, radii.join(", "))
        });
    });
    if !status.effects.is_empty() {
        ui.collapsing("Effects", |ui| {
            for (place, (effect, why)) in status.effects.iter().enumerate() {
                let mut is_on = !run.without.contains(effect);
                let key = EFFECT_KEYS.get(place).map_or_else(String::new, |key| format!("  ({})", key.name()));
                if ui.checkbox(&mut is_on, format!("{}{key}", effect.name())).on_hover_text(why).changed() {
                    run.toggle(*effect);
                }
            }
        });
    }
}

fn builders() -> impl Iterator<Item = Option<Builder>> {
    [None].into_iter().chain(Builder::ON_GPU.iter().copied().map(Some))
}

/// The colours of errors, from a thousandth to 1.
fn legend(ui: &mut Ui) {
    ui.horizontal(|ui| {
        for (colour, label) in ERROR_COLOURS.into_iter().zip(ERROR_LABELS) {
            let [red, green, blue] = colour.map(|channel| (255.0 * channel) as u8);
            let (place, _) = ui.allocate_exact_size([18.0, 14.0].into(), egui::Sense::hover());
            ui.painter().rect_filled(place, 0.0, Color32::from_rgb(red, green, blue));
            ui.label(label);
        }
    });
    ui.label(RichText::new("of the picture's mean; grey: not known").small());
}

fn keys(context: &Context, choices: &mut Choices, status: &Status, actions: &mut PanelActions) {
    context.input(|input| {
        for (key, shows, _) in SHOWN {
            if input.key_pressed(key) && (matches!(shows, SHOW_ALL | SHOW_ERROR) || status.has_parts) {
                choices.shows = shows;
            }
        }
        for (key, (effect, _)) in EFFECT_KEYS.into_iter().zip(&status.effects) {
            if input.key_pressed(key) {
                choices.run.toggle(*effect);
            }
        }
        if input.key_pressed(Key::B) {
            let all: Vec<Option<Builder>> = builders().collect();
            let now = all.iter().position(|builder| *builder == choices.run.builder).unwrap_or(0);
            choices.run.builder = all[(now + 1) % all.len()];
        }
        for (key, factor) in [(Key::OpenBracket, NARROWER), (Key::CloseBracket, 1.0 / NARROWER)] {
            if input.key_pressed(key) {
                choices.run.scale_radius(factor);
            }
        }
        choices.has_photons ^= input.key_pressed(Key::P) && !status.is_box;
        choices.is_open ^= input.key_pressed(Key::H);
        actions.screenshot |= input.key_pressed(Key::F);
        actions.render |= input.key_pressed(Key::R);
        actions.close |= input.key_pressed(Key::Escape);
        actions.usual_exposure |= input.key_pressed(Key::X);
        actions.first_camera |= input.key_pressed(Key::Home);
        let step = STOPS_PER_SECOND * input.stable_dt.min(0.1);
        for (keys, sign) in [([Key::Plus, Key::Equals], 1.0), ([Key::Minus, Key::Minus], -1.0)] {
            if keys.into_iter().any(|key| input.key_down(key)) {
                choices.stops = (choices.stops + sign * step).clamp(-20.0, 20.0);
            }
        }
    });
}

fn motion(context: &Context, pivot: f64) -> Motion {
    let mut motion = Motion::default();
    let (uses_pointer, uses_keys) = (context.egui_wants_pointer_input(), context.egui_wants_keyboard_input());
    context.input(|input| {
        let size = input.content_rect().size();
        if !uses_pointer {
            let by = input.pointer.delta();
            let by = [f64::from(by.x / size.y), f64::from(by.y / size.y)];
            let is_down = |button| input.pointer.button_down(button);
            if is_down(egui::PointerButton::Primary) {
                motion.orbit = [TURN * by[0], -TURN * by[1]];
            } else if is_down(egui::PointerButton::Secondary) {
                motion.turn = [TURN * by[0], -TURN * by[1]];
            } else if is_down(egui::PointerButton::Middle) {
                motion.shift = [-by[0], by[1]];
            }
            motion.approach = APPROACH * f64::from(input.smooth_scroll_delta.y);
        }
        if !uses_keys && !input.modifiers.command {
            let step = SPEED * pivot * f64::from(input.stable_dt.min(0.2)) * if input.modifiers.shift { 4.0 } else { 1.0 };
            let along = |forth: Key, back: Key| step * (f64::from(input.key_down(forth)) - f64::from(input.key_down(back)));
            motion.flight = [along(Key::D, Key::A), along(Key::E, Key::Q), along(Key::W, Key::S)];
        }
    });
    motion
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The legend is what the kernel draws.
    #[test]
    fn the_legend_has_the_colours_of_the_kernel() {
        let kernel = include_str!("../../glsl/kernels/display.comp");
        let colours: Vec<String> = ERROR_COLOURS.iter().map(|[red, green, blue]| format!("vec3({red:?}, {green:?}, {blue:?})")).collect();
        assert!(kernel.contains(&colours.join(", ")), "{colours:?}");
    }
}
