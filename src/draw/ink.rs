//! The colours of pictures.

/// Colours of a chart, distinguished by colour-blind readers too (after Okabe and Ito).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// First object or curve.
    Blue,
    /// Second object or curve.
    Orange,
    /// Third object or curve.
    Green,
    /// Fourth object or curve.
    Purple,
    /// Text, axes, marks.
    Grey,
}

impl Ink {
    /// Red, green and blue, 0 to 255.
    pub(super) fn rgb(self) -> (u8, u8, u8) {
        match self {
            Ink::Blue => (0x1f, 0x7f, 0xc4),
            Ink::Orange => (0xd5, 0x5e, 0x00),
            Ink::Green => (0x00, 0x93, 0x6b),
            Ink::Purple => (0xb2, 0x62, 0x98),
            Ink::Grey => (0x7a, 0x7a, 0x7a),
        }
    }

    /// The colour as SVG writes it.
    pub(super) fn hex(self) -> String {
        let (red, green, blue) = self.rgb();
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

#[cfg(test)]
mod tests {
    use super::Ink;

    /// Relative luminance of WCAG 2.1.
    fn luminance(ink: Ink) -> f64 {
        let (red, green, blue) = ink.rgb();
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
    }

    #[test]
    fn every_ink_reads_on_white_and_on_black() {
        for ink in [Ink::Blue, Ink::Orange, Ink::Green, Ink::Purple, Ink::Grey] {
            let l = luminance(ink);
            assert!(1.05 / (l + 0.05) >= 3.0 && (l + 0.05) / 0.05 >= 3.0, "{ink:?}");
        }
    }
}
