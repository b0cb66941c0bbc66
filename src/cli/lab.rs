//! Commands of the lab: what accuracy and speed cost, pictures to show, and the paper's figures and tables.

use std::sync::atomic::AtomicBool;

use clap::Subcommand;

use super::{End, bench, gallery, paper, study};
use crate::error::Result;

#[derive(Subcommand)]
pub(super) enum Command {
    /// Measure error against time for every setting on this device, and write a page about it
    #[command(after_help = STUDY, mut_arg("scene", |argument| argument.help(study::scene_help())))]
    Study(Box<study::StudyArgs>),
    /// Measure the speed of every pass against the limits of the device
    #[command(after_help = BENCH)]
    Bench(bench::BenchArgs),
    /// Make pictures that show what photonmill does best, each with its time and its error, and a page of them
    #[command(after_help = GALLERY)]
    Gallery(gallery::GalleryArgs),
    /// Reproduce every figure and table of the paper as images, CSV and one HTML page
    #[command(after_help = PAPER)]
    Paper(paper::PaperArgs),
}

pub(super) fn run(command: &Command, cancelled: &AtomicBool) -> Result<End> {
    match command {
        Command::Study(args) => study::run(args, cancelled),
        Command::Bench(args) => bench::run(args, cancelled),
        Command::Gallery(args) => gallery::run(args, cancelled),
        Command::Paper(args) => paper::run(args, cancelled),
    }
}

const STUDY: &str = "\
Examples:
  photonmill study open-box -o study
      Two minutes of measurements; open study/index.html
  photonmill study scene.glb -o study --budget 10m
      A scene of your own, in ten minutes";

const BENCH: &str = "\
Examples:
  photonmill bench --only open-box,cornell
      Two experiments, as text
  photonmill bench --scale -o bench
      Time and memory against photons and triangles, with charts";

const GALLERY: &str = "\
Examples:
  photonmill gallery -o gallery
      Eleven pictures; open gallery/index.html
  photonmill gallery -o gallery --size 320 --error 2%
      Smaller, and sooner done";

const PAPER: &str = "\
Examples:
  photonmill paper -o paper
      All figures and tables; open paper/index.html
  photonmill paper -o paper --threads all --longest 20s
      Also with all CPU threads; leaves out rows that would take longer than 20 s";
