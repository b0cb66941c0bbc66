//! Descriptor sets of one submission, each made and written once.

use std::collections::HashMap;
use std::sync::Arc;

use ash::vk;

use super::{AnyBuffer, Context, call};
use crate::error::Result;

/// Descriptor sets and storage buffers of one descriptor pool.
const SETS_PER_POOL: u32 = 256;
const BUFFERS_PER_POOL: u32 = 8 * SETS_PER_POOL;

pub(super) struct DescriptorSets {
    pools: Vec<vk::DescriptorPool>,
    pool_in_use: usize,
    sets: HashMap<(vk::DescriptorSetLayout, Vec<vk::Buffer>), vk::DescriptorSet>,
    context: Arc<Context>,
}

impl DescriptorSets {
    pub(super) fn new(context: Arc<Context>) -> DescriptorSets {
        DescriptorSets { pools: Vec::new(), pool_in_use: 0, sets: HashMap::new(), context }
    }

    /// Frees all sets, once the submission has ended.
    pub(super) fn clear(&mut self) -> Result<()> {
        for pool in &self.pools {
            // SAFETY: no submission is under way that uses a set of the pool.
            call("vkResetDescriptorPool", || unsafe {
                self.context.device.reset_descriptor_pool(*pool, vk::DescriptorPoolResetFlags::empty())
            })?;
        }
        self.sets.clear();
        self.pool_in_use = 0;
        Ok(())
    }

    /// The set of this layout with these buffers, by their bindings; written once a submission.
    pub(super) fn get(&mut self, layout: vk::DescriptorSetLayout, buffers: Vec<(u32, &&AnyBuffer)>) -> Result<vk::DescriptorSet> {
        let key = (layout, buffers.iter().map(|(_, buffer)| buffer.raw()).collect());
        if let Some(set) = self.sets.get(&key) {
            return Ok(*set);
        }
        let set = self.allocate(layout)?;
        let infos: Vec<[vk::DescriptorBufferInfo; 1]> =
            buffers.iter().map(|(_, buffer)| [vk::DescriptorBufferInfo::default().buffer(buffer.raw()).range(vk::WHOLE_SIZE)]).collect();
        let writes: Vec<_> = buffers
            .iter()
            .zip(&infos)
            .map(|((binding, _), info)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(*binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(info)
            })
            .collect();
        // SAFETY: the set was just allocated and is in no submission.
        unsafe { self.context.device.update_descriptor_sets(&writes, &[]) };
        self.sets.insert(key, set);
        Ok(set)
    }

    fn allocate(&mut self, layout: vk::DescriptorSetLayout) -> Result<vk::DescriptorSet> {
        let device = &self.context.device;
        let layouts = [layout];
        loop {
            if let Some(pool) = self.pools.get(self.pool_in_use) {
                let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(*pool).set_layouts(&layouts);
                // SAFETY: pool and layout are alive.
                match unsafe { device.allocate_descriptor_sets(&info) } {
                    Ok(sets) => return Ok(sets[0]),
                    Err(vk::Result::ERROR_OUT_OF_POOL_MEMORY | vk::Result::ERROR_FRAGMENTED_POOL) => self.pool_in_use += 1,
                    Err(code) => return call("vkAllocateDescriptorSets", || Err(code)),
                }
                continue;
            }
            let sizes = [vk::DescriptorPoolSize::default().ty(vk::DescriptorType::STORAGE_BUFFER).descriptor_count(BUFFERS_PER_POOL)];
            let info = vk::DescriptorPoolCreateInfo::default().max_sets(SETS_PER_POOL).pool_sizes(&sizes);
            // SAFETY: `info` is complete; destroyed in Drop.
            self.pools.push(call("vkCreateDescriptorPool", || unsafe { device.create_descriptor_pool(&info, None) })?);
        }
    }
}

impl Drop for DescriptorSets {
    fn drop(&mut self) {
        for pool in &self.pools {
            // SAFETY: every submission was waited for.
            unsafe { self.context.device.destroy_descriptor_pool(*pool, None) };
        }
    }
}
