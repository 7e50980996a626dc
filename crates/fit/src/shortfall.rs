//! How many parts a compound may have, and why it has fewer than were asked for.

use std::fmt;

/// Most parts that can be asked for.
pub const MAX_PIECES: usize = 64;

/// Excess of the hulls over the object, as a part of it, below which they fill it; dimensionless.
///
/// A percent is not seen. It decides only how a shortfall is worded. Pinned by
/// `reasons_name_their_quantities`.
const FILLED: f64 = 0.01;

/// Why fewer parts came out than were asked for: what the search found of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shortfall {
    /// The hulls of the parts are the object, nearly.
    Filled {
        /// Parts that came out.
        parts: usize,
        /// By how much the hulls are larger than the object together, as a part of it.
        excess: f64,
    },
    /// The hulls are larger than the object, and no cut that was tried makes them smaller.
    NoGain {
        /// Parts that came out.
        parts: usize,
        /// By how much the hulls are larger than the object together, as a part of it.
        excess: f64,
    },
    /// No cut that was tried makes the hulls smaller; how large the object is, an open mesh does
    /// not say.
    Open {
        /// Parts that came out.
        parts: usize,
    },
}

impl Shortfall {
    /// Of this many parts whose hulls have this volume together, and of the object's own volume if
    /// it is known.
    pub(super) fn new(parts: usize, hulls: f64, own: Option<f64>) -> Self {
        match own.filter(|own| *own > 0.0).map(|own| (hulls / own - 1.0).max(0.0)) {
            None => Self::Open { parts },
            Some(excess) if excess < FILLED => Self::Filled { parts, excess },
            Some(excess) => Self::NoGain { parts, excess },
        }
    }
}

impl fmt::Display for Shortfall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |excess: &f64| 100.0 * excess;
        match self {
            Self::Filled { parts: 1, excess } => {
                write!(
                    f,
                    "the object is convex: its hull is {:.2} % larger than the object, and no cut reduces that",
                    percent(excess)
                )
            }
            Self::Filled { parts, excess } => write!(
                f,
                "the object consists of {parts} convex parts: their hulls are {:.2} % larger than the object, and no \
                 further cut reduces that",
                percent(excess)
            ),
            Self::NoGain { parts: 1, excess } => write!(
                f,
                "the hull is {:.1} % larger than the object, but none of the cuts that were tried reduces its volume",
                percent(excess)
            ),
            Self::NoGain { parts, excess } => write!(
                f,
                "the hulls of {parts} parts are {:.1} % larger than the object, but none of the further cuts that were \
                 tried reduces their volume",
                percent(excess)
            ),
            Self::Open { .. } => {
                write!(f, "none of the further cuts that were tried reduces the volume of the hulls (of an open mesh)")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Shortfall;

    #[test]
    fn reasons_name_their_quantities() {
        for (shortfall, words) in [
            (Shortfall::new(1, 1.003, Some(1.0)), "is convex: its hull is 0.30 % larger"),
            (Shortfall::new(3, 0.9999999, Some(1.0)), "3 convex parts: their hulls are 0.00 % larger"),
            (Shortfall::new(2, 1.03, Some(1.0)), "the hulls of 2 parts are 3.0 % larger"),
            (Shortfall::new(1, 2.0, Some(1.0)), "the hull is 100.0 % larger"),
            (Shortfall::new(2, 1.5, Some(1.0)), "the hulls of 2 parts are 50.0 % larger"),
            (Shortfall::new(2, 1.5, None), "open mesh"),
            (Shortfall::new(2, 1.5, Some(0.0)), "open mesh"),
        ] {
            assert!(shortfall.to_string().contains(words), "{shortfall}");
        }
    }
}
