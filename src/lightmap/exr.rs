//! Lightmap pages as OpenEXR files: 32-bit float RGB, and what the numbers mean in the header.

use std::fs::File;
use std::io::{BufReader, BufWriter, Seek, Write};
use std::path::Path;

use exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use exr::prelude::{
    Blocks, Compression, Encoding, Image as ExrImage, Layer, LayerAttributes, LineOrder,
    ReadChannels, ReadLayers, SpecificChannels, Vec2 as ExrVec2, WritableImage,
};

/// What a texel holds, as every page's header says it.
pub const SEMANTICS: &str = "irradiance, lux, linear RGB, front side, cosine-weighted hemisphere";

/// Pixels of the largest image that is read.
const LARGEST: usize = 1 << 28;

/// An RGB image: rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Texels.
    pub width: usize,
    /// Texels.
    pub height: usize,
    /// `width * height` texels.
    pub texels: Vec<[f32; 3]>,
}

/// Writes a square page. `content` says whether direct light is in it, for the header. The bytes depend on the
/// arguments alone, not on the number of threads.
pub(crate) fn write(
    page: &[[f32; 3]],
    size: u32,
    content: &str,
    to: impl Write + Seek,
) -> Result<(), exr::error::Error> {
    let size = size as usize;
    let channels = SpecificChannels::rgb(|at: ExrVec2<usize>| {
        let [r, g, b] = page[at.y() * size + at.x()];
        (r, g, b)
    });
    let mut attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("rebake ", env!("CARGO_PKG_VERSION")))),
        comments: Some(Text::from(
            "Linear light, no gamma. Shade with albedo / pi * texel + emission.",
        )),
        ..LayerAttributes::default()
    };
    // One attribute of our own at most: the crate writes them in no particular order.
    let semantics = AttributeValue::Text(Text::from(format!("{SEMANTICS}; {content}").as_str()));
    attributes
        .other
        .insert(Text::from("rebakeSemantics"), semantics);
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let mut image = ExrImage::from_layer(Layer::new((size, size), attributes, encoding, channels));
    image.attributes.chromaticities = Some(Chromaticities {
        red: ExrVec2(0.64, 0.33),
        green: ExrVec2(0.30, 0.60),
        blue: ExrVec2(0.15, 0.06),
        white: ExrVec2(0.3127, 0.3290),
    });
    let mut to = BufWriter::with_capacity(1 << 20, to);
    let writer = image.write();
    if rayon::current_num_threads() == 1 {
        writer.non_parallel().to_buffered(&mut to)?;
    } else {
        writer.to_buffered(&mut to)?;
    }
    Ok(to.flush()?)
}

/// A square page as the bytes of a file; `content` goes into the header, beside what texels hold.
///
/// # Errors
/// None that a page of `size`² texels can bring about; those of the format otherwise.
pub fn encode(size: u32, page: &[[f32; 3]], content: &str) -> Result<Vec<u8>, exr::error::Error> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    write(page, size, content, &mut bytes)?;
    Ok(bytes.into_inner())
}

/// Reads the first layer with red, green and blue of an EXR file, whoever wrote it.
pub fn read(path: &Path) -> Result<Image, exr::error::Error> {
    // A broken header may claim any size; nothing is allocated before it is looked at.
    let headers = exr::meta::MetaData::read_from_file(path, false)?.headers;
    if headers.iter().any(|h| h.layer_size.area() > LARGEST) {
        return Err(exr::error::Error::Invalid("more than 2^28 pixels".into()));
    }
    let file = BufReader::with_capacity(1 << 20, File::open(path)?);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| Image {
                width: size.width(),
                height: size.height(),
                texels: vec![[0.0; 3]; size.area()],
            },
            |image, at, (r, g, b): (f32, f32, f32)| {
                image.texels[at.y() * image.width + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(file)?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn page(size: u32) -> Vec<[f32; 3]> {
        (0..size * size)
            .map(|i| [i as f32 * 0.37, 1e-9 * i as f32, 6e7 / (i + 1) as f32])
            .collect()
    }

    #[test]
    fn reads_back_what_it_wrote() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.exr");
        write(
            &page(37),
            37,
            "direct and indirect",
            File::create(&path).unwrap(),
        )
        .unwrap();
        let image = read(&path).unwrap();
        assert_eq!((image.width, image.height), (37, 37));
        assert_eq!(image.texels, page(37), "bit for bit");
        let header = exr::meta::MetaData::read_from_file(&path, true).unwrap();
        let header = &header.headers[0];
        let semantics = header
            .own_attributes
            .other
            .get(&Text::from("rebakeSemantics"));
        let told = format!("{semantics:?}");
        assert!(
            told.contains("irradiance, lux") && told.contains("direct and indirect"),
            "{told}"
        );
        assert!(header.shared_attributes.chromaticities.is_some());
    }

    #[test]
    fn threads_do_not_change_the_bytes() {
        let bytes = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut to = Cursor::new(Vec::new());
            pool.install(|| write(&page(200), 200, "indirect", &mut to))
                .unwrap();
            to.into_inner()
        };
        let one = bytes(1);
        assert!((0..3).all(|_| bytes(3) == one));
    }

    #[test]
    fn what_is_no_exr_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("no.exr");
        std::fs::write(&path, b"PNG?").unwrap();
        assert!(read(&path).is_err());
        assert!(read(&folder.path().join("none.exr")).is_err());
    }
}
