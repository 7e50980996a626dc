//! How far a body reaches along a direction, with the point that does: one method after the other,
//! from the cheapest on.

use super::active_set::{SupportPoint, SupportProgram};
use super::bracket::{Asked, Height};
use super::lanes::{FarthestOne, FoundOne};
use crate::body::Body;
use crate::measure::frames::query_frame::Posed;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::edge_newton::FarthestOfEdges;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::tangent_newton::TAYLOR_ROUNDING;
use crate::polynomial::{dispatch, gamma};
use nalgebra::Vector3;

/// The height of a body along a unit vector of its frame, as accurate as asked for if possible,
/// from a point of its frame known before, if there is one, with the constraints active there.
pub(in crate::measure) fn height(
    body: &Body,
    n: &Vector3<f64>,
    asked: Asked,
    known: Option<SupportPoint>,
    options: &Options<'_>,
) -> Height {
    let Asked { tolerance, angle } = asked;
    if runs(Stage::ClosedForm)
        && let Some(form) = body.closed_form()
    {
        let [lower, upper] = form.heights(n);
        return Height { lower, upper, point: form.support_point(n), active: 0, iterations: 0 };
    }
    // Hints may be those of other bodies.
    let is_of_body = |active: ActiveSet| u32::from(active) >> body.constraints().len() == 0;
    let known = known.filter(|known| known.x.iter().all(|v| v.is_finite()) && is_of_body(known.active));
    let center = &body.normalization().center;
    let (mut known, mut spent) = (known, 0);
    if runs(Stage::SupportLanes) {
        let from = known.map(|known| known.x - center);
        if body.is_smooth() {
            let limit = options.max_iterations();
            let (found, rounds) = dispatch(FarthestOne { body, n: *n, from, tolerance, angle, limit });
            let end = match found {
                Ok(found) => return followed(body, n, &found, rounds),
                Err(end) => end,
            };
            known = end.map(|x| SupportPoint::at((center + x, 0))).or(known);
            spent = rounds;
        } else {
            match dispatch(FarthestOfEdges { body, n: *n, known: from, asked, options }) {
                Ok(height) => return height,
                Err(lost) => {
                    known = lost.end.map(|(x, active)| SupportPoint { x, active }).or(known);
                    spent = lost.rounds;
                }
            }
        }
    }
    let ball = body.circumscribed();
    let unit = ball.radius.log2().round().exp2();
    let own = Posed::own(body, unit);
    let of_table = SupportPoint::at(body.farthest_in_table(n));
    let seen = |from: SupportPoint| SupportPoint { x: (from.x - ball.center) / unit, ..from };
    let (start, other) = (seen(known.unwrap_or(of_table)), known.map(|_| seen(of_table)));
    let program = SupportProgram { body: &own, direction: *n, start, other };
    let found = program.solve(tolerance / unit, |count| options.exhausted(spent + count));
    // From the centre of the ball, where the query frame is, to that of the normalization.
    let shift = n.dot(&(ball.center - center));
    let slack = gamma(8) * (ball.center.norm() + center.norm() + ball.radius);
    let (lower, point) = if found.lower > f64::NEG_INFINITY {
        (found.lower * unit + shift, found.point.x * unit + ball.center)
    } else {
        (n.dot(&(body.interior_point() - center)), *body.interior_point())
    };
    Height {
        lower: lower - slack,
        upper: found.upper * unit + shift + slack,
        point,
        active: found.point.active,
        iterations: spent + found.iterations,
    }
}

/// The height of a body of one constraint, after so many evaluations.
fn followed(body: &Body, n: &Vector3<f64>, found: &FoundOne, iterations: u32) -> Height {
    let (along, trust) = (n.dot(&found.x), body.trust());
    let slack = trust.rounding * trust.reach + TAYLOR_ROUNDING * found.x.norm();
    Height {
        lower: along - slack,
        upper: along + found.deficit + slack,
        point: body.normalization().center + found.x,
        active: 1,
        iterations,
    }
}

#[cfg(test)]
mod tests {
    use super::{Asked, Height, SupportPoint, height};
    use crate::body::Body;
    use crate::measure::options::Options;
    use crate::measure::solver::stages::{Stage, except, only};
    use crate::measure::tests::edges::cut;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    /// The height by Newton's method alone.
    fn alone(body: &Body, n: &Vector3<f64>, asked: Asked, known: Option<SupportPoint>) -> Height {
        only(&[Stage::SupportLanes], || height(body, n, asked, known, &Options::default()))
    }

    /// The unit vector across a slab, body frame: along the steepest curvature.
    fn across_slab(body: &Body, index: usize) -> Vector3<f64> {
        let bent = body.constraints()[index].polynomial.evaluate(&Vector3::zeros()).hessian.symmetric_eigen();
        let steepest = bent.eigenvectors.column(bent.eigenvalues.imax()).into_owned();
        body.normalization().linear.tr_mul(&steepest).normalize()
    }

