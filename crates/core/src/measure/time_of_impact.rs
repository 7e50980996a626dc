//! Time of impact of two moving bodies by conservative advancement, never late.
//!
//! For a unit vector n fixed to one of the bodies let `s(t)` be the width of the gap between the
//! planes that n supports the two bodies with; the distance is at least that. If the second
//! derivative of `n·(x - y)` in time is at most M for all points x of A and y of B
//! ([`Motion::acceleration_between`]), then `n·(x - y)` stays above its chord minus `½ M (t -
//! t_0)(t_1 - t)`; and so does the smallest of them,
//!
//! ```text
//! s(t) >= (1 - u) s(t_0) + u s(t_1) - ½ M (t_1 - t_0)² u (1 - u),   t = t_0 + u (t_1 - t_0).
//! ```
//!
//! The bodies are apart up to the first root of the right-hand side. With n the normal of the
//! closest points at t_0 and t_1 where Newton's method expects contact, the bound and the distance
//! agree to first order at t_0, and the advance closes on the contact quadratically, where bounds
//! by the greatest speed close on it by a constant factor (Mirtich 1996). A plane that turns with a
//! body rests on the same face of it all the time; which body it should turn with shows in the
//! trying.

use crate::body::{Body, Solid};
use crate::measure::distance::{Distance, between};
use crate::measure::frames::motion::Motion;
use crate::measure::frames::pose::ROTATION_ERROR;
use crate::measure::half_space::Support;
use crate::measure::options::Options;
use crate::measure::solver::projection::Single;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::gamma;
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;

/// Default distance that counts as contact, relative to the circumradius of the smaller solid.
pub const DEFAULT_CONTACT: f64 = 1e-6;

/// Default and largest limit of distance queries for one pair of bodies.
pub const MAX_QUERIES: u32 = 1000;

/// How long, how close and how hard to look for an impact; checked when made.
///
/// ```
/// use sublevel_core::measure::ImpactOptions;
///
/// let options = ImpactOptions::new(2.5)?.with_contact(1e-9)?;
/// assert!(ImpactOptions::new(-1.0).is_err());
/// # Ok::<(), sublevel_core::measure::ImpactOptionsError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ImpactOptions<'a> {
    duration: f64,
    contact: f64,
    max_queries: u32,
    stop: Option<&'a AtomicBool>,
}

/// Why a request cannot be served.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ImpactOptionsError {
    /// A duration that is no time.
    #[error("duration {0} s is not a finite time of at least 0")]
    Duration(f64),
    /// A contact distance out of range.
    #[error(
        "contact distance {0} is not between 1e-12 and 1 (relative to the smaller circumradius); the default is 1e-6"
    )]
    Contact(f64),
    /// A limit out of range.
    #[error("query limit {0} is not between 1 and {MAX_QUERIES}")]
    Queries(u32),
}

impl<'a> ImpactOptions<'a> {
    /// Look from time 0 to `duration` seconds.
    ///
    /// # Errors
    /// A duration that is negative or not finite.
    pub fn new(duration: f64) -> Result<Self, ImpactOptionsError> {
        if duration >= 0.0 && duration.is_finite() {
            Ok(Self { duration, contact: DEFAULT_CONTACT, max_queries: MAX_QUERIES, stop: None })
        } else {
            Err(ImpactOptionsError::Duration(duration))
        }
    }

    /// The same with another distance that counts as contact, relative to the circumradius of the
    /// smaller solid.
    ///
    /// # Errors
    /// A distance outside 1e-12 to 1.
    pub fn with_contact(self, contact: f64) -> Result<Self, ImpactOptionsError> {
        if (1e-12..=1.0).contains(&contact) {
            Ok(Self { contact, ..self })
        } else {
            Err(ImpactOptionsError::Contact(contact))
        }
    }

