//! The host's kernels, one thread each: rays, paths, validation, octree, similarity, hulls, metric, balance.
//!
//! `cargo bench --bench kernels [-- PART_OF_A_NAME]`: on the built-in Cornell box, or on `REBAKE_SCENE`, a built-in name or a file.
//! Rates (`thrpt`) are of what the kernel works on: rays, paths, virtual point lights, cells.

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, Throughput};
use glam::{Affine3A, Vec2, Vec3};
use rebake::cluster::cell::Cell;
use rebake::cluster::polygon::{self, Plane, Region};
use rebake::cluster::similarity::Groups;
use rebake::cluster::sums::key_of;
use rebake::cluster::{
    Budget, CellId, Clusters, FluxScale, Forest as _, Octree, SimilaritySettings, Wanted,
};
use rebake::scene::edit::Change;
use rebake::scene::{Scene, builtin};
use rebake::transport::intersect::offset;
use rebake::transport::sampling::{Sequence, cosine_hemisphere};
use rebake::transport::{PathSet, PathSettings, trace};
use rebake::transport::{SceneBvh, Validator, Vpl};

/// Paths of the larger kernels.
const PATHS: u32 = 1 << 15;
/// Incoherent rays at once.
const RAYS: u32 = 1 << 14;
/// What `--quality preview` refines to.
const BUDGET: Budget = Budget::Auto { error: 6e-4 };

/// A scene with its light's way through it.
struct Lit {
    scene: Scene,
    bvh: SceneBvh,
    settings: PathSettings,
    paths: PathSet,
    vpls: Vec<Vpl>,
    clusters: Clusters,
}

fn main() {
    let name = std::env::var("REBAKE_SCENE").unwrap_or_else(|_| "cornell".into());
    let (scene, _) = builtin::open(&name).unwrap_or_else(|e| panic!("REBAKE_SCENE: {e}"));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    one.expect("a thread").install(|| {
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, PATHS);
        let paths = trace(&scene, &bvh, &settings);
        let similarity = SimilaritySettings::default();
        let lit = Lit {
            clusters: Clusters::new(&scene, &paths, &settings, similarity),
            vpls: paths.vpls().copied().collect(),
            scene,
            bvh,
            settings,
            paths,
        };
        println!(
            "{name}: {} triangles, {} lights, {} paths, {} VPLs, seed 0, one thread",
            lit.bvh.triangles(),
            lit.scene.lights.len(),
            lit.paths.paths(),
            lit.vpls.len()
        );
        // Its plots want a font that the plots of `rebake` bring along themselves.
        let mut criterion = Criterion::default()
            .without_plots()
            .sample_size(10)
            .warm_up_time(std::time::Duration::from_millis(500))
            .measurement_time(std::time::Duration::from_secs(2))
            .configure_from_args();
        rays(&mut criterion.benchmark_group("tracing"), &lit);
        validation(&mut criterion.benchmark_group("validation"), &lit);
        dimming(&mut criterion.benchmark_group("dimming"), &lit);
        octree(&mut criterion.benchmark_group("octree"), &lit);
        cells(&mut criterion.benchmark_group("cells"), &lit);
        balance(&mut criterion.benchmark_group("balance"), &lit);
        criterion.final_summary();
    });
}

type Group<'a> = BenchmarkGroup<'a, WallTime>;

fn rays(group: &mut Group, lit: &Lit) {
    let (scene, bvh) = (&lit.scene, &lit.bvh);
    group.throughput(Throughput::Elements(bvh.triangles() as u64));
    group.bench_function("BVH", |b| b.iter(|| SceneBvh::build(scene)));
    // From every VPL once more, in an order that no cache likes.
    let sequence = Sequence::new(1, 0);
    let rays: Vec<(Vec3, Vec3)> = (0..RAYS)
        .map(|i| {
            let vpl = &lit.vpls[i as usize * 7919 % lit.vpls.len()];
            let [u, v, ..] = sequence.sample(i, 2);
            let direction = cosine_hemisphere(vpl.normal, [u, v]);
            (offset(vpl.position, vpl.normal), direction)
        })
        .collect();
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    group.bench_function("closest hits", |b| {
        b.iter(|| {
            let hit = |&&(o, d): &&(Vec3, Vec3)| bvh.closest(scene, o, d, f32::INFINITY).is_some();
            rays.iter().filter(hit).count()
        });
    });
    let reach = 0.1 * scene.bounds().size().max_element();
    group.bench_function("any hits nearby", |b| {
        b.iter(|| {
            let hit = |&&(o, d): &&(Vec3, Vec3)| bvh.occluded(scene, o, d, reach);
            rays.iter().filter(hit).count()
        });
    });
    group.throughput(Throughput::Elements(lit.paths.paths() as u64));
    group.bench_function("paths", |b| {
        b.iter(|| trace(scene, bvh, &lit.settings));
    });
}

