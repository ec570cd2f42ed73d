//! Random numbers that are pure functions of (seed, light, path, dimension), and the shapes they are mapped to.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

/// `sobol_burley` repeats after this many samples; longer sequences continue with another scramble.
const BLOCK_BITS: u32 = 16;

/// An Owen-scrambled Sobol sequence (Burley 2020), one per light. Sample `i` never depends on how many are drawn.
#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    seed: u32,
}

impl Sequence {
    /// The sequence of a light ([`crate::scene::Light::id`]) under a setting's seed.
    pub fn new(seed: u32, light: u32) -> Self {
        Self {
            seed: hash(seed ^ hash(light.wrapping_add(0x9e37_79b9))),
        }
    }

    /// Four numbers in [0, 1). Sets 0 and 1 are the eight dimensions of one Sobol sequence; every further set is a sequence
    /// of its own, decorrelated from the others (Burley's padding), because high Sobol dimensions are badly stratified in pairs.
    pub fn sample(&self, index: u32, set: u32) -> [f32; 4] {
        let (pad, set) = if set < 2 { (0, set) } else { (set, 0) };
        let block = index >> BLOCK_BITS;
        let seed = match (block, pad) {
            (0, 0) => self.seed,
            _ => hash(self.seed ^ hash(block << 8 | pad)),
        };
        sobol_burley::sample_4d(index & ((1 << BLOCK_BITS) - 1), set, seed)
    }
}

/// A 32-bit mixing function (Wellons' `lowbias32`).
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A right-handed orthonormal basis around a unit vector, without a singularity (Duff et al. 2017).
pub fn basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (
        Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3::new(b, sign + n.y * n.y * a, -n.y),
    )
}

/// A unit vector around `normal`, with density cos / pi: Shirley and Chiu's concentric disc, lifted.
pub fn cosine_hemisphere(normal: Vec3, u: [f32; 2]) -> Vec3 {
    let p = concentric_disc(u);
    let z = (1.0 - p.length_squared()).max(0.0).sqrt();
    let (x, y) = basis(normal);
    // Never exactly in the plane: such a ray would start inside its own surface.
    (x * p.x + y * p.y + normal * z.max(1e-4)).normalize()
}

fn concentric_disc(u: [f32; 2]) -> Vec2 {
    let p = Vec2::new(2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if p == Vec2::ZERO {
        return p;
    }
    let (radius, angle) = if p.x.abs() > p.y.abs() {
        (p.x, PI / 4.0 * (p.y / p.x))
    } else {
        (p.y, PI / 2.0 - PI / 4.0 * (p.x / p.y))
    };
    radius * Vec2::from_angle(angle)
}

/// A uniformly distributed unit vector.
pub fn sphere(u: [f32; 2]) -> Vec3 {
    around_z(1.0 - 2.0 * u[0], u[1])
}

/// The unit vector with the given cosine to +Z, at a fraction of the full turn.
pub fn around_z(cos: f32, turn: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (s, c) = (TAU * turn).sin_cos();
    Vec3::new(c * sin, s * sin, cos)
}

/// Uniform weights of a triangle's second and third vertex (Heitz 2019, a low-distortion map).
pub fn triangle(u: [f32; 2]) -> [f32; 2] {
    let [mut a, mut b] = u;
    if b > a {
        a *= 0.5;
        b -= a;
    } else {
        b *= 0.5;
        a -= b;
    }
    [a, b]
}

/// Chooses among weighted items, in proportion to their weights.
#[derive(Clone, Debug, Default)]
pub struct Distribution {
    /// Running sums, the last one being the total.
    sums: Vec<f64>,
}

impl Distribution {
    /// Of non-negative weights.
    pub fn new(weights: impl Iterator<Item = f64>) -> Self {
        let mut total = 0.0;
        Self {
            sums: weights
                .map(|w| {
                    total += w;
                    total
                })
                .collect(),
        }
    }

    /// The sum of the weights.
    pub fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// The item at a fraction `u` of the total; never one of weight 0. Needs a positive total.
    pub fn choose(&self, u: f32) -> usize {
        let target = f64::from(u) * self.total();
        self.sums
            .partition_point(|&s| s <= target)
            .min(self.sums.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_their_densities() {
        let sequence = Sequence::new(1, 2);
        let n = 4096;
        let normal = Vec3::new(0.48, -0.6, 0.64);
        let (mut hemisphere, mut ball, mut weights) = (Vec3::ZERO, Vec3::ZERO, [0.0; 2]);
        for i in 0..n {
            let [a, b, c, d] = sequence.sample(i, 0);
            let h = cosine_hemisphere(normal, [a, b]);
            assert!((h.length() - 1.0).abs() < 1e-5 && h.dot(normal) > 0.0);
            hemisphere += h / n as f32;
            ball += sphere([c, d]) / n as f32;
            let [s, t] = triangle([a, b]);
            assert!(s >= 0.0 && t >= 0.0 && s + t <= 1.0);
            weights = [weights[0] + s / n as f32, weights[1] + t / n as f32];
        }
        // The mean of a cosine-distributed direction is 2/3 of the normal.
        assert!((hemisphere - normal * (2.0 / 3.0)).length() < 2e-3);
        assert!(ball.length() < 2e-3);
        assert!(weights.iter().all(|w| (w - 1.0 / 3.0).abs() < 2e-3));
    }

    #[test]
    fn sequences_are_stratified_and_blocks_differ() {
        let sequence = Sequence::new(0, 0);
        let mut cells = [0; 64];
        for i in 0..64 {
            let [a, b, ..] = sequence.sample((1 << 16) + i, 3);
            cells[(a * 8.0) as usize * 8 + (b * 8.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
        assert_ne!(sequence.sample(5, 0), sequence.sample((1 << 16) + 5, 0));
        assert_ne!(sequence.sample(5, 0), Sequence::new(0, 1).sample(5, 0));
    }

    #[test]
    fn choices_follow_the_weights() {
        let d = Distribution::new([0.0, 1.0, 0.0, 3.0, 0.0].into_iter());
        let mut counts = [0; 5];
        (0..400).for_each(|i| counts[d.choose(i as f32 / 400.0)] += 1);
        assert_eq!(counts, [0, 100, 0, 300, 0]);
    }
}
