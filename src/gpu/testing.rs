//! A device for the tests of this crate.

use std::sync::OnceLock;

use super::{Gpu, GpuError, GpuOptions};

/// One device for all tests of a process, with the validation layer on where it is installed: then every wait fails on
/// its messages.
pub(crate) fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| {
        let open = |validate| {
            Gpu::new(&GpuOptions {
                device: None,
                validate,
            })
        };
        match open(true) {
            Err(GpuError::NoValidation) => open(false),
            opened => opened,
        }
        .expect("a Vulkan device (tools/setup.sh installs lavapipe)")
    })
}
