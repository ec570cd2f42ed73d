//! From the map's sums to images that can be sampled: what is shown of the map between two of its updates.

use std::sync::Arc;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};

use super::reference::Reference;
use super::shaders;
use crate::bake::Baker;
use crate::gpu::{
    Address, Buffer, Format, Gpu, Image, ImageOptions, Memory, Pipeline, Result, Stage, Ticket,
};
use crate::lightmap::{Lightmap, Texel};

/// The lightmap's pages as an image array. Bilinear filtering fetches none but listed texels, so nothing is filled around
/// charts.
pub struct Pages {
    gpu: Gpu,
    pipeline: Pipeline,
    /// What the image is copied from.
    staging: Option<Buffer>,
    image: Arc<Image>,
    /// Lux per unit of the image: about the mean, so that halves resolve what is dark and hold what is bright.
    lux: f32,
    reference: Option<Arc<Reference>>,
    /// The reference in the same units.
    compared: Option<Arc<Image>>,
    /// The last update, and what one takes on the device.
    updating: Option<Ticket>,
    cost: Duration,
}

/// What the display needs to know of the pages.
#[derive(Clone)]
pub struct PagesView {
    pub(super) image: Arc<Image>,
    pub(super) lux: f32,
    pub(super) reference: Option<Arc<Image>>,
    /// Errors are relative to no less than this, units of the image.
    pub(super) least: f32,
}

