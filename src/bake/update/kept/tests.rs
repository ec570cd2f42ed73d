use glam::Vec3;

use super::*;
use crate::bake::device::shared::BATCH;
use crate::gpu::GpuOptions;

fn pending(x: f32, sign: Sign, [other, version]: [Version; 2], parts: Parts) -> Pending {
    let light = VirtualLight {
        shape: Shape::Disk { area: 1.0 },
        position: Vec3::new(x, 0.0, 0.0),
        normal: Vec3::Y,
        surface: Vec3::Y,
        flux: Vec3::ONE,
        direct: false,
    };
    Pending {
        light,
        sign,
        version,
        other,
        begins: None,
        flux: None,
        parts,
        update: 0,
        keeping: Keeping::default(),
    }
}

const SIZES: ShadowSizes = ShadowSizes {
    indirect: 8,
    direct: 16,
    sun: 8,
};

fn slot(size: Size, place: u32) -> Slot {
    Slot { size, place }
}

#[test]
fn maps_stay_as_long_as_either_part_refers_to_them_and_slots_come_back() {
    let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
    let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * hemicube_bytes(SIZES.indirect));
    let mut note = |x, sign, versions, parts| maps.note(&pending(x, sign, versions, parts));
    // As many lights as may be sent together: none of them may draw over a map that another one looks up.
    let others = |note: &mut dyn FnMut(f32, Sign, [Version; 2], Parts) -> Keeping| {
        for _ in 0..BATCH {
            let nothing = note(9.0, Sign::Subtract, [0, 0], Parts::ALL);
            assert_eq!(nothing, Keeping::default());
        }
    };
    let own = |place| Some(slot(Size::Indirect, place));
    let new = |place| Keeping {
        store: own(place),
        ..Keeping::default()
    };
    let known = |place| Keeping {
        load: own(place),
        ..Keeping::default()
    };
    let (add, subtract) = (Sign::Add, Sign::Subtract);
    assert_eq!(note(1.0, add, [0, 0], Parts::SEEN), new(0));
    assert_eq!(note(1.0, add, [0, 0], Parts::REST), known(0));
    assert_eq!(note(2.0, add, [0, 0], Parts::ALL), new(1));
    // There is no room for a third one, and so none for what follows from it.
    assert_eq!(note(3.0, add, [0, 0], Parts::ALL), Keeping::default());
    assert_eq!(note(3.0, add, [0, 1], Parts::ALL), Keeping::default());
    // A light goes from one part, and the map stays for the other; then its slot is free.
    assert_eq!(note(1.0, subtract, [0, 0], Parts::REST), known(0));
    assert_eq!(note(1.0, subtract, [0, 0], Parts::SEEN), known(0));
    assert_eq!(note(1.0, subtract, [0, 0], Parts::SEEN), Keeping::default());
    assert_eq!(note(3.0, add, [0, 0], Parts::ALL), Keeping::default());
    others(&mut note);
    // To another version, in one part after the other: drawn once.
    let there = note(2.0, add, [0, 1], Parts::SEEN);
    assert_eq!((there.load_other, there.store), (own(1), own(0)));
    let there = note(2.0, add, [0, 1], Parts::REST);
    assert_eq!((there.load_other, there.load), (own(1), own(0)));
    others(&mut note);
    assert_eq!(note(4.0, add, [1, 1], Parts::ALL), new(1));
    // Where nothing differs a map serves both versions.
    let light = pending(4.0, add, [1, 1], Parts::ALL).light;
    maps.rename(&light, Parts::SEEN, 1, 2);
    let mut note = |x, sign, versions, parts| maps.note(&pending(x, sign, versions, parts));
    assert_eq!(note(4.0, subtract, [1, 1], Parts::REST), known(1));
    assert_eq!(note(4.0, subtract, [2, 2], Parts::SEEN), known(1));
    others(&mut note);
    assert_eq!(note(5.0, add, [2, 2], Parts::ALL), new(1));
}

#[test]
fn a_dimmed_light_finds_its_map_and_direct_light_leaves_half_of_the_room() {
    let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
    let all = Size::ALL.map(|size| size.bytes(&SIZES));
    let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * all[2] + all[1]);
    let direct = |x, shape, flux: f32, sign| {
        let mut new = pending(x, sign, [0, 0], Parts::ALL);
        (new.light.shape, new.light.direct) = (shape, true);
        new.light.flux *= flux;
        new
    };
    let lamp = maps.note(&direct(0.0, Shape::Point, 2.0, Sign::Add));
    assert_eq!(lamp.store, Some(slot(Size::Point, 0)));
    // It is drawn neither for what comes nor for what goes.
    let dimmed = maps.note(&direct(0.0, Shape::Point, 1.0, Sign::Add));
    let gone = maps.note(&direct(0.0, Shape::Point, 2.0, Sign::Subtract));
    assert_eq!((dimmed.load, gone.load), (lamp.store, lamp.store));
    // A spot that opens shows more than its map does; and there is room for no more direct light.
    let spot = |outer| Shape::Spot { inner: 0.1, outer };
    let narrow = maps.note(&direct(1.0, spot(0.2), 1.0, Sign::Add));
    assert_eq!(narrow.store, None);
    let left = maps.note(&direct(0.0, Shape::Point, 1.0, Sign::Subtract));
    assert_eq!(left.load, lamp.store);
    for _ in 0..BATCH {
        maps.note(&direct(9.0, Shape::Point, 1.0, Sign::Subtract));
    }
    let (first, second) = (
        maps.note(&direct(2.0, Shape::Point, 1.0, Sign::Add)),
        maps.note(&pending(3.0, Sign::Add, [0, 0], Parts::ALL)),
    );
    assert_eq!(first.store, lamp.store);
    assert_eq!(second.store, Some(slot(Size::Indirect, 0)));
    let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * 2 * all[1]);
    let narrow = maps.note(&direct(1.0, spot(0.2), 1.0, Sign::Add));
    let wide = maps.note(&direct(1.0, spot(0.3), 1.0, Sign::Add));
    assert_eq!(narrow.store, Some(slot(Size::Direct, 0)));
    assert_eq!(wide.store, Some(slot(Size::Direct, 1)));
}

#[test]
fn a_light_that_sees_what_another_one_saw_begins_with_its_map() {
    let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
    let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * hemicube_bytes(SIZES.indirect));
    let old = pending(1.0, Sign::Add, [0, 0], Parts::ALL);
    let first = maps.note(&old).store;
    assert!(first.is_some());
    let mut new = pending(1.0, Sign::Add, [2, 2], Parts::ALL);
    new.light.normal = Vec3::new(0.6, 0.8, 0.0);
    assert!(new.light.sees_as(&old.light) && !new.light.is_dimmed(&old.light));
    new.begins = Some(0);
    let keeping = maps.note(&new);
    assert_eq!((keeping.load, keeping.load_other), (None, first));
    assert!(keeping.store.is_some() && keeping.store != first);
    new.keeping = keeping;
    assert_eq!(new.begins(), 0);
    // Where nothing differs it is the same map, and it stays when the old light goes.
    maps.share(&old.light, 0, 1);
    new.version = 1;
    new.other = 1;
    new.keeping = maps.note(&new);
    assert_eq!((new.keeping.load, new.begins()), (first, 1));
    maps.note(&pending(1.0, Sign::Subtract, [0, 0], Parts::ALL));
    assert_eq!(maps.note(&new).load, first);
}
