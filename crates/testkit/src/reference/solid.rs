//! A posed body with 200 bits, evaluated term by term from its stored coefficients.

use super::big::{Big, Vector, add, big, dot, scaled, sub, vector};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// Value, gradient and Hessian of a constraint.
pub struct Jet {
    pub value: Big,
    pub gradient: Vector,
    pub hessian: [Vector; 3],
}

impl Jet {
    /// That of the constraint times a factor.
    pub fn times(self, factor: &Big) -> Self {
        Self {
            value: self.value * factor,
            gradient: scaled(&self.gradient, factor),
            hessian: self.hessian.map(|row| scaled(&row, factor)),
        }
    }
}

/// A body in the frame of work: world directions, origin at the first body's translation, lengths
/// in `unit` metres.
pub struct Solid<'a> {
    body: &'a Body,
    /// `z = linear v + offset` for points v of the frame of work.
    linear: [Vector; 3],
    offset: Vector,
    rotation: [Vector; 3],
    shift: Vector,
    unit: Big,
    /// Stored interior point.
    pub interior: Vector,
    center: Vector,
    /// Ten times the stored circumradius: no lower bound rests on that being sharp.
    radius: Big,
}

impl<'a> Solid<'a> {
    /// The body at its pose, the quaternion normalized exactly.
    pub fn new(body: &'a Body, pose: &Pose, origin: &Vector3<f64>, unit: f64) -> Self {
        let rotation = rotation(pose);
        let shift = sub(&vector(pose.translation()), &vector(origin));
        let own = body.normalization();
        let unit = big(unit);
        // z = L (Rᵀ (unit v - shift) - c), the rows of Rᵀ being the columns of R.
        let turned = |v: &Vector| -> Vector {
            std::array::from_fn(|i| dot(&std::array::from_fn(|j| rotation[j][i].clone()), v))
        };
        let l: [Vector; 3] = std::array::from_fn(|i| vector(&own.linear.row(i).transpose()));
        let linear = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).fold(big(0.0), |sum, k| sum + &l[i][k] * &rotation[j][k]) * &unit)
        });
        let inner = add(&turned(&shift), &vector(&own.center));
        let offset = std::array::from_fn(|i| -dot(&l[i], &inner));
        let mut solid = Self {
            body,
            linear,
            offset,
            rotation,
            shift,
            interior: std::array::from_fn(|_| big(0.0)),
            center: std::array::from_fn(|_| big(0.0)),
            radius: big(10.0 * body.circumscribed().radius) / &unit,
            unit,
        };
        solid.interior = solid.placed(body.interior_point());
        solid.center = solid.placed(&body.circumscribed().center);
        solid
    }

    /// A point of the body frame (metres) in the frame of work.
    pub fn placed(&self, x: &Vector3<f64>) -> Vector {
        let x = vector(x);
        let world: Vector = std::array::from_fn(|i| dot(&self.rotation[i], &x) + &self.shift[i]);
        scaled(&world, &(big(1.0) / &self.unit))
    }

    pub(super) fn len(&self) -> usize {
        self.body.constraints().len()
    }

    /// Constraint i at v.
    pub fn jet(&self, i: usize, v: &Vector) -> Jet {
        let z: Vector = std::array::from_fn(|i| dot(&self.linear[i], v) + &self.offset[i]);
        let jet = expand(self.body.constraints()[i].polynomial.terms(), &z);
        let column = |j: usize| -> Vector { std::array::from_fn(|i| self.linear[i][j].clone()) };
        let half: [Vector; 3] = std::array::from_fn(|j| {
            let column = column(j);
            std::array::from_fn(|i| dot(&jet.hessian[i], &column))
        });
        Jet {
            value: jet.value,
            gradient: std::array::from_fn(|j| dot(&column(j), &jet.gradient)),
            hessian: std::array::from_fn(|i| std::array::from_fn(|j| dot(&column(i), &half[j]))),
        }
    }

    /// Constraint i at v, nothing else.
    pub fn value(&self, i: usize, v: &Vector) -> Big {
        let z: Vector = std::array::from_fn(|i| dot(&self.linear[i], v) + &self.offset[i]);
        let powers = powers(&z);
        let terms = self.body.constraints()[i].polynomial.terms().iter();
        terms.fold(big(0.0), |sum, (e, c)| {
            let of = |i: usize| &powers[i][usize::from(e[i])];
            sum + big(*c) * of(0) * of(1) * of(2)
        })
    }

    /// The largest constraint at v.
    pub fn largest(&self, v: &Vector) -> Big {
        let values = (0..self.len()).map(|i| self.value(i, v));
        values.reduce(|most, value| if value > most { value } else { most }).expect("a body has constraints")
    }

    /// Upper bound of the distance from v to points of the body.
    pub fn reach(&self, v: &Vector) -> Big {
        super::big::norm(&sub(v, &self.center)) + &self.radius
    }

    /// How much lower than at v a direction r gets in the body at most, by the tangent planes at v
    /// with positive multipliers: `Σ λ (1 - g) + |r + Σ λ ∇g| · reach`.
    pub(super) fn fall(&self, index: &[usize], multipliers: &[Big], v: &Vector, r: &Vector) -> Big {
        let (mut slack, mut rest) = (big(0.0), r.clone());
        for (&i, m) in index.iter().zip(multipliers).filter(|(_, m)| **m > Big::ZERO) {
            let jet = self.jet(i, v);
            slack += m * (big(1.0) - jet.value);
            rest = add(&rest, &scaled(&jet.gradient, m));
        }
        slack + super::big::norm(&rest) * self.reach(v)
    }

    /// The point of the body where the segment from the interior point to v leaves it, or a little
    /// before; v if inside.
    pub fn pull_in(&self, v: &Vector) -> Option<Vector> {
        let (mut point, mut value) = (v.clone(), self.largest(v));
        let deepest = self.largest(&self.interior);
        let one = big(1.0);
        let mut margin = big(1e-58);
        for _ in 0..20 {
            if value <= one {
                return Some(point);
            }
            let factor = (&one - &deepest) / (&value - &deepest) * (&one - &margin);
            point = add(&self.interior, &scaled(&sub(&point, &self.interior), &factor));
            value = self.largest(&point);
            margin *= big(16.0);
        }
        None
    }
}

