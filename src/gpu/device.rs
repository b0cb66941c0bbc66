//! Instance, choice of a physical device, and the logical device with its one queue.

use std::ffi::CStr;
use std::sync::Arc;

use ash::vk;
use serde::Serialize;

use super::kernels::MAX_BUFFERS;
use super::window::{Window, instance_extensions};
use super::{call, platform, validation::Messages};
use crate::error::{Error, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// A device and the limits that matter here.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceFacts {
    pub index: usize,
    pub name: String,
    /// discrete, integrated, virtual, cpu or other.
    pub kind: &'static str,
    /// Name and version, as the driver calls itself, without the words of the device's name.
    pub driver: String,
    pub vulkan: String,
    pub subgroup_size: u32,
    pub storage_buffer_range_bytes: u64,
    pub allocation_bytes: u64,
    pub device_memory_bytes: u64,
    /// What plans may use of it: half, as the device is not ours alone, or what the user says.
    #[serde(skip)]
    pub usable_memory_bytes: u64,
    pub storage_buffers_per_stage: u32,
    pub work_group_count_x: u32,
    pub work_group_count_y: u32,
    pub work_group_size: u32,
    /// Valid bits of a timestamp; 0 means that the queue has none.
    pub timestamp_bits: u32,
    /// Nanoseconds a timestamp tick.
    pub timestamp_period_ns: f32,
    pub int64_atomics: bool,
    /// What brings the lanes of a subgroup together again after they went different ways.
    pub(crate) reconvergence: Reconvergence,
    /// Subgroup votes are right in a loop in which lanes go different ways, as the start-up check found; false before it.
    #[serde(skip)]
    pub votes_in_loops: bool,
    /// What the device lacks of what every kernel needs; empty if it can be used.
    pub lacks: Vec<String>,
    /// Extensions that this platform wants enabled.
    #[serde(skip)]
    pub(super) of_platform: Vec<&'static CStr>,
    #[serde(skip)]
    pub(super) queue_family: u32,
    #[serde(skip)]
    pub(super) pipeline_cache_id: String,
}

/// What a device promises about lanes that went different ways.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Reconvergence {
    /// VK_KHR_shader_maximal_reconvergence: they come together as the source reads.
    Maximal,
    /// VK_KHR_shader_subgroup_uniform_control_flow: they do where all of them went in together.
    UniformControlFlow,
    None,
}

impl DeviceFacts {
    /// Name and driver.
    pub fn label(&self) -> String {
        format!("{}, driver {}", self.name, self.driver)
    }
}

/// An instance, and what it was made with; what is made from it goes before it.
pub(super) struct Loaded {
    pub(super) entry: ash::Entry,
    pub(super) instance: ash::Instance,
    /// Of the validation layer.
    pub(super) messages: Option<Messages>,
    /// Whether it takes names and labels (VK_EXT_debug_utils).
    pub(super) has_labels: bool,
}

impl Drop for Loaded {
    fn drop(&mut self) {
        // SAFETY: nothing is left that was made from this instance.
        unsafe {
            self.messages.take().into_iter().for_each(|messages| messages.destroy());
            self.instance.destroy_instance(None);
        }
    }
}

