//! Scene versions' oracle: whatever way lights and objects went, the sums are those of the final scene lit from nothing.

mod beside;

use std::ops::Range;
use std::sync::Arc;

use glam::{Affine3A, Quat, Vec3};

use super::{EVALUATION, Numbers, SIZES, gpu, random_light, random_texels, turned};
use crate::bake::device::records::Parts;
use crate::bake::update::{Illumination, Sign};
use crate::bake::world::changes::{Changed, Place};
use crate::bake::world::versions::Version;
use crate::cluster::VirtualLight;
use crate::gpu::Gpu;
use crate::lightmap::texels::Texels;
use crate::lightmap::{Clearance, Texel};
use crate::scene::{Bounds, Mesh, Scene};

/// Objects of loose triangles, each near a place of its own, the first one everywhere; and texels of each.
fn objects(numbers: &mut Numbers, count: u32) -> (Scene, Texels) {
    let mut scene = Scene::of_triangles(&[]);
    scene.meshes.clear();
    let prototype = scene.objects.pop().expect("a soup");
    let mut texels = Texels::default();
    for _ in 0..count {
        append(numbers, &mut scene, &prototype, &mut texels);
    }
    (scene, texels)
}

fn append(
    numbers: &mut Numbers,
    scene: &mut Scene,
    prototype: &crate::scene::Object,
    texels: &mut Texels,
) {
    let object = scene.objects.len() as u32;
    let half = if object == 0 { 2.5 } else { 0.3 };
    let triangles: Vec<[Vec3; 3]> = (0..100)
        .map(|_| {
            let center = numbers.vector() * half;
            [0; 3].map(|_| center + numbers.vector() * half * 0.4)
        })
        .collect();
    scene
        .meshes
        .push(Scene::of_triangles(&triangles).meshes.pop().expect("one"));
    scene.objects.push(crate::scene::Object {
        mesh: scene.meshes.len() as u32 - 1,
        transform: Affine3A::from_translation(numbers.vector() * 1.5),
        ..prototype.clone()
    });
    find_texels(numbers, object, texels);
}

/// Of an object that has none.
fn find_texels(numbers: &mut Numbers, object: u32, texels: &mut Texels) -> Range<u32> {
    let half = if object == 0 { 2.5 } else { 0.3 };
    // Some fit where others were.
    let count = 3 + object % 3;
    let list = random_texels(numbers, count as usize, half);
    let tiles = texels.take(object, count);
    let own = &mut texels.list[tiles.start as usize * Texel::TILE..];
    for (entry, texel) in own.iter_mut().zip(list) {
        *entry = Texel { object, ..texel };
    }
    tiles
}

fn start(gpu: &Gpu, scene: &Scene, texels: &Texels) -> Illumination {
    Illumination::new(gpu, scene, texels, SIZES, EVALUATION).expect("a device with memory")
}

fn bounds(scene: &Scene, object: u32) -> Option<Bounds> {
    let count = scene.mesh(object).triangles.len() as u32;
    (count > 0).then(|| {
        (0..count)
            .flat_map(|t| scene.world_triangle(object, t))
            .fold(Bounds::EMPTY, Bounds::with)
    })
}

/// How far from an object its neighbourhood reaches.
const REACH: f32 = 0.4;

/// What stands near a texel, as far as that tells anything: any function of the objects around it will do.
fn near(scene: &Scene, texel: &Texel, entry: usize) -> (Vec3, Clearance) {
    let transform = &scene.objects[texel.object as usize].transform;
    let at = transform.transform_point3(Vec3::from_array(texel.position));
    // The first one is everywhere and always there.
    let around = (1..scene.objects.len() as u32).filter(|&object| {
        let reach = Vec3::splat(REACH);
        let holds = |b: Bounds| (b.min - reach).cmple(at).all() && at.cmple(b.max + reach).all();
        bounds(scene, object).is_some_and(holds)
    });
    let mut seed = 0u32;
    for object in around {
        let [x, y, z] = scene.objects[object as usize]
            .transform
            .translation
            .to_array();
        for word in [object, x.to_bits(), y.to_bits(), z.to_bits()] {
            seed = (seed ^ word).wrapping_mul(0x9e37_79b1).rotate_left(13) | 1;
        }
    }
    if seed == 0 {
        return (at, Clearance::OPEN);
    }
    let mut numbers = Numbers(u64::from(seed) + entry as u64);
    let clearance = Clearance {
        push: numbers.vector().normalize_or_zero().to_array(),
        near: 0.1 * numbers.next(),
        way: 0.1 * numbers.next(),
        room: 0.1 * numbers.next(),
    };
    (at, clearance)
}

