//! Near points of two sets, and points of one that are low in another, by Newton's method.

use super::active_set::{ActiveSet, Derivatives, Objective};
use super::placed_set::{Membership, PlacedSet};
use nalgebra::{Matrix3, Vector3};

/// Distance of two points that are tried as one common point, relative to the longest step;
/// dimensionless.
///
/// Whether the point lies in both sets is proven afterwards. A larger value tries points in vain, a
/// smaller one misses contacts that rounding blurs. Exercised by
/// `common_points_are_found_where_bodies_overlap`.
const COINCIDENT: f64 = 1e-6;

/// Steps that look for a common point from there: the last are as long as a tenth of a level.
const MAX_PUSHES: usize = 44;

/// Near points of two sets, proven to lie in them, and their distances, metres, the nearest first;
/// one point, at distance 0, if one was found that is in both. Newton's method begins at each of
/// the starts.
pub fn nearest_points(
    sets: [&PlacedSet<'_>; 2],
    starts: impl IntoIterator<Item = [Vector3<f64>; 2]>,
) -> Vec<NearPoints> {
    let Some(search) = PairSearch::new(sets) else { return Vec::new() };
    let mut found = Vec::new();
    for start in starts {
        found.extend(search.from(start).into_iter().flatten());
        if found.last().is_some_and(|near: &NearPoints| near.0 == 0.0) {
            break;
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if found.first().is_some_and(|nearest| nearest.0 == 0.0) {
        found.truncate(1);
    }
    found
}

/// Points that are proven to lie in the second set, and proven upper bounds of the largest
/// polynomial of the first set there, the lowest first. Newton's method begins at each of the
/// starts, on the boundary of the second set and inside.
pub fn lowest_points(sets: [&PlacedSet<'_>; 2], starts: impl IntoIterator<Item = Vector3<f64>>) -> Vec<LowPoint> {
    let (Some(levels), Some(member)) = (sets[0].membership(), sets[1].membership()) else { return Vec::new() };
    let (level, search) = (Level::of(sets[0]), ActiveSet::new([sets[1]]));
    let mut found = Vec::new();
    for start in starts {
        let refined = [true, false].map(|on_boundary| search.minimiser(&level, [start], on_boundary));
        for [x] in refined.into_iter().flatten().chain([[start]]) {
            let Some(x) = member.pulled(x) else { continue };
            let upper = levels.largest_value(&x);
            if upper.is_finite() {
                found.push((upper, x));
            }
        }
    }
    found.sort_by(|a: &LowPoint, b| a.0.total_cmp(&b.0));
    found
}

/// A proven upper bound of the largest polynomial of one set at a point, and the point, which is
/// proven to lie in another set.
pub type LowPoint = (f64, Vector3<f64>);

/// Two points that are proven to lie in two sets, and their distance, metres.
pub type NearPoints = (f64, [Vector3<f64>; 2]);

/// Two sets, ready to be searched.
pub(super) struct PairSearch<'a> {
    sets: [&'a PlacedSet<'a>; 2],
    members: [Membership<'a>; 2],
    search: ActiveSet<'a, 2>,
}

/// The polynomials of a set.
pub(super) struct Level<'a> {
    set: &'a PlacedSet<'a>,
    /// From the common frame to its normalized coordinates.
    linear: Matrix3<f64>,
}

impl<'a> Level<'a> {
    pub(super) fn of(set: &'a PlacedSet<'a>) -> Self {
        Self { set, linear: set.linear() }
    }
}

impl Objective<1> for Level<'_> {
    fn count(&self) -> usize {
        self.set.of.set.polynomials.len()
    }

    fn function(&self, index: usize, [x]: &[Vector3<f64>; 1]) -> Derivatives {
        let jet = self.set.of.set.polynomials[index].evaluate(&self.set.normalized(x));
        Derivatives::of_polynomial(0, &jet, &self.linear)
    }

    fn may_be_inside(&self) -> bool {
        true
    }
}

/// `½ |x - y|²`.
struct Apart;

impl Objective<2> for Apart {
    fn count(&self) -> usize {
        1
    }

    fn function(&self, _: usize, [x, y]: &[Vector3<f64>; 2]) -> Derivatives {
        Derivatives::half_squared_distance(x, y)
    }

    fn may_be_inside(&self) -> bool {
        false
    }
}

impl<'a> PairSearch<'a> {
    pub(super) fn new(sets: [&'a PlacedSet<'a>; 2]) -> Option<Self> {
        let members = [sets[0].membership()?, sets[1].membership()?];
        Some(Self { sets, members, search: ActiveSet::new(sets) })
    }

    /// Near points at the start, and where Newton's method leads from there; the latter are left
    /// out if the former are one point in both sets.
    pub(super) fn from(&self, start: [Vector3<f64>; 2]) -> [Option<NearPoints>; 2] {
        let here = self.pulled(start);
        if here.is_some_and(|near| near.0 == 0.0) {
            return [here, None];
        }
        [here, self.search.minimiser(&Apart, start, true).and_then(|points| self.pulled(points))]
    }

    /// Points pulled into the sets.
    fn pulled(&self, points: [Vector3<f64>; 2]) -> Option<NearPoints> {
        let (x, y) = (self.members[0].pulled(points[0])?, self.members[1].pulled(points[1])?);
        // One point in both is no distance apart.
        let common = [x, y].into_iter().find(|z| self.members.iter().all(|set| set.contains(z)));
        let common = common.or_else(|| self.common(&x, &y));
        Some(common.map_or((distance_up(&x, &y), [x, y]), |z| (0.0, [z, z])))
    }

    /// A point in both sets near two that are as good as one: Newton's method ends where both
    /// boundaries meet.
    fn common(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> Option<Vector3<f64>> {
        if (x - y).norm() > COINCIDENT * self.search.longest_step_m() {
            return None;
        }
        let mut z = (x + y) * 0.5;
        let mut extra = 1e-14;
        for _ in 0..MAX_PUSHES {
            if self.members.iter().all(|set| set.contains(&z)) {
                return Some(z);
            }
            // Against the gradient of the polynomial that is largest there, a little deeper each
            // time.
            let jets = [0, 1].map(|side| {
                let (g, at) = self.sets[side].largest_at(&z);
                let jet = g.evaluate(&at);
                (jet.value, self.search.linear(side).tr_mul(&jet.gradient))
            });
            let (value, gradient) = if jets[0].0 >= jets[1].0 { jets[0] } else { jets[1] };
            z -= gradient * (((value - 1.0).max(0.0) + extra) / gradient.norm_squared().max(f64::MIN_POSITIVE));
            extra *= 2.0;
        }
        None
    }
}

/// Rounded up.
pub(super) fn distance_up(x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
    ((x - y).norm() * (1.0 + 8.0 * f64::EPSILON)).next_up()
}
