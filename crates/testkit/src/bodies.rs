//! The bodies of the catalogue: `E`, `Q2k`, `C2k`, `P2k`, `B`, cylinders, and fitted ones.

use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Mutex, OnceLock};
use sublevel_core::body::{Body, Constraint, Normalization};
use sublevel_core::measure::Pose;
use sublevel_core::polynomial::{Exponents, HessianGram, HessianMonomial, Polynomial, degree_of, monomials};

/// A body at its pose.
pub type Placed<'a> = (&'a Body, &'a Pose);

/// E: ellipsoid with these half-axes.
pub fn e(x: f64, y: f64, z: f64) -> Body {
    kept("E", &[x, y, z], || Body::ellipsoid("E", Vector3::zeros(), Vector3::new(x, y, z)))
}

/// Q2k: `(x/a)^degree + (y/b)^degree + (z/c)^degree <= 1`.
pub fn q(degree: u8, x: f64, y: f64, z: f64) -> Body {
    let name = format!("Q{degree}");
    kept(&name, &[x, y, z], || Body::superellipsoid(&name, Vector3::zeros(), Vector3::new(x, y, z), degree))
}

/// C2k: `((x² + y²)/r²)^k + (z/h)^2k <= 1`, degree 2k.
pub fn c(degree: u8, radius: f64, half_height: f64) -> Body {
    let name = format!("C{degree}");
    let linear = Matrix3::from_diagonal(&Vector3::new(1.0 / radius, 1.0 / radius, 1.0 / half_height));
    kept(&name, &[radius, radius, half_height], || {
        let constraint = known(&name, || rounded_cylinder(degree));
        Body::new(&name, Normalization { center: Vector3::zeros(), linear }, vec![constraint])
    })
}

/// The constraint of C2k of unit sizes.
fn rounded_cylinder(degree: u8) -> Constraint {
    let half = usize::from(degree / 2);
    let mut terms = Vec::new();
    for i in 0..=half {
        terms.push(([2 * i as u8, 2 * (half - i) as u8, 0], binomial(half, i)));
    }
    terms.push(([0, 0, degree], 1.0));
    // The Hessian form of |u|^2k, u = (x, y), is 2k |u|^(2k-2) |w|² + 4k(k-1) |u|^(2k-4) (u·w)²:
    // definite on w_i u^e.
    let basis: Vec<_> = (0..2)
        .flat_map(|d| (0..half).map(move |i| (d, [i as u8, (half - 1 - i) as u8, 0])))
        .chain([(2, [0, 0, degree / 2 - 1])])
        .map(|(direction, exponents)| HessianMonomial { direction, exponents })
        .collect();
    let n = basis.len();
    let (k, mut gram) = (half as f64, DMatrix::zeros(n, n));
    for (i, b) in basis.iter().enumerate().take(n - 1) {
        gram[(i, i)] += 2.0 * k * binomial(half - 1, usize::from(b.exponents[0]));
    }
    gram[(n - 1, n - 1)] = f64::from(degree) * f64::from(degree - 1);
    for j in 0..half.saturating_sub(1) {
        // (u·w) u^e with |e| = k - 2: the weight of u^2e in |u|^(2k-4).
        let e = [j as u8, (half - 2 - j) as u8, 0];
        let w: Vec<f64> = basis
            .iter()
            .map(|b| {
                let mut raised = e;
                raised[usize::from(b.direction)] += 1;
                f64::from(u8::from(b.direction < 2 && b.exponents == raised))
            })
            .collect();
        let factor = 4.0 * k * (k - 1.0) * binomial(half - 2, j);
        gram += DMatrix::from_fn(n, n, |i, j| factor * w[i] * w[j]);
    }
    certified(terms, basis, gram)
}

/// P2k: `Σ (a_i·x)^degree <= 1` with the a_i along the axes and the diagonals of a cube, of the
/// given half-width.
pub fn p(degree: u8, size: f64) -> Body {
    let name = format!("P{degree}");
    let linear = Matrix3::identity() / size;
    kept(&name, &[size; 3], || {
        let constraint = known(&name, || octahedral_prism(degree));
        Body::new(&name, Normalization { center: Vector3::zeros(), linear }, vec![constraint])
    })
}