/// Finds out what stands near all texels: returns the tiles of objects that did not change themselves which hold texels that
/// have something else near them, and where these are.
fn surround(scene: &Scene, texels: &mut Texels, changed: &[u32]) -> (Vec<u32>, Vec<Vec3>) {
    texels.clearances.resize(texels.list.len(), Clearance::OPEN);
    let (mut replaced, mut told) = (Vec::new(), Vec::new());
    for object in (0..scene.objects.len() as u32).filter(|o| !scene.is_gone(*o)) {
        for tile in texels.tiles[object as usize].clone() {
            let mut any = false;
            for entry in tile as usize * Texel::TILE..(tile as usize + 1) * Texel::TILE {
                let (at, clearance) = near(scene, &texels.list[entry], entry);
                if texels.clearances[entry] != clearance && !changed.contains(&object) {
                    any = true;
                    told.push(at);
                }
                texels.clearances[entry] = clearance;
            }
            if any {
                replaced.push(tile);
            }
        }
    }
    replaced.sort_unstable();
    (replaced, told)
}

#[test]
fn every_way_to_a_scene_ends_at_the_same_sums() {
    let gpu = gpu();
    let mut all_reused = 0;
    for seed in 1..5 {
        let mut numbers = Numbers(seed);
        let (mut scene, mut texels) = objects(&mut numbers, 4);
        let empty = scene.meshes.len() as u32;
        scene.meshes.push(Arc::new(Mesh::default()));
        surround(&scene, &mut texels, &[]);
        let mut map = start(&gpu, &scene, &texels);
        // Of what is limited, too.
        map.set_occlusion(true);
        // No depth map, hardly any, or all of them are kept.
        map.keep_maps([0, 12 * 4 * 3, 1000][seed as usize % 3] * u64::from(SIZES.indirect).pow(2));
        let all = texels.list.len() / Texel::TILE;
        let mut seen: Vec<bool> = (0..all).map(|_| numbers.next() < 0.4).collect();
        map.divide(&seen).expect("upload");
        // The whole map, or its parts one by one.
        let mut held: Vec<(VirtualLight, Parts, Version)> = (0..20)
            .flat_map(|i| {
                let mut light = random_light(&mut numbers, i % 5);
                light.direct = i % 5 > 1 || i % 4 == 0;
                let parts: &[Parts] = match i % 3 {
                    0 => &[Parts::ALL],
                    1 => &Parts::EACH,
                    _ => &[Parts::REST],
                };
                parts.iter().map(move |parts| (light.clone(), *parts, 0))
            })
            .collect();
        for (light, parts, version) in &held {
            map.push_to(*parts, light.clone(), Sign::Add, *version)
                .expect("add");
        }
        let choose = |numbers: &mut Numbers, n: usize| (numbers.next() * n as f32) as usize;
        let mut retired: Vec<(Version, Range<u32>)> = Vec::new();
        let mut reused = 0;
        for step in 0..16 {
            // An edit: mostly moves, sometimes away, back, or something new.
            let object = 1 + choose(&mut numbers, scene.objects.len() - 1) as u32;
            let mut place = Place {
                object,
                before: bounds(&scene, object),
                after: None,
            };
            let (mut new, mut away) = (Vec::new(), false);
            let known = (texels.list.len() / Texel::TILE) as u32;
            match step % 4 {
                3 => {
                    let prototype = scene.objects[0].clone();
                    append(&mut numbers, &mut scene, &prototype, &mut texels);
                    place.object = scene.objects.len() as u32 - 1;
                    place.before = None;
                    new = vec![texels.tiles[place.object as usize].clone()];
                }
                2 => {
                    let own = object + u32::from(object >= empty);
                    let mesh = &mut scene.objects[object as usize].mesh;
                    away = *mesh != empty;
                    *mesh = if away { empty } else { own };
                    if !away {
                        new = vec![find_texels(&mut numbers, object, &mut texels)];
                    }
                }
                _ => {
                    scene.objects[object as usize].transform =
                        Affine3A::from_scale_rotation_translation(
                            Vec3::new(1.0, 0.8, -1.1),
                            Quat::from_rotation_y(numbers.next() * 6.0),
                            numbers.vector() * 1.5,
                        );
                }
            }
            place.after = bounds(&scene, place.object);
            let (replaced, told) = surround(&scene, &mut texels, &[place.object]);
            let changed = Changed {
                places: vec![place],
                near: told,
                reach: REACH,
            };
            let version = map
                .change(&scene, &texels, &new, &replaced, changed)
                .expect("a change");
            for tiles in &new {
                seen.resize(seen.len().max(tiles.end as usize), false);
                seen[tiles.start as usize..tiles.end as usize].fill(false);
            }
            reused += new.iter().filter(|tiles| tiles.start < known).count();
            if away {
                retired.push((version, texels.retire(object)));
            }
            for _ in 0..8 {
                let at = choose(&mut numbers, held.len());
                let (light, parts, old) = held[at].clone();
                match choose(&mut numbers, 5) {
                    0 => {
                        map.push_difference(parts, &light, old, version)
                            .expect("update");
                        held[at].2 = version;
                    }
                    1 => {
                        // Dimmed, and brighter again in the same scene.
                        for (factor, from) in [(0.4, old), (1.9, version)] {
                            let (light, parts, _) = held[at].clone();
                            let flux = light.flux * factor;
                            held[at].0.flux = flux;
                            let new = (held[at].0.clone(), version);
                            map.exchange(parts, [(light, from)], [new]).expect("update");
                        }
                        held[at].2 = version;
                    }
                    2 => {
                        let new = turned(&mut numbers, &light);
                        map.exchange(parts, [(light, old)], [(new.clone(), version)])
                            .expect("update");
                        held[at] = (new, parts, version);
                    }
                    which => {
                        map.push_to(parts, light.clone(), Sign::Subtract, old)
                            .expect("update");
                        let other = random_light(&mut numbers, at % 5);
                        let new = if which == 3 { light } else { other };
                        map.push_to(parts, new.clone(), Sign::Add, version)
                            .expect("update");
                        held[at] = (new, parts, version);
                    }
                }
            }
            let oldest = held.iter().map(|h| h.2).min().expect("lights");
            map.forget(oldest).expect("room");
            for (_, tiles) in retired.extract_if(.., |(since, _)| *since <= oldest) {
                texels.release(tiles);
            }
        }
        println!("seed {seed}: {reused} of what came lies where others were");
        all_reused += reused;
        let last = map.version();
        for (light, parts, version) in &mut held {
            map.push_difference(*parts, light, *version, last)
                .expect("update");
            *version = last;
        }
        map.forget(last).expect("room");
        let sums = map.sums().expect("read-back");
        assert!(sums.iter().any(|s| *s != 0));

        // Texels of objects that are gone hold nothing: nothing shines on them.
        let mut fresh = start(&gpu, &scene, &texels);
        fresh.set_occlusion(false);
        let gone = (0..scene.objects.len() as u32).filter(|&o| scene.mesh(o).triangles.is_empty());
        let place = |object| Place {
            object,
            before: None,
            after: None,
        };
        let changed = Changed {
            places: gone.map(place).collect(),
            ..Changed::default()
        };
        let version = fresh
            .change(&scene, &texels, &[], &[], changed)
            .expect("a change");
        fresh.divide(&seen).expect("upload");
        for (light, parts, _) in held {
            fresh
                .push_to(parts, light, Sign::Add, version)
                .expect("add");
        }
        let expected = fresh.sums().expect("read-back");
        let wrong = sums.iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert_eq!(wrong, 0, "of {} sums, seed {seed}", sums.len());
    }
    assert!(all_reused > 0, "no tile was ever another object's");
}
