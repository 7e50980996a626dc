//! Convex quadratic programs in three variables with few constraints, by active sets.
//!
//! ```text
//! min c·d + ½ dᵀ Q d   over d,   n_i·d + e_i <= 0
//! ```
//!
//! with unit vectors n_i and Q positive semidefinite. A set of up to three constraints that hold
//! with equality leaves a space of directions to minimise over. While a multiplier is negative its
//! constraint is let go, and while the minimiser violates a constraint that one is added; where
//! three hold already, it takes the place of the one whose multiplier would become negative first
//! (the ratio test of the dual simplex method).

use crate::measure::frames::vector::{V3, add_scaled, apply_symmetric, basis, dot, scaled};
use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::measure::solver::active_set_qp::MAX_CHANGES;
use crate::polynomial::Simd;

/// Square of the sine between the normals of two active constraints, or determinant of those of
/// three, below which they count as dependent. Larger, edges between sides that are tilted by
/// little are refused, and left to the general search; smaller, rounding moves points along them.
const DEPENDENT: f64 = 1e-9;

/// How far below 0 the multiplier of an active constraint may be, relative to what the slope is
/// computed from: its rounding, and more. Larger, a side that pulls away stays active; smaller,
/// rounding changes the active set. `cut_bodies_agree_with_the_general_search` counts what is
/// solved.
const NEGATIVE: f64 = 1e-12;

/// A constraint `n·d + e <= 0`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Row {
    /// Unit vector.
    pub(super) normal: V3<f64>,
    /// Value at d = 0.
    pub(super) excess: f64,
}

/// Which of the constraints hold with equality.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ActiveRows {
    pub(super) index: [u8; MAX_ACTIVE],
    pub(super) len: usize,
}

impl ActiveRows {
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.index[..self.len].iter().map(|&i| usize::from(i))
    }

    pub(super) fn contains(&self, row: usize) -> bool {
        self.iter().any(|i| i == row)
    }

    /// One more; there must be room for it.
    #[inline(always)]
    pub(super) fn push(&mut self, row: usize) {
        self.index[self.len] = row as u8;
        self.len += 1;
    }

    #[inline(always)]
    fn remove(&mut self, position: usize) {
        self.len -= 1;
        self.index[position] = self.index[self.len];
    }
}

/// A minimiser.
#[derive(Clone, Copy, Debug)]
pub(super) struct Minimum {
    pub(super) step: V3<f64>,
    pub(super) active: ActiveRows,
    /// Of the active constraints, at least 0: `c + Q d + Σ μ_i n_i = 0`.
    pub(super) multipliers: [f64; MAX_ACTIVE],
}

/// The minimiser, from a set of active constraints that is not empty; none if it is not found.
/// Multipliers down to -[`NEGATIVE`] count as 0, however long the gradient is. Constraints may be
/// violated by as much as `slack`; `smallest` is added to the curvature that is divided by.
#[inline(always)]
pub(super) fn minimize<S: Simd>(
    simd: S,
    (hessian, gradient): (&[f64; 6], V3<f64>),
    rows: &[Row],
    mut active: ActiveRows,
    (slack, smallest): (f64, f64),
) -> Option<Minimum> {
    for _ in 0..MAX_CHANGES {
        let step = OnActive::new(simd, hessian, rows, &active, smallest)?.minimizer(simd, hessian, gradient);
        let allowed = (slack, 1.0);
        if let Checked::Minimum(multipliers) = check(simd, (hessian, gradient), rows, &mut active, step, allowed)? {
            return Some(Minimum { step, active, multipliers });
        }
    }
    enumerate(simd, (hessian, gradient), rows, (slack, smallest))
}

/// The minimiser by trying all active sets, where changing one by one goes round in circles.
// Rare, and so compiled once.
#[cold]
#[inline(never)]
fn enumerate<S: Simd>(
    simd: S,
    (hessian, gradient): (&[f64; 6], V3<f64>),
    rows: &[Row],
    (slack, smallest): (f64, f64),
) -> Option<Minimum> {
    let count = rows.len();
    let mut sets = ActiveRows::default();
    let mut visit = |indices: &[usize]| {
        sets.len = 0;
        indices.iter().for_each(|&i| sets.push(i));
        let step = OnActive::new(simd, hessian, rows, &sets, smallest)?.minimizer(simd, hessian, gradient);
        match check(simd, (hessian, gradient), rows, &mut sets.clone(), step, (slack, 1.0))? {
            Checked::Minimum(multipliers) => Some(Minimum { step, active: sets, multipliers }),
            Checked::Exchanged => None,
        }
    };
    for i in 0..count {
        if let Some(found) = visit(&[i]) {
            return Some(found);
        }
        for j in 0..i {
            if let Some(found) = visit(&[i, j]) {
                return Some(found);
            }
            for k in 0..j {
                if let Some(found) = visit(&[i, j, k]) {
                    return Some(found);
                }
            }
        }
    }
    None
}