/// The constraint of P2k of unit half-width.
fn octahedral_prism(degree: u8) -> Constraint {
    let third = 1.0 / 3.0_f64.sqrt();
    let mut directions = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    directions
        .extend([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]].map(|d| d.map(|c| c * third)));
    let power = |a: &[f64; 3], e: Exponents| {
        let n = degree_of(e);
        let multinomial = factorial(n) / e.iter().map(|&k| factorial(usize::from(k))).product::<f64>();
        multinomial * (0..3).map(|i| a[i].powi(i32::from(e[i]))).product::<f64>()
    };
    let mut coefficients: BTreeMap<Exponents, f64> = BTreeMap::new();
    for e in monomials(usize::from(degree)).into_iter().filter(|&e| degree_of(e) == usize::from(degree)) {
        let sum = directions.iter().map(|a| power(a, e)).sum();
        coefficients.insert(e, sum);
    }
    let half = usize::from(degree / 2);
    let basis: Vec<_> = (0..3)
        .flat_map(|direction| {
            let of_z = monomials(half - 1).into_iter().filter(move |&e| degree_of(e) == half - 1);
            of_z.map(move |exponents| HessianMonomial { direction, exponents })
        })
        .collect();
    let n = basis.len();
    let scale = f64::from(degree) * f64::from(degree - 1);
    let mut gram = DMatrix::zeros(n, n);
    for a in &directions {
        let w: Vec<f64> = basis.iter().map(|b| a[usize::from(b.direction)] * power(a, b.exponents)).collect();
        gram += DMatrix::from_fn(n, n, |i, j| scale * w[i] * w[j]);
    }
    certified(coefficients.into_iter().collect(), basis, gram)
}

/// Q6 that slabs across x and z cut, at 0.8 and 0.6 of its half-axes: three constraints.
pub fn cut(x: f64, y: f64, z: f64) -> Body {
    kept("cut Q6", &[x, y, z], || {
        let whole = q(6, x, y, z);
        let slab = |axis: u8, half: f64| {
            known(&format!("slab {axis} {half}"), || {
                let exponents = std::array::from_fn(|k| if k == usize::from(axis) { 2 } else { 0 });
                let basis = vec![HessianMonomial { direction: axis, exponents: [0; 3] }];
                let coefficient = 1.0 / (half * half);
                certified(vec![(exponents, coefficient)], basis, DMatrix::from_element(1, 1, 2.0 * coefficient))
            })
        };
        let constraints = vec![whole.constraints()[0].clone(), slab(0, 0.8), slab(2, 0.6)];
        Body::new("cut Q6", *whole.normalization(), constraints)
    })
}

/// B: box with these half-extents.
pub fn b(x: f64, y: f64, z: f64) -> Body {
    kept("B", &[x, y, z], || Body::cuboid("B", Vector3::new(x, y, z)))
}

pub fn cylinder(radius: f64, half_height: f64) -> Body {
    kept("cylinder", &[radius, half_height], || Body::cylinder("cylinder", radius, half_height))
}

/// A body turned and moved within its frame, metres.
pub fn moved(body: &Body, turn: &UnitQuaternion<f64>, shift: &Vector3<f64>) -> Body {
    let numbers: Vec<f64> = turn.coords.iter().chain(shift).copied().collect();
    kept(&body.id().to_string(), &numbers, || body.moved(turn, shift))
}

/// The body of these half sizes, metres, with the constraints of one of unit sizes about its
/// origin, turned and moved within its frame: what [`Body::moved`] makes of one that is not made
/// here.
pub fn placed(unit: &Body, sizes: [f64; 3], turn: &UnitQuaternion<f64>, shift: &Vector3<f64>) -> Body {
    let numbers: Vec<f64> = sizes.iter().chain(turn.coords.iter()).chain(shift).copied().collect();
    kept(&format!("{} placed", unit.name()), &numbers, || {
        let linear = Matrix3::from_diagonal(&Vector3::from(sizes.map(|size| 1.0 / size)));
        let linear = linear * turn.to_rotation_matrix().inverse().matrix();
        Body::new(unit.name(), Normalization { center: *shift, linear }, unit.constraints().to_vec())
    })
}