/// Loads the Vulkan loader at run time and makes an instance.
pub(super) fn instance(validate: bool, window: Option<&Arc<Window>>) -> Result<Loaded> {
    let no_vulkan = |reason: String| Error::NoVulkan { reason };
    let entry = platform::load().map_err(|_| no_vulkan(platform::NO_LOADER.into()))?;
    let app = vk::ApplicationInfo::default().application_name(c"photonmill").api_version(vk::API_VERSION_1_3);

    let mut layers = Vec::new();
    // SAFETY: plain enumeration.
    let present = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
    let (extensions, flags) = platform::instance(&present);
    let mut extensions: Vec<_> = extensions.into_iter().map(CStr::as_ptr).collect();
    extensions.extend(window.map_or(Ok(&[][..]), |window| instance_extensions(window))?);
    if validate {
        // SAFETY: plain enumeration.
        let layers_present = call("vkEnumerateInstanceLayerProperties", || unsafe { entry.enumerate_instance_layer_properties() })?;
        if !layers_present.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            return Err(Error::NoValidationLayer);
        }
        layers.push(VALIDATION_LAYER.as_ptr());
        extensions.push(ash::ext::validation_features::NAME.as_ptr());
    }
    let has = |name: &CStr| present.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
    // The validation layer brings it where nothing else does.
    let has_labels = validate || has(ash::ext::debug_utils::NAME);
    if has_labels {
        extensions.push(ash::ext::debug_utils::NAME.as_ptr());
    }
    let synchronisation = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&synchronisation);
    let info = vk::InstanceCreateInfo::default().flags(flags).application_info(&app);
    let mut info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions);
    if validate {
        info = info.push_next(&mut features);
    }
    // SAFETY: all pointers in `info` are alive.
    let instance = unsafe { entry.create_instance(&info, None) }.map_err(|code| match (code, window) {
        (vk::Result::ERROR_EXTENSION_NOT_PRESENT, Some(_)) => {
            Error::NoWindow { reason: "this Vulkan loader cannot show pictures in windows".into() }
        }
        _ => no_vulkan(format!("vkCreateInstance says {code}")),
    })?;
    let messages = if validate { Some(Messages::listen(&entry, &instance)?) } else { None };
    Ok(Loaded { entry, instance, messages, has_labels })
}

type Found = (vk::PhysicalDevice, DeviceFacts);

/// Every physical device, in the loader's order.
pub(super) fn all(instance: &ash::Instance) -> Result<Vec<Found>> {
    // SAFETY: plain enumeration.
    let devices = unsafe { instance.enumerate_physical_devices() }
        .map_err(|code| Error::NoVulkan { reason: format!("vkEnumeratePhysicalDevices says {code}") })?;
    Ok(devices.into_iter().enumerate().map(|(index, device)| (device, facts(instance, device, index))).collect())
}

/// The device that `wanted` names by index or part of a name, else the best one.
pub(super) fn choose(instance: &ash::Instance, wanted: Option<&str>) -> Result<Found> {
    let devices = all(instance)?;
    let rank = |facts: &DeviceFacts| KINDS.iter().position(|(_, name)| *name == facts.kind).unwrap_or(KINDS.len());
    if devices.is_empty() && wanted.is_none() {
        return Err(Error::NoVulkan { reason: "the Vulkan loader finds no device".into() });
    }
    let chosen = match wanted {
        Some(wanted) => named(&devices, wanted)?,
        None => devices.iter().min_by_key(|(_, facts)| (!facts.lacks.is_empty(), rank(facts), facts.index)).expect("there is a device"),
    };
    if let Some(what) = chosen.1.lacks.first() {
        return Err(Error::DeviceLacks { device: chosen.1.name.clone(), what: what.clone() });
    }
    Ok(chosen.clone())
}

/// The device of that index, else the one whose name holds `wanted`.
fn named<'a>(devices: &'a [Found], wanted: &str) -> Result<&'a Found> {
    let index: Option<usize> = wanted.parse().ok();
    let by_index = index.and_then(|index| devices.iter().find(|(_, facts)| facts.index == index));
    // A number is no part of a name.
    let holds = |facts: &DeviceFacts| !wanted.is_empty() && index.is_none() && facts.name.to_lowercase().contains(&wanted.to_lowercase());
    let by_name: Vec<&Found> = devices.iter().filter(|(_, facts)| holds(facts)).collect();
    match (by_index, by_name.as_slice()) {
        (Some(device), _) => Ok(device),
        (None, [device]) => Ok(device),
        // Several cards of one name are as good as each other.
        (None, [device, others @ ..]) if others.iter().all(|other| other.1.name == device.1.name) => Ok(device),
        _ => Err(Error::DeviceAbsent { wanted: wanted.to_owned(), present: describe(devices) }),
    }
}

