//! Recording of graphics work: targets and draws.
//!
//! As with dispatches, what shaders read through addresses is the caller's to order by barriers; so is what is drawn and
//! then sampled.

use std::ops::Range;

use ash::vk;
use bytemuck::Pod;

use super::commands::{Commands, Stage};
use super::image::Image;
use super::{Buffer, GraphicsPipeline, Textures};

/// What is drawn into.
#[derive(Clone, Copy)]
pub struct Targets<'a> {
    /// Colour.
    pub color: &'a Image,
    /// Gets the mean of the colour's samples at the end.
    pub resolve: Option<&'a Image>,
    /// Depth.
    pub depth: Option<DepthTarget<'a>>,
    /// What colour begins as; none: what it was.
    pub clear: Option<[f32; 4]>,
}

/// Depth that is drawn with.
#[derive(Clone, Copy)]
pub struct DepthTarget<'a> {
    /// Where it lies.
    pub image: &'a Image,
    /// It begins as what was kept, instead of as 0: infinitely far.
    pub goes_on: bool,
    /// It is needed afterwards.
    pub kept: bool,
}

/// Which sides of triangles are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Both.
    Both,
    /// Those that are counter-clockwise as seen.
    Front,
    /// Those that are clockwise: the front of what is mirrored.
    Back,
}

/// Draws into targets.
pub struct Drawing<'a> {
    cmd: &'a mut Commands,
    bound: Option<(vk::PipelineLayout, u32, &'static str)>,
}

impl Commands {
    /// Draws into `targets` what `record` records. The viewport is all of them.
    pub fn draw<T>(&mut self, targets: &Targets, record: impl FnOnce(&mut Drawing) -> T) -> T {
        let size = targets.color.size();
        let attachment = |image: &Image| {
            vk::RenderingAttachmentInfo::default()
                .image_view(image.view)
                .image_layout(image.drawn_layout())
        };
        let mut color = attachment(targets.color).store_op(if targets.resolve.is_some() {
            vk::AttachmentStoreOp::DONT_CARE
        } else {
            vk::AttachmentStoreOp::STORE
        });
        color = match targets.clear {
            Some(float32) => {
                color
                    .load_op(vk::AttachmentLoadOp::CLEAR)
                    .clear_value(vk::ClearValue {
                        color: vk::ClearColorValue { float32 },
                    })
            }
            None => color.load_op(vk::AttachmentLoadOp::LOAD),
        };
        if let Some(resolve) = targets.resolve {
            assert_eq!(
                resolve.size(),
                size,
                "`{}` is of another size",
                resolve.name()
            );
            color = color
                .resolve_mode(vk::ResolveModeFlags::AVERAGE)
                .resolve_image_view(resolve.view)
                .resolve_image_layout(resolve.drawn_layout());
        }
        let colors = [color];
        let area = vk::Rect2D {
            offset: vk::Offset2D::default(),
            extent: vk::Extent2D {
                width: size[0],
                height: size[1],
            },
        };
        let mut info = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .color_attachments(&colors);
        let depth = targets.depth.map(|depth| {
            let image = depth.image;
            assert_eq!(image.size(), size, "`{}` is of another size", image.name());
            attachment(image)
                .load_op(if depth.goes_on {
                    vk::AttachmentLoadOp::LOAD
                } else {
                    vk::AttachmentLoadOp::CLEAR
                })
                .store_op(if depth.kept {
                    vk::AttachmentStoreOp::STORE
                } else {
                    vk::AttachmentStoreOp::DONT_CARE
                })
                .clear_value(vk::ClearValue {
                    depth_stencil: vk::ClearDepthStencilValue {
                        depth: 0.0,
                        stencil: 0,
                    },
                })
        });
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        // A negative height: +Y is up, as everywhere else.
        let viewport = [vk::Viewport {
            x: 0.0,
            y: size[1] as f32,
            width: size[0] as f32,
            height: -(size[1] as f32),
            min_depth: 0.0,
            max_depth: 1.0,
        }];
        let raw = self.raw();
        let depth = targets.depth.map(|depth| depth.image);
        let images: Vec<&Image> = [Some(targets.color), targets.resolve, depth]
            .into_iter()
            .flatten()
            .filter(|image| image.layout() != image.drawn_layout())
            .collect();
        for image in &images {
            self.transition(image, image.layout(), image.drawn_layout(), Stage::All);
        }
        // SAFETY: the command buffer is recording; views and structures are alive.
        unsafe {
            self.device().cmd_begin_rendering(raw, &info);
            self.device().cmd_set_viewport(raw, 0, &viewport);
            self.device().cmd_set_scissor(raw, 0, &[area]);
        }
        let mut drawing = Drawing {
            cmd: self,
            bound: None,
        };
        drawing.sides(Sides::Both);
        let result = record(&mut drawing);
        // SAFETY: as above.
        unsafe { self.device().cmd_end_rendering(raw) };
        for image in &images {
            self.transition(image, image.drawn_layout(), image.layout(), Stage::All);
        }
        result
    }

    /// Brings an image from one layout into another.
    pub(super) fn transition(
        &mut self,
        image: &Image,
        from: vk::ImageLayout,
        to: vk::ImageLayout,
        stage: Stage,
    ) {
        self.transition_levels(image, 0..image.mips(), [from, to], stage);
    }