    /// The same with at most this many distance and support queries for each pair of parts.
    ///
    /// # Errors
    /// A limit outside 1 to [`MAX_QUERIES`].
    pub fn with_max_queries(self, max_queries: u32) -> Result<Self, ImpactOptionsError> {
        if (1..=MAX_QUERIES).contains(&max_queries) {
            Ok(Self { max_queries, ..self })
        } else {
            Err(ImpactOptionsError::Queries(max_queries))
        }
    }

    /// The same with a flag that ends the search once it is set.
    pub fn with_stop(self, stop: &'a AtomicBool) -> Self {
        Self { stop: Some(stop), ..self }
    }
}

/// How a search for an impact ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImpactStatus {
    /// Proven apart all the time.
    Apart,
    /// Within the contact distance at `time`, and proven apart at all times before.
    Contact,
    /// The query limit, the stop flag or rounding came first: proven apart up to `time`, open
    /// after.
    Stopped,
}

/// The first contact of two moving solids, or the proof that there is none.
#[derive(Clone, Copy, Debug)]
pub struct Impact {
    /// How the search ended.
    pub status: ImpactStatus,
    /// At all times from 0 to before this one, seconds, the distance is proven to exceed half the
    /// contact distance.
    pub time: f64,
    /// The distance at that time: at most the contact distance on contact; none where nothing was
    /// in reach.
    pub distance: Option<Distance>,
    /// Distance queries and evaluations of a separating plane, together.
    pub queries: u32,
}

/// First time at which two moving solids come within the contact distance of `options`. The answer
/// is never late.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{ImpactOptions, ImpactStatus, Motion, Pose, time_of_impact};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.05)?;
/// let slab = Body::cuboid("slab", Vector3::new(0.005, 1.0, 1.0))?;
/// let start = Pose::from_quaternion(Vector3::new(-10.055, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let shot = Motion::new(start, Vector3::new(100.0, 0.0, 0.0), Vector3::zeros(), *start.translation())?;
/// let still = Motion::still(Pose::identity());
/// let impact = time_of_impact(&ball, &shot, &slab, &still, &ImpactOptions::new(1.0)?);
/// assert_eq!(impact.status, ImpactStatus::Contact);
/// assert!(impact.time <= 0.1 && impact.time > 0.1 - 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn time_of_impact(
    a: &impl Solid,
    motion_a: &Motion,
    b: &impl Solid,
    motion_b: &Motion,
    options: &ImpactOptions<'_>,
) -> Impact {
    let contact = options.contact * a.circumscribed().radius.min(b.circumscribed().radius);
    let mut first = Impact { status: ImpactStatus::Apart, time: options.duration, distance: None, queries: 0 };
    for part_a in a.parts() {
        for part_b in b.parts() {
            // Later impacts than the first found so far do not count.
            let mut search = Search {
                a: Moving { body: part_a, motion: motion_a },
                b: Moving { body: part_b, motion: motion_b },
                contact,
                options,
                queries: 0,
            };
            let found = search.run(first.time);
            let queries = first.queries + found.queries;
            if found.status != ImpactStatus::Apart {
                first = found;
            }
            first.queries = queries;
        }
    }
    first
}

#[derive(Clone, Copy)]
struct Moving<'a> {
    body: &'a Body,
    motion: &'a Motion,
}

struct Search<'a> {
    a: Moving<'a>,
    b: Moving<'a>,
    contact: f64,
    options: &'a ImpactOptions<'a>,
    queries: u32,
}

/// What is known of the gap at a time.
struct Gap<'a> {
    /// Seconds.
    t: f64,
    /// Unit normal from B to A, world frame.
    n: Vector3<f64>,
    found: &'a Distance,
    /// Lower bound of what the distance exceeds half the contact distance by, metres.
    width: f64,
}

/// Which body a separating plane is fixed to.
#[derive(Clone, Copy)]
enum Carrier {
    A,
    B,
}