/// The exact rotation of the stored quaternion: `R(q) / |q|²`.
pub(super) fn rotation(pose: &Pose) -> [Vector; 3] {
    let q = pose.rotation().coords;
    let [x, y, z, w] = [q.x, q.y, q.z, q.w].map(big);
    let square = |a: &Big| a * a;
    let two = big(2.0);
    let n = square(&x) + square(&y) + square(&z) + square(&w);
    let (xx, yy, zz, ww) = (square(&x), square(&y), square(&z), square(&w));
    let twice = |a: &Big, b: &Big, c: &Big, d: &Big, sign: f64| (a * b + c * d * big(sign)) * &two;
    let rows = [
        [&ww + &xx - &yy - &zz, twice(&x, &y, &w, &z, -1.0), twice(&x, &z, &w, &y, 1.0)],
        [twice(&x, &y, &w, &z, 1.0), &ww - &xx + &yy - &zz, twice(&y, &z, &w, &x, -1.0)],
        [twice(&x, &z, &w, &y, -1.0), twice(&y, &z, &w, &x, 1.0), &ww - &xx - &yy + &zz],
    ];
    rows.map(|row| row.map(|entry| entry / &n))
}

fn powers(z: &Vector) -> [Vec<Big>; 3] {
    std::array::from_fn(|i| {
        let mut powers = vec![big(1.0)];
        for k in 0..8 {
            powers.push(&powers[k] * &z[i]);
        }
        powers
    })
}

/// Value, gradient and Hessian of `Σ c z^e`, by differentiating each term.
fn expand(terms: &[([u8; 3], f64)], z: &Vector) -> Jet {
    let powers = powers(z);
    let monomial = |e: [u8; 3]| {
        let of = |i: usize| &powers[i][usize::from(e[i])];
        of(0) * of(1) * of(2)
    };
    let mut table: Vec<Option<Big>> = vec![None; 729];
    let mut jet = Jet {
        value: big(0.0),
        gradient: std::array::from_fn(|_| big(0.0)),
        hessian: std::array::from_fn(|_| std::array::from_fn(|_| big(0.0))),
    };
    // Small integers times a coefficient fit in 200 bits: exact.
    let mut accumulate = |sum: &mut Big, factor: u32, c: &Big, e: [u8; 3]| {
        let index = e.iter().fold(0, |index, &k| 9 * index + usize::from(k));
        let value = table[index].get_or_insert_with(|| monomial(e));
        *sum += c * big(f64::from(factor)) * &*value;
    };
    for (e, c) in terms {
        let c = big(*c);
        accumulate(&mut jet.value, 1, &c, *e);
        for i in (0..3).filter(|&i| e[i] > 0) {
            let mut once = *e;
            once[i] -= 1;
            accumulate(&mut jet.gradient[i], u32::from(e[i]), &c, once);
            for j in (0..=i).filter(|&j| once[j] > 0) {
                let mut twice = once;
                twice[j] -= 1;
                accumulate(&mut jet.hessian[i][j], u32::from(e[i]) * u32::from(once[j]), &c, twice);
            }
        }
    }
    for i in 0..3 {
        for j in 0..i {
            jet.hessian[j][i] = jet.hessian[i][j].clone();
        }
    }
    jet
}
