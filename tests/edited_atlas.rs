//! Lightmap space under edits: nothing moves, what is new finds room, and the written files hold all that a bake of them needs.

#[path = "scene_edits/fixtures.rs"]
mod fixtures;

use std::{fs, path::Path, sync::Arc};

use fixtures::{Step, edit, steps, write_chair};
use proptest::prelude::*;
use rebake::{
    bake::uv_raster::{rasterize, rasterize_objects},
    gpu::{Gpu, GpuOptions},
    lightmap::{
        Atlas, AtlasOptions, Texel,
        export::{Content, write_outputs},
        resolve::resolve,
        texels::Texels,
    },
    scene::{
        Document, Scene,
        builtin::builtin,
        edit::{Command, Edit, Editor},
    },
    transport::{PathSet, PathSettings, SceneBvh, trace},
};

/// A session's scene with its lightmap space, followed edit by edit.
struct Session {
    gpu: Gpu,
    editor: Editor,
    atlas: Atlas,
    texels: Texels,
}

impl Session {
    fn new(name: &str, density: f32, page_size: u32) -> Self {
        let options = GpuOptions {
            device: None,
            validate: false,
        };
        let gpu = Gpu::new(&options).expect("a Vulkan device (tools/setup.sh installs lavapipe)");
        let mut document = builtin(name).unwrap();
        let mut scene = Scene::from_document(&document).unwrap();
        // Its paths start on the scene's bounds.
        scene
            .add_sun(&mut document, 50.0, 20.0, 100.0, glam::Vec3::ONE)
            .unwrap();
        let editor = Editor::new(scene, document).unwrap();
        let options = AtlasOptions {
            density: Some(density),
            page_size: Some(page_size),
            ..AtlasOptions::default()
        };
        let atlas = Atlas::build(editor.scene(), &options).unwrap();
        let claims = rasterize(&gpu, &atlas).unwrap();
        let texels = Texels::build(editor.scene(), &atlas, &claims);
        Self {
            gpu,
            editor,
            atlas,
            texels,
        }
    }

    /// Applies an edit, or undoes one; tells whether it was accepted.
    fn step(&mut self, edit: Option<Edit>, folder: &Path) -> bool {
        let before = self.atlas.clone();
        let change = match edit {
            Some(edit) => self.editor.apply(&edit, folder),
            None => self.editor.undo(),
        };
        if change.is_err() {
            return false;
        }
        let scene = self.editor.scene();
        let mut new = match self.atlas.update(scene) {
            Ok(new) => new,
            // Scaled beyond a page.
            Err(_) => {
                assert_eq!(self.atlas.objects.len(), before.objects.len());
                self.editor.take_back().unwrap();
                return false;
            }
        };
        for (i, (a, b)) in before.objects.iter().zip(&self.atlas.objects).enumerate() {
            if new.binary_search(&(i as u32)).is_err() {
                assert_eq!((a.page, a.origin, a.size), (b.page, b.origin, b.size));
                assert!(Arc::ptr_eq(&a.layout, &b.layout));
            }
        }
        new.extend(self.texels.lacking(scene));
        new.sort_unstable();
        new.dedup();
        let claims = rasterize_objects(&self.gpu, &self.atlas, &new).unwrap();
        self.texels.extend(scene, &self.atlas, &claims, &new);
        for object in 0..self.texels.tiles.len() as u32 {
            if object as usize >= scene.objects.len() || scene.is_gone(object) {
                let tiles = self.texels.retire(object);
                self.texels.release(tiles);
            }
        }
        true
    }

    /// No rectangles of objects that are there overlap; what came later is what a whole build finds; and a
    /// bake of the written files has every texel where it was.
    fn check(&self) {
        let scene = self.editor.scene();
        let lit = |t: &&Texel| t.pixel != Texel::NONE;
        let mut free = vec![true; self.texels.list.len() / Texel::TILE];
        let mut count = 0;
        for tiles in &self.texels.tiles {
            for tile in tiles.clone() {
                assert!(std::mem::replace(&mut free[tile as usize], false));
                let first = tile as usize * Texel::TILE;
                let own = self.texels.list[first..first + Texel::TILE].iter();
                count += own.filter(lit).count();
            }
        }
        assert_eq!(count, self.texels.count as usize);
        let mut used =
            vec![vec![false; (self.atlas.page_size as usize).pow(2)]; self.atlas.pages as usize];
        for (i, object) in (0..).zip(&self.atlas.objects) {
            if scene.is_gone(i) {
                continue;
            }
            for y in object.origin.y..object.origin.y + object.size.y {
                for x in object.origin.x..object.origin.x + object.size.x {
                    let at = (y * self.atlas.page_size + x) as usize;
                    assert!(!std::mem::replace(
                        &mut used[object.page as usize][at],
                        true
                    ));
                }
            }
        }
        let shown = self.atlas.shown(scene);
        let claims = rasterize(&self.gpu, &shown).unwrap();
        let whole = Texels::build(scene, &shown, &claims);
        let own = |texels: &Texels, object: usize| -> Vec<Texel> {
            let tiles = &texels.tiles[object];
            texels.list[tiles.start as usize * Texel::TILE..tiles.end as usize * Texel::TILE]
                .to_vec()
        };
        for object in 0..scene.objects.len() {
            match scene.is_gone(object as u32) {
                true => assert!(own(&whole, object).is_empty()),
                false => assert_eq!(own(&self.texels, object), own(&whole, object)),
            }
        }

        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let pages = self.write(self.editor.document(), scene, &shown, &whole, &a);
        let placements = shown.placements(scene);
        let (fresh, document) = Scene::load(&a.join("scene.glb")).unwrap();
        let again = Atlas::from_settings(
            &fresh,
            shown.density,
            shown.page_size,
            shown.pages,
            &placements,
        )
        .unwrap();
        assert_eq!(again.placements(&fresh), placements);
        assert_eq!(paths(&fresh, scene), paths(scene, scene));
        let claims = rasterize(&self.gpu, &again).unwrap();
        let texels = Texels::build(&fresh, &again, &claims);
        assert_eq!(texels.count, whole.count);
        assert_eq!(self.write(&document, &fresh, &again, &texels, &b), pages);
        for page in pages {
            assert!(
                fs::read(a.join(&page)).unwrap() == fs::read(b.join(&page)).unwrap(),
                "{page} differs"
            );
        }
    }

