//! Holds whole bakes, through the real binary and its files, to irradiance that is known in closed form.

#[path = "common/map.rs"]
mod map;
#[path = "common/points.rs"]
mod points;
#[path = "common/quads.rs"]
mod quads;
#[path = "common/run.rs"]
mod run;

use std::f64::consts::PI;
use std::path::Path;

use glam::{DQuat, DVec3};
use map::Map;
use points::{Point, points};
use quads::Quad;
use run::{bake, builtin};
use serde_json::json;
use tempfile::tempdir;

/// Bakes an enclosure that is lit alike everywhere; the mean over its surface must be within 1 %, and every texel
/// whose point `counts` within 5 %, those that only filtering fetches included where every point counts.
fn enclosure(name: &str, options: &str, expected: f64, counts: Option<fn(&Point) -> bool>) {
    let folder = tempdir().unwrap();
    let scene = builtin(name, folder.path());
    let (out, _) = bake(&scene, "out", &format!("--texels 20k {options}"));
    let points = points(&out);
    let area: f64 = points.iter().map(|p| p.area).sum();
    let mean = points.iter().map(|p| p.mean() * p.area).sum::<f64>() / area;
    let mut values: Vec<f64> = points
        .iter()
        .filter(|p| counts.is_none_or(|counts| counts(p)))
        .flat_map(|p| p.value)
        .collect();
    if counts.is_none() {
        // Zero is nothing at all.
        let written = Map::read(&out).texels.into_iter().flatten();
        values.extend(written.filter(|v| *v != 0.0));
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(0.0, f64::max);
    let off = |value: f64| 100.0 * (value / expected - 1.0);
    let outside = values.iter().filter(|v| off(**v).abs() > 5.0).count();
    let found = format!(
        "{name}: mean {mean:.4} lux, {:+.3} % from {expected:.4}; texels {:+.2} % to {:+.2} %, {outside} of {} values beyond 5 %",
        off(mean),
        off(low),
        off(high),
        values.len(),
    );
    eprintln!("{found}");
    assert!(points.len() > 10_000 && values.len() > 20_000);
    assert!(off(mean).abs() <= 1.0, "{found}");
    assert_eq!(outside, 0, "{found}");
}

/// Every bounce in a sphere spreads evenly over it: `phi / (A (1 - albedo))`, with 100 cd in the centre and radius 1 m.
#[test]
fn integrating_sphere_of_albedo_one_half() {
    enclosure("integrating-sphere", "", 100.0 / 0.5, None);
}

/// As above, with 80 % of the light in bounces: after 16 of them 2.8 % of it would be left.
#[test]
fn integrating_sphere_of_albedo_four_fifths() {
    enclosure("integrating-sphere-0.8", "--bounces 32", 100.0 / 0.2, None);
}

/// Walls of radiance 1 all around: `pi / (1 - albedo)` everywhere. Here up to 6 cm, two texels, from the edges.
#[test]
fn furnace() {
    enclosure("furnace", "", PI / 0.5, Some(|p| edge_distance(p) > 0.06));
}

/// Along the edges, depth maps cannot tell the walls apart: there, and in the corners, a little light may be lost.
#[test]
fn furnace_edges_and_corners() {
    let folder = tempdir().unwrap();
    let scene = builtin("furnace", folder.path());
    let (out, _) = bake(&scene, "out", "--texels 20k");
    let points = points(&out);
    let near = |p: &Point| wall_distances(p).map(|d| d <= 0.06);
    let off = |p: &Point| 100.0 * (p.mean() / (2.0 * PI) - 1.0);
    for (name, of, mean_limit, worst_limit) in [
        ("edges", [true, false], 2.0, 10.0),
        ("corners", [true, true], 10.0, 30.0),
    ] {
        let errors: Vec<f64> = points.iter().filter(|p| near(p) == of).map(off).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = errors.iter().fold(0.0, |w: f64, e| w.max(e.abs()));
        let found = format!(
            "{name}: mean {mean:+.2} %, worst {worst:.2} % of {} texels",
            errors.len()
        );
        eprintln!("{found}");
        assert!(errors.len() > 20, "{found}");
        assert!(mean.abs() < mean_limit && worst < worst_limit, "{found}");
    }
}

/// Metres from a point of the furnace's cube, of 2 m on a floor at 0, to the nearest wall but the one it is on.
fn edge_distance(point: &Point) -> f64 {
    wall_distances(point)[0]
}

/// Metres from a point of the furnace's cube to the two walls that are nearest, but for the one it is on.
fn wall_distances(point: &Point) -> [f64; 2] {
    let inside = DVec3::ONE - (point.position - DVec3::Y).abs();
    let mut distances = inside.to_array();
    distances.sort_by(f64::total_cmp);
    [distances[1], distances[2]]
}

/// A panel that hangs a few millimetres before a wall, nearer than depth maps can tell at any distance, keeps it dark; what
/// it leaves open is lit all the same.
#[test]
fn a_panel_keeps_the_wall_behind_it_dark() {
    for gap in [0.005, 0.0005] {
        let folder = tempdir().unwrap();
        let upright = |name, z: f32, half: f32, emission| Quad {
            name,
            corners: [[-half, -half], [half, -half], [half, half], [-half, half]]
                .map(|[x, y]| [x, y, z]),
            emission: [emission; 3],
        };
        let wall = upright("wall", 0.0, 1.0, 0.0);
        let panel = upright("panel", gap, 0.4, 0.0);
        let mut lamp = upright("lamp", 3.0, 0.3, 1000.0);
        for corner in &mut lamp.corners {
            corner[0] += 1.5;
        }
        lamp.corners.reverse();
        let scene = quads::write(folder.path(), &[wall, panel, lamp], &[]);
        let (out, _) = bake(&scene, "out", "--texels 20k");
        let points = points(&out);
        let wall: Vec<(f64, f64)> = points
            .iter()
            .filter(|p| p.object == "wall")
            .map(|p| (p.position.x.abs().max(p.position.y.abs()), p.mean()))
            .collect();
        let lit: Vec<f64> = wall.iter().filter(|w| w.0 > 0.4).map(|w| w.1).collect();
        let beside = lit.iter().sum::<f64>() / lit.len() as f64;
        // A texel at the panel's edge may be seen past it.
        let behind = wall.iter().filter(|w| w.0 < 0.36).map(|w| w.1);
        let behind = behind.fold(0.0, f64::max);
        eprintln!("gap {gap}: at most {behind:.5} lux behind the panel, {beside:.3} beside it");
        assert!(
            beside > 1.0 && behind < 1e-3 * beside,
            "{behind} of {beside}"
        );
        let open = wall
            .iter()
            .filter(|w| w.0 > 0.45)
            .map(|w| w.1)
            .fold(f64::MAX, f64::min);
        assert!(open > 0.1 * beside, "{open} of {beside}");
    }
}

/// The largest error among the points, relative to what is expected, with the point it is at.
fn worst<'a>(
    points: impl IntoIterator<Item = &'a Point>,
    expected: impl Fn(&Point) -> f64,
) -> (f64, String) {
    let mut worst = (0.0, "no error".to_owned());
    for point in points {
        let expected = expected(point);
        for value in point.value {
            let error = (value / expected - 1.0).abs();
            if error.is_nan() || error > worst.0 {
                let Point {
                    object,
                    position,
                    texel,
                    ..
                } = point;
                worst = (
                    error,
                    format!(
                        "{object} {position} (texel {texel:?}): {value} lux instead of {expected}, {:.5} % off",
                        100.0 * error
                    ),
                );
            }
        }
    }
    worst
}

