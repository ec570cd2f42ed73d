//! What an edited scene is compared with: the loader's reading of its document, and differences found the slow way.

use proptest::prelude::*;
use rebake::scene::{
    Aperture, Document, Light, Scene, TextureRef,
    edit::{Change, Editor},
};

/// Without what is gone, and with indices as a loader gives them.
fn dense(scene: &Scene) -> Scene {
    let mut dense = scene.clone();
    dense.meshes.retain(|mesh| mesh.source != u32::MAX);
    let live = |o: &u32| !scene.is_gone(*o);
    let kept: Vec<u32> = (0..scene.objects.len() as u32).filter(live).collect();
    dense.objects = kept
        .iter()
        .map(|o| scene.objects[*o as usize].clone())
        .collect();
    for light in &mut dense.lights {
        if let Aperture::Surface { object } = &mut light.aperture {
            *object = kept.binary_search(object).unwrap() as u32;
        }
    }
    dense
}

/// Everything that light sees of an object, and of its emission, told from the document's point of view.
fn look(scene: &Scene, object: u32) -> Option<(Vec<[glam::Vec3; 3]>, String, String, String)> {
    if object as usize >= scene.objects.len() || scene.is_gone(object) {
        return None;
    }
    let texture = |t: &Option<TextureRef>| {
        let t = t.as_ref()?;
        let texels = &scene.textures[t.texture as usize].texels;
        Some((texels, t.texcoord, t.transform, t.wrap))
    };
    let (mut passes, mut reflects, mut emits) = (String::new(), String::new(), String::new());
    for primitive in &scene.mesh(object).primitives {
        let m = &scene.materials[primitive.material as usize];
        let base = texture(&m.base_color_texture);
        if m.alpha == rebake::scene::AlphaMode::Opaque {
            passes += "never ";
        } else {
            passes += &format!("{:?} {:?} {base:?} ", m.alpha, m.base_color.w);
        }
        reflects += &format!("{:?} {base:?} ", m.base_color.truncate());
        emits += &format!("{:?} {:?}", m.emission, texture(&m.emission_texture));
    }
    let triangles = 0..scene.mesh(object).triangles.len() as u32;
    let triangles = triangles.map(|t| scene.world_triangle(object, t)).collect();
    Some((triangles, passes, reflects, emits))
}

/// `Change::between` the slow way.
pub fn differences(old: &Scene, new: &Scene) -> Change {
    let mut change = Change::default();
    let mut touched = Vec::new();
    for object in 0..old.objects.len().max(new.objects.len()) as u32 {
        match (look(old, object), look(new, object)) {
            (None, None) => {}
            (Some(a), Some(b)) if a.0 == b.0 && a.1 == b.1 => {
                if a.2 != b.2 {
                    change.surfaces.push(object);
                }
                if a.3 != b.3 {
                    touched.push(object);
                }
            }
            _ => {
                change.objects.push(object);
                touched.push(object);
            }
        }
    }
    change.bounds_changed = old.bounds() != new.bounds();
    let find = |scene: &Scene, id: u32| -> Option<Light> {
        scene.lights.iter().find(|l| l.id() == id).cloned()
    };
    let ids = old.lights.iter().chain(&new.lights).map(Light::id);
    let ids: std::collections::BTreeSet<u32> = ids.collect();
    change.lights = ids
        .into_iter()
        .filter(|id| match (find(old, *id), find(new, *id)) {
            (Some(mut a), Some(b)) => {
                a.name = b.name.clone();
                let around = match b.aperture {
                    Aperture::Surface { object } => touched.contains(&object),
                    Aperture::Directional => change.bounds_changed,
                    _ => false,
                };
                a != b || around
            }
            _ => true,
        })
        .collect();
    change
}

/// The scene is what the loader makes of the document, also of the written one.
pub fn check(editor: &Editor) -> Result<(), TestCaseError> {
    let scene = editor.scene();
    let fresh = Scene::from_document(editor.document()).unwrap();
    prop_assert_eq!(&dense(scene), &fresh);
    prop_assert!(scene.objects.is_sorted_by_key(|o| o.node));
    prop_assert!(scene.lights.is_sorted_by_key(Light::id));
    let written = editor.document().to_glb().unwrap();
    let read = Scene::from_document(&Document::parse(&written, None).unwrap()).unwrap();
    prop_assert_eq!(&read, &fresh);
    Ok(())
}
