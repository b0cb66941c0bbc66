//! Kernels: their reflected interfaces, and the pipelines made from them.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::{Cursor, Write};
use std::path::PathBuf;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use rayon::prelude::*;

use super::reconvergence::reconverging;
use super::specialize::{content, decided};
use super::{AnyBuffer, Context, DeviceFacts, Gpu, Work, call};
use crate::error::Result;
use crate::records::Field;

/// Bytes of push constants that every Vulkan device has.
pub(super) const PUSH_BYTES: u32 = 128;

/// A kernel with its buffers filled in; `build.rs` writes one implementor a kernel.
pub(crate) trait Kernel {
    /// Record behind the push constants; `()` if there are none.
    type Push: Pod;
    const MODULE: Module;
    /// Fails to compile if the push constants exceed what every device allows.
    const FITS: ();
    /// The scene that it looks at, all of it; empty where it looks at none.
    fn scene(&self) -> Vec<&AnyBuffer>;
    /// Its own, in the order of `MODULE.bindings`.
    fn buffers(&self) -> Vec<&AnyBuffer>;
}

/// A compiled kernel and what reflection found in it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Module {
    pub name: &'static str,
    pub spirv: &'static [u8],
    pub push_bytes: u32,
    /// Bindings of set 0, the scene's, which are the same for all kernels of a world; none where it looks at no scene.
    pub scene_bindings: u32,
    /// Bindings of set 1: its own.
    pub bindings: &'static [Binding],
    /// Its lanes vote in a loop in which they go different ways.
    pub votes_in_loops: bool,
    /// Specialization constants: name and id. Id 0 is the work-group size, which has no name.
    pub constants: &'static [(&'static str, u32)],
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Binding {
    pub binding: u32,
    pub reads: bool,
    pub writes: bool,
}

/// A struct as a kernel sees it; compared with its Rust twin by `tests/engine/layout.rs`.
#[cfg_attr(not(test), expect(dead_code, reason = "tests alone read all of it"))]
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReflectedStruct {
    pub name: &'static str,
    /// Distance between neighbours, where the struct lies in an array.
    pub stride_bytes: Option<usize>,
    pub fields: &'static [Field],
}

/// Values of specialization constants, by name, and the work-group size. A kernel takes those that
/// it declares.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Constants {
    pub group_size: u32,
    values: BTreeMap<&'static str, u32>,
}

impl Constants {
    pub(crate) fn new(group_size: u32) -> Constants {
        Constants { group_size, values: BTreeMap::new() }
    }

    pub(crate) fn set(mut self, name: &'static str, value: u32) -> Constants {
        self.values.insert(name, value);
        self
    }
}

/// A kernel and the constants that it declares: id and value, the work-group size first.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct PipelineKey {
    pub(super) kernel: &'static str,
    constants: Vec<(u32, u32)>,
}

impl PipelineKey {
    fn new(module: &Module, constants: &Constants) -> PipelineKey {
        let declared = module.constants.iter().filter_map(|(name, id)| Some((*id, *constants.values.get(name)?)));
        PipelineKey { kernel: module.name, constants: [(0, constants.group_size)].into_iter().chain(declared).collect() }
    }
}

/// The pipelines of a device.
#[derive(Default)]
pub(super) struct Pipelines {
    by_key: HashMap<PipelineKey, Arc<Pipeline>>,
    /// By kernel and content: constants that nothing of what is left of a kernel names make no pipeline of its own.
    made: HashMap<(&'static str, [u8; 32]), Arc<Pipeline>>,
    /// Those of them that were made while other SPIR-V stood for the kernel.
    of_replaced: HashSet<(&'static str, [u8; 32])>,
}

impl Pipelines {
    /// Forgets which pipelines stand for a kernel, and drops those of SPIR-V that stood for its own.
    pub(super) fn forget(&mut self, is_changed: impl Fn(&str) -> bool) {
        self.by_key.retain(|key, _| !is_changed(key.kernel));
        self.of_replaced.drain().for_each(|key| drop(self.made.remove(&key)));
    }
}

pub(super) struct Pipeline {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    /// Of the scene, and of the kernel's own buffers.
    pub(super) set_layouts: [vk::DescriptorSetLayout; 2],
    context: Arc<Context>,
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        let device = &self.context.device;
        // SAFETY: commands wait for the device before they return, so nothing uses the pipeline.
        unsafe {
            device.destroy_pipeline(self.raw, None);
            device.destroy_pipeline_layout(self.layout, None);
        }
    }
}

/// Layouts of descriptor sets, by the numbers of their bindings: pipelines with the same ones leave each other's sets bound.
pub(super) struct SetLayouts {
    made: RefCell<HashMap<Vec<u32>, vk::DescriptorSetLayout>>,
    context: Arc<Context>,
}

impl SetLayouts {
    pub(super) fn new(context: &Arc<Context>) -> SetLayouts {
        SetLayouts { made: RefCell::default(), context: context.clone() }
    }