/// A horizontal rectangle that faces up.
fn ground(half: f32, z_half: f32) -> Quad {
    Quad {
        name: "ground",
        corners: [
            [-half, 0.0, z_half],
            [half, 0.0, z_half],
            [half, 0.0, -z_half],
            [-half, 0.0, -z_half],
        ],
        emission: [0.0; 3],
    }
}

/// Half the edge of the emitting square, its height, its radiance, and the distance of the wall.
const HALF: f64 = 0.25;
const HEIGHT: f64 = 1.0;
const RADIANCE: f64 = 1000.0;
const WALL: f64 = -1.5;

/// The square faces down; the ground is parallel to it and the wall perpendicular; nothing is in between.
/// Configuration factors of an element to a rectangle: Howell, "A catalog of radiation heat transfer configuration
/// factors", B-3 (parallel) and B-4 (perpendicular), for any position.
#[test]
fn square_emitter_over_a_plane_and_before_a_wall() {
    let folder = tempdir().unwrap();
    let (h, y, w) = (HALF as f32, HEIGHT as f32, WALL as f32);
    let wall = Quad {
        name: "wall",
        corners: [[w, 0.0, 1.5], [w, 0.0, -1.5], [w, 0.8, -1.5], [w, 0.8, 1.5]],
        emission: [0.0; 3],
    };
    let lamp = Quad {
        name: "lamp",
        corners: [[-h, y, -h], [h, y, -h], [h, y, h], [-h, y, h]],
        emission: [RADIANCE as f32; 3],
    };
    let scene = quads::write(folder.path(), &[ground(1.5, 1.5), wall, lamp], &[]);
    let (out, report) = bake(&scene, "out", "--texels 20k");
    eprintln!("{}", report["counts"]);

    let corners = |x: f64, z: f64, f: &dyn Fn(f64, f64) -> f64| {
        f(HALF - x, HALF - z) - f(-HALF - x, HALF - z) - f(HALF - x, -HALF - z)
            + f(-HALF - x, -HALF - z)
    };
    let parallel = |p: DVec3| {
        corners(p.x, p.z, &|a, b| {
            let (u, v) = (HEIGHT.hypot(a), HEIGHT.hypot(b));
            (a / u * (b / u).atan() + b / v * (a / v).atan()) / (2.0 * PI)
        })
    };
    let perpendicular = |p: DVec3| {
        let height = HEIGHT - p.y;
        -corners(p.x, p.z, &|a, b| {
            let s = height.hypot(a);
            height / (2.0 * PI * s) * (b / s).atan()
        })
    };
    let points = points(&out);
    let on = |name: &'static str| points.iter().filter(move |p| p.object == name);
    assert!(on("ground").count() > 5_000 && on("wall").count() > 1_000);
    let (error, place) = worst(on("ground"), |p| PI * RADIANCE * parallel(p.position));
    eprintln!("largest error: {place}");
    let (wall_error, wall_place) = worst(on("wall"), |p| PI * RADIANCE * perpendicular(p.position));
    eprintln!("largest error: {wall_place}");
    assert!(error < 0.005, "{place}");
    assert!(wall_error < 0.005, "{wall_place}");
}

