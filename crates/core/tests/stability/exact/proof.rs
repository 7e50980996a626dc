//! What points and multipliers prove, exactly.
//!
//! For every point x' of a body and multipliers λ >= 0, `1 >= g(x') >= g(x) + ∇g(x)·(x' - x)` gives
//! `Σ λ ∇g(x)·(x' - x) <= Σ λ (1 - g(x))`. All lower bounds are sums of this over both bodies; what
//! the gradients do not cancel counts with the reach of the body.

use super::Solid;
use super::number::{Vector, add, dot, near, nears, norm, scaled, sub, zero};
use dashu_ratio::RBig;
use sublevel_testkit::reference::big::Big;
use sublevel_testkit::reference::dual::Dual;

/// `Σ λ (1 - g(v))` and `Σ λ ∇g(v)`.
fn sum(body: &Solid<'_>, multipliers: &[(usize, RBig)], v: &Vector) -> (RBig, Vector) {
    multipliers.iter().fold((RBig::ZERO, zero()), |(slack, gradient), (i, multiplier)| {
        assert!(*multiplier >= RBig::ZERO);
        let (value, g) = body.jet(*i, v);
        (slack + multiplier * (RBig::ONE - value), add(&gradient, &scaled(&g, multiplier)))
    })
}

/// Two posed bodies, and the origin that a reference's points are relative to.
pub(crate) struct Proof<'a> {
    pub(crate) a: Solid<'a>,
    pub(crate) b: Solid<'a>,
    pub(crate) origin: Vector,
}

impl Proof<'_> {
    fn point(&self, x: &[Big; 3]) -> Vector {
        add(&self.origin, &nears(x))
    }

    fn multipliers(of: &[(usize, Big)]) -> Vec<(usize, RBig)> {
        of.iter().map(|(i, multiplier)| (*i, near(multiplier))).collect()
    }

    /// Lower bound of the signed distance: of the distance where it is positive, minus an upper
    /// bound of the depth where not. For all x' in A and y' in B, `n·(x' - y')` is at least the
    /// bound times |n|.
    pub(crate) fn parted(&self, normal: &[Big; 3], dual: &Dual) -> RBig {
        let (n, x, y) = (nears(normal), self.point(&dual.x), self.point(&dual.y));
        let (slack_a, g) = sum(&self.a, &Self::multipliers(&dual.of_a), &x);
        let (slack_b, h) = sum(&self.b, &Self::multipliers(&dual.of_b), &y);
        let [_, rest_a] = norm(&add(&n, &g));
        let [_, rest_b] = norm(&sub(&n, &h));
        let rest = rest_a * self.a.reach(&x) + rest_b * self.b.reach(&y);
        let bound = dot(&n, &sub(&x, &y)) - slack_a - slack_b - rest;
        let [below, above] = norm(&n);
        if bound > RBig::ZERO { bound / above } else { bound / below }
    }

    /// Square of the distance of a point of A and a point of B next to these.
    pub(crate) fn apart(&self, x: &[Big; 3], y: &[Big; 3]) -> Option<RBig> {
        let between = sub(&self.a.pull_in(&self.point(x))?, &self.b.pull_in(&self.point(y))?);
        Some(dot(&between, &between))
    }

    /// Lower bound of d(A‖B): `Σ ν g(x) - Σ μ (1 - h(x))` and what the gradients leave, the ν
    /// normalized to sum 1.
    pub(crate) fn level_lower(&self, dual: &Dual) -> RBig {
        let x = self.point(&dual.x);
        let (of_a, of_b) = (Self::multipliers(&dual.of_a), Self::multipliers(&dual.of_b));
        let total = of_a.iter().fold(RBig::ZERO, |total, (_, multiplier)| total + multiplier);
        let (slack_a, g) = sum(&self.a, &of_a, &x);
        let (slack_b, h) = sum(&self.b, &of_b, &x);
        let [_, rest] = norm(&add(&g, &h));
        RBig::ONE - (slack_a + slack_b + rest * self.b.reach(&x)) / total
    }

    /// Lower bound of d(A‖B) from one constraint of A at its stored interior point: exact where
    /// that is its minimiser, as at the centre of a box, to which a reference comes close only.
    pub(crate) fn least_level(&self) -> RBig {
        let bounds = (0..self.a.len()).map(|i| {
            let (value, gradient) = self.a.jet(i, &self.a.interior);
            let [_, rest] = norm(&gradient);
            value - rest * self.b.reach(&self.a.interior)
        });
        bounds.max().expect("a body has constraints")
    }

    /// Upper bound of d(A‖B): the largest constraint of A at a point of B next to this.
    pub(crate) fn level_upper(&self, x: &[Big; 3]) -> Option<RBig> {
        Some(self.a.largest(&self.b.pull_in(&self.point(x))?))
    }

    /// Lower bound of the growth distance about centres: `r·Δ / (max r·(A - c_A) + max -r·(B -
    /// c_B))` with r the gradient of A.
    pub(crate) fn growth_lower(&self, centers: &[Vector; 2], dual: &Dual) -> RBig {
        let (u, w) = (self.point(&dual.x), self.point(&dual.y));
        let (slack_a, r) = sum(&self.a, &Self::multipliers(&dual.of_a), &u);
        let (slack_b, t) = sum(&self.b, &Self::multipliers(&dual.of_b), &w);
        let [_, rest] = norm(&add(&r, &t));
        let arms = sub(&sub(&u, &centers[0]), &sub(&w, &centers[1]));
        let supports = dot(&r, &arms) + slack_a + slack_b + rest * self.b.reach(&w);
        // Supports about points of the bodies are not negative.
        let delta = dot(&r, &sub(&centers[1], &centers[0]));
        if supports > RBig::ZERO && delta > RBig::ZERO { delta / supports } else { RBig::ZERO }
    }

    /// Whether the bodies grown by s about their centres share the point.
    pub(crate) fn grown_meet(&self, centers: &[Vector; 2], s: &RBig, contact: &[Big; 3]) -> bool {
        let x = self.point(contact);
        let shrunk = |c: &Vector| add(c, &scaled(&sub(&x, c), &(RBig::ONE / s)));
        self.a.contains(&shrunk(&centers[0])) && self.b.contains(&shrunk(&centers[1]))
    }
}