/// Bodies of a process that are kept at most. Those of sizes that are drawn at random are asked for
/// again soon or never; long runs draw 1e5 of them.
const MOST_KEPT: usize = 1000;

/// The body of that name and these numbers, made once: cases share them, and proofs take their
/// time.
fn kept<E: Debug>(name: &str, numbers: &[f64], make: impl FnOnce() -> Result<Body, E>) -> Body {
    static KEPT: Mutex<BTreeMap<(String, Vec<u64>), Body>> = Mutex::new(BTreeMap::new());
    let key = (name.to_owned(), numbers.iter().map(|number| number.to_bits()).collect());
    let found = KEPT.lock().expect("nothing fails in here").get(&key).cloned();
    found.unwrap_or_else(|| {
        let body = make().expect("a body of the catalogue");
        let mut kept = KEPT.lock().expect("nothing fails in here");
        if kept.len() >= MOST_KEPT {
            kept.clear();
        }
        kept.insert(key, body.clone());
        body
    })
}

/// The constraint of that name, made once: of all sizes it is the same.
fn known(name: &str, make: impl FnOnce() -> Constraint) -> Constraint {
    static KNOWN: Mutex<BTreeMap<String, Constraint>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().expect("nothing fails in here");
    known.entry(name.to_owned()).or_insert_with(make).clone()
}

/// A definite Gram matrix from a semidefinite one: alternating projections onto the matrices of the
/// form and onto those with eigenvalues above a floor.
fn certified(terms: Vec<(Exponents, f64)>, basis: Vec<HessianMonomial>, mut matrix: DMatrix<f64>) -> Constraint {
    let polynomial = Polynomial::new(terms).unwrap();
    let floor = 1e-3 * matrix.trace() / matrix.nrows() as f64;
    for _ in 0..5000 {
        let gram = HessianGram::nearest(&polynomial, basis.clone(), matrix).unwrap();
        if gram.prove(&polynomial).is_ok() {
            return Constraint { polynomial, gram };
        }
        let mut split = gram.matrix().clone().symmetric_eigen();
        split.eigenvalues.apply(|value| *value = value.max(floor));
        let lifted = split.recompose();
        matrix = (&lifted + lifted.transpose()) * 0.5;
    }
    panic!("no definite Gram matrix was found");
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}

fn binomial(n: usize, k: usize) -> f64 {
    factorial(n) / (factorial(k) * factorial(n - k))
}

/// Support function `max n·x` in the body frame in closed form, for E, Q2k, C2k, boxes and
/// cylinders about their origin: the norm dual to the body's own.
pub fn support(body: &Body, n: &Vector3<f64>) -> f64 {
    let sizes = body.normalization().linear.diagonal().map(|l| 1.0 / l);
    let m = n.component_mul(&sizes).abs();
    let wall = m.x.hypot(m.y);
    let dual = |values: &[f64]| {
        let q = body.degree() as f64 / (body.degree() as f64 - 1.0);
        let most = values.iter().fold(0.0_f64, |most, &value| most.max(value));
        most * values.iter().map(|value| (value / most).powf(q)).sum::<f64>().powf(1.0 / q)
    };
    match body.name().as_bytes()[0] {
        b'B' => m.sum(),
        b'C' => dual(&[wall, m.z]),
        b'c' => wall + m.z,
        _ => dual(&[m.x, m.y, m.z]),
    }
}

/// Fitted bodies: a chair and a human at degrees 2, 4 and 6, as `sublevel-fit` makes them of its
/// sample shapes (a test there compares). Reading them proves them again.
pub fn fitted() -> &'static [Body] {
    static BODIES: OnceLock<Vec<Body>> = OnceLock::new();
    BODIES.get_or_init(|| {
        let files = [
            include_str!("../bodies/chair-d2.json"),
            include_str!("../bodies/human-d2.json"),
            include_str!("../bodies/chair-d4.json"),
            include_str!("../bodies/human-d4.json"),
            include_str!("../bodies/chair-d6.json"),
            include_str!("../bodies/human-d6.json"),
        ];
        files.map(|file| Body::from_json(file).expect("a proven body")).into()
    })
}