    fn of(&self, numbers: Vec<u32>) -> Result<vk::DescriptorSetLayout> {
        if let Some(layout) = self.made.borrow().get(&numbers) {
            return Ok(*layout);
        }
        let binding = |number: &u32| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(*number)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let bindings: Vec<_> = numbers.iter().map(binding).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: `info` is complete; destroyed in Drop.
        let layout = call("vkCreateDescriptorSetLayout", || unsafe { self.context.device.create_descriptor_set_layout(&info, None) })?;
        self.made.borrow_mut().insert(numbers, layout);
        Ok(layout)
    }
}

impl Drop for SetLayouts {
    fn drop(&mut self) {
        for layout in self.made.borrow().values() {
            // SAFETY: commands borrow the device that this belongs to, so no set is made any more.
            unsafe { self.context.device.destroy_descriptor_set_layout(*layout, None) };
        }
    }
}

impl Gpu {
    /// The pipeline of a kernel for these constants, made at first use.
    pub(super) fn pipeline(&self, module: &Module, constants: &Constants) -> Result<Arc<Pipeline>> {
        let key = PipelineKey::new(module, constants);
        if !self.pipelines.borrow().by_key.contains_key(&key) {
            self.prepare(&[*module], constants)?;
        }
        Ok(self.pipelines.borrow().by_key[&key].clone())
    }

    /// Makes the pipelines of these kernels now, as many at a time as there are cores, so that no run pays for them later.
    pub(crate) fn prepare(&self, modules: &[Module], constants: &Constants) -> Result<()> {
        let mut missing: Vec<(PipelineKey, [u8; 32], Pipeline, Vec<u32>)> = Vec::new();
        for module in modules {
            let key = PipelineKey::new(module, constants);
            if self.pipelines.borrow().by_key.contains_key(&key) || missing.iter().any(|(other, ..)| *other == key) {
                continue;
            }
            let words = decided(&self.words_of(module), &key.constants);
            let words = if module.votes_in_loops { reconverging(&words, self.facts.reconvergence) } else { words };
            let content = content(&words, &key.constants);
            let made = self.pipelines.borrow().made.get(&(module.name, content)).cloned();
            match made {
                Some(pipeline) => drop(self.pipelines.borrow_mut().by_key.insert(key, pipeline)),
                None => missing.push((key, content, self.pipeline_layout(module)?, words)),
            }
        }
        let (device, cache) = (&self.context.device, self.cache.raw);
        let jobs: Vec<_> = missing.iter().map(|(key, _, pipeline, words)| (key, pipeline.layout, words)).collect();
        let made: Vec<_> = jobs.par_iter().map(|(key, layout, words)| compile(device, cache, *layout, words, &key.constants)).collect();
        for ((key, content, mut pipeline, _), raw) in missing.into_iter().zip(made) {
            pipeline.raw = raw?;
            self.context.set_name(pipeline.raw, key.kernel);
            let pipeline = Arc::new(pipeline);
            let mut pipelines = self.pipelines.borrow_mut();
            self.add_work(Work { pipelines: 1, ..Work::default() });
            pipelines.made.insert((key.kernel, content), pipeline.clone());
            if self.options.replaced.iter().any(|(name, _)| name == key.kernel) {
                pipelines.of_replaced.insert((key.kernel, content));
            }
            pipelines.by_key.insert(key, pipeline);
        }
        Ok(())
    }

