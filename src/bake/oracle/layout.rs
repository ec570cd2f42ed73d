//! Records in memory, field by field, against what the shaders declare.

use crate::bake::device::records::{self, Light};
use crate::bake::device::shaders;
use crate::lightmap::Clearance;

#[test]
fn records_lie_in_memory_as_the_shaders_read_them() {
    use std::mem::offset_of;
    let expected: &[(&str, &[usize])] = &[
        (
            "Receiver",
            &[
                offset_of!(records::Receiver, position),
                offset_of!(records::Receiver, normal),
                offset_of!(records::Receiver, face),
                offset_of!(records::Receiver, clearance),
            ],
        ),
        (
            "Clearance",
            &[
                offset_of!(Clearance, push),
                offset_of!(Clearance, near),
                offset_of!(Clearance, way),
                offset_of!(Clearance, room),
            ],
        ),
        (
            "Replaced",
            &[
                offset_of!(records::Replaced, tile),
                offset_of!(records::Replaced, old),
                offset_of!(records::Replaced, ended),
                offset_of!(records::Replaced, new),
                offset_of!(records::Replaced, instance),
            ],
        ),
        (
            "Tile",
            &[
                offset_of!(records::Tile, center),
                offset_of!(records::Tile, extent),
                offset_of!(records::Tile, axis),
                offset_of!(records::Tile, cone_cos),
                offset_of!(records::Tile, face_cos),
                offset_of!(records::Tile, thickness),
                offset_of!(records::Tile, aside),
                offset_of!(records::Tile, sums),
                offset_of!(records::Tile, instance),
            ],
        ),
        (
            "Instance",
            &[
                offset_of!(records::Instance, since),
                offset_of!(records::Instance, until),
                offset_of!(records::Instance, crowded),
            ],
        ),
        (
            "Region",
            &[
                offset_of!(records::Region, center),
                offset_of!(records::Region, extent),
            ],
        ),
        (
            "Placement",
            &[
                offset_of!(records::Placement, row),
                offset_of!(records::Placement, normal_row),
            ],
        ),
        (
            "Triangle",
            &[
                offset_of!(records::Triangle, a),
                offset_of!(records::Triangle, b),
                offset_of!(records::Triangle, c),
            ],
        ),
        (
            "Cutout",
            &[
                offset_of!(records::Cutout, uv),
                offset_of!(records::Cutout, first),
                offset_of!(records::Cutout, size),
                offset_of!(records::Cutout, wrap),
            ],
        ),
        (
            "Chunk",
            &[
                offset_of!(records::Chunk, center),
                offset_of!(records::Chunk, extent),
                offset_of!(records::Chunk, count),
            ],
        ),
        (
            "Group",
            &[
                offset_of!(records::Group, center),
                offset_of!(records::Group, extent),
                offset_of!(records::Group, instance),
                offset_of!(records::Group, first),
                offset_of!(records::Group, count),
                offset_of!(records::Group, cell),
            ],
        ),
        (
            "View",
            &[
                offset_of!(records::View, origin),
                offset_of!(records::View, x),
                offset_of!(records::View, y),
                offset_of!(records::View, z),
                offset_of!(records::View, depth),
                offset_of!(records::View, size),
                offset_of!(records::View, kind),
                offset_of!(records::View, cos_cone),
                offset_of!(records::View, coarse),
                offset_of!(records::View, version),
                offset_of!(records::View, other),
                offset_of!(records::View, base),
                offset_of!(records::View, kept),
                offset_of!(records::View, asked),
            ],
        ),
        (
            "Light",
            &[
                offset_of!(Light, position),
                offset_of!(Light, normal),
                offset_of!(Light, flux),
                offset_of!(Light, other_flux),
                offset_of!(Light, area),
                offset_of!(Light, radius),
                offset_of!(Light, spot_scale),
                offset_of!(Light, spot_offset),
                offset_of!(Light, kind),
                offset_of!(Light, sign),
                offset_of!(Light, view),
                offset_of!(Light, other_view),
                offset_of!(Light, version),
                offset_of!(Light, other),
                offset_of!(Light, parts),
                offset_of!(Light, first_region),
                offset_of!(Light, regions),
                offset_of!(Light, origin),
                offset_of!(Light, blur),
                offset_of!(Light, blur_slope),
                offset_of!(Light, vertices),
                offset_of!(Light, vertex),
            ],
        ),
    ];
    for (name, offsets) in expected {
        let (_, members) = shaders::LAYOUTS
            .iter()
            .find(|(n, _)| n == name)
            .unwrap_or_else(|| panic!("{name} is in no shader"));
        let found: Vec<usize> = members.iter().map(|(_, offset)| *offset as usize).collect();
        assert_eq!(&found, offsets, "{name}: {members:?}");
    }
}
