//! How far two lightmaps differ: in numbers, by the worst texels, and as a picture.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::exr::{Image, read};
use super::glb::page_file;

/// Texels whose reference is darker than this part of its mean count for [`Comparison::rmse`], but not for the relative error: there it
/// says nothing.
pub const DARK: f64 = 0.02;
/// How many of the worst texels are listed.
const WORST: usize = 10;

/// Why two lightmaps cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// Not an EXR file with red, green and blue.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: ::exr::error::Error,
    },
    /// A folder without a bake in it.
    #[error("{} holds no lightmap_0.exr: give a folder that `rebake bake` wrote, or an EXR file", path.display())]
    NoLightmap {
        /// The folder.
        path: PathBuf,
    },
    /// Different numbers of pages.
    #[error("{} has {a_pages} pages and {} has {b_pages}: bake both with the same atlas (--settings)", a.display(), b.display())]
    Pages {
        /// First.
        a: PathBuf,
        /// Second.
        b: PathBuf,
        /// Pages of the first.
        a_pages: usize,
        /// Pages of the second.
        b_pages: usize,
    },
    /// Different sizes.
    #[error("{} is {} x {} and {} is {} x {}: bake both with the same atlas (--settings)", a.display(), a_size[0], a_size[1], b.display(), b_size[0], b_size[1])]
    Size {
        /// First.
        a: PathBuf,
        /// Second.
        b: PathBuf,
        /// Of the first, texels.
        a_size: [usize; 2],
        /// Of the second, texels.
        b_size: [usize; 2],
    },
}

/// Differences of a lightmap A from a reference B. Texels that are zero in both are no part of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Texels that are lit in either.
    pub texels: usize,
    /// Texels that differ in any bit.
    pub different: usize,
    /// Values that are NaN or infinite in either; such texels count nowhere else.
    pub not_finite: usize,
    /// Mean over texels and RGB of A, lux.
    pub mean_a: f64,
    /// Mean over texels and RGB of B, lux.
    pub mean_b: f64,
    /// Root of the mean squared difference over texels and RGB, lux.
    pub rmse: f64,
    /// `mean_a / mean_b - 1`.
    pub bias: f64,
    /// Absolute relative error of the mean over RGB, over texels where B exceeds 2 % of its mean.
    pub relative: Percentiles,
    /// The largest relative errors, worst first.
    pub worst: Vec<WorstTexel>,
}

/// Percentiles of a distribution; zero if it is empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

/// A texel that differs much.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstTexel {
    /// Page index.
    pub page: usize,
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Value in A, lux.
    pub a: [f32; 3],
    /// Value in B, lux.
    pub b: [f32; 3],
    /// Signed relative error of the mean over RGB.
    pub relative: f64,
}

/// Two lightmaps of one size, ready to be compared.
#[derive(Clone, Debug)]
pub struct Pair {
    pages: Vec<(Image, Image)>,
}

impl Pair {
    /// Reads two EXR files or two folders that bakes wrote. `b` is the reference.
    pub fn load(a: &Path, b: &Path) -> Result<Self, CompareError> {
        let (a_files, b_files) = (files(a)?, files(b)?);
        if a_files.len() != b_files.len() {
            let (a_pages, b_pages) = (a_files.len(), b_files.len());
            return Err(CompareError::Pages {
                a: a.into(),
                b: b.into(),
                a_pages,
                b_pages,
            });
        }
        let load = |path: &Path| {
            read(path).map_err(|cause| CompareError::Read {
                path: path.into(),
                cause,
            })
        };
        let mut pages = Vec::new();
        for (a, b) in a_files.into_iter().zip(b_files) {
            let (first, second) = (load(&a)?, load(&b)?);
            let size = |image: &Image| [image.width, image.height];
            if size(&first) != size(&second) {
                let (a_size, b_size) = (size(&first), size(&second));
                return Err(CompareError::Size {
                    a,
                    b,
                    a_size,
                    b_size,
                });
            }
            pages.push((first, second));
        }
        Ok(Self { pages })
    }

