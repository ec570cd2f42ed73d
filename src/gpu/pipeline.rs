//! Compute pipelines from embedded SPIR-V. No descriptors: shaders get addresses in push constants.

use ash::vk;

use super::Gpu;
use super::error::{GpuError, Result};
use super::garbage::Garbage;

/// Push constants that every device offers, bytes.
const MAX_PUSH: u32 = 128;

/// A shader of `glsl/`, compiled by the build script.
#[derive(Clone, Copy)]
pub struct Shader {
    /// File stem.
    pub name: &'static str,
    /// SPIR-V bytes.
    pub spirv: &'static [u8],
    /// Size of its push constant block, read from the SPIR-V.
    pub push_bytes: u32,
    /// Its local size, if it is a compute shader.
    pub local_size: [u32; 3],
}

impl Shader {
    /// The SPIR-V as words.
    pub(super) fn words(&self) -> Vec<u32> {
        self.spirv
            .chunks_exact(4)
            .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]))
            .collect()
    }
}

/// A compute pipeline.
pub struct Pipeline {
    gpu: Gpu,
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) shader: Shader,
}

/// Where specialization constants 0, 1, 2... lie in `constants`.
pub(super) fn entries(constants: &[u32]) -> Vec<vk::SpecializationMapEntry> {
    let entry = |id| vk::SpecializationMapEntry {
        constant_id: id,
        offset: id * 4,
        size: 4,
    };
    (0..constants.len() as u32).map(entry).collect()
}

impl Gpu {
    /// Builds `shader` with `constants` as its specialization constants 0, 1, 2...
    pub fn pipeline(&self, shader: Shader, constants: &[u32]) -> Result<Pipeline> {
        assert!(
            shader.push_bytes <= MAX_PUSH,
            "{}: push constants are too large",
            shader.name
        );
        let device = &self.0.device;
        let name = shader.name;
        let _span = tracing::debug_span!("pipeline", shader = name).entered();
        let code = shader.words();
        let entries = entries(constants);
        let specialization = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(constants));
        let ranges = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::COMPUTE,
            offset: 0,
            size: shader.push_bytes.max(4),
        }];
        let layout_info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges);
        // SAFETY: the SPIR-V comes from the build's compiler; pointers outlive the calls; failures free what was made.
        unsafe {
            let module = device
                .create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&code), None)
                .map_err(GpuError::call(format!("vkCreateShaderModule ({name})")))?;
            let made = device
                .create_pipeline_layout(&layout_info, None)
                .and_then(|layout| {
                    let stage = vk::PipelineShaderStageCreateInfo::default()
                        .stage(vk::ShaderStageFlags::COMPUTE)
                        .module(module)
                        .name(c"main")
                        .specialization_info(&specialization);
                    let info = [vk::ComputePipelineCreateInfo::default()
                        .stage(stage)
                        .layout(layout)];
                    device
                        .create_compute_pipelines(vk::PipelineCache::null(), &info, None)
                        .map_or_else(
                            |(_, result)| {
                                device.destroy_pipeline_layout(layout, None);
                                Err(result)
                            },
                            |pipelines| Ok((pipelines[0], layout)),
                        )
                });
            device.destroy_shader_module(module, None);
            let (raw, layout) =
                made.map_err(GpuError::call(format!("vkCreateComputePipelines ({name})")))?;
            self.set_name(raw, name);
            Ok(Pipeline {
                gpu: self.clone(),
                raw,
                layout,
                shader,
            })
        }
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.gpu
            .queue()
            .discard(Garbage::Pipeline(self.raw, self.layout));
    }
}
