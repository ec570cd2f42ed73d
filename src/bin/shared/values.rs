//! Values of options that both programs have.

/// A number above 0.
pub fn positive(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err("must be above 0".into())
    }
}

/// 1000, 256k, 1.5M or 512x512.
pub fn count(text: &str) -> Result<u64, String> {
    let bad = || "write a whole number like 1000000, 256k, 1M or 512x512".to_owned();
    if let Some((a, b)) = text.split_once('x') {
        let product = count(a)?.checked_mul(count(b)?);
        return product
            .filter(|n| *n <= MOST)
            .ok_or_else(|| format!("is more than {MOST}"));
    }
    let (digits, factor) = match text.char_indices().last().ok_or_else(bad)? {
        (end, 'k' | 'K') => (&text[..end], 1e3),
        (end, 'M' | 'm') => (&text[..end], 1e6),
        (end, 'G' | 'g') => (&text[..end], 1e9),
        _ => (text, 1.0),
    };
    let value: f64 = digits.parse::<f64>().map_err(|_| bad())? * factor;
    match value {
        v if v.is_nan() || v < 1.0 => Err("must be at least 1".into()),
        v if v > MOST as f64 => Err(format!("is more than {MOST}")),
        v => Ok(v.round() as u64),
    }
}

/// No count makes sense beyond this.
const MOST: u64 = 4_000_000_000;

pub fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parts: Result<Vec<f32>, _> = text.split(',').map(|p| p.trim().parse::<f32>()).collect();
    parts
        .ok()
        .filter(|p| p.iter().all(|v| v.is_finite()))
        .and_then(|p| p.try_into().ok())
        .ok_or_else(|| format!("write {N} numbers with commas between them"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_read_as_people_write_them() {
        assert_eq!(count("1M"), Ok(1_000_000));
        assert_eq!(count("512x512"), Ok(262_144));
        assert_eq!(count("1.5k"), Ok(1500));
        for bad in ["", "x", "-1", "0", "nan", "1e30", "4Gx4G"] {
            assert!(count(bad).is_err(), "{bad}");
        }
    }
}
