//! Tests of validation: after any edits the paths are those of a fresh trace.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, Quat, Vec3};
use proptest::prelude::*;

use super::bvh::SceneBvh;
use super::differences::Differences;
use super::paths::PathSettings;
use super::testing::{cornell, light};
use super::tracer::trace;
use super::validate::Validator;
use super::{Vpl, VplKey};
use crate::scene::edit::Change;
use crate::scene::{AlphaMode, Aperture, Light, Mesh, Scene};

/// Cornell with a spot, a point and a sun that shines through its open side.
pub(crate) fn lit() -> Scene {
    let mut scene = cornell();
    let aim = |x: f32, at: Vec3| Affine3A::from_rotation_translation(Quat::from_rotation_x(x), at);
    let spot = Aperture::Spot {
        inner: 0.3,
        outer: 0.7,
    };
    for (node, aperture, intensity, transform) in [
        (50, spot, Vec3::new(3.0, 2.0, 1.0), aim(-1.3, Vec3::Y * 0.8)),
        (
            51,
            Aperture::Point,
            Vec3::splat(0.4),
            aim(0.0, Vec3::splat(0.4)),
        ),
        (
            52,
            Aperture::Directional,
            Vec3::new(0.5, 0.6, 0.7),
            aim(-0.4, Vec3::ZERO),
        ),
    ] {
        scene.lights.push(Light {
            node,
            ..light(aperture, intensity, transform)
        });
    }
    scene
}

/// What a user may do, to the scene itself.
#[derive(Clone, Debug)]
pub(crate) enum Edit {
    Move(usize, Vec3, f32),
    Copy(usize, Vec3),
    Remove(usize),
    Reflect(usize, Vec3),
    Emit(usize, f32),
    Holes(usize, bool),
    Intensity(usize, Vec3),
    Aim(usize, Vec3, f32),
    Switch(usize),
}

pub(crate) fn edit() -> impl Strategy<Value = Edit> {
    let at = || (-0.5f32..0.5, -0.5f32..0.5, -0.5f32..0.5).prop_map(|(x, y, z)| Vec3::new(x, y, z));
    let color = || (0.0f32..1.0, 0.0f32..1.0, 0.0f32..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z));
    let i = 0usize..20;
    prop_oneof![
        3 => (i.clone(), at(), -1.0f32..1.0).prop_map(|(o, t, a)| Edit::Move(o, t, a)),
        1 => (i.clone(), at()).prop_map(|(o, t)| Edit::Copy(o, t)),
        1 => i.clone().prop_map(Edit::Remove),
        1 => (i.clone(), color()).prop_map(|(m, c)| Edit::Reflect(m, c)),
        1 => (i.clone(), prop_oneof![Just(0.0f32), 0.3f32..3.0]).prop_map(|(m, s)| Edit::Emit(m, s)),
        1 => (i.clone(), any::<bool>()).prop_map(|(m, h)| Edit::Holes(m, h)),
        1 => (i.clone(), color()).prop_map(|(l, c)| Edit::Intensity(l, c)),
        1 => (i.clone(), at(), 0.1f32..1.0).prop_map(|(l, t, a)| Edit::Aim(l, t, a)),
        1 => i.prop_map(Edit::Switch),
    ]
}

