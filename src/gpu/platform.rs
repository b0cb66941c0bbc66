//! What differs between Linux, Windows and macOS where Vulkan is concerned: how the loader is called and where it is, and what
//! drivers ask for that are Vulkan on top of another interface, as MoltenVK is on Apple's Metal. Nothing else asks which
//! system it runs on.

use std::ffi::CStr;

use ash::vk;

/// Where the Vulkan loader may be beside the system's own places. Homebrew's folders are not among those that macOS searches; where
/// there is MoltenVK without a loader, it is its own.
const ELSEWHERE: &[&str] = if cfg!(target_os = "macos") {
    &[
        "/opt/homebrew/lib/libvulkan.1.dylib",
        "/usr/local/lib/libvulkan.1.dylib",
        "libMoltenVK.dylib",
        "/opt/homebrew/lib/libMoltenVK.dylib",
        "/usr/local/lib/libMoltenVK.dylib",
    ]
} else {
    &[]
};

/// What a user without the loader reads.
pub(super) const NO_LOADER: &str =
    if cfg!(windows) { "the Vulkan loader (vulkan-1.dll) is not installed" } else { "the Vulkan loader (libvulkan) is not installed" };

/// Loads the loader at run time.
pub(super) fn load() -> Result<ash::Entry, ash::LoadingError> {
    // SAFETY: the loader is the system's own library; its initialisers are trusted.
    let of_system = unsafe { ash::Entry::load() };
    of_system.or_else(|error| {
        // SAFETY: the same of libraries that the user has installed.
        let load = |path: &&str| unsafe { ash::Entry::load_from(path) }.ok();
        ELSEWHERE.iter().find_map(load).ok_or(error)
    })
}

/// Extensions of the instance, and its flags, so that devices of drivers on top of another interface are listed too: without them
/// MoltenVK's device is not there.
pub(super) fn instance(present: &[vk::ExtensionProperties]) -> (Vec<&'static CStr>, vk::InstanceCreateFlags) {
    const PORTABILITY: &CStr = ash::khr::portability_enumeration::NAME;
    if has(present, PORTABILITY) {
        (vec![PORTABILITY], vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR)
    } else {
        (Vec::new(), vk::InstanceCreateFlags::empty())
    }
}

/// Extensions that a device wants to be enabled where it has them. A device that is a part of Vulkan only, as MoltenVK's, may lack what
/// is about drawing; compute shaders lack nothing by it.
pub(super) fn device(present: &[vk::ExtensionProperties]) -> Vec<&'static CStr> {
    const SUBSET: &CStr = ash::khr::portability_subset::NAME;
    [SUBSET].into_iter().filter(|name| has(present, name)).collect()
}

pub(super) fn has(present: &[vk::ExtensionProperties], name: &CStr) -> bool {
    present.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn properties(names: &[&CStr]) -> Vec<vk::ExtensionProperties> {
        let named = |name: &&CStr| vk::ExtensionProperties::default().extension_name(name).expect("the name fits");
        names.iter().map(named).collect()
    }

    #[test]
    fn portability_is_asked_for_where_it_is() {
        let other = ash::khr::surface::NAME;
        assert_eq!(instance(&properties(&[other])), (vec![], vk::InstanceCreateFlags::empty()));
        let flag = vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        assert_eq!(instance(&properties(&[other, c"VK_KHR_portability_enumeration"])), (vec![c"VK_KHR_portability_enumeration"], flag));
        assert!(device(&properties(&[other])).is_empty());
        assert_eq!(device(&properties(&[c"VK_KHR_portability_subset", other])), [c"VK_KHR_portability_subset"]);
    }
}
