//! A window that a device shows pictures in: pixels that a kernel wrote, copied to the window's image on the device, and a user
//! interface over them.

use std::ffi::c_char;
use std::sync::Arc;

use ash::{khr, vk};
use egui::{ClippedPrimitive, TexturesDelta};
use egui_ash_renderer::{DynamicRendering, Options as PainterOptions, RenderMode, Renderer, allocator::DefaultAllocator};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle, RawDisplayHandle};
pub(crate) use winit::window::Window;

use super::commands::command_buffer;
use super::{Buffer, DeviceFacts, Gpu, call};
use crate::error::{Error, Result};

fn no_window(reason: impl std::fmt::Display) -> Error {
    Error::NoWindow { reason: reason.to_string() }
}

fn display_of(window: &Window) -> Result<RawDisplayHandle> {
    Ok(window.display_handle().map_err(no_window)?.as_raw())
}

/// Extensions that an instance needs to show pictures in a window.
pub(super) fn instance_extensions(window: &Window) -> Result<&'static [*const c_char]> {
    ash_window::enumerate_required_extensions(display_of(window)?)
        .map_err(|code| no_window(format!("its display is of an unknown kind ({code})")))
}

/// The window as an instance knows it.
pub(super) struct Surface {
    raw: vk::SurfaceKHR,
    functions: khr::surface::Instance,
    /// It must outlive what is drawn in it.
    window: Arc<Window>,
}

impl Surface {
    pub(super) fn new(entry: &ash::Entry, instance: &ash::Instance, window: &Arc<Window>) -> Result<Surface> {
        let (display, handle) = (display_of(window)?, window.window_handle().map_err(no_window)?.as_raw());
        // SAFETY: the instance was made with the extensions of this display, and the window is kept.
        let raw = unsafe { ash_window::create_surface(entry, instance, display, handle, None) }
            .map_err(|code| no_window(format!("Vulkan cannot draw in it ({code})")))?;
        Ok(Surface { raw, functions: khr::surface::Instance::new(entry, instance), window: window.clone() })
    }

    pub(super) fn window(&self) -> &Arc<Window> {
        &self.window
    }

    /// A queue family that computes, draws and shows pictures in this window.
    pub(super) fn queue_family(&self, instance: &ash::Instance, physical: vk::PhysicalDevice, facts: &DeviceFacts) -> Result<u32> {
        // SAFETY: plain enumeration.
        let (families, extensions) = unsafe {
            (
                instance.get_physical_device_queue_family_properties(physical),
                instance.enumerate_device_extension_properties(physical).unwrap_or_default(),
            )
        };
        let has_swapchain = extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(khr::swapchain::NAME));
        let does = |family: &u32| {
            let wanted = vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS;
            let functions = &self.functions;
            // SAFETY: device, family and surface belong together.
            let ask = || unsafe { functions.get_physical_device_surface_support(physical, *family, self.raw) };
            let presents = || call("vkGetPhysicalDeviceSurfaceSupportKHR", ask);
            families[*family as usize].queue_flags.contains(wanted) && presents().unwrap_or(false)
        };
        (0..families.len() as u32)
            .filter(|_| has_swapchain)
            .filter(does)
            .max_by_key(|family| *family == facts.queue_family)
            .ok_or_else(|| no_window(format!("{} computes, but cannot show pictures in a window of this display", facts.label())))
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: no swapchain is left that was made for it, and the instance is alive.
        unsafe { self.functions.destroy_surface(self.raw, None) };
    }
}

type Painter = Renderer<DefaultAllocator>;

/// What is drawn over a picture.
pub(crate) struct Overlay {
    pub textures: TexturesDelta,
    pub primitives: Vec<ClippedPrimitive>,
    pub pixels_per_point: f32,
}

/// Images of the window in turn.
pub(crate) struct Presenter<'gpu> {
    gpu: &'gpu Gpu,
    functions: khr::swapchain::Device,
    swapchain: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    views: Vec<vk::ImageView>,
    /// One an image: whoever shows it waits for it.
    drawn: Vec<vk::Semaphore>,
    acquired: vk::Semaphore,
    fence: vk::Fence,
    pool: vk::CommandPool,
    command_buffer: vk::CommandBuffer,
    format: vk::SurfaceFormatKHR,
    extent: vk::Extent2D,
    painter: Option<Painter>,
}

