//! Reads a lightmap page as a renderer would.

use std::path::Path;

use exr::prelude::read_first_flat_layer_from_file;

/// A lightmap page.
pub struct Map {
    /// Width and height, texels.
    pub size: usize,
    /// Irradiance in lux, row by row from the top.
    pub texels: Vec<[f64; 3]>,
}

impl Map {
    /// Page 0 of a bake, which must be its only one.
    pub fn read(out: &Path) -> Self {
        assert!(!out.join("lightmap_1.exr").exists(), "one page is expected");
        let image = read_first_flat_layer_from_file(out.join("lightmap_0.exr")).expect("an EXR");
        let layer = image.layer_data;
        assert_eq!(layer.size.0, layer.size.1);
        let channel = |name: &str| -> Vec<f64> {
            let list = &layer.channel_data.list;
            let channel = list.iter().find(|c| c.name.eq(name)).expect("RGB");
            channel.sample_data.values_as_f32().map(f64::from).collect()
        };
        let [red, green, blue] = ["R", "G", "B"].map(channel);
        Self {
            size: layer.size.0,
            texels: (0..red.len())
                .map(|i| [red[i], green[i], blue[i]])
                .collect(),
        }
    }
}