    /// Directions of all kinds: any, across a slab, nearly across one, along the edge of two, and
    /// between the normals of two.
    fn direction(body: &Body, random: &mut Seeded, kind: u64) -> Vector3<f64> {
        let any = random.unit();
        let slabs = body.constraints().len() - 1;
        let [first, second] =
            [(); 2].map(|()| across_slab(body, 1 + random.index(slabs)) * [1.0, -1.0][random.index(2)]);
        let n = match kind {
            0 => any,
            1 => first,
            2 => first + any * 10_f64.powf(random.between(-14.0, -1.0)),
            3 => first.cross(&second),
            _ => first + second * random.positive(),
        };
        // One slab may have been drawn twice.
        n.try_normalize(1e-6).unwrap_or(any)
    }

    /// Bodies of degree 4 to 8 that up to six slabs cut, against the interior-point method that
    /// proves their extents and against the general search.
    #[test]
    fn slab_cut_bodies_are_followed_to_their_edges() {
        let count = 1000;
        let (mut solved, mut rounds) = ([0; 2], [0; 2]);
        for seed in 0..count {
            let mut random = Seeded(640_000 + seed);
            let body = cut(&mut random);
            let (center, radius) = (body.normalization().center, body.circumscribed().radius);
            let n = direction(&body, &mut random, seed % 5);
            let asked = Asked::narrow(5e-10 * radius);
            let cold = alone(&body, &n, asked, None);
            let turned = (n + random.unit() * 10_f64.powf(random.between(-8.0, -2.0))).normalize();
            let known = Some(SupportPoint { x: cold.point, active: cold.active });
            let warm = alone(&body, &turned, asked, known);
            for (start, (n, found)) in [(n, cold), (turned, warm)].into_iter().enumerate() {
                let label = format!("seed {seed}, start {start}: {found:?}");
                let support = body.support(&n);
                let (least, most) =
                    (n.dot(&(support.point - center)), support.height_m + n.dot(&(body.interior_point() - center)));
                let rounding = 1e-12 * radius;
                // The method's points may lie outside by a little.
                assert!(found.lower <= most && least - 1e-9 * radius <= found.upper, "{label}: {least} {most}");
                let truth = except(&[Stage::SupportLanes], || height(&body, &n, asked, None, &Options::default()));
                assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}: {truth:?}");
                assert!(body.value(&found.point) <= 1.0 + 1e-12, "{label}");
                let attained = n.dot(&(found.point - center));
                assert!((attained - found.lower).abs() <= rounding, "{label}: {attained}");
                if found.upper - found.lower <= 1e-9 * radius {
                    solved[start] += 1;
                    rounds[start] += found.iterations;
                }
            }
        }
        println!("{solved:?} of {count} solved in {rounds:?} evaluations");
        assert!(solved.iter().all(|solved| *solved > count * 97 / 100), "{solved:?} of {count}");
        assert!(rounds.iter().zip(solved).all(|(rounds, solved)| u64::from(*rounds) < 5 * solved), "{rounds:?}");
    }

    /// Boxes, plates and cylinders without their closed forms, against these; also exactly and
    /// nearly along faces and edges.
    #[test]
    fn heights_of_boxes_and_cylinders_are_closed() {
        type Case = (Body, Box<dyn Fn(&Vector3<f64>) -> f64>);
        let half = Vector3::new(0.4, 1.0, 2.5);
        let plate = Vector3::new(1.0, 0.7, 0.005);
        let cases: [Case; 3] = [
            (Body::cuboid("box", half).unwrap(), Box::new(move |n| half.dot(&n.abs()))),
            (Body::cuboid("plate", plate).unwrap(), Box::new(move |n| plate.dot(&n.abs()))),
            (Body::cylinder("can", 0.4, 1.3).unwrap(), Box::new(|n| 0.4 * n.x.hypot(n.y) + 1.3 * n.z.abs())),
        ];
        let (count, mut solved) = (1500, 0);
        for seed in 0..count {
            let mut random = Seeded(650_000 + seed);
            let (body, truth) = &cases[(seed % 3) as usize];
            let radius = body.circumscribed().radius;
            let axes = Matrix3::<f64>::identity();
            let [face, other] = [(); 2].map(|()| axes.column(random.index(3)) * [1.0, -1.0][random.index(2)]);
            let small = [0.0, 1e-13, 1e-10, 1e-7, 1e-4][random.index(5)];
            let n = match seed % 4 {
                0 => random.unit(),
                1 => face + random.unit() * small,
                // Along an edge, or a face again.
                2 => face * 2.0 + other,
                _ => face * 2.0 + other + random.unit() * small,
            };
            let n = n.normalize();
            let found = alone(body, &n, Asked::narrow(5e-10 * radius), None);
            let (label, truth) = (format!("seed {seed} {}, {n:?}: {found:?}", body.name()), truth(&n));
            let truth = truth - n.dot(&body.normalization().center);
            assert!(found.lower <= truth + 1e-14 * radius && truth - 1e-14 * radius <= found.upper, "{label}: {truth}");
            solved += u64::from(found.upper - found.lower <= 1e-9 * radius);
        }
        println!("{solved} of {count} solved");
        assert!(solved > count * 96 / 100, "{solved} of {count}");
    }
}
