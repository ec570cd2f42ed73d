//! Changes the lightmap on the device: adds and subtracts virtual lights, in batches whose size follows measured time.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::accumulate::{AccumulatePass, Evaluation};
use super::occluders::Occluders;
use super::place::Receivers;
use super::records::{self, ShadowSizes};
use super::shadow::ShadowPass;
use super::shared::BATCH;
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Gpu, Result, Ticket};
use crate::scene::Bounds;

/// Depth pixels of one batch: 256 MiB.
const DEPTH_ELEMENTS: u64 = 64 << 20;
/// No submission on a GPU should run longer: drivers kill those that run for seconds.
const SUBMISSION: Duration = Duration::from_millis(400);
/// Lights of the first submission there, before anything is known.
const FIRST_BATCH: usize = 4;
/// Submissions in flight: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;

/// Whether a light's contribution is added or taken away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Its light comes.
    Add,
    /// Its light goes, bit for bit as it came.
    Subtract,
}

/// The device side of a bake: occluders, receivers, passes, and the sums they work on.
pub struct Illumination {
    gpu: Gpu,
    occluders: Occluders,
    receivers: Receivers,
    shadow: ShadowPass,
    accumulate: AccumulatePass,
    sizes: ShadowSizes,
    bounds: Bounds,
    pending: Vec<(VirtualLight, Sign)>,
    in_flight: VecDeque<(Ticket, Instant, usize)>,
    /// Lights per submission, so that it stays below [`SUBMISSION`].
    batch: usize,
    lights: u64,
}

impl Illumination {
    pub(super) fn new(
        gpu: &Gpu,
        occluders: Occluders,
        receivers: Receivers,
        bounds: Bounds,
        sizes: ShadowSizes,
        evaluation: Evaluation,
    ) -> Result<Self> {
        let square = |size: u32| u64::from(size) * u64::from(size);
        let largest = (6 * square(sizes.direct))
            .max(square(sizes.sun))
            .max(3 * square(sizes.indirect));
        let elements = (3 * square(sizes.indirect) * u64::from(BATCH))
            .min(DEPTH_ELEMENTS)
            .max(largest);
        Ok(Self {
            shadow: ShadowPass::new(gpu, &occluders, elements)?,
            accumulate: AccumulatePass::new(gpu, &receivers, evaluation)?,
            gpu: gpu.clone(),
            occluders,
            receivers,
            sizes,
            bounds,
            pending: Vec::new(),
            in_flight: VecDeque::new(),
            // Nobody kills what runs on a CPU, and larger batches are faster there too.
            batch: if gpu.info().kind == "CPU" {
                BATCH as usize
            } else {
                FIRST_BATCH
            },
            lights: 0,
        })
    }

    /// Takes a light in; it is sent with its batch, at the latest by [`Illumination::flush`].
    pub fn push(&mut self, light: VirtualLight, sign: Sign) -> Result<()> {
        let fits = self.pending.first().is_none_or(|(first, _)| {
            first.direct == light.direct
                && self.pending.len() < self.batch
                && self.elements(self.pending.iter().map(|p| &p.0)) + self.elements([&light])
                    <= self.shadow.elements()
        });
        if !fits {
            self.send()?;
        }
        self.pending.push((light, sign));
        Ok(())
    }

    /// Sends what is pending and waits for everything.
    pub fn flush(&mut self) -> Result<()> {
        self.send()?;
        while !self.in_flight.is_empty() {
            self.retire()?;
        }
        Ok(())
    }

    /// Virtual lights sent so far, subtractions included.
    pub fn lights_sent(&self) -> u64 {
        self.lights
    }

    /// What casts shadows.
    pub fn occluders(&self) -> &Occluders {
        &self.occluders
    }

    /// Waits, then reads the irradiance of every texel slot, in lux.
    pub fn irradiance(&mut self) -> Result<Vec<[f32; 3]>> {
        let scale = f64::from(self.accumulate.scale());
        let sums = self.sums()?;
        let tile = super::shared::TILE as usize;
        Ok(sums
            .chunks_exact(3 * tile)
            .flat_map(|t| {
                (0..tile).map(move |i| {
                    [0, 1, 2].map(|channel| (t[channel * tile + i] as f64 / scale) as f32)
                })
            })
            .collect())
    }

    /// Waits, then reads the fixed-point sums: per tile 64 reds, 64 greens, 64 blues.
    pub fn sums(&mut self) -> Result<Vec<i64>> {
        self.flush()?;
        self.accumulate.read()
    }

    fn elements<'a>(&self, lights: impl IntoIterator<Item = &'a VirtualLight>) -> u64 {
        let square = |size: u32| u64::from(size) * u64::from(size);
        lights
            .into_iter()
            .map(|light| match light.shape {
                Shape::Directional { .. } => square(self.sizes.sun),
                Shape::Point => 6 * square(self.sizes.direct),
                _ => {
                    3 * square(if light.direct {
                        self.sizes.direct
                    } else {
                        self.sizes.indirect
                    })
                }
            })
            .sum()
    }

    fn send(&mut self) -> Result<()> {
        if self.pending.is_empty() {
            return Ok(());
        }
        while self.in_flight.len() >= IN_FLIGHT {
            self.retire()?;
        }
        let mut views = Vec::new();
        let mut offset = 0;
        let lights: Vec<_> = self
            .pending
            .iter()
            .map(|(light, sign)| {
                let sign = if *sign == Sign::Add { 1 } else { -1 };
                records::record(
                    light,
                    sign,
                    &self.sizes,
                    &self.bounds,
                    &mut views,
                    &mut offset,
                )
            })
            .collect();
        let soft = self.pending[0].0.direct;
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(crate::gpu::Stage::All, crate::gpu::Stage::All);
        self.shadow.record(&mut cmd, &self.occluders, &views)?;
        self.accumulate.record(
            &self.gpu,
            &mut cmd,
            &self.receivers,
            &self.shadow,
            &lights,
            soft,
        )?;
        self.in_flight
            .push_back((cmd.submit()?, Instant::now(), lights.len()));
        self.lights += lights.len() as u64;
        self.pending.clear();
        Ok(())
    }

    /// Waits for the oldest submission and learns from the time it took.
    fn retire(&mut self) -> Result<()> {
        let Some((ticket, sent, lights)) = self.in_flight.pop_front() else {
            return Ok(());
        };
        ticket.wait()?;
        if self.gpu.info().kind == "CPU" {
            return Ok(());
        }
        // A batch waits for the one before it: the span holds both.
        let took = sent.elapsed() / IN_FLIGHT as u32;
        if took > SUBMISSION {
            self.batch = (self.batch / 2).max(1);
        } else if took * 3 < SUBMISSION && lights >= self.batch {
            self.batch = (self.batch * 2).min(BATCH as usize);
        }
        Ok(())
    }
}
