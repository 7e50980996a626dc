//! A posed body in rational arithmetic: `g(L (Rᵀ (v - t) - c))` with R the rotation of the stored
//! quaternion normalised exactly, `R(q) / |q|²`, which is rational.

use super::number::{Vector, add, dot, exact, exacts, norm, scaled, sub};
use dashu_int::{IBig, UBig, ops::Gcd};
use dashu_ratio::RBig;
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// A body at its pose; points are metres in the world.
pub(crate) struct Solid<'a> {
    body: &'a Body,
    polynomials: Vec<Integral>,
    rotation: [Vector; 3],
    translation: Vector,
    /// Rows of `L Rᵀ`, by which gradients come back.
    linear: [Vector; 3],
    /// Stored interior point.
    pub(crate) interior: Vector,
    center: Vector,
    radius: RBig,
}

impl<'a> Solid<'a> {
    pub(crate) fn new(body: &'a Body, pose: &Pose) -> Self {
        let rotation = rotation(pose);
        let translation = exacts(pose.translation());
        let own = body.normalization();
        let linear = std::array::from_fn(|i| {
            let row = exacts(&own.linear.row(i).transpose());
            std::array::from_fn(|j| dot(&row, &rotation[j]))
        });
        let polynomials = body.constraints().iter().map(|c| Integral::new(c.polynomial.terms())).collect();
        let ball = body.circumscribed();
        let mut solid = Self {
            body,
            polynomials,
            rotation,
            linear,
            interior: translation.clone(),
            center: translation.clone(),
            translation,
            radius: exact(ball.radius),
        };
        solid.interior = solid.placed(body.interior_point());
        solid.center = solid.placed(&ball.center);
        solid
    }

    /// A point of the body frame in the world.
    pub(crate) fn placed(&self, x: &Vector3<f64>) -> Vector {
        let x = exacts(x);
        std::array::from_fn(|i| dot(&self.rotation[i], &x) + &self.translation[i])
    }

    pub(crate) fn len(&self) -> usize {
        self.polynomials.len()
    }

    /// Normalized coordinates.
    fn normalized(&self, v: &Vector) -> Fractions {
        let from_translation = sub(v, &self.translation);
        let center = exacts(&self.body.normalization().center);
        Fractions::new(std::array::from_fn(|i| {
            let row = exacts(&self.body.normalization().linear.row(i).transpose());
            dot(&self.linear[i], &from_translation) - dot(&row, &center)
        }))
    }

    /// Value and gradient of constraint i.
    pub(crate) fn jet(&self, i: usize, v: &Vector) -> (RBig, Vector) {
        let z = self.normalized(v);
        let g: Vector = std::array::from_fn(|axis| self.polynomials[i].slope(axis, &z));
        let gradient = std::array::from_fn(|j| (0..3).fold(RBig::ZERO, |sum, k| sum + &self.linear[k][j] * &g[k]));
        (self.polynomials[i].value(&z), gradient)
    }

    /// The largest constraint.
    pub(crate) fn largest(&self, v: &Vector) -> RBig {
        let z = self.normalized(v);
        self.polynomials.iter().map(|p| p.value(&z)).max().expect("a body has constraints")
    }

    pub(crate) fn contains(&self, v: &Vector) -> bool {
        self.largest(v) <= RBig::ONE
    }

    /// A point of the body next to v: towards the interior point by as little as is tried. None if
    /// v is not near the body.
    pub(crate) fn pull_in(&self, v: &Vector) -> Option<Vector> {
        let out = sub(v, &self.interior);
        let shares = [0.0, 2_f64.powi(-100), 2_f64.powi(-85), 2_f64.powi(-70)].into_iter();
        shares.map(|share| add(&self.interior, &scaled(&out, &(RBig::ONE - exact(share))))).find(|v| self.contains(v))
    }

    /// At least the distance from v to any point of the body, by its proven ball.
    pub(crate) fn reach(&self, v: &Vector) -> RBig {
        let [_, above] = norm(&sub(v, &self.center));
        above + &self.radius
    }
}

/// A polynomial times a power of two that makes its coefficients whole numbers.
struct Integral {
    terms: Vec<([u8; 3], IBig)>,
    degree: usize,
    scale: UBig,
}

/// Three fractions `parts[i] / whole`.
struct Fractions {
    /// Powers up to the highest degree there is.
    parts: [Vec<IBig>; 3],
    whole: Vec<IBig>,
}

/// Highest degree of a body's polynomial.
const MAX_DEGREE: usize = 8;

impl Fractions {
    fn new(z: Vector) -> Self {
        let lcm = |a: &UBig, b: &UBig| a / a.gcd(b) * b;
        let whole = z.iter().fold(UBig::ONE, |whole, z| lcm(&whole, z.denominator()));
        let powers = |x: IBig| {
            let mut powers = vec![IBig::ONE];
            (0..MAX_DEGREE).for_each(|k| powers.push(&powers[k] * &x));
            powers
        };
        let parts = z.map(|z| powers(z.numerator() * IBig::from(&whole / z.denominator())));
        Self { parts, whole: powers(whole.into()) }
    }
}

