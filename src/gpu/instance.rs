//! The loader, the instance, the devices it offers, and the validation layer's voice.

use std::ffi::{CStr, c_void};
use std::sync::Mutex;

use ash::{ext, vk};

use super::error::{GpuError, Result};
use super::features::{self, Features};

/// What [`super::Gpu::new`] is asked for.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Index or part of the name, as `rebake devices` lists them; none picks discrete before integrated before CPU.
    pub device: Option<String>,
    /// Run the Khronos validation layer; a message is an error.
    pub validate: bool,
}

/// A device that the loader offers.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// For `--device`.
    pub index: usize,
    /// Vulkan's name for it.
    pub name: String,
    /// Driver name and version.
    pub driver: String,
    /// Discrete, integrated, virtual, CPU or other.
    pub kind: &'static str,
    /// Bytes of its largest device-local heap.
    pub memory: u64,
    /// Required features it does not have, by Vulkan's names.
    pub missing: Vec<String>,
    pub(super) handle: vk::PhysicalDevice,
}

/// Messages of the validation layer, waiting to become an error.
#[derive(Default)]
pub(super) struct Messages(Mutex<Vec<String>>);

impl Messages {
    pub(super) fn take(&self) -> Option<String> {
        let mut messages = self.0.lock().unwrap_or_else(|e| e.into_inner());
        (!messages.is_empty()).then(|| std::mem::take(&mut *messages).join("\n"))
    }
}

/// The instance and its debug messenger.
pub(super) struct Instance {
    // Declared before `entry`: the loader must outlive everything it made.
    pub(super) raw: ash::Instance,
    debug: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(super) has_debug_utils: bool,
    pub(super) messages: Box<Messages>,
    pub(super) entry: ash::Entry,
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes a valid structure; `user` is the boxed `Messages` that the instance owns.
    let (text, messages) = unsafe {
        let data = &*data;
        let text = if data.p_message.is_null() {
            c""
        } else {
            CStr::from_ptr(data.p_message)
        };
        (
            text.to_string_lossy().into_owned(),
            &*user.cast::<Messages>(),
        )
    };
    if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
        tracing::error!("validation: {text}");
    } else {
        tracing::warn!("validation: {text}");
    }
    messages
        .0
        .lock()
        .unwrap_or_else(|e| e.into_inner())
        .push(text);
    vk::FALSE
}

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