    /// The numbers.
    pub fn compare(&self) -> Comparison {
        let lit = || {
            self.pages.iter().enumerate().flat_map(|(page, (a, b))| {
                let texels = a.texels.iter().zip(&b.texels).enumerate();
                texels
                    .filter(|(_, (a, b))| **a != [0.0; 3] || **b != [0.0; 3])
                    .map(move |(i, (&a_value, &b_value))| {
                        (page, i % a.width, i / a.width, a_value, b_value)
                    })
            })
        };
        let (mut texels, mut different, mut not_finite) = (0, 0, 0);
        let (mut sum_a, mut sum_b, mut squares) = (0.0, 0.0, 0.0);
        for (_, _, _, a, b) in lit() {
            different += usize::from(a.map(f32::to_bits) != b.map(f32::to_bits));
            if !finite(a, b) {
                not_finite += 1;
                continue;
            }
            texels += 1;
            sum_a += mean(a);
            sum_b += mean(b);
            squares += (0..3)
                .map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2))
                .sum::<f64>()
                / 3.0;
        }
        let count = texels.max(1) as f64;
        let (mean_a, mean_b) = (sum_a / count, sum_b / count);
        let mut errors: Vec<WorstTexel> = lit()
            .filter(|(.., a, b)| finite(*a, *b) && mean(*b) > DARK * mean_b)
            .map(|(page, x, y, a, b)| WorstTexel {
                page,
                x,
                y,
                a,
                b,
                relative: mean(a) / mean(b) - 1.0,
            })
            .collect();
        // Sorted by error, then by place: the order is the same every time.
        errors.sort_by(|s, t| {
            let key = |w: &WorstTexel| (w.page, w.y, w.x);
            t.relative
                .abs()
                .total_cmp(&s.relative.abs())
                .then(key(s).cmp(&key(t)))
        });
        let at = |share: f64| {
            let below =
                ((errors.len() as f64 * share).ceil() as usize).clamp(1, errors.len().max(1));
            errors
                .get(errors.len().saturating_sub(below))
                .map_or(0.0, |w| w.relative.abs())
        };
        Comparison {
            texels,
            different,
            not_finite,
            mean_a,
            mean_b,
            rmse: (squares / count).sqrt(),
            bias: if mean_b > 0.0 {
                mean_a / mean_b - 1.0
            } else {
                0.0
            },
            relative: Percentiles {
                p50: at(0.5),
                p95: at(0.95),
                p99: at(0.99),
                max: at(1.0),
            },
            worst: errors.into_iter().take(WORST).collect(),
        }
    }

    /// A PNG file per page: texels that agree are grey, those where A is brighter than B turn red, darker ones blue, fully at
    /// a relative error of `full` (0.25, say); what is lit in neither is black, and NaN is magenta.
    pub fn false_colour(&self, full: f32) -> Result<Vec<Vec<u8>>, image::ImageError> {
        let mean_b = self.compare().mean_b;
        let colour = |(&a, &b): (&[f32; 3], &[f32; 3])| {
            if a == [0.0; 3] && b == [0.0; 3] {
                return [0; 3];
            }
            if !finite(a, b) {
                return [255, 0, 255];
            }
            let scale = mean(b).max(DARK * mean_b).max(f64::MIN_POSITIVE) * f64::from(full);
            let error = ((mean(a) - mean(b)) / scale).clamp(-1.0, 1.0);
            let byte = |v: f64| (v * 255.0).round() as u8;
            let fade = byte(0.5 - 0.5 * error.abs());
            let strong = byte(0.5 + 0.5 * error.abs());
            if error > 0.0 {
                [strong, fade, fade]
            } else {
                [fade, fade, strong]
            }
        };
        self.pages
            .iter()
            .map(|(a, b)| {
                let rgb: Vec<u8> = a.texels.iter().zip(&b.texels).flat_map(colour).collect();
                png(&rgb, a.width as u32, a.height as u32)
            })
            .collect()
    }
}