/// An object moved that about 1 % of the paths come near.
fn validation(group: &mut Group, lit: &Lit) {
    let scene = &lit.scene;
    let before = Validator::new(scene, &lit.bvh, &lit.settings);
    let paths = before.paths().paths();
    let moved = |object: usize| {
        let mut edited = scene.clone();
        let by = Vec3::new(0.01, 0.0, 0.01) * scene.bounds().size().max_element();
        let to = Affine3A::from_translation(by);
        edited.objects[object].transform = to * edited.objects[object].transform;
        let change = Change::between(scene, &edited);
        (edited, change)
    };
    let marked = |object: usize| {
        let (edited, change) = moved(object);
        let mut validator = before.clone();
        validator.invalidate(&edited, &change);
        validator
    };
    let step = scene.objects.len().div_ceil(60);
    let object = (0..scene.objects.len())
        .step_by(step)
        .filter(|&o| scene.lights.iter().all(|l| l.node != scene.objects[o].node))
        .min_by_key(|&o| (marked(o).invalid_paths() * 100).abs_diff(paths))
        .unwrap_or(0);
    let (edited, change) = moved(object);
    group.bench_function("BVH follows", |b| {
        b.iter(|| lit.bvh.moved(&edited, &change.objects));
    });
    let bvh = lit.bvh.moved(&edited, &change.objects);
    group.throughput(Throughput::Elements(paths as u64));
    group.bench_function("marking", |b| {
        let mark = |mut v: Validator| {
            v.invalidate(&edited, &change);
            v
        };
        b.iter_batched(|| before.clone(), mark, BatchSize::LargeInput);
    });
    let invalid = marked(object);
    println!(
        "object {object} moved by 1 % of the scene: {} of {paths} paths marked",
        invalid.invalid_paths()
    );
    follow(group, lit, &edited, &bvh, &invalid);
}

/// Every light dimmed to a half: no path goes elsewhere.
fn dimming(group: &mut Group, lit: &Lit) {
    let before = Validator::new(&lit.scene, &lit.bvh, &lit.settings);
    let mut edited = lit.scene.clone();
    edited.lights.iter_mut().for_each(|l| l.intensity *= 0.5);
    edited.materials.iter_mut().for_each(|m| m.emission *= 0.5);
    let change = Change::between(&lit.scene, &edited);
    let mark = |mut v: Validator| {
        v.invalidate(&edited, &change);
        v
    };
    group.throughput(Throughput::Elements(lit.paths.paths() as u64));
    group.bench_function("marking", |b| {
        b.iter_batched(|| before.clone(), mark, BatchSize::LargeInput);
    });
    follow(group, lit, &edited, &lit.bvh, &mark(before));
}

/// Paths that an edit marked are valid again, and what stands for their light follows.
fn follow(group: &mut Group, lit: &Lit, edited: &Scene, bvh: &SceneBvh, invalid: &Validator) {
    let step = |mut v: Validator| {
        let differences = v.step(edited, bvh, usize::MAX);
        (v, differences)
    };
    group.throughput(Throughput::Elements(invalid.invalid_paths() as u64));
    group.bench_function("tracing again", |b| {
        b.iter_batched(|| invalid.clone(), step, BatchSize::LargeInput);
    });
    let (after, differences) = step(invalid.clone());
    let changed = differences.removed.len() + differences.added.len() + differences.revised.len();
    let apply = |mut c: Clusters| {
        c.apply(edited, after.paths(), &differences);
        c
    };
    group.throughput(Throughput::Elements(changed as u64));
    group.bench_function("clusters follow", |b| {
        b.iter_batched(|| lit.clusters.clone(), apply, BatchSize::LargeInput);
    });
    let mut wanted = Wanted::new();
    wanted.update(&lit.clusters, BUDGET);
    let applied = apply(lit.clusters.clone());
    group.throughput(Throughput::Elements(wanted.cells().len() as u64));
    group.bench_function("wanted lights follow", |b| {
        let update = |mut w: Wanted| w.update(&applied, BUDGET);
        b.iter_batched(|| wanted.clone(), update, BatchSize::LargeInput);
    });
}