/// Bakes a black rectangle under lights; every texel must be exact to 1e-5. Where the texel's centre lies so near to
/// an edge that the texel stands for a point beside it, 1e-3 is what the shift of 1/64 texel may do.
fn exact(
    name: &str,
    lights: &[(serde_json::Value, serde_json::Value)],
    expected: impl Fn(&Point) -> f64,
) {
    let folder = tempdir().unwrap();
    let scene = quads::write(folder.path(), &[ground(1.0, 0.71)], lights);
    let (out, _) = bake(&scene, "out", "--texels 10k");
    let points = points(&out);
    let (inner, edge): (Vec<&Point>, Vec<&Point>) =
        points.iter().partition(|p| p.margin > 1.0 / 60.0);
    assert!(inner.len() > 5_000 && inner.len() > 20 * edge.len());
    let (error, place) = worst(inner, &expected);
    eprintln!("{name}: largest error {place}");
    assert!(error < 1e-5, "{name}: {place}");
    let (error, place) = worst(edge, &expected);
    assert!(error < 1e-3, "{name}: {place}");
}

#[test]
fn point_light_over_a_plane() {
    let at = DVec3::new(0.3, 0.625, -0.2);
    let light = json!({ "type": "point", "intensity": 80.0 });
    let node = json!({ "translation": at.to_array() });
    exact("point", &[(light, node)], |p| {
        let to_light = at.as_vec3().as_dvec3() - p.position;
        80.0 * to_light.normalize().dot(p.normal) / to_light.length_squared()
    });
}