impl<'gpu> Presenter<'gpu> {
    /// Of a device that was opened with a window.
    pub(crate) fn new(gpu: &'gpu Gpu) -> Result<Presenter<'gpu>> {
        let context = &gpu.context;
        let surface = context.surface.as_ref().expect("the device was opened with a window");
        // SAFETY: device and surface are alive.
        let formats = call("vkGetPhysicalDeviceSurfaceFormatsKHR", || unsafe {
            surface.functions.get_physical_device_surface_formats(context.physical_device, surface.raw)
        })?;
        // Codes are written as they are, in 8 bits.
        let known = [vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM];
        let format = formats
            .into_iter()
            .find(|format| known.contains(&format.format) && format.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR)
            .ok_or_else(|| no_window("the display has no pixels of 8 bits"))?;
        let device = &context.device;
        let (pool, command_buffer, fence) = command_buffer(gpu)?;
        // SAFETY: the info is complete; destroyed in Drop, as all is.
        let acquired = call("vkCreateSemaphore", || unsafe { device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) })?;
        let mode =
            DynamicRendering { color_attachment_format: format.format, depth_attachment_format: None, stencil_attachment_format: None };
        let painter = Renderer::with_default_allocator(
            &context.loaded.instance,
            context.physical_device,
            device.clone(),
            RenderMode::DynamicRendering(mode),
            PainterOptions::default(),
        )
        .map_err(drawing)?;
        Ok(Presenter {
            gpu,
            functions: khr::swapchain::Device::new(&context.loaded.instance, device),
            swapchain: vk::SwapchainKHR::null(),
            images: Vec::new(),
            views: Vec::new(),
            drawn: Vec::new(),
            acquired,
            fence,
            pool,
            command_buffer,
            format,
            extent: vk::Extent2D::default(),
            painter: Some(painter),
        })
    }

    /// Whether its pixels have blue first.
    pub(crate) fn blue_first(&self) -> bool {
        self.format.format == vk::Format::B8G8R8A8_UNORM
    }

    /// Pixels of the window as it is now; none while it is minimised.
    pub(crate) fn size(&self) -> Result<[u32; 2]> {
        let surface = self.gpu.context.surface.as_ref().expect("there is a window");
        // SAFETY: device and surface are alive.
        let capabilities = call("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", || unsafe {
            surface.functions.get_physical_device_surface_capabilities(self.gpu.context.physical_device, surface.raw)
        })?;
        let vk::Extent2D { width, height } = capabilities.current_extent;
        // Where the window takes the size of its images.
        let size = surface.window.inner_size();
        Ok(if width == u32::MAX { [size.width, size.height] } else { [width, height] })
    }

    /// Shows pixels, so many as the window has, row by row from the top, and an overlay. They are written by then. `false`: the window has
    /// another size by now.
    pub(crate) fn present(&mut self, pixels: &Buffer<u32>, [width, height]: [u32; 2], mut overlay: Overlay) -> Result<bool> {
        // egui wants to be sure that nobody forgets them.
        let (set, free) = (std::mem::take(&mut overlay.textures.set), std::mem::take(&mut overlay.textures.free));
        let mut painter = self.painter.take().expect("there is a painter");
        for (id, delta) in set.iter().flat_map(|(id, deltas)| deltas.iter().map(move |delta| (id, delta))) {
            painter.set_texture(self.gpu.queue, self.pool, *id, delta).map_err(drawing)?;
        }
        let is_shown = self.draw(pixels, vk::Extent2D { width, height }, &mut painter, &overlay);
        for id in free {
            painter.free_texture(id).map_err(drawing)?;
        }
        self.painter = Some(painter);
        is_shown
    }