impl Integral {
    fn new(terms: &[([u8; 3], f64)]) -> Self {
        // Denominators are powers of two: the largest is a multiple of all.
        let scale = terms.iter().map(|(_, c)| exact(*c).denominator().clone()).max().expect("a polynomial has terms");
        let whole = |c: f64| {
            let c = exact(c);
            c.numerator() * IBig::from(&scale / c.denominator())
        };
        let terms: Vec<_> = terms.iter().map(|(e, c)| (*e, whole(*c))).collect();
        let degree = terms.iter().map(|(e, _)| order(*e)).max().unwrap_or(0);
        Self { terms, degree, scale }
    }

    fn value(&self, z: &Fractions) -> RBig {
        self.sum(z, self.degree, self.terms.iter().map(|(e, c)| (*e, c.clone())))
    }

    /// Derivative along one axis.
    fn slope(&self, axis: usize, z: &Fractions) -> RBig {
        let lowered = self.terms.iter().filter(|(e, _)| e[axis] > 0).map(|(e, c)| {
            let mut lower = *e;
            lower[axis] -= 1;
            (lower, c * IBig::from(e[axis]))
        });
        self.sum(z, self.degree.saturating_sub(1), lowered)
    }

    /// `Σ c z^e / scale`, brought to the power `degree` of the common denominator.
    fn sum(&self, z: &Fractions, degree: usize, terms: impl Iterator<Item = ([u8; 3], IBig)>) -> RBig {
        let sum = terms.fold(IBig::ZERO, |sum, (e, c)| {
            let of = |i: usize| &z.parts[i][usize::from(e[i])];
            sum + c * of(0) * of(1) * of(2) * &z.whole[degree - order(e)]
        });
        RBig::from_parts_signed(sum, &z.whole[degree] * IBig::from(self.scale.clone()))
    }
}

fn order(e: [u8; 3]) -> usize {
    e.iter().copied().map(usize::from).sum()
}

fn rotation(pose: &Pose) -> [Vector; 3] {
    let q = pose.rotation().coords;
    let [x, y, z, w] = [q.x, q.y, q.z, q.w].map(exact);
    let square = &x * &x + &y * &y + &z * &z + &w * &w;
    let two = exact(2.0);
    // The unit matrix plus twice that of the quaternion: R = 1 + 2 (w [v] + [v]²) / |q|².
    let rows = [
        [-(&y * &y + &z * &z), &x * &y - &w * &z, &x * &z + &w * &y],
        [&x * &y + &w * &z, -(&x * &x + &z * &z), &y * &z - &w * &x],
        [&x * &z - &w * &y, &y * &z + &w * &x, -(&x * &x + &y * &y)],
    ];
    std::array::from_fn(|i| std::array::from_fn(|j| exact(f64::from(u8::from(i == j))) + &two * &rows[i][j] / &square))
}

/// Rotations are orthogonal, without any error.
#[test]
fn rotations_are_exact() {
    let mut random = sublevel_testkit::random::Seeded(31);
    for _ in 0..50 {
        let rows = rotation(&random.pose(1.0));
        for i in 0..3 {
            for j in 0..3 {
                assert_eq!(dot(&rows[i], &rows[j]), exact(f64::from(u8::from(i == j))));
            }
        }
        let minors: Vector = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            &rows[1][j] * &rows[2][k] - &rows[1][k] * &rows[2][j]
        });
        assert_eq!(dot(&rows[0], &minors), RBig::ONE);
    }
}

/// Values of powers of norms are what the powers are, and slopes what differences of an exactly
/// quadratic function say.
#[test]
fn values_are_exact() {
    let body = sublevel_testkit::bodies::q(8, 0.5, 0.25, 2.0);
    let solid = Solid::new(&body, &sublevel_testkit::random::at(1.0, -2.0, 3.0));
    let corner = [exact(1.5), exact(-1.75), exact(5.0)];
    assert_eq!(solid.largest(&corner), exact(3.0));
    assert_eq!(solid.jet(0, &corner).1, [exact(16.0), exact(32.0), exact(4.0)]);
    let mut random = sublevel_testkit::random::Seeded(32);
    let (ellipsoid, pose) = (sublevel_testkit::bodies::e(1.0, 0.7, 0.3), random.pose(2.0));
    let solid = Solid::new(&ellipsoid, &pose);
    for _ in 0..20 {
        let (x, y) = (exacts(&random.unit()), exacts(&random.unit()));
        let both = add(&solid.jet(0, &x).1, &solid.jet(0, &y).1);
        assert_eq!(solid.largest(&x) - solid.largest(&y), dot(&both, &sub(&x, &y)) / exact(2.0));
    }
}
