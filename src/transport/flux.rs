//! Where the energy of paths goes: every lumen sent is accounted for.

use glam::Vec3;
use serde::Serialize;

/// Where the energy of paths went, lumens (mean over RGB). `sent + gained = absorbed + escaped + lost_at_cap + ended`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FluxBalance {
    /// Left the lights.
    pub sent: f64,
    /// Reached a first surface.
    pub first_hit: f64,
    /// Sent on by VPLs: what the virtual lights of bounces carry.
    pub reflected: f64,
    /// Swallowed by albedo or by back sides.
    pub absorbed: f64,
    /// Left the scene.
    pub escaped: f64,
    /// Reached a surface after the last allowed bounce.
    pub lost_at_cap: f64,
    /// Carried by paths that Russian roulette ended; equals `gained` in expectation.
    pub ended: f64,
    /// Added to paths that Russian roulette let live.
    pub gained: f64,
}

impl FluxBalance {
    /// The sum, entry by entry.
    pub fn add(&mut self, other: &Self) {
        self.sent += other.sent;
        self.first_hit += other.first_hit;
        self.reflected += other.reflected;
        self.absorbed += other.absorbed;
        self.escaped += other.escaped;
        self.lost_at_cap += other.lost_at_cap;
        self.ended += other.ended;
        self.gained += other.gained;
    }

    /// What is unaccounted for, relative to what was sent; rounding alone.
    pub fn error(&self) -> f64 {
        let out = self.absorbed + self.escaped + self.lost_at_cap + self.ended;
        (self.sent + self.gained - out).abs() / self.sent.max(f64::MIN_POSITIVE)
    }
}

/// The lumens of an energy, mean over RGB.
pub(super) fn lumens(energy: Vec3) -> f64 {
    (f64::from(energy.x) + f64::from(energy.y) + f64::from(energy.z)) / 3.0
}