fn octree(group: &mut Group, lit: &Lit) {
    let scale = FluxScale::new(lit.settings.flux_per_path);
    group.throughput(Throughput::Elements(lit.vpls.len() as u64));
    group.bench_function("build", |b| b.iter(|| Octree::build(scale, &lit.vpls)));
    let full = Octree::build(scale, &lit.vpls);
    // A tenth goes and comes back: the tree is then what it was.
    let some: Vec<&Vpl> = lit.vpls.iter().step_by(10).collect();
    let mut without = full.clone();
    assert!(some.iter().all(|v| without.remove(v)));
    group.throughput(Throughput::Elements(some.len() as u64));
    group.bench_function("add", |b| {
        let add = |mut tree: Octree| {
            some.iter().for_each(|v| tree.add(v));
            tree
        };
        assert_eq!(add(without.clone()), full);
        b.iter_batched(|| without.clone(), add, BatchSize::LargeInput);
    });
    group.bench_function("remove", |b| {
        let remove = |mut tree: Octree| {
            some.iter().for_each(|v| assert!(tree.remove(v)));
            tree
        };
        b.iter_batched(|| full.clone(), remove, BatchSize::LargeInput);
    });
}

fn cells(group: &mut Group, lit: &Lit) {
    let similarity = SimilaritySettings::default();
    let cut = lit.clusters.select(BUDGET);
    let found = cut.cells.iter().filter_map(|id| match id {
        CellId::Octree(cell) => Some((*cell, lit.clusters.octree.node(cell)?.vpls())),
        CellId::Aperture { .. } => None,
    });
    let found: Vec<(Cell, Vec<Vpl>)> = found.collect();
    group.throughput(Throughput::Elements(found.len() as u64));
    group.bench_function("similarity", |b| {
        let groups = |found: Vec<(Cell, Vec<Vpl>)>| -> Vec<Groups> {
            let made = found.into_iter();
            made.map(|(cell, vpls)| Groups::new(cell, vpls, &similarity))
                .collect()
        };
        b.iter_batched(|| found.clone(), groups, BatchSize::LargeInput);
    });
    // What becomes polygons: every plane with its points.
    let planes: Vec<(Cell, Plane, Vec<Vec2>)> = found
        .iter()
        .flat_map(|(cell, vpls)| {
            let groups = Groups::new(*cell, vpls.clone(), &similarity);
            let points = |members: &[u32], plane: &Plane| -> Vec<Vec2> {
                let at = members.iter().map(|&i| groups.vpls[i as usize].position);
                at.map(|p| plane.project(p)).collect()
            };
            let planes = groups.planes.iter();
            planes
                .map(|p| (*cell, p.plane, points(&p.members, &p.plane)))
                .collect::<Vec<_>>()
        })
        .collect();
    group.throughput(Throughput::Elements(planes.len() as u64));
    group.bench_function("sections", |b| {
        b.iter(|| {
            for (cell, plane, _) in &planes {
                let [low, high] = cell.bounds();
                black_box(plane.section(low, high));
            }
        });
    });
    let sections = |(cell, plane, points): (Cell, Plane, Vec<Vec2>)| {
        let [low, high] = cell.bounds();
        (plane.section(low, high), plane, points)
    };
    let sections: Vec<_> = planes.into_iter().map(sections).collect();
    group.bench_function("outlines", |b| {
        let outline = |sections: Vec<(Vec<Vec2>, Plane, Vec<Vec2>)>| {
            for (section, plane, points) in sections {
                let region = Region::of(&points, section);
                black_box(region.map(|r| polygon::vertices(&plane, r.outline)));
            }
        };
        b.iter_batched(|| sections.clone(), outline, BatchSize::LargeInput);
    });
    group.throughput(Throughput::Elements(found.len() as u64));
    group.bench_function("virtual lights", |b| {
        b.iter(|| lit.clusters.virtual_lights(&cut));
    });
}

fn balance(group: &mut Group, lit: &Lit) {
    group.throughput(Throughput::Elements(lit.vpls.len() as u64));
    group.bench_function("metric", |b| {
        b.iter(|| {
            let keys = lit.vpls.iter();
            keys.map(|v| key_of(v.weight, 0.5, 0.1))
                .fold(0u64, u64::wrapping_add)
        });
    });
    for error in [6e-4, 1e-4] {
        let budget = Budget::Auto { error };
        let cells = lit.clusters.select(budget).cells.len();
        group.throughput(Throughput::Elements(cells as u64));
        group.bench_function(format!("cut at {error:e}"), |b| {
            b.iter(|| lit.clusters.select(budget));
        });
    }
    let roots = lit.clusters.roots();
    println!("{} roots", roots.len());
    let first = |mut wanted: Wanted| wanted.update(&lit.clusters, BUDGET);
    group.bench_function("wanted lights from nothing", |b| {
        b.iter_batched(Wanted::new, first, BatchSize::LargeInput);
    });
}
