//! The Khronos validation layer: its messages are collected, and any message is an error at the end of the run.

use std::ffi::{CStr, c_char, c_void};
use std::fmt::Write;
use std::sync::Mutex;

use ash::vk;

use super::call;
use crate::error::Result;

/// Messages of one instance.
pub(super) struct Messages {
    loader: ash::ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    /// Behind a pointer that stays put, because the layer holds it.
    list: Box<Mutex<Vec<String>>>,
}

impl Messages {
    pub(super) fn listen(entry: &ash::Entry, instance: &ash::Instance) -> Result<Messages> {
        let list = Box::new(Mutex::new(Vec::new()));
        let loader = ash::ext::debug_utils::Instance::new(entry, instance);
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
            .pfn_user_callback(Some(record_message))
            .user_data((&raw const *list).cast_mut().cast());
        // SAFETY: the callback gets the list, which lives as long as the messenger.
        let messenger = call("vkCreateDebugUtilsMessengerEXT", || unsafe { loader.create_debug_utils_messenger(&info, None) })?;
        Ok(Messages { loader, messenger, list })
    }

    pub(super) fn all(&self) -> Vec<String> {
        self.list.lock().expect("no panic while holding the messages").clone()
    }

    /// Stops listening.
    ///
    /// # Safety
    /// The instance must still be alive.
    pub(super) unsafe fn destroy(self) {
        // SAFETY: the caller keeps the instance alive.
        unsafe { self.loader.destroy_debug_utils_messenger(self.messenger, None) };
    }
}

/// Called by the layer on any thread.
unsafe extern "system" fn record_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    message: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    list: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid message with labels that have names, and the pointer that `listen` gave it.
    let (list, mut text, labels) = unsafe {
        let message = &*message;
        let text = |text: *const c_char| CStr::from_ptr(text).to_string_lossy().into_owned();
        let labels = match message.cmd_buf_label_count {
            0 => &[],
            count => std::slice::from_raw_parts(message.p_cmd_buf_labels, count as usize),
        };
        let labels: Vec<String> = labels.iter().map(|label| text(label.p_label_name)).collect();
        (&*list.cast::<Mutex<Vec<String>>>(), text(message.p_message), labels)
    };
    if !labels.is_empty() {
        // The innermost comes first; some versions of the layer list each twice.
        let mut pass: Vec<String> = labels.into_iter().rev().collect();
        pass.dedup();
        write!(text, " (in the pass {})", pass.join("/")).expect("text can be written");
    }
    if let Ok(mut list) = list.lock() {
        list.push(text);
    }
    vk::FALSE
}