/// What is said of a step along which the active constraints hold with equality.
pub(super) enum Checked {
    /// It is the minimiser, with these multipliers.
    Minimum([f64; MAX_ACTIVE]),
    /// It is not; the active set has been changed by one constraint.
    Exchanged,
}

/// Whether a step that is stationary on its active constraints is the minimiser over all: their
/// multipliers are at least 0, but for the rounding of slopes that are computed from numbers of
/// this `scale`, and no other constraint is violated by more than `slack`. If not, changes the
/// active set; none if that is not possible.
#[inline(always)]
pub(super) fn check<S: Simd>(
    simd: S,
    (hessian, gradient): (&[f64; 6], V3<f64>),
    rows: &[Row],
    active: &mut ActiveRows,
    step: V3<f64>,
    (slack, scale): (f64, f64),
) -> Option<Checked> {
    let slope = add_scaled::<S, f64>(apply_symmetric::<S, f64>(hessian, step), 1.0, gradient);
    let mut multipliers = multipliers_of(simd, rows, active, scaled::<S, f64>(slope, -1.0))?;
    let mut least = 0;
    for k in 1..active.len {
        if multipliers[k] < multipliers[least] {
            least = k;
        }
    }
    if multipliers[least] < -NEGATIVE * scale {
        if active.len > 1 {
            active.remove(least);
            return Some(Checked::Exchanged);
        }
        // What faces away from where the minimum pulls gives way to what faces it most.
        let mut facing = (0.0, None);
        for (i, row) in rows.iter().enumerate() {
            let along = -dot::<S, f64>(row.normal, slope);
            if along > facing.0 {
                facing = (along, Some(i));
            }
        }
        active.index[0] = facing.1? as u8;
        return Some(Checked::Exchanged);
    }
    let mut worst = (slack, None);
    for (i, row) in rows.iter().enumerate() {
        let violated = dot::<S, f64>(row.normal, step) + row.excess;
        if violated > worst.0 && !active.contains(i) {
            worst = (violated, Some(i));
        }
    }
    let Some(next) = worst.1 else {
        for multiplier in &mut multipliers[..active.len] {
            *multiplier = multiplier.max(0.0);
        }
        return Some(Checked::Minimum(multipliers));
    };
    if active.len == MAX_ACTIVE {
        let shares = in_terms_of_three(simd, rows, active, rows[next].normal)?;
        let mut first = (f64::INFINITY, None);
        for k in 0..MAX_ACTIVE {
            let ratio = multipliers[k] / shares[k];
            if shares[k] > 0.0 && ratio < first.0 {
                first = (ratio, Some(k));
            }
        }
        active.remove(first.1?);
    }
    active.push(next);
    Some(Checked::Exchanged)
}

/// Steps along which active constraints hold with equality.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnActive {
    /// One of them.
    pub(super) to: V3<f64>,
    /// `G = Z (Zᵀ Q Z)⁻¹ Zᵀ` with the directions Z along which they go on holding: minimisers move
    /// by `-G δc` when c changes by δc. Entries xx, xy, xz, yy, yz, zz.
    pub(super) compliance: [f64; 6],
}