    /// As [`Commands::transition`], some levels alone.
    pub(super) fn transition_levels(
        &mut self,
        image: &Image,
        levels: Range<u32>,
        [from, to]: [vk::ImageLayout; 2],
        stage: Stage,
    ) {
        let access = vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE;
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(stage.flags())
            .src_access_mask(access)
            .dst_stage_mask(stage.flags())
            .dst_access_mask(access)
            .old_layout(from)
            .new_layout(to)
            .image(image.handle)
            .subresource_range(image.levels(levels))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the command buffer is recording, the image is alive.
        unsafe { self.device().cmd_pipeline_barrier2(self.raw(), &info) };
    }
}

impl Drawing<'_> {
    /// The pipeline of the next draws.
    pub fn pipeline(&mut self, pipeline: &GraphicsPipeline) {
        // SAFETY: the pipeline is alive.
        unsafe {
            self.cmd.device().cmd_bind_pipeline(
                self.cmd.raw(),
                vk::PipelineBindPoint::GRAPHICS,
                pipeline.raw,
            );
        }
        self.bound = Some((pipeline.layout, pipeline.push_bytes, pipeline.name));
    }

    /// The images of the next draws, for a pipeline that has as many.
    pub fn textures(&mut self, pipeline: &GraphicsPipeline, textures: &Textures) {
        assert_eq!(
            pipeline.textures, textures.count,
            "{}: another number of images than its shader's",
            pipeline.name
        );
        // SAFETY: set and layout are alive and alike.
        unsafe {
            self.cmd.device().cmd_bind_descriptor_sets(
                self.cmd.raw(),
                vk::PipelineBindPoint::GRAPHICS,
                pipeline.layout,
                0,
                &[textures.set],
                &[],
            );
        }
    }

    /// The push constants of the next draws.
    pub fn push<P: Pod>(&mut self, push: &P) {
        let (layout, bytes, name) = self.bound.expect("a pipeline comes first");
        assert_eq!(
            size_of::<P>(),
            bytes as usize,
            "{name}: push constants differ from the shader's"
        );
        // SAFETY: the size is the layout's range's.
        unsafe {
            self.cmd.device().cmd_push_constants(
                self.cmd.raw(),
                layout,
                vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT,
                0,
                bytemuck::bytes_of(push),
            );
        }
    }

    /// Which sides the next draws show.
    pub fn sides(&mut self, sides: Sides) {
        let (cull, front) = match sides {
            Sides::Both => (vk::CullModeFlags::NONE, vk::FrontFace::COUNTER_CLOCKWISE),
            Sides::Front => (vk::CullModeFlags::BACK, vk::FrontFace::COUNTER_CLOCKWISE),
            Sides::Back => (vk::CullModeFlags::BACK, vk::FrontFace::CLOCKWISE),
        };
        let raw = self.cmd.raw();
        // SAFETY: the command buffer is recording.
        unsafe {
            self.cmd.device().cmd_set_cull_mode(raw, cull);
            self.cmd.device().cmd_set_front_face(raw, front);
        }
    }

    /// Nothing is drawn outside of `size` pixels from `at` on.
    pub fn scissor(&mut self, at: [u32; 2], size: [u32; 2]) {
        let area = [vk::Rect2D {
            offset: vk::Offset2D {
                x: at[0] as i32,
                y: at[1] as i32,
            },
            extent: vk::Extent2D {
                width: size[0],
                height: size[1],
            },
        }];
        // SAFETY: the command buffer is recording.
        unsafe { self.cmd.device().cmd_set_scissor(self.cmd.raw(), 0, &area) };
    }

    /// Draws the vertices of these numbers.
    pub fn vertices(&mut self, range: Range<u32>) {
        assert!(self.bound.is_some(), "a pipeline comes first");
        let (raw, count) = (self.cmd.raw(), range.len() as u32);
        if count > 0 {
            // SAFETY: a pipeline is bound.
            unsafe { self.cmd.device().cmd_draw(raw, count, 1, range.start, 0) };
        }
    }

    /// Where the next indexed draws find their indices: u32.
    pub fn indices(&mut self, buffer: &Buffer) {
        // SAFETY: the buffer is alive.
        unsafe {
            self.cmd.device().cmd_bind_index_buffer(
                self.cmd.raw(),
                buffer.raw.handle,
                0,
                vk::IndexType::UINT32,
            );
        }
    }

    /// Draws the vertices that a range of indices names; `buffer` is the one that was bound.
    pub fn indexed(&mut self, buffer: &Buffer, range: Range<u32>) {
        assert!(self.bound.is_some(), "a pipeline comes first");
        assert!(
            u64::from(range.end) * 4 <= buffer.size(),
            "a draw reads past the end of `{}`",
            buffer.name()
        );
        if !range.is_empty() {
            // SAFETY: a pipeline is bound, the indices are there.
            unsafe {
                self.cmd.device().cmd_draw_indexed(
                    self.cmd.raw(),
                    range.len() as u32,
                    1,
                    range.start,
                    0,
                    0,
                );
            }
        }
    }
}