impl Carrier {
    fn stage(self) -> Stage {
        match self {
            Self::A => Stage::PlaneOfA,
            Self::B => Stage::PlaneOfB,
        }
    }

    fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

impl Moving<'_> {
    /// M of the module's documentation for a plane fixed to this body.
    fn acceleration(&self, other: &Self, n: &Vector3<f64>, from: f64, to: f64) -> f64 {
        let ball = other.body.circumscribed();
        self.motion.acceleration_between(other.motion, (&ball.center, ball.radius), n, (from, to))
    }

    /// Bound of the error of the pose at a time.
    fn error(&self, t: f64) -> f64 {
        let ball = self.body.circumscribed();
        self.motion.error(t, ball.center.norm() + ball.radius)
    }

    /// Witness of a distance as the hint for a support, in the body frame.
    fn hint(&self, t: f64, witness: &Vector3<f64>) -> WarmStart {
        let pose = self.motion.pose(t);
        let y = pose.rotation().inverse_transform_vector(&(witness - pose.translation()));
        Hint::Single { y, active: 0 }.into()
    }
}

impl Search<'_> {
    fn run(&mut self, duration: f64) -> Impact {
        let half = 0.5 * self.contact;
        let (mut t, mut warm) = (0.0, WarmStart::default());
        let mut last = None;
        if runs(Stage::MovingBalls) && self.balls_stay_apart(duration) {
            return self.end(ImpactStatus::Apart, duration, None);
        }
        let mut carrier = Carrier::A;
        while !self.exhausted() {
            let found = self.distance(t, &mut warm);
            last = Some(found);
            if found.upper <= self.contact {
                return self.end(ImpactStatus::Contact, t, last);
            }
            let gap = found.lower - self.errors(t) - half;
            let (Some(n), true) = (found.normal, gap > 0.0) else { break };
            if t >= duration {
                return self.end(ImpactStatus::Apart, duration, last);
            }
            let now = Gap { t, n, found: &found, width: gap };
            let next = self.aim(&now, duration);
            let mut advanced = self.advance(carrier, &now, next);
            // Where a plane fixed to one body does not get far, one fixed to the other may.
            if advanced < t + 0.7 * (next - t) && self.turning() {
                let other = self.advance(carrier.other(), &now, next);
                if other > advanced {
                    (advanced, carrier) = (other, carrier.other());
                }
            }
            if advanced >= duration {
                return self.end(ImpactStatus::Apart, duration, last);
            }
            if !(advanced > t) {
                break;
            }
            t = advanced;
        }
        self.end(ImpactStatus::Stopped, t, last)
    }

    fn end(&self, status: ImpactStatus, time: f64, distance: Option<Distance>) -> Impact {
        Impact { status, time, distance, queries: self.queries }
    }

    fn exhausted(&self) -> bool {
        self.options().stopped() || self.queries >= self.options.max_queries
    }

    /// For the queries on the way, with the stop flag.
    fn options(&self) -> Options<'_> {
        self.options.stop.map_or(Options::default(), |stop| Options::default().with_stop(stop))
    }

    /// Distance at time t, accurate enough to tell contact from half of it.
    fn distance(&mut self, t: f64, warm: &mut WarmStart) -> Distance {
        self.queries += 1;
        let (a, b) = (self.a.body, self.b.body);
        let radius = a.circumscribed().radius.min(b.circumscribed().radius);
        let accuracy = (0.1 * self.contact / radius).min(1.0);
        let options = self.options().with_accuracy(accuracy).unwrap_or(self.options());
        let (pose_a, pose_b) = (self.a.motion.pose(t), self.b.motion.pose(t));
        between((a, &pose_a), (b, &pose_b), &StopCriterion::NARROW, &options, warm)
    }

    fn errors(&self, t: f64) -> f64 {
        self.a.error(t) + self.b.error(t)
    }

    fn turning(&self) -> bool {
        self.a.motion.is_turning() || self.b.motion.is_turning()
    }

    /// The time up to which a plane that is normal to n now and fixed to one of the bodies proves
    /// them apart, at most `next`.
    fn advance(&mut self, carrier: Carrier, now: &Gap<'_>, next: f64) -> f64 {
        let Gap { t, ref n, found, width } = *now;
        if !runs(carrier.stage()) {
            return t;
        }
        let (own, other) = self.of(carrier);
        let (turned, error) = own.motion.carry(n, t, next);
        let acceleration = own.acceleration(&other, n, t, next);
        let at_next = self.separation(&turned, error, t, next, found) - 0.5 * self.contact;
        advance(t, next, width, at_next, acceleration)
    }

    /// The body that carries the plane, and the other.
    fn of(&self, carrier: Carrier) -> (Moving<'_>, Moving<'_>) {
        match carrier {
            Carrier::A => (self.a, self.b),
            Carrier::B => (self.b, self.a),
        }
    }

    /// The time at which the closest points, going on as they do, come within three quarters of the
    /// contact distance; no later than where the bound of the acceleration spoils what a plane can
    /// prove.
    fn aim(&self, now: &Gap<'_>, duration: f64) -> f64 {
        let Gap { t, ref n, found, width: gap } = *now;
        let towards = self.b.motion.velocity_at(t, &found.witness_b) - self.a.motion.velocity_at(t, &found.witness_a);
        let speed = n.dot(&towards);
        let travel = if speed > 0.0 { (gap - 0.25 * self.contact).max(0.5 * gap) / speed } else { f64::INFINITY };
        let acceleration = self.a.acceleration(&self.b, n, t, t).min(self.b.acceleration(&self.a, n, t, t));
        (t + travel.min((8.0 * gap / acceleration).sqrt())).min(duration)
    }

    /// Lower bound of the gap between the supporting planes along n, known up to `error`, at time
    /// t.
    fn separation(&mut self, n: &Vector3<f64>, error: f64, from: f64, t: f64, found: &Distance) -> f64 {
        self.queries += 1;
        let options = self.options();
        let (pose_a, pose_b) = (self.a.motion.pose(t), self.b.motion.pose(t));
        let (a, b) = (Single::new(self.a.body, &pose_a), Single::new(self.b.body, &pose_b));
        let narrow = 0.05 * self.contact;
        let mut warm = [self.a.hint(from, &found.witness_a), self.b.hint(from, &found.witness_b)];
        let low = Support::new(&a, &-n).solve(narrow / a.unit, &options, &mut warm[0]);
        let high = Support::new(&b, n).solve(narrow / b.unit, &options, &mut warm[1]);
        // n·x over A is that of its query origin less the support of -n; differences first, however
        // far from the origin.
        let [arm_a, arm_b] = [(&a, &pose_a), (&b, &pose_b)]
            .map(|(single, pose)| pose.transform_direction(&single.to_body(&Vector3::zeros())));
        let offset = (pose_a.translation() - pose_b.translation()) + (arm_a - arm_b);
        let size = offset.norm() + 2.0 * (arm_a.norm() + arm_b.norm()) + 2.0 * (a.unit + b.unit);
        let slack = (ROTATION_ERROR + gamma(16) + error) * size;
        n.dot(&offset) - low.upper * a.unit - high.upper * b.unit - slack - self.errors(t)
    }

    /// Whether the circumscribed balls are proven apart all the time, by the plane between them.
    fn balls_stay_apart(&self, duration: f64) -> bool {
        let centers = |t: f64| {
            let [a, b] = [self.a, self.b].map(|m| m.motion.pose(t).transform_point(&m.body.circumscribed().center));
            (a - b, gamma(32) * (a.norm() + b.norm()) + ROTATION_ERROR * (a.norm() + b.norm()))
        };
        let (start, end) = (centers(0.0), centers(duration));
        let Some(n) = start.0.try_normalize(0.0) else { return false };
        let radii = self.a.body.circumscribed().radius + self.b.body.circumscribed().radius;
        let gap = |(apart, error): &(Vector3<f64>, f64), t: f64| {
            n.dot(apart) - radii * (1.0 + 1e-14) - error - self.errors(t) - 0.5 * self.contact
        };
        let (first, last) = (gap(&start, 0.0), gap(&end, duration));
        let accelerations = [self.a, self.b].map(|Moving { body, motion }| {
            let ball = body.circumscribed();
            motion.acceleration_along(&n, &ball.center, ball.radius)
        });
        first > 0.0 && advance(0.0, duration, first, last, accelerations.iter().sum()) >= duration
    }
}

