//! Graphics pipelines: vertices are pulled through addresses in push constants, images come as set 0.

use ash::vk;

use super::error::{GpuError, Result};
use super::garbage::Garbage;
use super::image::Format;
use super::{Gpu, Shader};

/// Push constants that every device offers, bytes.
const MAX_PUSH: u32 = 128;

/// What becomes of the colour that is there already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// It goes.
    Replace,
    /// It shows through; the new colour has been multiplied by its alpha.
    Premultiplied,
}

/// What a draw call's vertices are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// Three make a triangle.
    Triangles,
    /// Two make a line.
    Lines,
}

/// How depth is used. Nearer is greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthUse {
    /// There is none.
    None,
    /// Hides what lies behind, and is written.
    Write,
    /// Hides what lies behind.
    Test,
}

/// What a graphics pipeline is to be.
#[derive(Clone, Copy, Debug)]
pub struct GraphicsOptions {
    /// Of the target's pixels.
    pub format: Format,
    /// Of a pixel.
    pub samples: u32,
    /// Images in set 0.
    pub textures: u32,
    /// With or without, and which way.
    pub depth: DepthUse,
    /// Onto what is there.
    pub blend: Blend,
    /// Of the vertices.
    pub topology: Topology,
}

/// A graphics pipeline.
pub struct GraphicsPipeline {
    gpu: Gpu,
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) push_bytes: u32,
    pub(super) textures: u32,
    pub(super) name: &'static str,
}

impl Gpu {
    /// Builds a pipeline of a vertex and a fragment shader, which see the same push constants; `constants` are the fragment
    /// shader's specialization constants 0, 1, 2...
    pub fn graphics(
        &self,
        vertex: Shader,
        fragment: Shader,
        constants: &[u32],
        options: &GraphicsOptions,
    ) -> Result<GraphicsPipeline> {
        let push_bytes = vertex.push_bytes.max(fragment.push_bytes);
        assert!(
            push_bytes <= MAX_PUSH,
            "{}: push constants are too large",
            vertex.name
        );
        let device = &self.0.device;
        let name = fragment.name;
        let ranges = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT,
            offset: 0,
            size: push_bytes.max(4),
        }];
        let set = self.set_layout(options.textures)?;
        let sets = [set];
        let layout_info = vk::PipelineLayoutCreateInfo::default()
            .push_constant_ranges(&ranges)
            .set_layouts(&sets);
        // SAFETY: the SPIR-V comes from the build's compiler; pointers outlive the calls; what failures leave is freed.
        unsafe {
            let layout = device.create_pipeline_layout(&layout_info, None);
            device.destroy_descriptor_set_layout(set, None);
            let layout =
                layout.map_err(GpuError::call(format!("vkCreatePipelineLayout ({name})")))?;
            let mut pipeline = GraphicsPipeline {
                gpu: self.clone(),
                raw: vk::Pipeline::null(),
                layout,
                push_bytes,
                textures: options.textures,
                name,
            };
            let modules = [self.module(vertex)?, vk::ShaderModule::null()];
            let modules = match self.module(fragment) {
                Ok(module) => [modules[0], module],
                Err(error) => {
                    device.destroy_shader_module(modules[0], None);
                    return Err(error);
                }
            };
            let made = self.create(&modules, constants, layout, options);
            for module in modules {
                device.destroy_shader_module(module, None);
            }
            pipeline.raw = made.map_err(GpuError::call(format!(
                "vkCreateGraphicsPipelines ({name})"
            )))?;
            self.set_name(pipeline.raw, name);
            Ok(pipeline)
        }
    }

    fn module(&self, shader: Shader) -> Result<vk::ShaderModule> {
        let code = shader.words();
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the SPIR-V comes from the build's compiler; the pointer outlives the call.
        unsafe { self.0.device.create_shader_module(&info, None) }.map_err(GpuError::call(format!(
            "vkCreateShaderModule ({})",
            shader.name
        )))
    }

    /// # Safety
    /// Modules and layout are alive and fit together.
    unsafe fn create(
        &self,
        modules: &[vk::ShaderModule; 2],
        constants: &[u32],
        layout: vk::PipelineLayout,
        options: &GraphicsOptions,
    ) -> std::result::Result<vk::Pipeline, vk::Result> {
        let stage = |stage, module| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(stage)
                .module(module)
                .name(c"main")
        };
        let entries = super::pipeline::entries(constants);
        let specialization = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(constants));
        let stages = [
            stage(vk::ShaderStageFlags::VERTEX, modules[0]),
            stage(vk::ShaderStageFlags::FRAGMENT, modules[1]).specialization_info(&specialization),
        ];
        let vertices = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(match options.topology {
                Topology::Triangles => vk::PrimitiveTopology::TRIANGLE_LIST,
                Topology::Lines => vk::PrimitiveTopology::LINE_LIST,
            });
        let viewport = vk::PipelineViewportStateCreateInfo::default()
            .viewport_count(1)
            .scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::from_raw(options.samples));
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(options.depth != DepthUse::None)
            .depth_write_enable(options.depth == DepthUse::Write)
            .depth_compare_op(vk::CompareOp::GREATER_OR_EQUAL);
        let attachment = vk::PipelineColorBlendAttachmentState {
            blend_enable: u32::from(options.blend != Blend::Replace),
            src_color_blend_factor: vk::BlendFactor::ONE,
            dst_color_blend_factor: vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
            color_blend_op: vk::BlendOp::ADD,
            src_alpha_blend_factor: vk::BlendFactor::ONE,
            dst_alpha_blend_factor: vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
            alpha_blend_op: vk::BlendOp::ADD,
            color_write_mask: vk::ColorComponentFlags::RGBA,
        };
        let attachments = [attachment];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let states = [
            vk::DynamicState::VIEWPORT,
            vk::DynamicState::SCISSOR,
            vk::DynamicState::CULL_MODE,
            vk::DynamicState::FRONT_FACE,
        ];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);
        let formats = [options.format.raw()];
        let mut targets =
            vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats);
        if options.depth != DepthUse::None {
            targets = targets.depth_attachment_format(Format::Depth.raw());
        }
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertices)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout)
            .push_next(&mut targets)];
        // SAFETY: the caller's promise; all pointers outlive the call.
        unsafe {
            self.0
                .device
                .create_graphics_pipelines(vk::PipelineCache::null(), &info, None)
        }
        .map(|pipelines| pipelines[0])
        .map_err(|(_, result)| result)
    }
}

impl Drop for GraphicsPipeline {
    fn drop(&mut self) {
        self.gpu
            .queue()
            .discard(Garbage::Pipeline(self.raw, self.layout));
    }
}
