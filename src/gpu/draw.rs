//! Recording of graphics work: targets, draws, and the copies between buffers and images.
//!
//! As with dispatches, what shaders read through addresses is the caller's to order by barriers; so is what is drawn and
//! then sampled.

use std::ops::Range;

use ash::vk;
use bytemuck::Pod;

use super::commands::{Commands, Stage};
use super::image::{Format, Image, Textures};
use super::queue::MAX_UPLOAD;
use super::{Buffer, GraphicsPipeline, Result};

/// What is drawn into.
#[derive(Clone, Copy)]
pub struct Targets<'a> {
    /// Colour.
    pub color: &'a Image,
    /// Gets the mean of the colour's samples at the end.
    pub resolve: Option<&'a Image>,
    /// Depth, cleared to 0: infinitely far.
    pub depth: Option<&'a Image>,
    /// What colour begins as; none: what it was.
    pub clear: Option<[f32; 4]>,
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
                .image_layout(vk::ImageLayout::GENERAL)
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
                .resolve_image_layout(vk::ImageLayout::GENERAL);
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
            assert_eq!(depth.size(), size, "`{}` is of another size", depth.name());
            attachment(depth)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
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
        result
    }

    /// Copies pixels out of a buffer into `size` pixels from `at` on, of a layer.
    pub fn copy_to_image(
        &mut self,
        from: &Buffer,
        offset: u64,
        to: &Image,
        layer: u32,
        at: [u32; 2],
        size: [u32; 2],
    ) {
        let bytes = u64::from(size[0]) * u64::from(size[1]) * to.format().bytes();
        assert!(
            offset + bytes <= from.size(),
            "copy reads past the end of `{}`",
            from.name()
        );
        // SAFETY: the range lies inside the buffer, the region is checked by `fill_region`.
        unsafe { self.fill_region(from.raw.handle, offset, to, layer, at, size) };
    }

    /// Puts host pixels into `size` pixels from `at` on, of a layer, through the upload ring.
    pub fn upload_image<T: Pod>(
        &mut self,
        to: &Image,
        layer: u32,
        at: [u32; 2],
        size: [u32; 2],
        pixels: &[T],
    ) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(pixels);
        let row = (u64::from(size[0]) * to.format().bytes()) as usize;
        assert_eq!(
            bytes.len(),
            row * size[1] as usize,
            "`{}` gets another number of pixels",
            to.name()
        );
        let rows = (MAX_UPLOAD / row.max(1)).max(1);
        for (i, part) in bytes.chunks(rows * row.max(1)).enumerate() {
            let serial = self.serial();
            let (staging, offset) = self.gpu().queue().stage(&self.gpu().0, serial, part)?;
            let at = [at[0], at[1] + (i * rows) as u32];
            let size = [size[0], (part.len() / row) as u32];
            // SAFETY: the staged bytes are those of the region.
            unsafe { self.fill_region(staging, offset, to, layer, at, size) };
        }
        Ok(())
    }

    /// # Safety
    /// The buffer holds the region's pixels at `offset`.
    unsafe fn fill_region(
        &mut self,
        from: vk::Buffer,
        offset: u64,
        to: &Image,
        layer: u32,
        at: [u32; 2],
        size: [u32; 2],
    ) {
        let whole = to.size();
        assert!(
            at[0] + size[0] <= whole[0] && at[1] + size[1] <= whole[1] && layer < to.layers(),
            "copy writes outside of `{}`",
            to.name()
        );
        let region = [vk::BufferImageCopy {
            buffer_offset: offset,
            buffer_row_length: 0,
            buffer_image_height: 0,
            image_subresource: to.part(0, layer..layer + 1),
            image_offset: offset3(at.map(|v| v as i32), 0),
            image_extent: vk::Extent3D {
                width: size[0],
                height: size[1],
                depth: 1,
            },
        }];
        if size.contains(&0) {
            return;
        }
        // SAFETY: the region lies inside the image; the caller speaks for the buffer.
        unsafe {
            self.device().cmd_copy_buffer_to_image(
                self.raw(),
                from,
                to.handle,
                vk::ImageLayout::GENERAL,
                &region,
            );
        }
    }

    /// Copies an image's first layer into a buffer, row after row.
    pub fn copy_from_image(&mut self, from: &Image, to: &Buffer, offset: u64) {
        self.copy_out(from, [0, 0], from.size(), to, offset);
    }

    /// Copies a pixel of an image's first layer to the beginning of a buffer.
    pub fn copy_pixel(&mut self, from: &Image, at: [u32; 2], to: &Buffer) {
        let size = from.size();
        assert!(
            at[0] < size[0] && at[1] < size[1],
            "`{}` is smaller",
            from.name()
        );
        self.copy_out(from, at, [1, 1], to, 0);
    }

    fn copy_out(&mut self, from: &Image, at: [u32; 2], size: [u32; 2], to: &Buffer, offset: u64) {
        let bytes = u64::from(size[0]) * u64::from(size[1]) * from.format().bytes();
        assert!(
            offset + bytes <= to.size(),
            "copy writes past the end of `{}`",
            to.name()
        );
        let region = [vk::BufferImageCopy {
            buffer_offset: offset,
            buffer_row_length: 0,
            buffer_image_height: 0,
            image_subresource: from.part(0, 0..1),
            image_offset: offset3(at.map(|v| v as i32), 0),
            image_extent: vk::Extent3D {
                width: size[0],
                height: size[1],
                depth: 1,
            },
        }];
        // SAFETY: the region lies inside the image and fits into the buffer.
        unsafe {
            self.device().cmd_copy_image_to_buffer(
                self.raw(),
                from.handle,
                vk::ImageLayout::GENERAL,
                to.raw.handle,
                &region,
            );
        }
    }

    /// Scales a whole image into another one, linearly between texels.
    pub fn scale(&mut self, from: &Image, to: &Image) {
        self.blit(from, 0, to, 0);
    }

    /// Makes a mip level (1 or more) from the one before it.
    pub fn mip(&mut self, image: &Image, level: u32) {
        assert!(
            (1..image.mips()).contains(&level),
            "`{}` has no level {level}",
            image.name()
        );
        self.blit(image, level - 1, image, level);
    }

    fn blit(&mut self, from: &Image, from_level: u32, to: &Image, to_level: u32) {
        let corners = |size: [i32; 2]| [vk::Offset3D::default(), offset3(size, 1)];
        let region = [vk::ImageBlit {
            src_subresource: from.part(from_level, 0..1),
            src_offsets: corners(from.mip_size(from_level)),
            dst_subresource: to.part(to_level, 0..1),
            dst_offsets: corners(to.mip_size(to_level)),
        }];
        let layout = vk::ImageLayout::GENERAL;
        // SAFETY: both regions are whole levels.
        unsafe {
            self.device().cmd_blit_image(
                self.raw(),
                from.handle,
                layout,
                to.handle,
                layout,
                &region,
                vk::Filter::LINEAR,
            );
        }
    }

    /// Brings an image from one layout into another.
    pub(super) fn transition(
        &mut self,
        image: &Image,
        from: vk::ImageLayout,
        to: vk::ImageLayout,
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
            .subresource_range(image.range())];
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

    /// Draws `count` vertices.
    pub fn vertices(&mut self, count: u32) {
        assert!(self.bound.is_some(), "a pipeline comes first");
        if count > 0 {
            // SAFETY: a pipeline is bound.
            unsafe { self.cmd.device().cmd_draw(self.cmd.raw(), count, 1, 0, 0) };
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

fn offset3(at: [i32; 2], z: i32) -> vk::Offset3D {
    vk::Offset3D {
        x: at[0],
        y: at[1],
        z,
    }
}

impl Image {
    /// Waits for the device, then copies the first layer out, row after row.
    pub fn read<T: Pod>(&self) -> Result<Vec<T>> {
        assert!(self.samples() == 1 && self.format() != Format::Depth);
        let size = self.size();
        let bytes = u64::from(size[0]) * u64::from(size[1]) * self.format().bytes();
        let buffer = self.gpu.buffer("picture", bytes, super::Memory::Readback)?;
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.copy_from_image(self, &buffer, 0);
        cmd.barrier(Stage::Transfer, Stage::Host);
        cmd.submit()?.wait()?;
        Ok(buffer.mapped(0..bytes as usize / size_of::<T>()))
    }
}
