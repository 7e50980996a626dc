//! Lengths as arguments.

/// A length with its unit, or in metres.
pub(in crate::cli) fn length(text: &str) -> Result<f64, String> {
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)];
    units
        .into_iter()
        .find_map(|(unit, metres)| Some(text.strip_suffix(unit)?.trim_end().parse::<f64>().ok()? * metres))
        .filter(|length| *length > 0.0 && length.is_finite())
        .ok_or_else(|| "not a positive length such as 5mm, 2cm or 0.005 (metres)".to_owned())
}

#[cfg(test)]
mod tests {
    use super::length;

    #[test]
    fn lengths_have_units_or_are_metres() {
        for (text, metres) in [("5mm", 5e-3), ("2 cm", 2e-2), ("0.5m", 0.5), ("3e-3", 3e-3), ("1e3mm", 1.0)] {
            assert!((length(text).unwrap() - metres).abs() < 1e-15, "{text}");
        }
        for text in ["", "mm", "5in", "-1mm", "0", "nan", "inf", "5 5mm"] {
            assert!(length(text).is_err(), "{text}");
        }
    }
}
