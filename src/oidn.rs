//! Open Image Denoise where it is installed, any version from 1.4 on: loaded at run time, and only where somebody asks for it.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::{NonNull, null};

use glam::Vec3;
use libloading::Library;

use crate::error::{Error, Result};

/// The library's names, the newest first.
const NAMES: &[&str] = if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.1.dylib", "libOpenImageDenoise.dylib"]
} else if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0", "libOpenImageDenoise.so"]
};
/// `OIDN_DEVICE_TYPE_CPU`: the one that reads the host's memory everywhere.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`
const FLOAT3: c_int = 3;

/// Of a device and of a filter.
type Handle = NonNull<c_void>;

/// The functions that are called, in the order of a run.
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Option<Handle>,
    commit_device: unsafe extern "C" fn(Handle),
    number_of_device: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    error_of_device: unsafe extern "C" fn(Option<Handle>, *mut *const c_char) -> c_int,
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Option<Handle>,
    /// Name, memory, format, width, height; offset, bytes of a pixel and of a row, 0 where they follow from these.
    set_image: unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_switch: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
    release_device: unsafe extern "C" fn(Handle),
}

/// A device of the library.
pub(crate) struct Denoiser {
    functions: Functions,
    device: Handle,
    /// Such as 2.3.3.
    pub version: String,
}

/// Noise-free layers of what is seen first.
pub(crate) struct Guides<'a> {
    pub albedo: &'a [Vec3],
    pub normal: &'a [Vec3],
}

impl Denoiser {
    /// Fails where the library is not installed.
    pub(crate) fn open() -> Result<Denoiser> {
        let absent = |reason: &str| {
            let remedy = "install Open Image Denoise (package oidn or libopenimagedenoise of many systems, or its release from openimagedenoise.org with its lib folder in LD_LIBRARY_PATH), or omit `denoise`";
            Error::Denoiser { reason: format!("{reason}; {remedy}") }
        };
        // SAFETY: the library is what the system has under this name; its initialisers are trusted.
        let library = NAMES.iter().find_map(|name| unsafe { Library::new(name) }.ok()).ok_or_else(|| absent("is not installed"))?;
        // It stays: threads of its own outlive its devices, and would run code that is gone.
        let library: &'static Library = Box::leak(Box::new(library));
        let functions = Functions::of(library).ok_or_else(|| absent("is older than version 1.4"))?;
        // SAFETY: the functions have the types of the library's header.
        let device = unsafe { (functions.new_device)(CPU) }.ok_or_else(|| Error::Denoiser { reason: "makes no device".to_owned() })?;
        let mut denoiser = Denoiser { functions, device, version: String::new() };
        // SAFETY: the device is alive, and the name ends with a zero byte.
        let version = unsafe {
            (denoiser.functions.commit_device)(device);
            (denoiser.functions.number_of_device)(device, c"version".as_ptr())
        };
        denoiser.check()?;
        denoiser.version = format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100);
        Ok(denoiser)
    }

    /// A picture of linear light without its noise.
    pub(crate) fn denoise(&self, (width, height): (u32, u32), light: &[Vec3], guides: &Guides) -> Result<Vec<Vec3>> {
        let pixels = width as usize * height as usize;
        assert_eq!([light.len(), guides.albedo.len(), guides.normal.len()], [pixels; 3], "{width} x {height} pixels");
        let mut denoised = vec![Vec3::ZERO; pixels];
        let functions = &self.functions;
        // SAFETY: the device is alive, and names end with a zero byte.
        let filter = unsafe { (functions.new_filter)(self.device, c"RT".as_ptr()) };
        let Some(filter) = filter else {
            return self.check().and_then(|()| Err(Error::Denoiser { reason: "makes no filter".to_owned() }));
        };
        let image = |name: &CStr, memory: *mut Vec3| {
            // SAFETY: the memory holds three floats per pixel, and outlives the filter, which writes to no other image than its output.
            unsafe { (functions.set_image)(filter, name.as_ptr(), memory.cast(), FLOAT3, width as usize, height as usize, 0, 0, 0) };
        };
        image(c"color", light.as_ptr().cast_mut());
        image(c"albedo", guides.albedo.as_ptr().cast_mut());
        image(c"normal", guides.normal.as_ptr().cast_mut());
        image(c"output", denoised.as_mut_ptr());
        // SAFETY: the filter is alive until it is released, and so is all memory that it was given.
        unsafe {
            (functions.set_switch)(filter, c"hdr".as_ptr(), true);
            (functions.set_switch)(filter, c"cleanAux".as_ptr(), true);
            (functions.commit_filter)(filter);
            (functions.execute_filter)(filter);
            (functions.release_filter)(filter);
        }
        self.check().map(|()| denoised)
    }

    /// Fails if a call has failed since the last check.
    fn check(&self) -> Result<()> {
        let mut message = null();
        // SAFETY: the device is alive; a message is valid until the next call.
        let reason = unsafe {
            match (self.functions.error_of_device)(Some(self.device), &raw mut message) {
                0 => return Ok(()),
                code if message.is_null() => format!("fails with code {code}"),
                _ => format!("fails: {}", CStr::from_ptr(message).to_string_lossy()),
            }
        };
        Err(Error::Denoiser { reason })
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        // SAFETY: nothing else uses the device.
        unsafe { (self.functions.release_device)(self.device) };
    }
}

impl Functions {
    /// `None` where the library lacks one of them.
    fn of(library: &Library) -> Option<Functions> {
        /// Under the first of these names that it has.
        fn find<T: Copy>(library: &Library, names: &[&CStr]) -> Option<T> {
            // SAFETY: the caller's type is that of the library's header.
            names.iter().find_map(|name| unsafe { library.get::<T>(name.to_bytes_with_nul()) }.ok()).map(|function| *function)
        }
        Some(Functions {
            new_device: find(library, &[c"oidnNewDevice"])?,
            commit_device: find(library, &[c"oidnCommitDevice"])?,
            // Renamed in version 2.
            number_of_device: find(library, &[c"oidnGetDeviceInt", c"oidnGetDevice1i"])?,
            error_of_device: find(library, &[c"oidnGetDeviceError"])?,
            new_filter: find(library, &[c"oidnNewFilter"])?,
            set_image: find(library, &[c"oidnSetSharedFilterImage"])?,
            set_switch: find(library, &[c"oidnSetFilterBool", c"oidnSetFilter1b"])?,
            commit_filter: find(library, &[c"oidnCommitFilter"])?,
            execute_filter: find(library, &[c"oidnExecuteFilter"])?,
            release_filter: find(library, &[c"oidnReleaseFilter"])?,
            release_device: find(library, &[c"oidnReleaseDevice"])?,
        })
    }
}
