//! Pictures as files.

use std::path::Path;

use image::codecs::jpeg::JpegEncoder;

use super::ViewError;

/// Of a hundred.
const JPEG_QUALITY: u8 = 82;

/// Writes RGBA bytes as a picture, PNG or, by the file's ending, JPEG.
pub(super) fn write_picture(path: &Path, size: [u32; 2], pixels: &[u8]) -> Result<(), ViewError> {
    let rgb: Vec<u8> = pixels
        .chunks_exact(4)
        .flat_map(|p| [p[0], p[1], p[2]])
        .collect();
    let failed = |cause| ViewError::Write {
        path: path.into(),
        cause,
    };
    let encoded = if path.extension().is_some_and(|e| e == "jpg") {
        let mut bytes = Vec::new();
        let mut encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
        let done = encoder.encode(&rgb, size[0], size[1], image::ExtendedColorType::Rgb8);
        done.map(|()| bytes)
    } else {
        crate::lightmap::compare::png(&rgb, size[0], size[1])
    };
    let bytes = encoded.map_err(|e| failed(std::io::Error::other(e)))?;
    std::fs::write(path, bytes).map_err(failed)
}
