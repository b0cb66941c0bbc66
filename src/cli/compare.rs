//! `photonmill compare`: how far a picture is from a reference.

use std::path::{Path, PathBuf};

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::values::{parse_integer, value_enum};
use super::{JsonOrStdoutArg, complain, optional_file, say_beside};
use crate::error::{Error, Result, require, within};
use crate::output::destination::{Destination, check_distinct, check_not_read, write_all};
use crate::output::exr_file;
use crate::output::words::lower_case;
use crate::render::Percent;
use crate::text::percent;
use crate::verify::compare::Comparison;
use crate::verify::compare::false_colour::Show;
use crate::verify::compare::image::Image;
use crate::verify::compare::pair::Pair;
use crate::verify::compare::z_scores::{self, ZScores};

#[derive(Args)]
pub(super) struct CompareArgs {
    /// Picture: .exr or .hdr, whose values are linear, or .png, whose values are taken as a display shows them
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The reference, of the same size and kind
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Write the deviation of each pixel in false colours as a .png; pixels that are not compared are grey
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,
    /// What the false colours show [default: difference]
    #[arg(long, value_enum, value_name = "WHAT", help_heading = "Output")]
    show: Option<ShowArg>,
    #[command(flatten)]
    json: JsonOrStdoutArg,
    /// Standard errors of A, an .exr as `render --error-image` writes it; prints z-scores, and whether the pictures agree
    #[arg(long, value_name = "FILE", help_heading = "Checks")]
    errors_a: Option<PathBuf>,
    /// Standard errors of B; without one of the two, that picture is taken as exact
    #[arg(long, value_name = "FILE", help_heading = "Checks")]
    errors_b: Option<PathBuf>,
    /// Blocks of rounds that the errors come from, of the picture that has fewer; errors of few blocks are uncertain, and z-scores
    /// then follow Student's distribution [default: as the files of errors say; else so many that they follow a normal one]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Checks")]
    error_blocks: Option<u32>,
    /// End with exit code 1 if the RMSE is above so many per cent of the reference's mean
    #[arg(long, value_name = "PERCENT", allow_hyphen_values = true, help_heading = "Checks")]
    fail_above: Option<Percent>,
    #[command(flatten)]
    progress: ProgressArgs,
}

value_enum!(ShowArg => Show {
    /// The difference relative to the reference's mean, on a logarithmic scale
    Difference,
    /// The difference in standard errors
    Z,
    /// How visible it is: FLIP
    Flip,
});

/// As many as a render has.
const MAX_BLOCKS: u32 = 1 << 20;
/// The standard errors of A and of B, by the option that names them.
const ERRORS: [&str; 2] = ["--errors-a", "--errors-b"];

pub(super) fn run(args: &CompareArgs) -> Result<()> {
    if let Some(allowed) = args.fail_above.map(Percent::share) {
        require(allowed >= 0.0 && allowed.is_finite(), "--fail-above", allowed, "must be 0 % or more, and finite")?;
    }
    let show = args.show.map_or(Show::default(), Show::from);
    let has_errors = args.errors_a.is_some() || args.errors_b.is_some();
    if let Some(blocks) = args.error_blocks {
        within("--error-blocks", blocks, 2..=MAX_BLOCKS, "blocks of rounds that a standard error comes from")?;
        require(has_errors, "--error-blocks", blocks, "needs --errors-a, --errors-b or both")?;
    }
    require(args.show.is_none() || args.output.is_some(), "--show", lower_case(show), "needs -o FILE, the picture that shows it")?;
    require(show != Show::Z || has_errors, "--show", lower_case(show), "needs --errors-a, --errors-b or both")?;
    let output = optional_file("-o", args.output.as_ref())?;
    if let Some(path) = &args.output {
        let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
        require(is_png, "-o", path.display(), "must be a file name that ends in .png")?;
    }
    let json = optional_file("--json", args.json.json.as_ref())?;
    let files: Vec<Destination> = [&output, &json].into_iter().flatten().cloned().collect();
    check_distinct(&files)?;
    let inputs = [Some(&args.a), Some(&args.b), args.errors_a.as_ref(), args.errors_b.as_ref()];
    check_not_read(&files, inputs.into_iter().flatten().map(PathBuf::as_path))?;

    let reporter = ProgressReporter::new(&args.progress);
    reporter.status("comparing");
    let [a, b] = [read(&args.a)?, read(&args.b)?];
    let pair = Pair::new(&a, &b)?;
    let z = if has_errors { Some(z_scores(args, &pair)?) } else { None };
    let comparison = Comparison::new(pair, z);
    let colours = output.map(|output| {
        let none =
            || Error::setting("-o", output.path().display(), "shows nothing of a black reference; use another --show (z needs --errors-a)");
        comparison.false_colour(show).ok_or_else(none).map(|content| (output, content))
    });
    let colours = colours.transpose()?;
    reporter.finish();

    comparison.warnings().iter().for_each(|line| complain(&format!("warning: {line}")));
    let mut text = comparison.text();
    let wrote = colours.as_ref().map(|(output, _)| format!("\nwrote {}: {}", output.path().display(), show.scale()));
    let written = write_all(colours.into_iter().chain(json.map(|json| (json, comparison.json()))));
    if written.is_ok() {
        text.extend(wrote);
    }
    say_beside(&files, &text)?;
    written?;
    match args.fail_above.map(Percent::share).filter(|allowed| comparison.deviation.is_above(*allowed)) {
        Some(allowed) => {
            let found = comparison.deviation.relative_rmse();
            Err(Error::PictureAbove { allowed: percent(allowed), path: args.a.clone(), found })
        }
        None => Ok(()),
    }
}

fn read(path: &Path) -> Result<Image> {
    Image::read(path).map_err(|reason| Error::Image { path: path.to_owned(), reason })
}

/// From the errors of one picture or both.
fn z_scores(args: &CompareArgs, pair: &Pair) -> Result<ZScores> {
    let mut errors = [None, None];
    let mut refusal = None;
    // Of the picture that has fewer.
    let mut freedom: Option<u32> = None;
    for ((errors, option), path) in errors.iter_mut().zip(ERRORS).zip([&args.errors_a, &args.errors_b]) {
        let Some(path) = path else { continue };
        let refuse = |reason: String| Error::setting(option, path.display(), reason);
        let picture = Image::read(path).map_err(refuse)?;
        z_scores::check(&picture, pair).map_err(refuse)?;
        *errors = Some(picture);
        let own = std::fs::read(path).ok().and_then(|content| exr_file::freedom(&content)).filter(|freedom| *freedom > 0);
        freedom = freedom.into_iter().chain(own).min();
        refusal =
            Some(refuse("has no finite error above 0, so that there is no z-score; render eight blocks of rounds or more".to_owned()));
    }
    ZScores::of(pair, errors.each_ref().map(Option::as_ref), args.error_blocks.or(freedom.map(|freedom| freedom + 1)))
        .ok_or_else(|| refusal.expect("an option names errors"))
}