impl OnActive {
    /// Of a set of constraints that is not empty; none if their normals are dependent, or nothing
    /// bounds a minimiser.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        hessian: &[f64; 6],
        rows: &[Row],
        active: &ActiveRows,
        smallest: f64,
    ) -> Option<Self> {
        let row = |k: usize| &rows[usize::from(active.index[k])];
        match active.len {
            1 => {
                let Row { normal, excess } = *row(0);
                let [u, v, _] = basis(simd, normal);
                let (of_u, of_v) = (apply_symmetric::<S, f64>(hessian, u), apply_symmetric::<S, f64>(hessian, v));
                let uu = dot::<S, f64>(of_u, u) + smallest;
                let (uv, vv) = (dot::<S, f64>(of_u, v), dot::<S, f64>(of_v, v) + smallest);
                let inverse = 1.0 / (uu * vv - uv * uv);
                if !(inverse > 0.0 && inverse.is_finite()) {
                    return None;
                }
                // Of `(vv u - uv v) uᵀ + (uu v - uv u) vᵀ`, over the determinant.
                let a = scaled::<S, f64>(add_scaled::<S, f64>(scaled::<S, f64>(u, vv), -uv, v), inverse);
                let b = scaled::<S, f64>(add_scaled::<S, f64>(scaled::<S, f64>(v, uu), -uv, u), inverse);
                let entry = |i: usize, j: usize| a[i] * u[j] + b[i] * v[j];
                let compliance = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
                Some(Self { to: scaled::<S, f64>(normal, -excess), compliance })
            }
            2 => {
                let (p, q) = (row(0), row(1));
                let along = cross(p.normal, q.normal);
                let sine_square = dot::<S, f64>(along, along);
                if !(sine_square > DEPENDENT) {
                    return None;
                }
                let [a, b] = shares_of_two(simd, p, q, [-p.excess, -q.excess]);
                let bent = dot::<S, f64>(apply_symmetric::<S, f64>(hessian, along), along) + smallest * sine_square;
                let inverse = 1.0 / bent;
                if !(inverse > 0.0 && inverse.is_finite()) {
                    return None;
                }
                let entry = |i: usize, j: usize| along[i] * along[j] * inverse;
                let compliance = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
                Some(Self { to: add_scaled::<S, f64>(scaled::<S, f64>(p.normal, a), b, q.normal), compliance })
            }
            MAX_ACTIVE => {
                let dual = dual_basis(simd, rows, active)?;
                let sum = add_scaled::<S, f64>(scaled::<S, f64>(dual[0], -row(0).excess), -row(1).excess, dual[1]);
                Some(Self { to: add_scaled::<S, f64>(sum, -row(2).excess, dual[2]), compliance: [0.0; 6] })
            }
            _ => None,
        }
    }

    /// The minimiser for a gradient c.
    #[inline(always)]
    pub(super) fn minimizer<S: Simd>(&self, _: S, hessian: &[f64; 6], gradient: V3<f64>) -> V3<f64> {
        let slope = add_scaled::<S, f64>(apply_symmetric::<S, f64>(hessian, self.to), 1.0, gradient);
        add_scaled::<S, f64>(self.to, -1.0, apply_symmetric::<S, f64>(&self.compliance, slope))
    }
}

/// The multipliers μ of active constraints with `Σ μ_i n_i = pull`, as far as they span that.
#[inline(always)]
fn multipliers_of<S: Simd>(simd: S, rows: &[Row], active: &ActiveRows, pull: V3<f64>) -> Option<[f64; MAX_ACTIVE]> {
    let row = |k: usize| &rows[usize::from(active.index[k])];
    match active.len {
        1 => Some([dot::<S, f64>(row(0).normal, pull), 0.0, 0.0]),
        2 => {
            let (p, q) = (row(0), row(1));
            let [a, b] = shares_of_two(simd, p, q, [dot::<S, f64>(p.normal, pull), dot::<S, f64>(q.normal, pull)]);
            Some([a, b, 0.0])
        }
        MAX_ACTIVE => in_terms_of_three(simd, rows, active, pull),
        _ => None,
    }
}

/// The shares of two normals in a vector that they span, by its products with them.
#[inline(always)]
fn shares_of_two<S: Simd>(_: S, p: &Row, q: &Row, [a, b]: [f64; 2]) -> [f64; 2] {
    let cosine = dot::<S, f64>(p.normal, q.normal);
    let inverse = 1.0 / (1.0 - cosine * cosine);
    [(a - cosine * b) * inverse, (b - cosine * a) * inverse]
}

/// The cofactors of the normals of three active constraints, by rows, over their determinant.
#[inline(always)]
fn dual_basis<S: Simd>(_: S, rows: &[Row], active: &ActiveRows) -> Option<[V3<f64>; 3]> {
    let normal = |k: usize| rows[usize::from(active.index[k])].normal;
    let (p, q, r) = (normal(0), normal(1), normal(2));
    let crossed = cross(q, r);
    let determinant = dot::<S, f64>(p, crossed);
    if !(determinant.abs() > DEPENDENT) {
        return None;
    }
    let inverse = 1.0 / determinant;
    Some([
        scaled::<S, f64>(crossed, inverse),
        scaled::<S, f64>(cross(r, p), inverse),
        scaled::<S, f64>(cross(p, q), inverse),
    ])
}