impl Edit {
    pub(crate) fn apply(&self, scene: &mut Scene) {
        let objects = scene.objects.len();
        let materials = scene.materials.len();
        let punctual: Vec<usize> = (0..scene.lights.len())
            .filter(|&l| !matches!(scene.lights[l].aperture, Aperture::Surface { .. }))
            .collect();
        let pick = |i: usize| punctual.get(i % punctual.len().max(1)).copied();
        match *self {
            Edit::Move(i, by, angle) => {
                // The walls stay most of the time, so that light does.
                let object = if i < 3 { i } else { 3 + i % (objects - 3) };
                let turn = Affine3A::from_rotation_y(angle);
                let moved = Affine3A::from_translation(by * 0.4) * turn;
                scene.objects[object].transform = moved * scene.objects[object].transform;
            }
            Edit::Copy(i, by) => {
                let mut copy = scene.objects[i % objects].clone();
                copy.node = 100 + objects as u32;
                copy.transform = Affine3A::from_translation(by) * copy.transform;
                scene.objects.push(copy);
            }
            Edit::Remove(i) => {
                scene.meshes.push(Arc::new(Mesh::default()));
                scene.objects[i % objects].mesh = scene.meshes.len() as u32 - 1;
            }
            Edit::Reflect(i, color) => {
                let color = color.extend(scene.materials[i % materials].base_color.w);
                scene.materials[i % materials].base_color = color;
            }
            Edit::Emit(i, strength) => {
                let material = &mut scene.materials[i % materials];
                material.emission = Vec3::new(3.0, 2.0, 1.0) * strength;
            }
            Edit::Holes(i, holes) => {
                let material = &mut scene.materials[i % materials];
                material.alpha = AlphaMode::Mask { cutoff: 0.5 };
                material.base_color.w = if holes { 0.0 } else { 1.0 };
            }
            Edit::Intensity(i, color) => {
                if let Some(l) = pick(i) {
                    // Dimmed, or with another colour.
                    let now = scene.lights[l].intensity;
                    let dimmed = now * (0.2 + 2.0 * color.x);
                    scene.lights[l].intensity = if i < 10 { dimmed } else { color };
                }
            }
            Edit::Aim(i, to, angle) => {
                if let Some(l) = pick(i) {
                    let light = &mut scene.lights[l];
                    if i < 7 {
                        light.transform.translation = to.into();
                    } else if let Aperture::Spot { outer, .. } = &mut light.aperture {
                        *outer = angle;
                    } else {
                        light.transform.matrix3 = Affine3A::from_rotation_x(-angle).matrix3;
                    }
                }
            }
            Edit::Switch(i) => match pick(i) {
                Some(l) if i < 10 => {
                    scene.lights.remove(l);
                }
                Some(l) => {
                    let node = 200 + scene.lights.iter().map(|l| l.node).max().unwrap_or(0);
                    let light = scene.lights[l].clone();
                    scene.lights.push(Light { node, ..light });
                }
                None => {}
            },
        }
        relight(scene);
    }
}

/// Emissive objects are lights, and lights are in order.
fn relight(scene: &mut Scene) {
    let emissive = |object: u32| {
        let primitives = scene.mesh(object).primitives.iter();
        let materials = primitives.map(|p| &scene.materials[p.material as usize]);
        materials.into_iter().any(|m| m.emission != Vec3::ZERO)
    };
    let surfaces: Vec<Light> = (0..scene.objects.len() as u32)
        .filter(|&o| emissive(o))
        .map(|object| Light {
            node: scene.objects[object as usize].node,
            ..light(Aperture::Surface { object }, Vec3::ONE, Affine3A::IDENTITY)
        })
        .collect();
    let punctual = |l: &Light| !matches!(l.aperture, Aperture::Surface { .. });
    scene.lights.retain(punctual);
    scene.lights.extend(surfaces);
    scene.lights.sort_by_key(|l| l.id());
}

/// A scene that is edited, and what its observers know.
struct Session {
    scene: Scene,
    bvh: SceneBvh,
    validator: Validator,
    seen: BTreeMap<VplKey, Vpl>,
}

impl Session {
    fn new(scene: Scene, paths: u32) -> Self {
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings {
            max_bounces: 6,
            ..PathSettings::for_paths(&scene, paths)
        };
        let validator = Validator::new(&scene, &bvh, &settings);
        let seen = validator.paths().vpls().map(|v| (v.key, *v)).collect();
        Self {
            scene,
            bvh,
            validator,
            seen,
        }
    }

    fn edit(&mut self, change: impl FnOnce(&mut Scene)) {
        let old = self.scene.clone();
        change(&mut self.scene);
        let change = Change::between(&old, &self.scene);
        self.bvh = self.bvh.moved(&self.scene, &change.objects);
        self.validator.invalidate(&self.scene, &change);
    }