impl Instance {
    /// `window`: what the window system needs.
    pub(super) fn new(validate: bool, window: &[*const std::ffi::c_char]) -> Result<Self> {
        // SAFETY: the loader is a system library without load-time preconditions; it is kept for as long as `raw`.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoLoader(e.to_string()))?;
        // SAFETY: plain enumeration calls and an instance creation whose pointers outlive the calls.
        unsafe {
            if validate {
                let layers = entry
                    .enumerate_instance_layer_properties()
                    .map_err(GpuError::call("vkEnumerateInstanceLayerProperties"))?;
                if !layers
                    .iter()
                    .any(|l| l.layer_name_as_c_str() == Ok(VALIDATION))
                {
                    return Err(GpuError::NoValidation);
                }
            }
            let extensions = entry
                .enumerate_instance_extension_properties(None)
                .map_err(GpuError::call("vkEnumerateInstanceExtensionProperties"))?;
            let has_debug_utils = extensions
                .iter()
                .any(|e| e.extension_name_as_c_str() == Ok(ext::debug_utils::NAME))
                || validate;

            let app = vk::ApplicationInfo::default()
                .application_name(c"rebake")
                .api_version(vk::API_VERSION_1_3);
            let layer_names: Vec<_> = validate
                .then_some(VALIDATION.as_ptr())
                .into_iter()
                .collect();
            let extension_names: Vec<_> = has_debug_utils
                .then_some(ext::debug_utils::NAME.as_ptr())
                .into_iter()
                .chain(window.iter().copied())
                .collect();
            let info = vk::InstanceCreateInfo::default()
                .application_info(&app)
                .enabled_layer_names(&layer_names)
                .enabled_extension_names(&extension_names);
            let raw = entry
                .create_instance(&info, None)
                .map_err(|result| match result {
                    vk::Result::ERROR_EXTENSION_NOT_PRESENT => {
                        GpuError::NoWindow("the Vulkan loader knows no such window system".into())
                    }
                    vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
                        GpuError::NoDevice("(no driver answers)".into())
                    }
                    result => GpuError::Call {
                        call: "vkCreateInstance".into(),
                        result,
                    },
                })?;

            let mut instance = Self {
                raw,
                debug: None,
                has_debug_utils,
                messages: Box::default(),
                entry,
            };
            if validate {
                let debug = ext::debug_utils::Instance::new(&instance.entry, &instance.raw);
                let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                    .message_severity(
                        vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                            | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                    )
                    .message_type(
                        vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                            | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
                    )
                    .pfn_user_callback(Some(on_message))
                    .user_data(
                        std::ptr::from_ref::<Messages>(&instance.messages)
                            .cast_mut()
                            .cast(),
                    );
                let messenger = debug
                    .create_debug_utils_messenger(&info, None)
                    .map_err(GpuError::call("vkCreateDebugUtilsMessengerEXT"))?;
                instance.debug = Some((debug, messenger));
            }
            Ok(instance)
        }
    }

    /// All devices, in the loader's order.
    pub(super) fn devices(&self) -> Result<Vec<DeviceInfo>> {
        // SAFETY: queries on handles that this instance just gave out.
        unsafe {
            let handles = match self.raw.enumerate_physical_devices() {
                Ok(handles) => handles,
                Err(vk::Result::ERROR_INITIALIZATION_FAILED) => Vec::new(),
                Err(result) => {
                    return Err(GpuError::Call {
                        call: "vkEnumeratePhysicalDevices".into(),
                        result,
                    });
                }
            };
            Ok(handles
                .into_iter()
                .enumerate()
                .map(|(index, handle)| self.describe(index, handle))
                .collect())
        }
    }

    unsafe fn describe(&self, index: usize, handle: vk::PhysicalDevice) -> DeviceInfo {
        // SAFETY: the caller passes a handle of this instance.
        let (properties, memory) = unsafe {
            (
                self.raw.get_physical_device_properties(handle),
                self.raw.get_physical_device_memory_properties(handle),
            )
        };
        let mut driver = format!("{:#x}", properties.driver_version);
        let missing = if properties.api_version < vk::API_VERSION_1_3 {
            vec![format!(
                "Vulkan 1.3 (it has {}.{})",
                vk::api_version_major(properties.api_version),
                vk::api_version_minor(properties.api_version)
            )]
        } else {
            let mut driver_properties = vk::PhysicalDeviceDriverProperties::default();
            let mut subgroups = vk::PhysicalDeviceSubgroupProperties::default();
            let mut properties2 = vk::PhysicalDeviceProperties2::default()
                .push_next(&mut driver_properties)
                .push_next(&mut subgroups);
            // SAFETY: as above; the chain is valid for a 1.3 device.
            unsafe {
                self.raw
                    .get_physical_device_properties2(handle, &mut properties2)
            };
            let text = |s: std::result::Result<&CStr, _>| {
                s.map_or(String::new(), |s| s.to_string_lossy().into_owned())
            };
            driver = format!(
                "{} {}",
                text(driver_properties.driver_name_as_c_str()),
                text(driver_properties.driver_info_as_c_str())
            );
            // SAFETY: as above.
            let mut missing = features::missing(&unsafe { Features::supported(&self.raw, handle) });
            if !subgroups
                .supported_operations
                .contains(vk::SubgroupFeatureFlags::ARITHMETIC)
            {
                missing.push("subgroup arithmetic".to_owned());
            }
            missing
        };
        DeviceInfo {
            index,
            name: properties
                .device_name_as_c_str()
                .map_or_else(|_| "?".into(), |s| s.to_string_lossy().into_owned()),
            driver: driver.trim().to_owned(),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
                vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
                vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
                vk::PhysicalDeviceType::CPU => "CPU",
                _ => "other",
            },
            memory: memory
                .memory_heaps_as_slice()
                .iter()
                .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
                .map(|heap| heap.size)
                .max()
                .unwrap_or(0),
            missing,
            handle,
        }
    }

    /// Whether a device can tell its time together with the host's.
    pub(super) fn calibrates(&self, device: &DeviceInfo) -> bool {
        let name = ext::calibrated_timestamps::NAME;
        // SAFETY: the handle is one of this instance's; the function is asked for only where the extension is.
        unsafe {
            let extensions = self
                .raw
                .enumerate_device_extension_properties(device.handle)
                .unwrap_or_default();
            let mut names = extensions.iter().map(|e| e.extension_name_as_c_str());
            if !names.any(|n| n == Ok(name)) {
                return false;
            }
            let loader = ext::calibrated_timestamps::Instance::new(&self.entry, &self.raw);
            let domains = loader
                .get_physical_device_calibrateable_time_domains(device.handle)
                .unwrap_or_default();
            domains.contains(&vk::TimeDomainEXT::DEVICE)
        }
    }

    /// The device that `wanted` names (index, or part of the name in any case), or the best there is.
    pub(super) fn choose(&self, wanted: Option<&str>) -> Result<DeviceInfo> {
        let devices = self.devices()?;
        let chosen = match wanted {
            Some(wanted) => {
                let index = wanted.parse::<usize>().ok();
                devices.into_iter().find(|d| {
                    index.map_or_else(
                        || d.name.to_lowercase().contains(&wanted.to_lowercase()),
                        |i| d.index == i,
                    )
                })
            }
            None => {
                let rank = |d: &DeviceInfo| match d.kind {
                    "discrete" => 0,
                    "integrated" => 1,
                    "virtual" => 2,
                    _ => 3,
                };
                devices
                    .into_iter()
                    .min_by_key(|d| (!d.missing.is_empty(), rank(d), d.index))
            }
        };
        let chosen = chosen.ok_or_else(|| {
            GpuError::NoDevice(wanted.map_or("was found".into(), |w| format!("matches `{w}`")))
        })?;
        if !chosen.missing.is_empty() {
            return Err(GpuError::Lacks {
                device: chosen.name,
                missing: chosen.missing.join(", "),
            });
        }
        Ok(chosen)
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: everything made from this instance is gone: `Gpu` drops its device first.
        unsafe {
            if let Some((debug, messenger)) = self.debug.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}