/// Encodes 8-bit RGB.
pub(crate) fn png(rgb: &[u8], width: u32, height: u32) -> Result<Vec<u8>, image::ImageError> {
    use image::ImageEncoder;
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(rgb, width, height, image::ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

/// Reads the pages of a folder that a bake wrote, or one EXR file.
pub fn load_pages(path: &Path) -> Result<Vec<Image>, CompareError> {
    let load = |path: PathBuf| read(&path).map_err(|cause| CompareError::Read { path, cause });
    files(path)?.into_iter().map(load).collect()
}

/// The pages of a folder that a bake wrote, or the file itself.
fn files(path: &Path) -> Result<Vec<PathBuf>, CompareError> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let pages = (0..).map(|k| path.join(page_file(k)));
    let pages: Vec<PathBuf> = pages.take_while(|p| p.exists()).collect();
    if pages.is_empty() {
        return Err(CompareError::NoLightmap { path: path.into() });
    }
    Ok(pages)
}

fn mean(texel: [f32; 3]) -> f64 {
    texel.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0
}

fn finite(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().chain(&b).all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(values: &[([f32; 3], [f32; 3])]) -> Pair {
        let image = |texels: Vec<[f32; 3]>| Image {
            width: values.len(),
            height: 1,
            texels,
        };
        let (a, b) = values.iter().copied().unzip();
        Pair {
            pages: vec![(image(a), image(b))],
        }
    }

    #[test]
    fn percentiles_and_worst_texels_are_those_of_a_known_error() {
        // 100 texels with errors of 0, 1, ... 99 percent, and one that neither has.
        let mut values: Vec<_> = (0..100)
            .map(|i| ([1.0 + i as f32 / 100.0; 3], [1.0; 3]))
            .collect();
        values.push(([0.0; 3], [0.0; 3]));
        let result = pair(&values).compare();
        assert_eq!((result.texels, result.different), (100, 99));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
        near(result.relative.p50, 0.49);
        near(result.relative.p95, 0.94);
        near(result.relative.p99, 0.98);
        near(result.bias, 0.495);
        near(
            result.rmse,
            ((0..100).map(|i| (i * i) as f64).sum::<f64>() / 1e6).sqrt(),
        );
        assert_eq!((result.worst[0].x, result.worst.len()), (99, 10));
    }

    #[test]
    fn dark_texels_and_nan_do_not_enter_the_relative_error() {
        let values = [
            ([1.0; 3], [1.0; 3]),
            ([0.5; 3], [0.001; 3]),
            ([f32::NAN; 3], [1.0; 3]),
        ];
        let result = pair(&values).compare();
        assert_eq!((result.texels, result.not_finite), (2, 1));
        assert_eq!(result.relative.max, 0.0);
        assert!(result.rmse > 0.3);
        let colours = pair(&values).false_colour(0.25).unwrap();
        let picture = image::load_from_memory(&colours[0]).unwrap().into_rgb8();
        let pixels: Vec<_> = picture.pixels().map(|p| p.0).collect();
        assert_eq!(pixels, [[128, 128, 128], [255, 0, 0], [255, 0, 255]]);
    }

    #[test]
    fn what_cannot_be_compared_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let save = |name: &str, size: u32| {
            let path = folder.path().join(name);
            let page = vec![[1.0; 3]; (size * size) as usize];
            super::super::exr::write(&page, size, "", std::fs::File::create(&path).unwrap())
                .unwrap();
            path
        };
        let (a, b) = (save("a.exr", 4), save("b.exr", 8));
        let error = Pair::load(&a, &b).unwrap_err().to_string();
        assert!(
            error.contains("4 x 4") && error.contains("8 x 8"),
            "{error}"
        );
        assert!(matches!(
            Pair::load(&a, folder.path()),
            Err(CompareError::NoLightmap { .. })
        ));
        save("lightmap_0.exr", 4);
        assert_eq!(
            Pair::load(&a, folder.path()).unwrap().compare().different,
            0
        );
        save("lightmap_1.exr", 4);
        assert!(matches!(
            Pair::load(&a, folder.path()),
            Err(CompareError::Pages { .. })
        ));
    }
}
