//! Lorentz cones `u >= |(v, w)|` as an interior-point method needs them.
//!
//! `[[u + v, w], [w, u - v]]` is positive semidefinite exactly if (u, v, w) is in the cone. With v
//! = 0 throughout it is the cone `u >= |w|`, and with w = 0, too, the ray `u >= 0`: one arithmetic
//! serves all three. Notation and scaling as by Alizadeh and Goldfarb (Math. Program. 95, 2003) and
//! Nesterov and Todd (Math. Oper. Res. 22, 1997).

use nalgebra::{Matrix3, Vector3};

/// `u² - v² - w²`: positive inside.
fn determinant(x: &Vector3<f64>) -> f64 {
    // The difference of squares as a product keeps its digits near the boundary.
    let tail = x.y.hypot(x.z);
    (x.x - tail) * (x.x + tail)
}

/// `(u, -v, -w)`.
fn mirrored(x: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(x.x, -x.y, -x.z)
}

/// The Jordan product `x∘y = (x·y, x₀y₁ + y₀x₁)`; its unit is (1, 0, 0).
pub(super) fn product(x: &Vector3<f64>, y: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(x.dot(y), x.x * y.y + y.x * x.y, x.x * y.z + y.x * x.z)
}

/// The y with `x∘y = d`, x inside.
pub(super) fn quotient(d: &Vector3<f64>, x: &Vector3<f64>) -> Vector3<f64> {
    let first = d.dot(&mirrored(x)) / determinant(x);
    Vector3::new(first, (d.y - first * x.y) / x.x, (d.z - first * x.z) / x.x)
}

/// Longest step from x inside along d that stays in the cone; infinite if every one does.
pub(super) fn longest(x: &Vector3<f64>, d: &Vector3<f64>) -> f64 {
    // det(x + αd) = c + 2bα + aα², c > 0: the smallest positive root; u turns negative only past
    // it.
    let (a, b, c) = (d.dot(&mirrored(d)), d.dot(&mirrored(x)), determinant(x));
    let discriminant = b * b - a * c;
    // Of a ray it is zero but for rounding.
    if discriminant < -1e-12 * b * b || (a >= 0.0 && b >= 0.0) {
        return f64::INFINITY;
    }
    let root = discriminant.max(0.0).sqrt();
    // Of the two forms of that root the one without cancellation.
    if b > 0.0 { (b + root) / -a } else { c / (root - b) }
}

/// The symmetric W with `W z = W⁻¹x` for x and z inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scaling {
    /// Of determinant 1.
    axis: Vector3<f64>,
    size: f64,
}

impl Scaling {
    /// None unless x and z are inside.
    pub(super) fn new(x: &Vector3<f64>, z: &Vector3<f64>) -> Option<Self> {
        let (of_x, of_z) = (determinant(x), determinant(z));
        if !(of_x > 0.0 && of_z > 0.0 && x.x > 0.0 && z.x > 0.0) {
            return None;
        }
        let (x, z) = (x / of_x.sqrt(), z / of_z.sqrt());
        let axis = (x + mirrored(&z)) / (2.0 * (1.0 + x.dot(&z))).sqrt();
        Some(Self { axis, size: (of_x / of_z).powf(0.25) })
    }

    /// `W y`.
    pub(super) fn apply(&self, y: &Vector3<f64>) -> Vector3<f64> {
        Self::turn(&self.axis, y) * self.size
    }

    /// `W⁻¹ y`.
    pub(super) fn unapply(&self, y: &Vector3<f64>) -> Vector3<f64> {
        Self::turn(&mirrored(&self.axis), y) / self.size
    }

    /// `[[a₀, a₁ᵀ], [a₁, I + a₁a₁ᵀ/(1 + a₀)]] y`.
    fn turn(axis: &Vector3<f64>, y: &Vector3<f64>) -> Vector3<f64> {
        let along = axis.y * y.y + axis.z * y.z;
        let factor = y.x + along / (1.0 + axis.x);
        Vector3::new(axis.x * y.x + along, y.y + factor * axis.y, y.z + factor * axis.z)
    }

    /// W², which maps z to x.
    pub(super) fn square(&self) -> Matrix3<f64> {
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        (self.axis * self.axis.transpose() * 2.0 - mirror) * self.size.powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    /// Inside, at times all but on the boundary.
    fn inside(random: &mut Seeded) -> Vector3<f64> {
        let tail = Vector3::new(0.0, random.signed(), random.signed());
        let room = 10_f64.powf(4.0 * random.signed() - 4.0);
        tail + Vector3::x() * (tail.norm() + room)
    }

    #[test]
    fn scaling_and_division_do_what_they_say() {
        let mut random = Seeded(5);
        for _ in 0..2_000 {
            let (x, z, d) = (inside(&mut random), inside(&mut random), Vector3::from_fn(|_, _| random.signed()));
            let scaling = Scaling::new(&x, &z).unwrap();
            // Rounding of a determinant near the boundary shows in all of them.
            let close = |a: Vector3<f64>, b: Vector3<f64>| {
                let blur = 1e-15 * (x.norm_squared() / determinant(&x)) * (z.norm_squared() / determinant(&z));
                (a - b).norm() <= (1e-12 + 10.0 * blur) * (a.norm() + b.norm())
            };
            assert!(close(scaling.square() * z, x), "{x:?} {z:?}");
            assert!(close(scaling.apply(&z), scaling.unapply(&x)), "{x:?} {z:?}");
            assert!(close(scaling.unapply(&scaling.apply(&d)), d));
            assert!(close(scaling.apply(&scaling.apply(&d)), scaling.square() * d));
            assert!((product(&x, &quotient(&d, &x)) - d).norm() <= 1e-12 * (1.0 + x.norm_squared() / determinant(&x)));
        }
    }

    #[test]
    fn the_longest_step_ends_on_the_boundary() {
        let mut random = Seeded(6);
        for _ in 0..2_000 {
            let (x, d) = (inside(&mut random), Vector3::from_fn(|_, _| random.signed()));
            let length = longest(&x, &d);
            let room = |length: f64| {
                let y = x + d * length;
                y.x - y.y.hypot(y.z)
            };
            if length.is_finite() {
                assert!(room(length).abs() <= 1e-12 * (1.0 + length) && room(0.999 * length) > 0.0, "{x:?} {d:?}");
            } else {
                assert!(room(1e6) > 0.0, "{x:?} {d:?}");
            }
        }
        assert_eq!(longest(&Vector3::x(), &Vector3::new(-0.5, 0.0, 0.0)), 2.0);
    }
}
