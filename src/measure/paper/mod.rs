//! The paper's figures, running times and table, measured on this machine and compared with the published numbers, as
//! images, CSV and one page.

pub(crate) mod bench;
pub(crate) mod chart;
pub(crate) mod experiments;
pub(crate) mod figures;
pub(crate) mod page;
pub(crate) mod published;
#[cfg(test)]
mod sample;
pub(crate) mod tables;
pub(crate) mod verdicts;

use crate::error::{Error, Result};
use crate::output::destination::{Folder, write_all};
use bench::{Bench, Device};
use experiments::{LeftOut, RunningTime, TotalTime};
use figures::{Figure, Panel};

/// What is measured besides the paper's own settings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PaperRequest {
    /// Photons of a round at the size that fills the device.
    pub large: u32,
    /// Runs that count, at most.
    pub repeats: usize,
    /// Threads of a second CPU builder; 1: there is none.
    pub threads: usize,
    /// A row of table 1 that is predicted to take longer is left out.
    pub longest_ms: f64,
}

/// Everything that was found.
pub(crate) struct Reproduction {
    /// `None` without Vulkan.
    pub device: Option<Device>,
    /// The host's processor.
    pub cpu: String,
    pub request: PaperRequest,
    pub figures: Vec<Figure>,
    pub running_times: Vec<RunningTime>,
    pub totals: Vec<TotalTime>,
    /// Experiments that would have taken too long.
    pub passes_left_out: Vec<LeftOut>,
    pub totals_left_out: Vec<LeftOut>,
    /// False if it was ended before its last experiment.
    pub complete: bool,
}

/// Runs every experiment; one that is ended from outside leaves what was finished before it.
pub(crate) fn reproduce(bench: &mut Bench, request: PaperRequest) -> Result<Reproduction> {
    let mut found = Reproduction {
        device: bench.device(),
        cpu: bench::processor(),
        request,
        figures: Vec::new(),
        running_times: Vec::new(),
        totals: Vec::new(),
        passes_left_out: Vec::new(),
        totals_left_out: Vec::new(),
        complete: false,
    };
    bench.expect(figures::COUNT + experiments::count(bench, &request));
    match run_all(bench, &mut found) {
        Err(Error::Interrupted) => {}
        result => {
            result?;
            found.complete = true;
        }
    }
    Ok(found)
}

fn run_all(bench: &mut Bench, found: &mut Reproduction) -> Result<()> {
    figures::make(bench, &mut found.figures)?;
    experiments::running_times(bench, found)?;
    experiments::totals(bench, found)
}

/// Writes pictures, tables and the page.
pub(crate) fn write(folder: &Folder, found: &Reproduction) -> Result<()> {
    let panels = |figure: &Figure| {
        let file = |(place, panel): (usize, &Panel)| (folder.file(&Panel::file_name(figure.number, place)), panel.png.clone());
        figure.panels.iter().enumerate().map(file).collect::<Vec<_>>()
    };
    let mut files: Vec<_> = found.figures.iter().flat_map(panels).collect();
    files.push((folder.file("running_times.csv"), tables::running_times(&found.running_times)));
    files.push((folder.file("table1.csv"), tables::totals(&found.totals)));
    files.push((folder.file("findings.csv"), tables::findings(&verdicts::all(found))));
    files.push((folder.file("index.html"), page::html(found).into_bytes()));
    write_all(files)
}
