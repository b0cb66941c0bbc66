use clap::Args;
use crate::error::Result;
#[derive(Args)]
pub(super) struct PaperArgs {}
pub(super) fn run(_: &PaperArgs, _: &std::sync::atomic::AtomicBool) -> Result<()> { Ok(()) }
