//! Kernels that run on their buffers.

use ash::vk;

use super::Commands;
use super::barriers::Access;
use crate::error::Result;
use crate::gpu::{Buffer, Kernel, Work};
use crate::records::DispatchArgs;

/// How many invocations or groups a dispatch has.
#[derive(Clone, Copy)]
pub(crate) enum Extent<'a> {
    /// One invocation an item; folded into rows where the device allows too few groups along x.
    Items(u64),
    /// Groups along x and y.
    Groups(u32, u32),
    /// As a [`DispatchArgs`] record on the device says.
    Indirect(&'a Buffer<DispatchArgs>),
}

/// Runs the first of two forms of a kernel, which adds to sums of 64 bits in one word, or the second one, which adds in two.
macro_rules! dispatch_by_sums {
    ($commands:expr, $in_one_word:expr, [$one_word:ident, $two_words:ident] $buffers:tt, $push:expr, $extent:expr) => {
        if $in_one_word {
            $commands.dispatch($one_word $buffers, $push, $extent)
        } else {
            $commands.dispatch($two_words $buffers, $push, $extent)
        }
    };
}

pub(crate) use dispatch_by_sums;

impl Commands<'_> {
    /// Runs a kernel on its buffers.
    pub(crate) fn dispatch<K: Kernel>(&mut self, kernel: K, push: &K::Push, extent: Extent) -> Result<()> {
        if self.gpu.options.time_dispatches {
            return self.scope(K::MODULE.name, |commands| commands.record_dispatch(kernel, push, extent));
        }
        self.gpu.context.begin_label(self.command_buffer, K::MODULE.name);
        let recorded = self.record_dispatch(kernel, push, extent);
        self.gpu.context.end_label(self.command_buffer);
        recorded
    }

    fn record_dispatch<K: Kernel>(&mut self, kernel: K, push: &K::Push, extent: Extent) -> Result<()> {
        let () = K::FITS;
        let module = K::MODULE;
        let buffers = kernel.buffers();
        let pipeline = self.gpu.pipeline(&module, &self.constants)?;
        let numbered = module.bindings.iter().map(|binding| binding.binding).zip(&buffers);
        let own = self.descriptor_sets.get(pipeline.set_layouts[1], numbered.collect())?;
        let scene = kernel.scene();
        let scene_set =
            if scene.is_empty() { None } else { Some(self.descriptor_sets.get(pipeline.set_layouts[0], (0..).zip(&scene).collect())?) };
        // A kernel without a scene has another layout of set 0, and so disturbs what is bound there.
        let sets: Vec<_> = scene_set.filter(|_| self.bound_scene != scene_set).into_iter().chain([own]).collect();
        self.bound_scene = scene_set;
        let mut accesses: Vec<Access> =
            module.bindings.iter().zip(&buffers).map(|(binding, buffer)| (*buffer, binding.reads, binding.writes)).collect();
        accesses.extend(scene.iter().map(|buffer| (*buffer, true, false)));
        if let Extent::Indirect(args) = &extent {
            accesses.push((args.any(), true, false));
        }
        self.order(&accesses);

        let (device, command_buffer) = (&self.gpu.context.device, self.command_buffer);
        // SAFETY: the command buffer is recording; pipeline, sets and buffers live until the
        // submission has ended; group counts are within the device's limits.
        unsafe {
            device.cmd_bind_pipeline(command_buffer, vk::PipelineBindPoint::COMPUTE, pipeline.raw);
            device.cmd_bind_descriptor_sets(
                command_buffer,
                vk::PipelineBindPoint::COMPUTE,
                pipeline.layout,
                2 - sets.len() as u32,
                &sets,
                &[],
            );
            if module.push_bytes != 0 {
                device.cmd_push_constants(command_buffer, pipeline.layout, vk::ShaderStageFlags::COMPUTE, 0, bytemuck::bytes_of(push));
            }
            let groups = match extent {
                Extent::Items(items) => {
                    let DispatchArgs { x, y, z } = self.fold(items.div_ceil(u64::from(self.constants.group_size)));
                    device.cmd_dispatch(command_buffer, x, y, z);
                    u64::from(x) * u64::from(y)
                }
                Extent::Groups(x, y) => {
                    assert!(x <= self.gpu.facts.work_group_count_x && y <= self.gpu.facts.work_group_count_y, "{x} x {y} groups");
                    device.cmd_dispatch(command_buffer, x, y, 1);
                    u64::from(x) * u64::from(y)
                }
                Extent::Indirect(args) => {
                    device.cmd_dispatch_indirect(command_buffer, args.any().raw(), 0);
                    0
                }
            };
            let invocations = groups * u64::from(self.constants.group_size);
            self.gpu.add_work(Work { dispatches: 1, invocations, ..Work::default() });
        }
        self.dispatch_count += 1;
        Ok(())
    }

    /// Groups laid out in rows that the device allows; glsl/dispatch/dispatch.glsl reads them back.
    fn fold(&self, groups: u64) -> DispatchArgs {
        let columns = groups.min(u64::from(self.gpu.facts.work_group_count_x));
        let rows = if columns == 0 { 0 } else { groups.div_ceil(columns) };
        assert!(rows <= u64::from(self.gpu.facts.work_group_count_y), "{groups} groups");
        DispatchArgs { x: columns as u32, y: rows as u32, z: 1 }
    }
}
