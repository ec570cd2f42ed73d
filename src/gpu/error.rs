//! What can go wrong on the device, with the name of the call or resource and the way out.

use ash::vk;

/// A failure of the driver or the device.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No Vulkan loader or driver.
    #[error(
        "no Vulkan loader was found ({0}); install libvulkan1 and a driver (mesa-vulkan-drivers has lavapipe, which needs no GPU)"
    )]
    NoLoader(String),
    /// No device at all, or none that `--device` names.
    #[error(
        "no Vulkan device {0}; `rebake devices` lists what is here (mesa-vulkan-drivers has lavapipe, which needs no GPU)"
    )]
    NoDevice(String),
    /// The chosen device lacks something.
    #[error(
        "{device} lacks {missing}; update its driver, or choose another with --device (`rebake devices` lists them)"
    )]
    Lacks {
        /// The device's name.
        device: String,
        /// Vulkan's names, comma-separated.
        missing: String,
    },
    /// A layer that `--validate` needs.
    #[error(
        "the layer VK_LAYER_KHRONOS_validation is not installed; install vulkan-validationlayers, or leave --validate out"
    )]
    NoValidation,
    /// The window system.
    #[error("no window can be opened: {0}; with --headless the viewer needs none")]
    NoWindow(String),
    /// An allocation failed.
    #[error(
        "out of memory: {name} needs {bytes} bytes ({reason}); lower --texels, --density or --shadow-size"
    )]
    OutOfMemory {
        /// The resource.
        name: String,
        /// Its size.
        bytes: u64,
        /// What the allocator said.
        reason: String,
    },
    /// The device stopped.
    #[error(
        "the device was lost while running `{running}`; lower --quality or --shadow-size, or try another --device (files written earlier are whole)"
    )]
    Lost {
        /// Scopes of the submission in flight.
        running: String,
    },
    /// Any other failed call.
    #[error("{call} failed: {result}")]
    Call {
        /// The Vulkan function, and what it was for.
        call: String,
        /// What it returned.
        result: vk::Result,
    },
    /// The validation layer spoke.
    #[error("the validation layer reports:\n{0}")]
    Validation(String),
}

impl GpuError {
    /// For `map_err`: names the failed call.
    pub(crate) fn call(call: impl Into<String>) -> impl FnOnce(vk::Result) -> Self {
        move |result| GpuError::Call {
            call: call.into(),
            result,
        }
    }

    /// Whether what was drawn to is gone: its window was destroyed.
    pub fn is_surface_lost(&self) -> bool {
        matches!(self, Self::Call { result, .. } if *result == vk::Result::ERROR_SURFACE_LOST_KHR)
    }
}

/// Shorthand.
pub type Result<T> = std::result::Result<T, GpuError>;
