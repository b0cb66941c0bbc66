//! Names of objects, and labels of passes and dispatches in command buffers (VK_EXT_debug_utils): what RenderDoc, Nsight and
//! messages of the validation layer call them. Without such a tool a driver ignores them.

use std::ffi::CString;

use ash::vk;

use super::Context;

pub(super) struct Labels(ash::ext::debug_utils::Device);

impl Labels {
    pub(super) fn new(instance: &ash::Instance, device: &ash::Device) -> Labels {
        Labels(ash::ext::debug_utils::Device::new(instance, device))
    }
}

fn c_string(name: &str) -> CString {
    CString::new(name).expect("names hold no zero byte")
}

impl Context {
    pub(super) fn set_name<T: vk::Handle>(&self, object: T, name: &str) {
        if let Some(Labels(debug)) = &self.labels {
            let name = c_string(name);
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // SAFETY: the object belongs to this device. Failing to name it changes nothing.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }

    /// Until the next `end_label`, commands belong to this pass, within those that are open.
    pub(super) fn begin_label(&self, command_buffer: vk::CommandBuffer, name: &str) {
        if let Some(Labels(debug)) = &self.labels {
            let name = c_string(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: the command buffer is recording.
            unsafe { debug.cmd_begin_debug_utils_label(command_buffer, &label) };
        }
    }

    pub(super) fn end_label(&self, command_buffer: vk::CommandBuffer) {
        if let Some(Labels(debug)) = &self.labels {
            // SAFETY: the command buffer is recording, and a label is open in it.
            unsafe { debug.cmd_end_debug_utils_label(command_buffer) };
        }
    }
}