/// The time from t_0 up to which the gap stays positive, from its lower bounds at both ends and
/// that of its acceleration; t_1 if that is all the way.
fn advance(t_0: f64, t_1: f64, first: f64, last: f64, acceleration: f64) -> f64 {
    let step = t_1 - t_0;
    let bend = 0.5 * acceleration * step * step * (1.0 + 1e-12);
    // first - fall u + bend u² with its first root in a form without cancellation.
    let fall = first - last + bend;
    let discriminant = fall * fall - 4.0 * bend * first;
    if last > 0.0 && (fall <= 0.0 || discriminant < -1e-12 * fall * fall) {
        return t_1;
    }
    let u = 2.0 * first / (fall + discriminant.max(0.0).sqrt()) * (1.0 - 1e-11);
    // Not `<`: a NaN proves nothing.
    if last > 0.0 && u >= 1.0 {
        t_1
    } else if u > 0.0 {
        (t_0 + u.min(1.0) * step).next_down().max(t_0)
    } else {
        t_0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Compound;
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{Pose, distance};
    use sublevel_testkit::Seeded;

    fn at(x: Vector3<f64>) -> Pose {
        Pose::from_quaternion(x, [0.0, 0.0, 0.0, 1.0]).unwrap()
    }

    fn gliding(start: Vector3<f64>, velocity: Vector3<f64>) -> Motion {
        Motion::new(at(start), velocity, Vector3::zeros(), start).unwrap()
    }

    #[test]
    fn balls_meet_when_the_closed_form_says() {
        let (a, b) = (Body::ball("a", Vector3::zeros(), 0.3).unwrap(), Body::ball("b", Vector3::zeros(), 0.7).unwrap());
        let mut queries = [0_u32; 500];
        for seed in 0..500 {
            let mut random = Seeded(seed);
            let d = random.unit();
            let side = d.cross(&random.unit()).normalize();
            // Head on to past each other; grazing by a billionth on purpose.
            let aside = [0.0, 0.6, 0.99, 1.0 - 1e-9, 1.0 + 1e-9, 1.01][(seed % 6) as usize];
            let speed = 10_f64.powf(2.0 * random.signed());
            let drift = random.unit() * speed * 3.0;
            let origin = random.unit() * 10.0;
            let back = 2.0 + random.signed();
            let (one, other) = (gliding(origin, d * speed + drift), gliding(origin + d * back + side * aside, drift));
            let options = ImpactOptions::new(10.0 / speed).unwrap().with_contact(1e-10).unwrap();
            let found = time_of_impact(&a, &one, &b, &other, &options);
            let contact = 1e-10 * 0.3 * 1.03;
            let truth = |reach: f64| (back - (reach * reach - aside * aside).sqrt()) / speed;
            let label = format!("seed {seed} aside {aside}: {found:?} against {}", truth(1.0));
            queries[seed as usize] = found.queries;
            if aside > 1.0 {
                assert_eq!(found.status, ImpactStatus::Apart, "{label}");
            } else {
                assert_eq!(found.status, ImpactStatus::Contact, "{label}");
                // Not late, and no earlier than the contact distance explains.
                assert!(found.time <= truth(1.0), "{label}");
                assert!(found.time >= truth(1.0 + contact) - 1e-13 / speed, "{label}");
            }
        }
        queries.sort_unstable();
        assert!(queries[250] <= 20, "median {}, most {}", queries[250], queries[499]);
    }

    #[test]
    fn a_blade_strikes_when_the_closed_form_says() {
        let blade = Body::cuboid("blade", Vector3::new(2.0, 0.02, 0.1)).unwrap();
        let ball = Body::ball("ball", Vector3::zeros(), 0.05).unwrap();
        let mut queries = Vec::new();
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let (place, rate) = (1.0 + 0.9 * random.signed().abs(), 10_f64.powf(2.0 * random.signed()));
            let turn = 0.3 + 2.4 * random.signed().abs();
            // The ball lies at an angle `turn` ahead; the blade's face meets it where place · sin =
            // 0.02 + 0.05.
            let pose = at(Vector3::new(place * turn.cos(), place * turn.sin(), 0.03 * random.signed()));
            let spin = Motion::new(Pose::identity(), Vector3::zeros(), Vector3::z() * rate, Vector3::zeros()).unwrap();
            let truth = (turn - (0.07 / place).asin()) / rate;
            let found =
                time_of_impact(&blade, &spin, &ball, &Motion::still(pose), &ImpactOptions::new(9.0 / rate).unwrap());
            let label = format!("seed {seed}: {found:?} against {truth}");
            assert_eq!(found.status, ImpactStatus::Contact, "{label}");
            assert!(found.time <= truth && found.time > truth - 2e-6 / rate, "{label}");
            queries.push(found.queries);
        }
        queries.sort_unstable();
        assert!(queries[100] <= 20, "median {}, most {}", queries[100], queries[199]);
    }

    #[test]
    fn a_tip_grazes_by_a_billionth() {
        let blade = Body::ellipsoid("blade", Vector3::zeros(), Vector3::new(2.0, 0.02, 0.1)).unwrap();
        let ball = Body::ball("ball", Vector3::zeros(), 0.05).unwrap();
        let mut most = 0;
        for seed in 0..100 {
            let mut random = Seeded(seed);
            let (rate, turn) = (10_f64.powf(2.0 * random.signed()), 0.3 + 2.4 * random.signed().abs());
            let spin = Motion::new(Pose::identity(), Vector3::zeros(), Vector3::z() * rate, Vector3::zeros()).unwrap();
            let options = ImpactOptions::new(6.0 / rate).unwrap().with_contact(1e-9).unwrap();
            for (gap, status) in [(-1e-9, ImpactStatus::Contact), (1e-9, ImpactStatus::Apart)] {
                let pose = at(Vector3::new(turn.cos(), turn.sin(), 0.0) * (2.05 + gap));
                let found = time_of_impact(&blade, &spin, &ball, &Motion::still(pose), &options);
                let label = format!("seed {seed} gap {gap}: {found:?}");
                assert_eq!(found.status, status, "{label}");
                // Contact is where the tip is, or where it will be half a turn later.
                let tips = [turn, turn - std::f64::consts::PI].map(|angle| angle / rate);
                assert!(
                    gap > 0.0 || tips.iter().any(|tip| found.time <= *tip && found.time > tip - 1e-3 / rate),
                    "{label}"
                );
                most = most.max(found.queries);
            }
        }
        assert!(most <= 300, "{most}");
    }

    #[test]
    fn nothing_tunnels_through_a_slab() {
        let slab = Body::cuboid("slab", Vector3::new(0.005, 2.0, 2.0)).unwrap();
        let bodies = [
            Body::ball("ball", Vector3::zeros(), 0.02).unwrap(),
            Body::cuboid("brick", Vector3::new(0.01, 0.02, 0.03)).unwrap(),
            Body::superellipsoid("q8", Vector3::zeros(), Vector3::new(0.01, 0.02, 0.03), 8).unwrap(),
            Body::ellipsoid("needle", Vector3::zeros(), Vector3::new(0.1, 0.001, 0.001)).unwrap(),
        ];
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let body = &bodies[(seed % 4) as usize];
            let start = random_pose(&mut random, 0.0);
            let start = Pose::from_quaternion(
                Vector3::new(-10.0, random.signed(), random.signed()),
                start.rotation().coords.into(),
            )
            .unwrap();
            let spin = if seed % 3 == 0 { Vector3::zeros() } else { random.unit() * 30.0 };
            let shot = Motion::new(start, Vector3::new(100.0, 0.0, 0.0), spin, *start.translation()).unwrap();
            let still = Motion::still(Pose::identity());
            let found = time_of_impact(body, &shot, &slab, &still, &ImpactOptions::new(1.0).unwrap());
            let label = format!("seed {seed} {}: {found:?}", body.name());
            assert_eq!(found.status, ImpactStatus::Contact, "{label}");
            never_late((body, &shot), (&slab, &still), &found, &label);
            assert!(found.queries <= 60, "{label}");
        }
    }

    /// Dense sampling before the impact finds no contact, and at the impact the bodies are close.
    fn never_late((a, motion_a): (&Body, &Motion), (b, motion_b): (&Body, &Motion), found: &Impact, label: &str) {
        let mut warm = WarmStart::default();
        let contact = 1e-6 * a.circumscribed().radius.min(b.circumscribed().radius);
        let mut at = |t: f64| distance(a, &motion_a.pose(t), b, &motion_b.pose(t), &Options::default(), &mut warm);
        for k in 0..200 {
            let t = found.time * (1.0 - f64::from(k) / 200.0) * (1.0 - 1e-15);
            let sampled = at(t);
            assert!(sampled.upper > 0.4 * contact || found.time == 0.0, "{label}: at {t} already {sampled:?}");
        }
        if found.status == ImpactStatus::Contact {
            assert!(at(found.time).upper <= contact * (1.0 + 1e-3), "{label}: only {:?}", at(found.time));
        }
    }

    #[test]
    fn random_motions_are_never_late() {
        let zoos: Vec<_> = (0..5).map(|seed| zoo(&mut Seeded(seed))).collect();
        let (mut queries, mut hits) = (Vec::new(), 0);
        for seed in 0..400 {
            let mut random = Seeded(40_000 + seed);
            let bodies = &zoos[(seed % 5) as usize];
            let (a, b) =
                (&bodies[random.next() as usize % bodies.len()], &bodies[random.next() as usize % bodies.len()]);
            let reach = a.circumscribed().radius + b.circumscribed().radius;
            let motion = |random: &mut Seeded, start: Pose, towards: Vector3<f64>| {
                let spin = random.unit() * 2.0 * random.signed();
                let center = start.translation() + random.unit() * reach * 0.3;
                Motion::new(start, towards, spin, center).unwrap()
            };
            let far = reach * 2.5;
            let (pose_a, pose_b) = (random_pose(&mut random, 0.3), random_pose(&mut random, far));
            let aim = (pose_a.translation() - pose_b.translation()) + random.unit() * reach * 0.7;
            let (one, other) = (motion(&mut random, pose_a, Vector3::zeros()), motion(&mut random, pose_b, aim));
            let found = time_of_impact(a, &one, b, &other, &ImpactOptions::new(2.0).unwrap());
            let label = format!("seed {seed} {}-{}: {found:?}", a.name(), b.name());
            assert_ne!(found.status, ImpactStatus::Stopped, "{label}");
            never_late((a, &one), (b, &other), &found, &label);
            hits += u32::from(found.status == ImpactStatus::Contact);
            queries.push(found.queries);
        }
        queries.sort_unstable();
        assert!(hits > 150 && queries[200] <= 20 && queries[399] <= 200, "{hits} hits, queries {queries:?}");
    }

    #[test]
    fn compounds_meet_with_their_first_part() {
        let at = |x: f64| Body::ball("part", Vector3::new(x, 0.0, 0.0), 1.0).unwrap();
        let row = Compound::new("row", vec![at(10.0), at(0.0), at(5.0)]).unwrap();
        let ball = at(0.0);
        let still = Motion::still(Pose::identity());
        for (start, velocity, truth) in [
            (Vector3::new(20.0, 0.0, 0.0), -Vector3::x(), 8.0),
            (Vector3::new(-20.0, 0.0, 0.0), Vector3::x(), 18.0),
            (Vector3::new(5.0, 30.0, 0.0), -Vector3::y(), 28.0),
        ] {
            let found =
                time_of_impact(&row, &still, &ball, &gliding(start, velocity), &ImpactOptions::new(50.0).unwrap());
            assert!(found.status == ImpactStatus::Contact && found.time <= truth, "{found:?}");
            assert!(found.time > truth - 1e-5, "{found:?}");
        }
        let past = gliding(Vector3::new(20.0, 2.001, 0.0), -Vector3::x());
        let found = time_of_impact(&row, &still, &ball, &past, &ImpactOptions::new(50.0).unwrap());
        assert_eq!(found.status, ImpactStatus::Apart, "{found:?}");
    }

    #[test]
    fn starts_limits_and_nonsense() {
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let still = Motion::still(Pose::identity());
        let one = |start: f64, speed: f64, options: &ImpactOptions<'_>| {
            time_of_impact(&ball, &still, &ball, &gliding(Vector3::x() * start, Vector3::x() * speed), options)
        };
        let second = ImpactOptions::new(1.0).unwrap();
        let found = one(1.5, 0.0, &second);
        assert!(found.status == ImpactStatus::Contact && found.time == 0.0, "{found:?}");
        assert_eq!(one(3.0, 0.0, &second).status, ImpactStatus::Apart);
        assert_eq!(one(3.0, 5.0, &second).status, ImpactStatus::Apart);
        assert_eq!(one(3.0, 0.0, &ImpactOptions::new(0.0).unwrap()).status, ImpactStatus::Apart);
        let found = one(3.0, -5.0, &second.with_max_queries(1).unwrap());
        assert!(found.status == ImpactStatus::Stopped && found.time <= 0.2, "{found:?}");
        let stop = AtomicBool::new(true);
        let found = one(3.0, -5.0, &second.with_stop(&stop));
        assert!(found.status == ImpactStatus::Stopped && found.time == 0.0, "{found:?}");
        // Overflowing motions end without an answer and without a panic.
        let found = one(3.0, -1e15, &ImpactOptions::new(1e300).unwrap());
        assert!(found.status != ImpactStatus::Apart && found.time <= 1e-15, "{found:?}");
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(ImpactOptions::new(bad).is_err() && second.with_contact(bad).is_err());
        }
        assert!(second.with_max_queries(0).is_err() && second.with_max_queries(MAX_QUERIES + 1).is_err());
    }

    #[test]
    fn chords_bound_what_they_span() {
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            // s(t) = a + b t + c cos(w t + p) has |s''| <= |c| w².
            let (a, b, c) = (random.signed() + 1.0, random.signed(), random.signed());
            let (w, p) = (3.0 * random.signed().abs(), 3.0 * random.signed());
            let s = |t: f64| a + b * t + c * (w * t + p).cos();
            let (t_0, t_1) = (random.signed(), 2.0 + random.signed());
            if s(t_0) > 0.0 {
                let safe = advance(t_0, t_1, s(t_0), s(t_1), c.abs() * w * w);
                assert!(safe >= t_0 && safe <= t_1, "seed {seed}: {safe}");
                for k in 0..500 {
                    let t = t_0 + (safe - t_0) * f64::from(k) / 500.0;
                    assert!(s(t) > 0.0, "seed {seed}: {} at {t} of {safe}", s(t));
                }
            }
        }
    }
}
