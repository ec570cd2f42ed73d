//! Lights that come, that go, and that stay but for what changed about them.

use super::Illumination;
use super::kept::Keeping;
use super::pending::{Pending, Sign};
use crate::bake::device::records::{self, Parts};
use crate::bake::world::versions::Version;
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::Result;

impl Illumination {
    /// Takes a light in, as it shines in a version of the scene; it is sent with its batch, at the latest by
    /// [`Illumination::flush`].
    pub fn push(&mut self, light: VirtualLight, sign: Sign, version: Version) -> Result<()> {
        self.push_to(Parts::ALL, light, sign, version)
    }

    /// As [`Illumination::push`], for some parts of the map.
    pub(in crate::bake) fn push_to(
        &mut self,
        parts: Parts,
        light: VirtualLight,
        sign: Sign,
        version: Version,
    ) -> Result<()> {
        let new = self.pending(parts, light, sign, version);
        self.enter(new)
    }

    /// Brings a light that was added under one version to another: takes it away where the change between the two can
    /// make a difference, and adds it there again. The sums become what they would be had the light been added under `to`,
    /// bit for bit. Returns whether the change can make a difference to it.
    pub fn push_difference(
        &mut self,
        parts: Parts,
        light: &VirtualLight,
        from: Version,
        to: Version,
    ) -> Result<bool> {
        if from == to {
            return Ok(false);
        }
        if !self.sees_change(light, from, to) {
            self.kept.rename(light, parts, from, to);
            return Ok(false);
        }
        // A parallel light's depth map spans the whole scene: with other bounds every pixel is another.
        let parallel = matches!(light.shape, Shape::Directional { .. });
        if parallel && self.versions.bounds(from) != self.versions.bounds(to) {
            self.push_to(parts, light.clone(), Sign::Subtract, from)?;
            self.push_to(parts, light.clone(), Sign::Add, to)?;
            return Ok(true);
        }
        let new = self.pending(parts, light.clone(), Sign::Add, to);
        self.enter(Pending { other: from, ..new })?;
        Ok(true)
    }

    /// Adds a light under a version and takes away what it was with another flux under another one, by one evaluation where the
    /// change between the two makes no other difference to it. The sums become what they would be by two, bit for bit.
    fn push_flux(
        &mut self,
        parts: Parts,
        (old, from): (VirtualLight, Version),
        (light, to): (VirtualLight, Version),
    ) -> Result<()> {
        if self.sees_change(&light, from, to) {
            self.push_to(parts, light, Sign::Add, to)?;
            return self.push_to(parts, old, Sign::Subtract, from);
        }
        if from != to {
            self.kept.rename(&old, parts, from, to);
        }
        let flux = Some(old.flux);
        let new = self.pending(parts, light, Sign::Add, to);
        self.enter(Pending { flux, ..new })
    }

    /// Adds a light, which may see what one of those sees that leave: then only what changed is drawn for it.
    fn push_instead(
        &mut self,
        parts: Parts,
        leaving: &[(VirtualLight, Version)],
        (light, to): (VirtualLight, Version),
    ) -> Result<()> {
        let mut new = self.pending(parts, light, Sign::Add, to);
        let seen = leaving.iter().find(|(old, _)| old.sees_as(&new.light));
        if let Some(&(_, from)) = seen.filter(|(_, from)| *from != to) {
            if self.sees_change(&new.light, from, to) {
                new.begins = Some(from);
            } else {
                self.kept.share(&new.light, from, to);
            }
        }
        self.enter(new)
    }

    /// Whether the change between two versions can make a difference to a light's light.
    fn sees_change(&mut self, light: &VirtualLight, from: Version, to: Version) -> bool {
        if from == to {
            return false;
        }
        let regions = &self.versions.between(from, to).lookups;
        let epsilon = self.accumulate.epsilon();
        !regions.is_empty() && !records::misses(light, &self.sizes, regions, epsilon)
    }

    fn pending(&self, parts: Parts, light: VirtualLight, sign: Sign, version: Version) -> Pending {
        Pending {
            light,
            sign,
            version,
            other: version,
            begins: None,
            flux: None,
            parts,
            update: self.updates,
            keeping: Keeping::default(),
        }
    }

    /// Takes lights away and adds others, each under its version; what is among both only goes from one version to the
    /// other, or from one flux to the other. Does so in some parts of the map. Returns how many were taken away, added, and limited
    /// to what changed.
    pub fn exchange(
        &mut self,
        parts: Parts,
        leaving: impl IntoIterator<Item = (VirtualLight, Version)>,
        coming: impl IntoIterator<Item = (VirtualLight, Version)>,
    ) -> Result<[u64; 3]> {
        self.updates += 1;
        let mut evaluated = [0; 3];
        let mut leaving: Vec<_> = leaving.into_iter().collect();
        let mut others = Vec::new();
        for (light, to) in coming {
            if let Some(at) = leaving.iter().position(|(old, _)| *old == light) {
                let (_, from) = leaving.swap_remove(at);
                evaluated[2] += u64::from(self.push_difference(parts, &light, from, to)?);
            } else {
                others.push((light, to));
            }
        }
        (evaluated[0], evaluated[1]) = (leaving.len() as u64, others.len() as u64);
        for (light, to) in others {
            let dimmed = |(old, _): &(VirtualLight, _)| old.is_dimmed(&light);
            match leaving.iter().position(dimmed) {
                Some(at) => self.push_flux(parts, leaving.swap_remove(at), (light, to))?,
                None => self.push_instead(parts, &leaving, (light, to))?,
            }
        }
        for (light, from) in leaving {
            self.push_to(parts, light, Sign::Subtract, from)?;
        }
        Ok(evaluated)
    }
}