impl PagesView {
    /// Lux at both ends of false colours that suit the scene: three decades around its mean, in round numbers.
    pub fn scale(&self) -> [f32; 2] {
        [0.03, 30.0].map(|share| round(self.lux * share))
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    sums: Address,
    texels: Address,
    pages: Address,
    first_tile: u32,
    unit: f32,
}

/// Workgroups per dispatch, below the guaranteed limit.
const STRIDE: u32 = 1 << 15;

impl Pages {
    /// Nothing yet. What they are held against has as many texels as what they are brought up to date with.
    pub fn new(gpu: &Gpu, reference: Option<Arc<Reference>>) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            pipeline: gpu.pipeline(shaders::VIEW_PAGES, &[])?,
            staging: None,
            image: Arc::new(image(gpu, 1, 1)?),
            lux: 1.0,
            reference,
            compared: None,
            updating: None,
            cost: Duration::ZERO,
        })
    }

    /// What an update takes on the device, by those that have finished.
    pub fn cost(&mut self) -> Result<Duration> {
        if let Some(ticket) = self.updating.take_if(|t| t.is_done().unwrap_or(true)) {
            ticket.wait()?;
            self.cost = ticket.device_time().unwrap_or(self.cost);
        }
        Ok(self.cost)
    }

    /// What there is to show: another one after an update only if the number or size of pages has changed.
    pub fn view(&self) -> PagesView {
        PagesView {
            image: Arc::clone(&self.image),
            lux: self.lux,
            reference: self.compared.clone(),
            least: self
                .reference
                .as_ref()
                .map_or(1.0, |r| (r.least() / f64::from(self.lux)).max(1e-30) as f32),
        }
    }

    /// Brings the images to what the map holds at this moment, in order with what is submitted before and after.
    pub fn update(&mut self, baker: &Baker) -> Result<()> {
        self.fit(baker)?;
        let Some(staging) = &self.staging else {
            return Ok(());
        };
        let map = baker.on_device();
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        cmd.scope("view pages", |cmd| {
            for range in &map.tiles {
                for first_tile in range.clone().step_by(STRIDE as usize) {
                    let tiles = STRIDE.min(range.end - first_tile);
                    let push = Push {
                        sums: map.sums.address(),
                        texels: map.texels.address(),
                        pages: staging.address(),
                        first_tile,
                        unit: (map.unit / f64::from(self.lux)) as f32,
                    };
                    cmd.dispatch(&self.pipeline, &push, [tiles * Texel::TILE as u32, 1, 1]);
                }
            }
            cmd.barrier(Stage::Compute, Stage::Transfer);
            copy(cmd, staging, &self.image);
        });
        cmd.barrier(Stage::Transfer, Stage::All);
        self.updating = Some(cmd.submit()?);
        Ok(())
    }

    /// Shows a finished map, seams matched and gutters filled: just what is written.
    pub fn show(&mut self, baker: &Baker, map: &Lightmap) -> Result<()> {
        self.fit(baker)?;
        let pages = map.pages.iter().map(|page| &page[..]);
        self.fill(&self.image, pages)
    }

    /// Puts lux into the pages of an image.
    fn fill<'a>(&self, image: &Image, pages: impl Iterator<Item = &'a [[f32; 3]]>) -> Result<()> {
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        for (layer, page) in (0..).zip(pages) {
            let half = |v: f32| half::f16::from_f32((v / self.lux).min(65000.0)).to_bits();
            let halves: Vec<[u16; 4]> = page
                .iter()
                .map(|e| [half(e[0]), half(e[1]), half(e[2]), half::f16::ONE.to_bits()])
                .collect();
            cmd.upload_image(image, layer, [0, 0], image.size(), &halves)?;
        }
        cmd.barrier(Stage::Transfer, Stage::All);
        let _in_order = cmd.submit()?;
        Ok(())
    }

    fn fit(&mut self, baker: &Baker) -> Result<()> {
        let [size, pages] = baker.page_layout();
        if self.staging.is_some() && self.image.size()[0] == size && self.image.layers() == pages {
            return Ok(());
        }
        let bits = baker.settings().fixed_point_bits;
        self.lux = ((28 - bits) as f32).exp2();
        let image = image(&self.gpu, size, pages)?;
        let bytes = u64::from(pages) * u64::from(size) * u64::from(size) * Format::Rgba16F.bytes();
        let staging = self.gpu.buffer("pages", bytes, Memory::Device)?;
        let mut cmd = self.gpu.commands()?;
        cmd.fill(&staging, 0, bytes, 0);
        let _in_order = cmd.submit()?;
        self.image = Arc::new(image);
        self.staging = Some(staging);
        if let Some(reference) = &self.reference {
            let image = self::image(&self.gpu, size, pages)?;
            // Pages that later additions need have nothing to be held against.
            let empty = vec![[0.0; 3]; size as usize * size as usize];
            let page = |k: u32| reference.pages().get(k as usize).map(|p| &p.texels[..]);
            self.fill(&image, (0..pages).map(|k| page(k).unwrap_or(&empty)))?;
            self.compared = Some(Arc::new(image));
        }
        Ok(())
    }
}

/// The nearest of 1, 2 and 5 times a power of ten.
fn round(value: f32) -> f32 {
    let decade = 10f32.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|step| step * decade)
        .into_iter()
        .min_by(|a, b| (a / value).ln().abs().total_cmp(&(b / value).ln().abs()))
        .unwrap_or(value)
}

fn copy(cmd: &mut crate::gpu::Commands, from: &Buffer, to: &Image) {
    let size = to.size();
    let bytes = u64::from(size[0]) * u64::from(size[1]) * to.format().bytes();
    for layer in 0..to.layers() {
        cmd.copy_to_image(from, u64::from(layer) * bytes, to, layer, [0, 0], size);
    }
}

fn image(gpu: &Gpu, size: u32, pages: u32) -> Result<Image> {
    let options = ImageOptions {
        size: [size; 2],
        layers: pages.max(1),
        mips: false,
        samples: 1,
        format: Format::Rgba16F,
    };
    gpu.image("lightmap pages", &options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_in_round_numbers() {
        for (value, rounded) in [(1.2, 1.0), (0.0026, 0.002), (6.0, 5.0), (88.0, 100.0)] {
            assert!((round(value) / rounded - 1.0).abs() < 1e-5, "{value}");
        }
    }
}