    fn step(&mut self, max_paths: usize) -> Differences {
        let differences = self.validator.step(&self.scene, &self.bvh, max_paths);
        assert!(differences.paths <= max_paths);
        for vpl in &differences.removed {
            assert_eq!(self.seen.remove(&vpl.key), Some(*vpl));
        }
        for vpl in &differences.added {
            assert_eq!(self.seen.insert(vpl.key, *vpl), None);
        }
        for [old, new] in &differences.revised {
            assert_eq!(self.seen.insert(new.key, *new), Some(*old));
        }
        assert!(self.seen.values().eq(self.validator.paths().vpls()));
        differences
    }

    fn finish(&mut self) {
        while !self.validator.is_valid() {
            let before = self.validator.invalid_paths();
            let differences = self.step(97);
            assert_eq!(self.validator.invalid_paths(), before - differences.paths);
        }
        let fresh = trace(
            &self.scene,
            &SceneBvh::build(&self.scene),
            self.validator.settings(),
        );
        assert_eq!(*self.validator.paths(), fresh);
        assert!(self.step(10).is_empty());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn retraced_paths_are_those_of_a_fresh_trace(
        edits in prop::collection::vec((edit(), 0usize..4), 1..10)
    ) {
        let mut session = Session::new(lit(), 300);
        for (edit, steps) in edits {
            session.edit(|scene| edit.apply(scene));
            for _ in 0..steps {
                session.step(40);
            }
            if steps == 3 {
                session.finish();
            }
        }
        session.finish();
    }
}

#[test]
fn only_what_an_edit_can_change_is_traced_again() {
    let mut session = Session::new(lit(), 4000);
    let all = session.validator.paths().paths();
    // The small box, by a little: few rays come near it.
    session.edit(|s| s.objects[3].transform = Affine3A::from_translation(Vec3::X * 0.05));
    let marked = session.validator.invalid_paths();
    assert!(marked > all / 20 && marked < all / 2, "{marked} of {all}");
    session.finish();
    // The paths of a lamp that is dimmed, or painted, go where they went.
    let dimmed = |differences: &Differences| {
        !differences.revised.is_empty()
            && (differences.revised.iter()).all(|[old, new]| old.scatter == new.scatter)
            && differences.emissions.is_empty()
            && differences.removed.is_empty()
            && differences.added.is_empty()
            && differences.lights.iter().all(|l| !l.moved)
    };
    session.edit(|s| s.materials[5].emission *= Vec3::new(0.7, 0.5, 0.1));
    let lamp = session.validator.paths().lights[&11].paths.len();
    assert_eq!(session.validator.invalid_paths(), lamp);
    let differences = session.step(usize::MAX);
    assert!(dimmed(&differences));
    assert_eq!(differences.lights.len(), 1);
    session.finish();
    // Spots and points too, also when two edits come at once, or none is left of their light.
    session.edit(|s| s.lights.iter_mut().for_each(|l| l.intensity *= 0.77));
    session.edit(|s| s.lights.iter_mut().for_each(|l| l.intensity *= 1.13));
    assert!(dimmed(&session.step(usize::MAX)));
    session.finish();
    // Past twice what it was, by as much again: paths carry what they did, and there are more of them.
    for _ in 0..3 {
        session.edit(|s| s.materials[5].emission *= 2.0);
        session.finish();
    }
    session.edit(|s| s.lights.iter_mut().for_each(|l| l.intensity = Vec3::ZERO));
    assert!(dimmed(&session.step(usize::MAX)));
    session.finish();
    // Undone before anything was traced, an edit leaves nothing behind.
    session.edit(|s| s.objects[4].transform = Affine3A::from_translation(Vec3::X * 0.3));
    session.edit(|s| s.objects[4].transform = Affine3A::IDENTITY);
    assert!(session.validator.invalid_flux() > 0.0);
    assert!(session.step(usize::MAX).is_empty());
    session.finish();
}

#[test]
fn a_bake_is_the_first_edit() {
    let scene = lit();
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, 500);
    let mut validator = Validator::start(&scene, &settings);
    assert!(validator.invalid_paths().abs_diff(500) < 4);
    let first = validator.step(&scene, &bvh, 100);
    assert_eq!(first.lights.len(), 4);
    assert!(first.lights.iter().all(|l| l.flux[0] == Vec3::ZERO));
    validator.step(&scene, &bvh, usize::MAX);
    assert_eq!(*validator.paths(), trace(&scene, &bvh, &settings));
}
