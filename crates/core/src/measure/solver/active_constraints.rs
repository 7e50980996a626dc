//! Which constraints an answer rests on.

/// Active constraints of one body (those met with equality), as a bit set.
pub(in crate::measure) type ActiveSet = u16;

/// Most constraints of one body that can be active at once in general position in space.
pub(in crate::measure) const MAX_ACTIVE: usize = 3;

/// The active constraints of one body at a witness with their multipliers λ >= 0: the outward
/// normal there is `Σ λ_i ∇g_i`, the gradients by metres, so the multipliers are in metres.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance};
///
/// // |x|²/4 of a ball of radius 2 has a gradient of length 1 at its surface.
/// let ball = Body::ball("ball", Vector3::zeros(), 2.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(5.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = distance(&ball, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// let active: Vec<(usize, f64)> = answer.active_a.iter().collect();
/// assert!(active.len() == 1 && active[0].0 == 0 && (active[0].1 - 1.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActiveConstraints {
    index: [u8; MAX_ACTIVE],
    multiplier: [f64; MAX_ACTIVE],
    len: u8,
}

impl ActiveConstraints {
    /// A single constraint.
    #[inline(always)]
    pub(in crate::measure) fn single(index: u8, multiplier: f64) -> Self {
        Self { index: [index, 0, 0], multiplier: [multiplier, 0.0, 0.0], len: 1 }
    }

    /// One more constraint; those beyond the third are left out.
    pub(in crate::measure) fn push(&mut self, index: usize, multiplier: f64) {
        let len = usize::from(self.len);
        if len < MAX_ACTIVE {
            (self.index[len], self.multiplier[len]) = (index as u8, multiplier);
            self.len += 1;
        }
    }

    /// Pairs of the position of a constraint in [`crate::body::Body::constraints`] and its
    /// multiplier, metres.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let len = usize::from(self.len);
        self.index[..len].iter().map(|&i| usize::from(i)).zip(self.multiplier[..len].iter().copied())
    }
}