fn describe(devices: &[Found]) -> String {
    let list: Vec<String> = devices.iter().map(|(_, facts)| format!("{} '{}'", facts.index, facts.name)).collect();
    if list.is_empty() { "none".to_owned() } else { list.join(", ") }
}

/// What devices are called, the best first; any other is the last choice.
const KINDS: [(vk::PhysicalDeviceType, &str); 4] = [
    (vk::PhysicalDeviceType::DISCRETE_GPU, "discrete"),
    (vk::PhysicalDeviceType::INTEGRATED_GPU, "integrated"),
    (vk::PhysicalDeviceType::VIRTUAL_GPU, "virtual"),
    (vk::PhysicalDeviceType::CPU, "cpu"),
];

fn facts(instance: &ash::Instance, device: vk::PhysicalDevice, index: usize) -> DeviceFacts {
    let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut v12 = vk::PhysicalDeviceVulkan12Properties::default();
    let mut v13 = vk::PhysicalDeviceVulkan13Properties::default();
    let mut f12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut f13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut maximal = vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR::default();
    let mut uniform = vk::PhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR::default();
    let of_platform;
    // SAFETY: the device belongs to the instance; only a 1.3 device fills the 1.3 structs, and they
    // are chained only for one.
    let (properties, features, families, memory) = unsafe {
        let extensions = instance.enumerate_device_extension_properties(device).unwrap_or_default();
        let has = |name: &CStr| platform::has(&extensions, name);
        let version = instance.get_physical_device_properties(device).api_version;
        let mut properties = vk::PhysicalDeviceProperties2::default();
        let mut features = vk::PhysicalDeviceFeatures2::default();
        of_platform = platform::device(&extensions);
        if version >= vk::API_VERSION_1_3 {
            properties = properties.push_next(&mut v11).push_next(&mut v12).push_next(&mut v13);
            features = features.push_next(&mut f12).push_next(&mut f13);
            if has(ash::khr::shader_maximal_reconvergence::NAME) {
                features = features.push_next(&mut maximal);
            }
            if has(ash::khr::shader_subgroup_uniform_control_flow::NAME) {
                features = features.push_next(&mut uniform);
            }
        }
        instance.get_physical_device_properties2(device, &mut properties);
        instance.get_physical_device_features2(device, &mut features);
        (
            properties.properties,
            features.features,
            instance.get_physical_device_queue_family_properties(device),
            instance.get_physical_device_memory_properties(device),
        )
    };
    let limits = properties.limits;
    // The first compute family among those with the best timestamps.
    let queue_family = families
        .iter()
        .enumerate()
        .filter(|(_, family)| family.queue_flags.contains(vk::QueueFlags::COMPUTE))
        .max_by_key(|(index, family)| (family.timestamp_valid_bits, std::cmp::Reverse(*index)))
        .map(|(index, _)| index as u32);

    let subgroup_needs = vk::SubgroupFeatureFlags::BASIC | vk::SubgroupFeatureFlags::BALLOT | vk::SubgroupFeatureFlags::ARITHMETIC;
    let mut lacks = Vec::new();
    let mut need = |present: bool, what: &str| {
        if !present {
            lacks.push(what.to_owned());
        }
    };
    need(properties.api_version >= vk::API_VERSION_1_3, "Vulkan 1.3");
    need(queue_family.is_some(), "a compute queue");
    need(f12.scalar_block_layout == vk::TRUE, "scalarBlockLayout");
    need(f13.synchronization2 == vk::TRUE, "synchronization2");
    need(f13.maintenance4 == vk::TRUE, "maintenance4");
    need(limits.max_per_stage_descriptor_storage_buffers >= MAX_BUFFERS, &format!("{MAX_BUFFERS} storage buffers in a shader stage"));
    need(
        v11.subgroup_supported_operations.contains(subgroup_needs) && v11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE),
        "subgroup ballots and arithmetic in compute shaders",
    );

    let version = |v: u32| format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v));
    let text = |name: std::result::Result<&CStr, _>| name.map(|name: &CStr| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = text(properties.device_name_as_c_str());
    let driver = format!("{} {}", text(v12.driver_name_as_c_str()), text(v12.driver_info_as_c_str()));
    let is_new = |word: &&str| !name.to_lowercase().contains(&word.to_lowercase().replace(['(', ')', ','], ""));
    let driver: Vec<&str> = driver.split_whitespace().filter(is_new).collect();
    let heaps = memory.memory_heaps_as_slice().iter();
    let of_device = heaps.filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    let device_memory_bytes = of_device.map(|heap| heap.size).max().unwrap_or(0);
    DeviceFacts {
        index,
        driver: driver.join(" "),
        name,
        kind: KINDS.iter().find(|(kind, _)| *kind == properties.device_type).map_or("other", |(_, name)| name),
        vulkan: version(properties.api_version),
        subgroup_size: v11.subgroup_size,
        storage_buffer_range_bytes: u64::from(limits.max_storage_buffer_range),
        allocation_bytes: v11.max_memory_allocation_size.min(v13.max_buffer_size),
        device_memory_bytes,
        usable_memory_bytes: device_memory_bytes / 2,
        storage_buffers_per_stage: limits.max_per_stage_descriptor_storage_buffers,
        work_group_count_x: limits.max_compute_work_group_count[0],
        work_group_count_y: limits.max_compute_work_group_count[1],
        work_group_size: limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
        timestamp_bits: queue_family.map_or(0, |family| families[family as usize].timestamp_valid_bits),
        timestamp_period_ns: limits.timestamp_period,
        int64_atomics: features.shader_int64 == vk::TRUE && f12.shader_buffer_int64_atomics == vk::TRUE,
        // The older of the two, which all validation layers know, promises enough: all lanes come to the loop together.
        reconvergence: if uniform.shader_subgroup_uniform_control_flow == vk::TRUE {
            Reconvergence::UniformControlFlow
        } else if maximal.shader_maximal_reconvergence == vk::TRUE {
            Reconvergence::Maximal
        } else {
            Reconvergence::None
        },
        votes_in_loops: false,
        lacks,
        of_platform,
        queue_family: queue_family.unwrap_or(0),
        pipeline_cache_id: properties.pipeline_cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect(),
    }
}

