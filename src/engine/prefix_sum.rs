//! Prefix sums on the device: sums of blocks, sums of those, and so on up, then down again.

use crate::constants::SCAN_ITEMS;
use crate::error::Result;
use crate::gpu::kernels::{ScanAdd, ScanBlocks};
use crate::gpu::{Buffer, Commands, Extent};
use crate::records::ScanPush;

/// Turns `item_count` numbers into their exclusive prefix sums; `levels` have room for [`block_sum_counts`].
///
/// [`block_sum_counts`]: crate::plan::buffers::block_sum_counts
pub(crate) fn scan(commands: &mut Commands, items: &Buffer<u32>, levels: &[Buffer<u32>], item_count: u32, group_size: u32) -> Result<()> {
    let threads = || Extent::Items(u64::from(item_count.div_ceil(SCAN_ITEMS)));
    scan_part(commands, items, levels, item_count, group_size, &threads)
}

/// The same of the first numbers alone, as many as `threads` read: sums before them do not depend on those behind,
/// which are left in disorder.
pub(crate) fn scan_part<'a>(
    commands: &mut Commands,
    items: &Buffer<u32>,
    levels: &[Buffer<u32>],
    item_count: u32,
    group_size: u32,
    threads: &dyn Fn() -> Extent<'a>,
) -> Result<()> {
    let [block_sums, coarser @ ..] = levels else { panic!("a prefix sum has a level") };
    let push = ScanPush { item_count };
    commands.dispatch(ScanBlocks { items, block_sums }, &push, threads())?;
    if coarser.is_empty() {
        return Ok(());
    }
    let block_count = item_count.div_ceil(group_size * SCAN_ITEMS);
    scan(commands, block_sums, coarser, block_count, group_size)?;
    commands.dispatch(ScanAdd { items, block_sums }, &push, threads())
}
