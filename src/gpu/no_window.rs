//! In place of `window` where the crate is built without the feature of that name: there is no window, and nothing to draw in one.

use std::ffi::c_char;
use std::sync::Arc;

use ash::vk;

use super::DeviceFacts;
use crate::error::Result;

pub(crate) enum Window {}

pub(super) enum Surface {}

pub(super) fn instance_extensions(window: &Window) -> Result<&'static [*const c_char]> {
    match *window {}
}

impl Surface {
    pub(super) fn new(_: &ash::Entry, _: &ash::Instance, window: &Arc<Window>) -> Result<Surface> {
        match **window {}
    }

    pub(super) fn window(&self) -> &Arc<Window> {
        match *self {}
    }

    pub(super) fn queue_family(&self, _: &ash::Instance, _: vk::PhysicalDevice, _: &DeviceFacts) -> Result<u32> {
        match *self {}
    }
}