/// The logical device with the features that the kernels use, and its queue.
pub(super) fn create(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    facts: &DeviceFacts,
    presents: bool,
) -> Result<(ash::Device, vk::Queue)> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(facts.queue_family).queue_priorities(&[1.0])];
    let features = vk::PhysicalDeviceFeatures::default().shader_int64(facts.int64_atomics);
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true).shader_buffer_int64_atomics(facts.int64_atomics);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true).maintenance4(true).dynamic_rendering(presents);
    let mut maximal = vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR::default().shader_maximal_reconvergence(true);
    let mut uniform = vk::PhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR::default().shader_subgroup_uniform_control_flow(true);
    let of_lanes = match facts.reconvergence {
        Reconvergence::Maximal => Some(ash::khr::shader_maximal_reconvergence::NAME),
        Reconvergence::UniformControlFlow => Some(ash::khr::shader_subgroup_uniform_control_flow::NAME),
        Reconvergence::None => None,
    };
    let of_window = presents.then_some(ash::khr::swapchain::NAME);
    let extensions: Vec<_> = of_lanes.into_iter().chain(of_window).chain(facts.of_platform.iter().copied()).map(CStr::as_ptr).collect();
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_features(&features)
        .enabled_extension_names(&extensions)
        .push_next(&mut v12)
        .push_next(&mut v13);
    match facts.reconvergence {
        Reconvergence::Maximal => info = info.push_next(&mut maximal),
        Reconvergence::UniformControlFlow => info = info.push_next(&mut uniform),
        Reconvergence::None => {}
    }
    // SAFETY: all pointers in `info` are alive, and `facts` says that the features are there.
    unsafe {
        let device = call("vkCreateDevice", || instance.create_device(physical, &info, None))?;
        let queue = device.get_device_queue(facts.queue_family, 0);
        Ok((device, queue))
    }
}
