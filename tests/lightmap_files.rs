//! The written files, read as a renderer reads them: at every surface point, the lightmap holds that point's light.

use glam::{Vec2, Vec3};
use rebake::lightmap::{
    Atlas, AtlasOptions, Lightmap, Texel, coverage, export, exr, page_file, resolve, texels::Texels,
};
use rebake::scene::{Document, Scene, builtin::builtin};
use serde_json::Value;

/// A light field that is linear in space, so that bilinear filtering on a flat chart reproduces it.
fn light(at: Vec3) -> Vec3 {
    Vec3::new(10.0 + at.x, 20.0 + 2.0 * at.y, 30.0 - 3.0 * at.z)
}

/// Lights every texel that can be fetched by continuing the plane of a triangle that fetches it.
fn lit(scene: &Scene, atlas: &Atlas) -> Lightmap {
    let (mut list, mut irradiance) = (Vec::new(), Vec::new());
    for (o, place) in atlas.objects.iter().enumerate() {
        let mut value = vec![None; (place.size.x * place.size.y) as usize];
        for (t, corners) in place.layout.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|v| place.layout.vertices[v as usize].uv);
            let mesh = scene.mesh(o as u32);
            let p = mesh.triangles[t].map(|v| {
                scene.objects[o]
                    .transform
                    .transform_point3(mesh.positions[v as usize])
            });
            let area = (b - a).perp_dot(c - a);
            let (low, high) = (a.min(b).min(c) - 1.5, a.max(b).max(c) + 1.5);
            for y in low.y.max(0.0) as u32..(high.y as u32).min(place.size.y) {
                for x in low.x.max(0.0) as u32..(high.x as u32).min(place.size.x) {
                    let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let weights = Vec3::new(
                        (b - at).perp_dot(c - at),
                        (c - at).perp_dot(a - at),
                        (a - at).perp_dot(b - at),
                    ) / area;
                    // The triangle that the texel is nearest to says most.
                    let inside = weights.min_element();
                    let slot = &mut value[(y * place.size.x + x) as usize];
                    if area != 0.0 && slot.is_none_or(|(best, _)| best < inside) {
                        let at = p[0] * weights.x + p[1] * weights.y + p[2] * weights.z;
                        *slot = Some((inside, light(at)));
                    }
                }
            }
        }
        let fetched = coverage::fetched(&place.layout, place.size);
        for (i, _) in fetched.iter().enumerate().filter(|(_, f)| **f) {
            let (x, y) = (i as u32 % place.size.x, i as u32 / place.size.x);
            let (x, y) = (x + place.origin.x, y + place.origin.y);
            let pixel = (place.page * atlas.page_size + y) * atlas.page_size + x;
            list.push(Texel {
                position: [0.0; 3],
                object: o as u32,
                normal: [0.0; 3],
                face: [0.0; 3],
                pixel,
            });
            irradiance.push(value[i].unwrap().1.to_array());
        }
    }
    let texels = Texels {
        list,
        ..Texels::default()
    };
    resolve::resolve(scene, atlas, &texels, &irradiance)
}

/// The lightmap page of a primitive, by the way that the file gives.
fn page_of(json: &Value, node: u32, primitive: u32) -> usize {
    let mesh = json["nodes"][node as usize]["mesh"].as_u64().unwrap() as usize;
    let primitive = &json["meshes"][mesh]["primitives"][primitive as usize];
    let material = &json["materials"][primitive["material"].as_u64().unwrap() as usize];
    let lightmap = &material["extensions"]["MOZ_lightmap"];
    assert_eq!(lightmap["texCoord"], 1);
    let texture = &json["textures"][lightmap["index"].as_u64().unwrap() as usize];
    let image = texture["extensions"]["EXT_texture_exr"]["source"]
        .as_u64()
        .unwrap() as usize;
    let uri = json["images"][image]["uri"].as_str().unwrap();
    (0..).find(|k| uri == page_file(*k)).unwrap() as usize
}

fn check(document: &Document, options: &AtlasOptions) {
    let scene = Scene::from_document(document).unwrap();
    let atlas = Atlas::build(&scene, options).unwrap();
    let map = lit(&scene, &atlas);
    let folder = tempfile::tempdir().unwrap();
    let content = export::Content::DirectAndIndirect;
    export::write_outputs(
        folder.path(),
        document,
        &scene,
        &atlas,
        &map,
        content,
        Vec::new(),
    )
    .unwrap();

    let (read, document) = Scene::load(&folder.path().join("scene.glb")).unwrap();
    let pages: Vec<_> = (0..atlas.pages)
        .map(|k| exr::read(&folder.path().join(page_file(k))).unwrap())
        .collect();
    let map = Lightmap {
        page_size: pages[0].width as u32,
        pages: pages.into_iter().map(|page| page.texels).collect(),
    };
    assert_eq!(read.objects.len(), scene.objects.len());
    let (mut points, mut worst) = (0, 0.0f32);
    for (o, object) in read.objects.iter().enumerate() {
        let mesh = read.mesh(o as u32);
        for primitive in &mesh.primitives {
            let page = page_of(&document.json, object.node, primitive.source);
            for t in primitive.triangles.clone() {
                let corners = mesh.triangles[t as usize];
                for (a, b) in [
                    (0.0, 0.0),
                    (1.0, 0.0),
                    (0.0, 1.0),
                    (0.5, 0.5),
                    (0.3, 0.2),
                    (0.01, 0.98),
                ] {
                    let weigh = |[p, q, r]: [Vec3; 3]| p * (1.0 - a - b) + q * a + r * b;
                    let uv = weigh(corners.map(|v| mesh.texcoords[1][v as usize].extend(0.0)))
                        .truncate();
                    let at = weigh(corners.map(|v| {
                        object
                            .transform
                            .transform_point3(mesh.positions[v as usize])
                    }));
                    let error = map.sample_bilinear(page as u32, uv) - light(at);
                    worst = worst.max(error.abs().max_element());
                    points += 1;
                }
            }
        }
    }
    assert!(
        points > 100 && worst < 0.01,
        "{points} points, largest error {worst}"
    );
}

#[test]
fn every_point_of_the_cornell_box_finds_its_own_light() {
    let document = builtin("cornell").unwrap();
    check(
        &document,
        &AtlasOptions {
            texels: 30_000,
            ..AtlasOptions::default()
        },
    );
}

#[test]
fn so_does_it_on_several_pages() {
    let document = builtin("cornell").unwrap();
    let options = AtlasOptions {
        density: Some(40.0),
        page_size: Some(128),
        ..AtlasOptions::default()
    };
    let scene = Scene::from_document(&document).unwrap();
    assert!(Atlas::build(&scene, &options).unwrap().pages > 1);
    check(&document, &options);
}
