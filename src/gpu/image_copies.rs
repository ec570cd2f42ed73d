//! Copies between buffers and images, and from images to images.

use ash::vk;
use bytemuck::Pod;

use super::commands::{Commands, Stage};
use super::image::{Format, Image};
use super::queue::MAX_UPLOAD;
use super::{Buffer, Result};

impl Commands {
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
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        self.transition(to, to.layout(), layout, Stage::All);
        // SAFETY: the region lies inside the image; the caller speaks for the buffer.
        unsafe {
            self.device()
                .cmd_copy_buffer_to_image(self.raw(), from, to.handle, layout, &region);
        }
        self.transition(to, layout, to.layout(), Stage::All);
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
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        self.transition(from, from.layout(), layout, Stage::All);
        // SAFETY: the region lies inside the image and fits into the buffer.
        unsafe {
            self.device().cmd_copy_image_to_buffer(
                self.raw(),
                from.handle,
                layout,
                to.raw.handle,
                &region,
            );
        }
        self.transition(from, layout, from.layout(), Stage::All);
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
        let (read, written) = (
            vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
            vk::ImageLayout::TRANSFER_DST_OPTIMAL,
        );
        let ends = [(from, from_level, read), (to, to_level, written)];
        for (image, level, layout) in ends {
            let change = [image.layout(), layout];
            self.transition_levels(image, level..level + 1, change, Stage::All);
        }
        // SAFETY: both regions are whole levels.
        unsafe {
            self.device().cmd_blit_image(
                self.raw(),
                from.handle,
                read,
                to.handle,
                written,
                &region,
                vk::Filter::LINEAR,
            );
        }
        for (image, level, layout) in ends {
            let change = [layout, image.layout()];
            self.transition_levels(image, level..level + 1, change, Stage::All);
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
