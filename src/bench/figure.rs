//! Numbers with their spread: the median of some runs between the least and the largest.

use serde::{Deserialize, Serialize};

/// Which way a figure should go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// Times and sizes.
    Lower,
    /// Rates.
    Higher,
    /// Counts: what the work was, not how well it was done.
    Neither,
}

/// What was measured, over some runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// Its unit; empty for counts.
    pub unit: String,
    /// Which way it should go.
    pub better: Better,
    /// The middle one; the mean of the two in the middle if the runs are even in number.
    pub median: f64,
    /// The least.
    pub min: f64,
    /// The largest.
    pub max: f64,
    /// How many.
    pub runs: u32,
}

impl Figure {
    /// A figure of some runs, at least one.
    pub fn new(
        name: impl Into<String>,
        unit: &str,
        better: Better,
        runs: impl IntoIterator<Item = f64>,
    ) -> Self {
        let mut runs: Vec<f64> = runs.into_iter().collect();
        runs.sort_unstable_by(f64::total_cmp);
        let n = runs.len();
        assert!(n > 0, "a figure has runs");
        Self {
            name: name.into(),
            unit: unit.into(),
            better,
            median: 0.5 * (runs[(n - 1) / 2] + runs[n / 2]),
            min: runs[0],
            max: runs[n - 1],
            runs: n as u32,
        }
    }

    /// What does not change from run to run.
    pub fn count(name: impl Into<String>, value: f64) -> Self {
        Self::new(name, "", Better::Neither, [value])
    }
}

/// A figure, or several, over something that is varied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// What it shows.
    pub name: String,
    /// What is varied.
    pub over: String,
    /// In order.
    pub points: Vec<Point>,
}

/// A point of a series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Where.
    pub at: f64,
    /// What was measured there; the same names in the same order at every point.
    pub figures: Vec<Figure>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_lie_in_the_middle() {
        let of = |runs: &[f64]| Figure::new("x", "s", Better::Lower, runs.iter().copied());
        let f = of(&[3.0, 1.0, 2.0]);
        assert_eq!((f.min, f.median, f.max, f.runs), (1.0, 2.0, 3.0, 3));
        assert_eq!(of(&[4.0, 1.0, 2.0, 3.0]).median, 2.5);
        assert_eq!(Figure::count("n", 7.0).median, 7.0);
    }
}