/// Two bars in an L, metres: off-centre and not symmetric.
pub fn bars() -> Vec<Vector3<f64>> {
    let bars = [([-0.5, -0.15, -0.1], [0.5, 0.15, 0.1]), ([0.3, -0.15, -0.1], [0.5, 0.15, 0.9])];
    let corner = |(low, high): &([f64; 3], [f64; 3]), i: usize| {
        Vector3::from_fn(|k, _| if i >> k & 1 == 1 { high[k] } else { low[k] })
    };
    bars.iter().flat_map(|bar| (0..8).map(move |i| corner(bar, i))).collect()
}

/// Fitted bodies around the [`bars`], of degrees 4 and 6, as [`fitted`] are.
fn fitted_bars() -> [Body; 2] {
    let files = [include_str!("../bodies/bars-d4.json"), include_str!("../bodies/bars-d6.json")];
    files.map(|file| Body::from_json(file).expect("a proven body"))
}

/// The bodies of the stability chart, in the order that its seeds go by: those of [`zoo`] with
/// bars in place of furniture and people.
pub fn chart_zoo() -> &'static [Body] {
    static ZOO: OnceLock<Vec<Body>> = OnceLock::new();
    ZOO.get_or_init(|| {
        let mut zoo = analytic();
        for degree in [4, 6, 8] {
            zoo.extend([q(degree, 0.8, 0.5, 1.1), p(degree, 0.7)]);
        }
        zoo.extend(fitted_bars());
        zoo
    })
}

/// Those of the zoos that have no degree of their own or are round about an axis.
fn analytic() -> Vec<Body> {
    vec![e(1.0, 0.7, 0.4), b(0.6, 0.9, 0.3), cylinder(0.5, 0.8), c(4, 0.5, 1.0), c(6, 0.8, 0.3), c(8, 1.0, 0.7)]
}

/// One of each kind, of sizes about 1.
pub fn zoo() -> Vec<Body> {
    let mut zoo = analytic();
    zoo.extend([4, 6, 8].map(|degree| q(degree, 0.8, 0.5, 1.1)));
    zoo.extend([4, 6, 8].map(|degree| p(degree, 0.7)));
    zoo.extend_from_slice(fitted());
    zoo
}

#[test]
fn every_kind_can_be_built() {
    for body in zoo() {
        println!("{} degree {} radius {}", body.name(), body.degree(), body.circumscribed().radius);
    }
}

#[test]
fn placed_bodies_are_those_that_are_moved() {
    let mut random = crate::random::Seeded(2);
    for _ in 0..5 {
        let [x, y, z] = [(); 3].map(|()| random.between(0.3, 3.0));
        let (turn, shift) = (random.rotation(), random.unit());
        for (unit, sizes, body) in [
            (e(1.0, 1.0, 1.0), [x, y, z], e(x, y, z)),
            (b(1.0, 1.0, 1.0), [x, y, z], b(x, y, z)),
            (cylinder(1.0, 1.0), [x, x, z], cylinder(x, z)),
            (cut(1.0, 1.0, 1.0), [x, y, z], cut(x, y, z)),
        ] {
            let [made, expected] = [placed(&unit, sizes, &turn, &shift), moved(&body, &turn, &shift)];
            assert_eq!((made.name(), made.id()), (expected.name(), expected.id()));
            assert_eq!(made.interior_point(), expected.interior_point(), "{}", made.name());
            assert!(made.boundary() == expected.boundary(), "{}", made.name());
        }
    }
}

#[test]
fn closed_supports_are_supports() {
    let mut random = crate::random::Seeded(1);
    for body in zoo().iter().filter(|body| !body.name().starts_with(['F', 'P'])) {
        for _ in 0..20 {
            let n = random.unit();
            let most = body.boundary().iter().map(|x| n.dot(x)).fold(f64::MIN, f64::max);
            let closed = support(body, &n);
            let radius = body.circumscribed().radius;
            assert!(most <= closed + 1e-12 && closed - most < 0.25 * radius, "{}: {most} {closed}", body.name());
        }
    }
}
