//! Kernels: what reflection knows of them, and the pipelines made from them.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use std::rc::Rc;

use ash::vk;
use bytemuck::Pod;

use super::{Buffer, Context, DeviceFacts, Gpu, call};
use crate::error::Result;
use crate::records::Field;

/// A kernel with its buffers filled in; `build.rs` writes one implementor a kernel.
pub trait Kernel {
    /// Record behind the push constants; `()` if there are none.
    type Push: Pod;
    const MODULE: Module;
    /// Fails to compile if the push constants exceed what every device allows.
    const FITS: ();
    /// In the order of `MODULE.bindings`.
    fn buffers(&self) -> Vec<&Buffer>;
}

/// A compiled kernel and what reflection found in it.
#[derive(Debug, Clone, Copy)]
pub struct Module {
    pub name: &'static str,
    pub spirv: &'static [u8],
    pub push_bytes: u32,
    pub bindings: &'static [Binding],
    /// Specialization constants: name and id. Id 0 is the work-group size, which has no name.
    pub constants: &'static [(&'static str, u32)],
}

#[derive(Debug, Clone, Copy)]
pub struct Binding {
    pub name: &'static str,
    pub set: u32,
    pub binding: u32,
    pub reads: bool,
    pub writes: bool,
}

/// A struct as a kernel sees it; compared with its Rust twin by `tests/layout.rs`.
#[derive(Debug, Clone, Copy)]
pub struct ReflectedStruct {
    pub name: &'static str,
    /// Distance between neighbours, where the struct lies in an array.
    pub stride_bytes: Option<usize>,
    pub fields: &'static [Field],
}

/// Values of specialization constants, by name, and the work-group size. A kernel takes those that
/// it declares.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Constants {
    pub group_size: u32,
    values: BTreeMap<&'static str, u32>,
}

impl Constants {
    pub fn new(group_size: u32) -> Constants {
        Constants { group_size, values: BTreeMap::new() }
    }

    pub fn set(mut self, name: &'static str, value: u32) -> Constants {
        self.values.insert(name, value);
        self
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct PipelineKey {
    kernel: &'static str,
    constants: Constants,
}

pub(super) struct Pipeline {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) set_layouts: Vec<vk::DescriptorSetLayout>,
    context: Rc<Context>,
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        let device = &self.context.device;
        // SAFETY: commands wait for the device before they return, so nothing uses the pipeline.
        unsafe {
            device.destroy_pipeline(self.raw, None);
            device.destroy_pipeline_layout(self.layout, None);
            for layout in &self.set_layouts {
                device.destroy_descriptor_set_layout(*layout, None);
            }
        }
    }
}

impl Gpu {
    /// The pipeline of a kernel for these constants, made at first use.
    pub(super) fn pipeline(&self, module: &Module, constants: &Constants) -> Result<Rc<Pipeline>> {
        let key = PipelineKey { kernel: module.name, constants: constants.clone() };
        if let Some(pipeline) = self.pipelines.borrow().get(&key) {
            return Ok(pipeline.clone());
        }
        let pipeline = Rc::new(self.create_pipeline(module, constants)?);
        self.pipelines.borrow_mut().insert(key, pipeline.clone());
        Ok(pipeline)
    }

    /// Makes the pipelines of these kernels now, so that no run pays for them later.
    pub fn prepare(&self, modules: &[Module], constants: &Constants) -> Result<()> {
        modules.iter().try_for_each(|module| self.pipeline(module, constants).map(drop))
    }

    /// Pipelines made so far.
    pub fn pipeline_count(&self) -> usize {
        self.pipelines.borrow().len()
    }

    fn create_pipeline(&self, module: &Module, constants: &Constants) -> Result<Pipeline> {
        let device = &self.context.device;
        let set_count = module.bindings.iter().map(|binding| binding.set + 1).max().unwrap_or(0);
        let mut pipeline = Pipeline {
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layouts: Vec::new(),
            context: self.context.clone(),
        };
        for set in 0..set_count {
            let bindings: Vec<_> = module
                .bindings
                .iter()
                .filter(|binding| binding.set == set)
                .map(|binding| {
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(binding.binding)
                        .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                        .descriptor_count(1)
                        .stage_flags(vk::ShaderStageFlags::COMPUTE)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            // SAFETY: `info` is complete; destroyed with the pipeline.
            pipeline.set_layouts.push(call("vkCreateDescriptorSetLayout", unsafe { device.create_descriptor_set_layout(&info, None) })?);
        }
        let push = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(module.push_bytes)];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&pipeline.set_layouts)
            .push_constant_ranges(if module.push_bytes == 0 { &[] } else { &push });
        // SAFETY: as above.
        pipeline.layout = call("vkCreatePipelineLayout", unsafe { device.create_pipeline_layout(&info, None) })?;

        let own = || ash::util::read_spv(&mut Cursor::new(module.spirv)).expect("build.rs wrote whole SPIR-V words");
        let words = self.replaced.iter().find(|(name, _)| name == module.name).map_or_else(own, |(_, words)| words.clone());
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the code comes from the GLSL compiler.
        let shader = call("vkCreateShaderModule", unsafe { device.create_shader_module(&info, None) })?;
        let mut entries = vec![vk::SpecializationMapEntry { constant_id: 0, offset: 0, size: 4 }];
        let mut values = vec![constants.group_size];
        for (name, id) in module.constants {
            if let Some(value) = constants.values.get(name) {
                entries.push(vk::SpecializationMapEntry { constant_id: *id, offset: 4 * values.len() as u32, size: 4 });
                values.push(*value);
            }
        }
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(shader)
            .name(c"main")
            .specialization_info(&specialization);
        let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(pipeline.layout);
        // SAFETY: layout and module are alive; the module is no longer needed afterwards.
        let made = unsafe {
            let made = device.create_compute_pipelines(self.cache.raw, &[info], None).map_err(|(_, code)| code);
            device.destroy_shader_module(shader, None);
            made
        };
        pipeline.raw = call("vkCreateComputePipelines", made)?[0];
        self.context.set_name(pipeline.raw, module.name);
        Ok(pipeline)
    }
}

/// Vulkan's pipeline cache, kept in the user's cache folder from run to run.
pub(super) struct DiskCache {
    raw: vk::PipelineCache,
    /// `None` where the system names no cache folder.
    path: Option<PathBuf>,
    loaded_bytes: usize,
    context: Rc<Context>,
}

impl DiskCache {
    pub(super) fn open(context: &Rc<Context>, facts: &DeviceFacts) -> Result<DiskCache> {
        let path = directories::ProjectDirs::from("", "", "photonmill")
            .map(|folders| folders.cache_dir().join(format!("pipelines-{}.bin", facts.pipeline_cache_id)));
        // A cache that cannot be read is as good as none; the driver checks what it is given.
        let content = path.as_ref().and_then(|path| std::fs::read(path).ok()).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&content);
        // SAFETY: the driver validates the header of the data; destroyed in Drop.
        let raw = call("vkCreatePipelineCache", unsafe { context.device.create_pipeline_cache(&info, None) })?;
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
