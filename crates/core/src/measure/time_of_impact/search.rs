//! Conservative advancement of two bodies: a distance, a plane, a step in time, and again.

use super::advance::advance;
use super::answer::{Impact, ImpactStatus};
use super::options::ImpactOptions;
use crate::body::Body;
use crate::measure::distance::{Distance, between};
use crate::measure::frames::motion::Motion;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::support_point::{Asked, SupportPoint, height};
use crate::measure::warm::WarmStart;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// A body and how it moves.
#[derive(Clone, Copy)]
pub(super) struct Moving<'a> {
    pub(super) body: &'a Body,
    pub(super) motion: &'a Motion,
}

/// The search for the first contact of two bodies.
pub(super) struct Search<'a> {
    pub(super) a: Moving<'a>,
    pub(super) b: Moving<'a>,
    /// Distance that counts as contact, metres.
    pub(super) contact: f64,
    pub(super) options: &'a ImpactOptions<'a>,
    pub(super) queries: u32,
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
    /// M of the documentation of `time_of_impact` for a plane fixed to this body.
    fn acceleration(&self, other: &Self, n: &Vector3<f64>, from: f64, to: f64) -> f64 {
        let ball = other.body.circumscribed();
        self.motion.acceleration_between(other.motion, (&ball.center, ball.radius), n, (from, to))
    }

    /// Bound of the error of the pose at a time.
    fn error(&self, t: f64) -> f64 {
        let ball = self.body.circumscribed();
        self.motion.error(t, ball.center.norm() + ball.radius)
    }

    /// Witness of a distance as a start for a support point, in the body frame.
    fn known(&self, t: f64, witness: &Vector3<f64>) -> SupportPoint {
        let pose = self.motion.pose(t);
        SupportPoint { x: pose.rotation().inverse_transform_vector(&(witness - pose.translation())), active: 0 }
    }
}

impl Search<'_> {
    /// The first contact before `duration`, seconds.
    pub(super) fn run(&mut self, duration: f64) -> Impact {
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

    /// Distance at time t, accurate enough to distinguish the contact distance from half of it.
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
    /// contact distance; no later than where the bound of the acceleration outweighs what a plane
    /// can prove.
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
        let narrow = 0.05 * self.contact;
        let of = |moving: &Moving<'_>, pose: &Pose, n: &Vector3<f64>, witness| {
            let own = pose.rotation().inverse_transform_vector(n);
            height(moving.body, &own, Asked::within(narrow), Some(moving.known(from, witness)), &options).upper
        };
        let low = of(&self.a, &pose_a, &-n, &found.witness_a);
        let high = of(&self.b, &pose_b, n, &found.witness_b);
        // Differences first, however far from the origin.
        let [arm_a, arm_b] = [(&self.a, &pose_a), (&self.b, &pose_b)]
            .map(|(moving, pose)| pose.transform_direction(&moving.body.normalization().center));
        let offset = (pose_a.translation() - pose_b.translation()) + (arm_a - arm_b);
        let size = offset.norm() + 2.0 * (arm_a.norm() + arm_b.norm()) + low.abs() + high.abs();
        let reach = |moving: &Moving<'_>| {
            let ball = moving.body.circumscribed();
            ball.radius + (ball.center - moving.body.normalization().center).norm()
        };
        let slack = (ROTATION_ERROR + gamma(16) + error) * (size + reach(&self.a) + reach(&self.b));
        n.dot(&offset) - low - high - slack - self.errors(t)
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