/// The numbers a with `v = Σ a_k n_k`.
#[inline(always)]
fn in_terms_of_three<S: Simd>(simd: S, rows: &[Row], active: &ActiveRows, v: V3<f64>) -> Option<[f64; 3]> {
    let dual = dual_basis(simd, rows, active)?;
    Some([dot::<S, f64>(dual[0], v), dot::<S, f64>(dual[1], v), dot::<S, f64>(dual[2], v)])
}

#[inline(always)]
fn cross(a: V3<f64>, b: V3<f64>) -> V3<f64> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::{ActiveRows, Row, minimize};
    use crate::polynomial::Scalar;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    /// The least value over all active sets of at most three constraints whose minimiser is
    /// feasible with multipliers at least 0: what optimality means.
    fn brute_force(q: &Matrix3<f64>, c: &Vector3<f64>, rows: &[(Vector3<f64>, f64)]) -> Option<Vector3<f64>> {
        let mut sets = vec![vec![]];
        for i in 0..rows.len() {
            sets.push(vec![i]);
            for j in 0..i {
                sets.push(vec![i, j]);
                sets.extend((0..j).map(|k| vec![i, j, k]));
            }
        }
        sets.iter().find_map(|set| {
            let n = 3 + set.len();
            let mut kkt = nalgebra::DMatrix::<f64>::zeros(n, n);
            let mut right = nalgebra::DVector::<f64>::zeros(n);
            kkt.view_mut((0, 0), (3, 3)).copy_from(q);
            right.rows_mut(0, 3).copy_from(&-c);
            for (k, &i) in set.iter().enumerate() {
                kkt.view_mut((0, 3 + k), (3, 1)).copy_from(&rows[i].0);
                kkt.view_mut((3 + k, 0), (1, 3)).copy_from(&rows[i].0.transpose());
                right[3 + k] = -rows[i].1;
            }
            let solution = kkt.lu().solve(&right)?;
            let step = Vector3::new(solution[0], solution[1], solution[2]);
            let feasible = rows.iter().all(|(n, e)| n.dot(&step) + e < 1e-9);
            (feasible && solution.iter().skip(3).all(|&m| m > -1e-9)).then_some(step)
        })
    }

    #[test]
    fn minimisers_are_those_of_all_active_sets() {
        let mut found = 0;
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let half = Matrix3::from_fn(|_, _| random.signed());
            let q = half * half.transpose() + Matrix3::identity() * 1e-3;
            let mut vector = || Vector3::from_fn(|_, _| random.signed());
            let (c, count) = (vector(), 1 + (seed % 7) as usize);
            // The origin of a ball of radius 0.2 is feasible.
            let rows: Vec<_> = (0..count).map(|_| (vector().normalize(), vector().x.abs() * -0.4 - 0.2)).collect();
            // Push against the first one, so that at least one is active.
            let c = c - rows[0].0 * 4.0;
            let Some(truth) = brute_force(&q, &c, &rows) else { continue };
            let packed: Vec<Row> =
                rows.iter().map(|(normal, excess)| Row { normal: (*normal).into(), excess: *excess }).collect();
            let mut active = ActiveRows::default();
            active.push(0);
            let hessian = [q[(0, 0)], q[(0, 1)], q[(0, 2)], q[(1, 1)], q[(1, 2)], q[(2, 2)]];
            let answer = minimize(Scalar, (&hessian, c.into()), &packed, active, (1e-12, 0.0));
            let Some(answer) = answer else { continue };
            found += 1;
            let step = Vector3::from(answer.step);
            assert!((step - truth).norm() < 1e-7 * (1.0 + truth.norm()), "seed {seed}: {step:?} {truth:?}");
            let pull: Vector3<f64> =
                answer.active.iter().zip(answer.multipliers).map(|(i, multiplier)| rows[i].0 * multiplier).sum();
            assert!((q * step + c + pull).norm() < 1e-6, "seed {seed}");
        }
        println!("{found} of 2000 solved");
        assert!(found > 1980, "{found}");
    }
}
