//! What pictures are measured to be: how bright they are, and what a place in false colours stands for.

use super::exposure::meter;
use super::look::Look;
use crate::gpu::{
    Buffer, Commands, Format, Gpu, Image, ImageOptions, Memory, Result, Stage, Ticket,
};

/// Width and height of the picture that light is measured on.
const SIZE: [u32; 2] = [64, 36];

/// A measurement under way.
struct Running {
    ticket: Ticket,
    what: What,
}

#[derive(Clone, Copy)]
enum What {
    /// Of a picture taken with an exposure factor.
    Brightness(f32),
    /// Of a pixel; its unit.
    Value(f32),
}

/// Measures pictures, one at a time.
pub(super) struct Metering {
    small: Image,
    read: Buffer,
    recorded: Option<What>,
    running: Option<Running>,
    probed: Option<f32>,
}

impl Metering {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let options = ImageOptions {
            size: SIZE,
            layers: 1,
            mips: false,
            samples: 1,
            format: Format::Rgba16F,
        };
        let bytes = u64::from(SIZE[0] * SIZE[1]) * Format::Rgba16F.bytes();
        Ok(Self {
            small: gpu.image("meter", &options)?,
            read: gpu.buffer("metered", bytes, Memory::Readback)?,
            recorded: None,
            running: None,
            probed: None,
        })
    }

    /// Records a measurement of a picture's brightness, unless one is under way. Whether it did.
    pub(super) fn measure(&mut self, cmd: &mut Commands, radiance: &Image, exposure: f32) -> bool {
        if self.running.is_some() {
            return false;
        }
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.scope("view meter", |cmd| {
            cmd.scale(radiance, &self.small);
            cmd.barrier(Stage::Transfer, Stage::Transfer);
            cmd.copy_from_image(&self.small, &self.read, 0);
        });
        cmd.barrier(Stage::Transfer, Stage::Host);
        self.recorded = Some(What::Brightness(exposure));
        true
    }

    /// As [`Metering::measure`], what a place of a picture in false colours stands for; the place as shares of width and height.
    pub(super) fn probe(
        &mut self,
        cmd: &mut Commands,
        radiance: &Image,
        look: Look,
        at: [f32; 2],
    ) -> bool {
        let (Some(unit), None) = (look.unit(), &self.running) else {
            return false;
        };
        let pixel = [0, 1].map(|i| {
            let size = radiance.size()[i] as f32;
            (at[i].clamp(0.0, 1.0) * size).min(size - 1.0) as u32
        });
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.copy_pixel(radiance, pixel, &self.read);
        cmd.barrier(Stage::Transfer, Stage::Host);
        self.recorded = Some(What::Value(unit));
        true
    }

    /// What the last probe found; none where nothing is.
    pub(super) fn probed(&self) -> Option<f32> {
        self.probed
    }

    /// The submission that the measurement is part of.
    pub(super) fn submitted(&mut self, ticket: Ticket) {
        let what = self.recorded.take();
        self.running = what.map(|what| Running { ticket, what });
    }

    /// The mean luminance of the last picture that was measured, once that is done (or, with `wait`, now), cd/m².
    pub(super) fn take(&mut self, wait: bool) -> Result<Option<f32>> {
        let Some(running) = &self.running else {
            return Ok(None);
        };
        if !wait && !running.ticket.is_done()? {
            return Ok(None);
        }
        running.ticket.wait()?;
        let what = running.what;
        self.running = None;
        let halves = match what {
            What::Value(_) => 4,
            What::Brightness(_) => (4 * SIZE[0] * SIZE[1]) as usize,
        };
        let halves = self.read.mapped::<u16>(0..halves);
        let pixels: Vec<[half::f16; 4]> = halves
            .chunks_exact(4)
            .map(|p| [p[0], p[1], p[2], p[3]].map(half::f16::from_bits))
            .collect();
        match what {
            What::Value(unit) => {
                let [value, .., alpha] = pixels[0].map(half::f16::to_f32);
                self.probed = (alpha > 0.5).then(|| value / alpha * unit);
                Ok(None)
            }
            What::Brightness(factor) => Ok(meter(&pixels, factor)),
        }
    }
}