    /// Writes a map that depends on where each texel is in the world; returns its pages.
    fn write(
        &self,
        document: &Document,
        scene: &Scene,
        atlas: &Atlas,
        texels: &Texels,
        out: &Path,
    ) -> Vec<String> {
        let irradiance: Vec<[f32; 3]> = texels
            .list
            .iter()
            .map(|texel| {
                let transform = scene.objects[texel.object as usize].transform;
                let p = transform.transform_point3(texel.position.into());
                let n = transform.matrix3 * glam::Vec3A::from(texel.normal);
                (p * 7.0 + glam::Vec3::from(n))
                    .to_array()
                    .map(|v| v.sin() + 1.5)
            })
            .collect();
        let map = resolve(scene, atlas, texels, &irradiance);
        let files = write_outputs(
            out,
            document,
            scene,
            atlas,
            &map,
            Content::DirectAndIndirect,
            Vec::new(),
        );
        let names = files.unwrap().into_iter();
        names
            .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
            .filter(|name| name.ends_with(".exr"))
            .collect()
    }
}

/// Light paths, each with the node that it hits in the place of the object.
fn paths(scene: &Scene, reference: &Scene) -> PathSet {
    let settings = PathSettings::for_paths(reference, 500);
    let mut set = trace(scene, &SceneBvh::build(scene), &settings);
    let node = |object: &mut u32| {
        if let Some(object_hit) = scene.objects.get(*object as usize) {
            *object = object_hit.node;
        }
    };
    for path in set.lights.values_mut().flat_map(|light| &mut light.paths) {
        node(&mut path.emission.scatter.object);
        for vpl in &mut path.vpls {
            node(&mut vpl.object);
            node(&mut vpl.scatter.object);
        }
    }
    set
}

fn parse(line: &str) -> Option<Edit> {
    match Command::parse(line).unwrap() {
        Command::Edit(edit) => Some(edit),
        _ => None,
    }
}

#[test]
fn what_is_new_finds_room_and_new_pages_and_what_was_undone_finds_its_own() {
    let folder = tempfile::tempdir().unwrap();
    write_chair(folder.path());
    let mut session = Session::new("cornell", 60.0, 128);
    let pages = session.atlas.pages;
    let first = session.atlas.clone();
    session.check();
    for line in [
        r#"{"do": "copy", "node": "small.box", "name": "box 2"}"#,
        r#"{"do": "add", "file": "chair.gltf", "name": "chair"}"#,
        r#"{"do": "transform", "node": "chair", "scale": [0.2, 0.2, 0.2]}"#,
        r#"{"do": "copy", "node": "tall.box"}"#,
        r#"{"do": "remove", "node": "box 2"}"#,
        r#"{"do": "copy", "node": "small.box", "name": "box 3"}"#,
        r#"{"do": "copy", "node": "floor"}"#,
        r#"{"do": "remove", "node": "small.box"}"#,
        r#"{"do": "copy", "node": "tall.box", "name": "tower"}"#,
    ] {
        assert!(session.step(parse(line), folder.path()), "{line}");
    }
    assert!(session.atlas.pages > pages);
    // What comes lies where something lay that was taken away.
    let place = |name: &str| {
        let objects = &session.editor.scene().objects;
        let at = objects.iter().position(|o| o.name == name).unwrap();
        let place = &session.atlas.objects[at];
        (place.page, place.origin, place.size)
    };
    assert_eq!(place("box 3"), place("box 2"));
    // A copy is laid out as its original.
    let twin = &session.atlas.objects[8];
    assert!(Arc::ptr_eq(&twin.layout, &first.objects[5].layout));
    session.check();
    let full = session.atlas.clone();
    for _ in 0..9 {
        assert!(session.step(None, folder.path()));
    }
    let shown = session.atlas.shown(session.editor.scene());
    assert_eq!(
        (shown.pages, shown.objects.len()),
        (first.pages, first.objects.len())
    );
    session.check();
    for _ in 0..9 {
        session.editor.redo().unwrap();
        session.atlas.update(session.editor.scene()).unwrap();
    }
    for (a, b) in full.objects.iter().zip(&session.atlas.objects) {
        assert_eq!((a.page, a.origin, a.size), (b.page, b.origin, b.size));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_scripts_keep_every_texel_in_the_files(steps in steps(4..14)) {
        let folder = tempfile::tempdir().unwrap();
        write_chair(folder.path());
        let mut session = Session::new("cornell", 40.0, 128);
        let mut depth = 0;
        for step in &steps {
            let edit = edit(&session.editor, step as &Step);
            let undo = edit.is_none();
            if undo && depth == 0 {
                continue;
            }
            if session.step(edit, folder.path()) {
                depth = if undo { depth - 1 } else { depth + 1 };
            }
        }
        session.check();
    }
}
