//! The features that every device must have, by Vulkan's names. One list serves the check and the creation.

use ash::vk;

/// Feature structures that form one `pNext` chain.
#[derive(Default)]
pub(super) struct Features {
    core: vk::PhysicalDeviceFeatures,
    vulkan11: vk::PhysicalDeviceVulkan11Features<'static>,
    vulkan12: vk::PhysicalDeviceVulkan12Features<'static>,
    vulkan13: vk::PhysicalDeviceVulkan13Features<'static>,
}

impl Features {
    /// What a device supports.
    ///
    /// # Safety
    /// `device` belongs to `instance` and has Vulkan 1.3.
    pub(super) unsafe fn supported(instance: &ash::Instance, device: vk::PhysicalDevice) -> Self {
        let mut features = Features::default();
        let mut chain = features.chain();
        // SAFETY: the caller's promise; the chain is valid for 1.3.
        unsafe { instance.get_physical_device_features2(device, &mut chain) };
        features.core = chain.features;
        features
    }

    pub(super) fn chain(&mut self) -> vk::PhysicalDeviceFeatures2<'_> {
        // The structures live in `self`; the borrow keeps them in place while the chain is used.
        vk::PhysicalDeviceFeatures2::default()
            .features(self.core)
            .push_next(&mut self.vulkan11)
            .push_next(&mut self.vulkan12)
            .push_next(&mut self.vulkan13)
    }
}

impl Features {
    /// Whether draws and dispatches can be counted: for traces, which do without.
    pub(super) fn counts(&self) -> bool {
        self.core.pipeline_statistics_query == vk::TRUE
    }

    /// Switches that on as well.
    pub(super) fn with_counts(mut self, counts: bool) -> Self {
        self.core.pipeline_statistics_query = counts.into();
        self
    }
}

macro_rules! required {
    ($($chain:ident . $field:ident),* $(,)?) => {
        /// Names of the required features that `supported` has not.
        pub(super) fn missing(supported: &Features) -> Vec<String> {
            let mut names = Vec::new();
            $(if supported.$chain.$field == vk::FALSE { names.push(camel_case(stringify!($field))); })*
            names
        }

        /// All required features, switched on.
        pub(super) fn required() -> Features {
            let mut features = Features::default();
            $(features.$chain.$field = vk::TRUE;)*
            features
        }
    };
}

required! {
    core.shader_int64,
    vulkan12.buffer_device_address,
    vulkan12.shader_buffer_int64_atomics,
    vulkan12.scalar_block_layout,
    vulkan12.timeline_semaphore,
    vulkan12.host_query_reset,
    vulkan13.dynamic_rendering,
    vulkan13.synchronization2,
    vulkan13.maintenance4,
}

fn camel_case(snake: &str) -> String {
    let mut name = String::new();
    let mut upper = false;
    for c in snake.chars() {
        match (c, upper) {
            ('_', _) => upper = true,
            (c, true) => {
                name.extend(c.to_uppercase());
                upper = false;
            }
            (c, false) => name.push(c),
        }
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_supported_names_every_feature_as_vulkan_does() {
        let names = missing(&Features::default());
        assert!(names.contains(&"shaderInt64".to_owned()));
        assert!(names.contains(&"bufferDeviceAddress".to_owned()));
        assert!(missing(&required()).is_empty());
    }
}