    fn draw(&mut self, pixels: &Buffer<u32>, extent: vk::Extent2D, painter: &mut Painter, overlay: &Overlay) -> Result<bool> {
        if self.swapchain == vk::SwapchainKHR::null() || self.extent != extent {
            self.make_images(extent)?;
        }
        // SAFETY: the semaphore is unsignalled, as the last frame waited for it.
        let acquired = unsafe { self.functions.acquire_next_image(self.swapchain, u64::MAX, self.acquired, vk::Fence::null()) };
        let index = match acquired {
            Ok((index, _)) => index,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.drop_images();
                return Ok(false);
            }
            Err(code) => return call("vkAcquireNextImageKHR", || Err(code)),
        };
        self.record(pixels, index as usize, painter, overlay)?;
        let device = &self.gpu.context.device;
        let wait = [vk::SemaphoreSubmitInfo::default().semaphore(self.acquired).stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let signal =
            [vk::SemaphoreSubmitInfo::default().semaphore(self.drawn[index as usize]).stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let command_buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.command_buffer)];
        let submission =
            [vk::SubmitInfo2::default().wait_semaphore_infos(&wait).signal_semaphore_infos(&signal).command_buffer_infos(&command_buffers)];
        let (swapchains, indices, semaphores) = ([self.swapchain], [index], [self.drawn[index as usize]]);
        let shown = vk::PresentInfoKHR::default().swapchains(&swapchains).image_indices(&indices).wait_semaphores(&semaphores);
        // SAFETY: everything recorded is alive, and waited for.
        let presented = unsafe {
            call("vkQueueSubmit2", || device.queue_submit2(self.gpu.queue, &submission, self.fence))?;
            call("vkWaitForFences", || device.wait_for_fences(&[self.fence], true, u64::MAX))?;
            call("vkResetFences", || device.reset_fences(&[self.fence]))?;
            self.functions.queue_present(self.gpu.queue, &shown)
        };
        match presented {
            Ok(false) => Ok(true),
            Ok(true) | Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.drop_images();
                Ok(false)
            }
            Err(code) => call("vkQueuePresentKHR", || Err(code)),
        }
    }

    fn record(&self, pixels: &Buffer<u32>, index: usize, painter: &mut Painter, overlay: &Overlay) -> Result<()> {
        let (device, command_buffer, image) = (&self.gpu.context.device, self.command_buffer, self.images[index]);
        let whole = vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let turn = |from: vk::ImageLayout, to: vk::ImageLayout| {
            let barrier = [vk::ImageMemoryBarrier2::default()
                .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
                .old_layout(from)
                .new_layout(to)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(image)
                .subresource_range(whole)];
            // SAFETY: the command buffer is recording, and the image is this frame's.
            unsafe { device.cmd_pipeline_barrier2(command_buffer, &vk::DependencyInfo::default().image_memory_barriers(&barrier)) };
        };
        let vk::Extent2D { width, height } = self.extent;
        assert!(u64::from(width) * u64::from(height) <= pixels.count(), "{width} x {height} pixels");
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let copied = [vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D { width, height, depth: 1 })];
        let attachment = [vk::RenderingAttachmentInfo::default()
            .image_view(self.views[index])
            .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::LOAD)
            .store_op(vk::AttachmentStoreOp::STORE)];
        let rendering = vk::RenderingInfo::default()
            .render_area(vk::Rect2D::default().extent(self.extent))
            .layer_count(1)
            .color_attachments(&attachment);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last frame has ended, so the command buffer may be recorded again; what it refers to is alive.
        unsafe {
            call("vkBeginCommandBuffer", || device.begin_command_buffer(command_buffer, &begin))?;
            turn(vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
            device.cmd_copy_buffer_to_image(command_buffer, pixels.any().raw(), image, vk::ImageLayout::TRANSFER_DST_OPTIMAL, &copied);
            turn(vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
            device.cmd_begin_rendering(command_buffer, &rendering);
            painter.cmd_draw(command_buffer, self.extent, overlay.pixels_per_point, &overlay.primitives).map_err(drawing)?;
            device.cmd_end_rendering(command_buffer);
            turn(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, vk::ImageLayout::PRESENT_SRC_KHR);
            call("vkEndCommandBuffer", || device.end_command_buffer(command_buffer))
        }
    }

    fn make_images(&mut self, extent: vk::Extent2D) -> Result<()> {
        self.drop_images();
        let surface = self.gpu.context.surface.as_ref().expect("there is a window");
        let device = &self.gpu.context.device;
        // SAFETY: device and surface are alive; what is made is destroyed in `drop_images`.
        unsafe {
            let capabilities = call("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", || {
                surface.functions.get_physical_device_surface_capabilities(self.gpu.context.physical_device, surface.raw)
            })?;
            let most = if capabilities.max_image_count == 0 { u32::MAX } else { capabilities.max_image_count };
            let info = vk::SwapchainCreateInfoKHR::default()
                .surface(surface.raw)
                .min_image_count((capabilities.min_image_count + 1).min(most))
                .image_format(self.format.format)
                .image_color_space(self.format.color_space)
                .image_extent(extent)
                .image_array_layers(1)
                .image_usage(vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::COLOR_ATTACHMENT)
                .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
                .pre_transform(capabilities.current_transform)
                .composite_alpha(vk::CompositeAlphaFlagsKHR::OPAQUE)
                .present_mode(vk::PresentModeKHR::FIFO)
                .clipped(true);
            self.swapchain = call("vkCreateSwapchainKHR", || self.functions.create_swapchain(&info, None))?;
            self.images = call("vkGetSwapchainImagesKHR", || self.functions.get_swapchain_images(self.swapchain))?;
            for image in &self.images {
                let range = vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
                let info = vk::ImageViewCreateInfo::default()
                    .image(*image)
                    .view_type(vk::ImageViewType::TYPE_2D)
                    .format(self.format.format)
                    .subresource_range(range);
                self.views.push(call("vkCreateImageView", || device.create_image_view(&info, None))?);
                self.drawn.push(call("vkCreateSemaphore", || device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None))?);
            }
        }
        self.extent = extent;
        Ok(())
    }

    fn drop_images(&mut self) {
        let device = &self.gpu.context.device;
        // SAFETY: the queue is of this thread alone, and idle afterwards.
        unsafe {
            let _ = device.queue_wait_idle(self.gpu.queue);
            self.views.drain(..).for_each(|view| device.destroy_image_view(view, None));
            self.drawn.drain(..).for_each(|semaphore| device.destroy_semaphore(semaphore, None));
            self.functions.destroy_swapchain(self.swapchain, None);
        }
        self.images.clear();
        self.swapchain = vk::SwapchainKHR::null();
    }
}

fn drawing(error: egui_ash_renderer::RendererError) -> Error {
    Error::Device { call: "drawing the user interface", reason: error.to_string() }
}

impl Drop for Presenter<'_> {
    fn drop(&mut self) {
        self.drop_images();
        self.painter.take();
        let device = &self.gpu.context.device;
        // SAFETY: every frame was waited for.
        unsafe {
            device.destroy_semaphore(self.acquired, None);
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