/// Two suns, one of them low: what a plane's own shadow map says of it must not shade it.
#[test]
fn directional_lights_over_a_plane() {
    let turns = [(-80f64, 20f64, 1.0), (-8.0, 70.0, 40.0)].map(|(pitch, yaw, lux)| {
        let turn =
            DQuat::from_rotation_y(yaw.to_radians()) * DQuat::from_rotation_x(pitch.to_radians());
        (turn, lux)
    });
    let lights = turns.map(|(turn, lux)| {
        let light = json!({ "type": "directional", "intensity": lux });
        (light, json!({ "rotation": turn.to_array() }))
    });
    exact("directional", &lights, |p| {
        turns
            .iter()
            .map(|(turn, lux)| lux * (*turn * DVec3::Z).dot(p.normal))
            .sum()
    });
}

/// Straight down, with the falloff that `KHR_lights_punctual` suggests; outside the cone it is dark.
#[test]
fn spot_light_over_a_plane() {
    let folder = tempdir().unwrap();
    let (inner, outer) = (0.3f64, 0.6f64);
    let light = json!({ "type": "spot", "intensity": 80.0, "spot": { "innerConeAngle": inner, "outerConeAngle": outer } });
    let turn = DQuat::from_rotation_x(-PI / 2.0);
    let node = json!({ "translation": [0.0, 1.0, 0.0], "rotation": turn.to_array() });
    let scene = quads::write(folder.path(), &[ground(1.0, 0.71)], &[(light, node)]);
    let (out, _) = bake(&scene, "out", "--texels 10k");
    let mut dark = 0;
    for point in points(&out).iter().filter(|p| p.margin > 1.0 / 60.0) {
        let to_light = DVec3::Y - point.position;
        let cos = to_light.normalize().y;
        let cone = ((cos - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
        let expected = 80.0 * cone * cone * cos / to_light.length_squared();
        let error = (point.mean() - expected).abs();
        // Near the cone's edge nothing is left that an error could be relative to.
        assert!(
            error < 1e-5 * 80.0,
            "{}: {} instead of {expected}",
            point.position,
            point.mean()
        );
        dark += usize::from(expected == 0.0 && point.mean() == 0.0);
    }
    assert!(dark > 1_000);
}

/// A bake's map must be reachable through what the exported material says.
#[test]
fn the_map_is_what_scene_glb_refers_to() {
    let folder = tempdir().unwrap();
    let scene = quads::write(folder.path(), &[ground(1.0, 1.0)], &[]);
    let (out, _) = bake(&scene, "out", "--texels 1k --point 0,1,0,10");
    let glb = std::fs::read(Path::new(&out).join("scene.glb")).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let lightmap = &document["materials"][0]["extensions"]["MOZ_lightmap"];
    assert_eq!(lightmap["texCoord"], 1);
    let texture = &document["textures"][lightmap["index"].as_u64().unwrap() as usize];
    let image = texture["extensions"]["EXT_texture_exr"]["source"]
        .as_u64()
        .unwrap() as usize;
    assert_eq!(document["images"][image]["uri"], "lightmap_0.exr");
    // The light that was added by hand is in the written scene, so that a renderer has it too.
    assert_eq!(
        document["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"],
        10.0
    );
}