    /// SPIR-V of a kernel, or what stands for it in this device.
    fn words_of(&self, module: &Module) -> Vec<u32> {
        let own = || ash::util::read_spv(&mut Cursor::new(module.spirv)).expect("build.rs wrote whole SPIR-V words");
        self.options.replaced.iter().find(|(name, _)| name == module.name).map_or_else(own, |(_, words)| words.clone())
    }

    /// A pipeline that is still to be compiled.
    fn pipeline_layout(&self, module: &Module) -> Result<Pipeline> {
        let set_layouts = [
            self.set_layouts.of((0..module.scene_bindings).collect())?,
            self.set_layouts.of(module.bindings.iter().map(|binding| binding.binding).collect())?,
        ];
        // The same for all, as sets stay bound only between layouts whose push constants are alike.
        let push = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(PUSH_BYTES)];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts).push_constant_ranges(&push);
        // SAFETY: `info` is complete; destroyed with the pipeline.
        let layout = call("vkCreatePipelineLayout", || unsafe { self.context.device.create_pipeline_layout(&info, None) })?;
        Ok(Pipeline { raw: vk::Pipeline::null(), layout, set_layouts, context: self.context.clone() })
    }
}

fn compile(
    device: &ash::Device,
    cache: vk::PipelineCache,
    layout: vk::PipelineLayout,
    words: &[u32],
    constants: &[(u32, u32)],
) -> Result<vk::Pipeline> {
    let info = vk::ShaderModuleCreateInfo::default().code(words);
    // SAFETY: the code comes from the GLSL compiler.
    let shader = call("vkCreateShaderModule", || unsafe { device.create_shader_module(&info, None) })?;
    let offsets = (0..).step_by(size_of::<u32>());
    let entries: Vec<_> = constants
        .iter()
        .zip(offsets)
        .map(|((id, _), offset)| vk::SpecializationMapEntry { constant_id: *id, offset, size: size_of::<u32>() })
        .collect();
    let values: Vec<u32> = constants.iter().map(|(_, value)| *value).collect();
    let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(shader)
        .name(c"main")
        .specialization_info(&specialization);
    let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
    // SAFETY: layout and module are alive; the module is no longer needed afterwards. Vulkan guards the cache itself.
    let made = unsafe {
        let made = device.create_compute_pipelines(cache, &[info], None).map_err(|(_, code)| code);
        device.destroy_shader_module(shader, None);
        made
    };
    Ok(call("vkCreateComputePipelines", || made)?[0])
}

/// Vulkan's pipeline cache, kept in the user's cache folder from run to run.
pub(super) struct DiskCache {
    raw: vk::PipelineCache,
    /// `None` where the system names no cache folder.
    path: Option<PathBuf>,
    loaded_bytes: usize,
    context: Arc<Context>,
}

impl DiskCache {
    pub(super) fn open(context: &Arc<Context>, facts: &DeviceFacts) -> Result<DiskCache> {
        let path = directories::ProjectDirs::from("", "", "photonmill")
            .map(|folders| folders.cache_dir().join(format!("pipelines-{}.bin", facts.pipeline_cache_id)));
        // A cache that cannot be read is as good as none; the driver checks what it is given.
        let content = path.as_ref().and_then(|path| std::fs::read(path).ok()).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&content);
        // SAFETY: the driver validates the header of the data; destroyed in Drop.
        let raw = call("vkCreatePipelineCache", || unsafe { context.device.create_pipeline_cache(&info, None) })?;
        Ok(DiskCache { raw, path, loaded_bytes: content.len(), context: context.clone() })
    }

    /// Writes the cache if it has grown. A folder that cannot be written costs time, not results.
    fn save(&self) -> Option<()> {
        // SAFETY: the cache is alive.
        let content = unsafe { self.context.device.get_pipeline_cache_data(self.raw) }.ok()?;
        let path = self.path.as_ref().filter(|_| content.len() != self.loaded_bytes)?;
        let folder = path.parent()?;
        std::fs::create_dir_all(folder).ok()?;
        let mut file = tempfile::NamedTempFile::new_in(folder).ok()?;
        file.write_all(&content).ok()?;
        file.persist(path).ok().map(drop)
    }
}

impl Drop for DiskCache {
    fn drop(&mut self) {
        self.save();
        // SAFETY: no pipeline is being created.
        unsafe { self.context.device.destroy_pipeline_cache(self.raw, None) };
    }
}
