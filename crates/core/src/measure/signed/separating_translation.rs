//! A short separating translation of overlapping unions: one of A after which none of its parts
//! meets a part of B.
//!
//! Any translation after which every pair of parts is proven apart bounds the depth from above.
//! Along a direction one is found by going on, pair by pair, until a plane across the direction
//! parts those that still meet. From there it shrinks: where it leads, every pair of parts lies on
//! two sides of a plane with a normal n and a gap s, so that a translation w separates it, too, if
//! `n·w >= n·v - s`; of all w beyond these planes the shortest is next ([`shortest`]), and so on.
//! Each is proven again. The planes of pairs that touch turn meanwhile, so the search ends at a
//! translation from which no small change is shorter, which need not be the shortest of all.

use super::pair::between;
use crate::body::{Body, PartNode, Solid};
use crate::measure::bounds::culling::across;
use crate::measure::distance::settle;
use crate::measure::frames::pose::Pose;
use crate::measure::half_space::{HalfSpace, distance_to_half_space};
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::part_pairs::{NodeBound, SeenFrame, TreePair, ball_gaps, nodes, only_node};
use crate::measure::solver::depth::local_search::{ELSEWHERE, solid_tolerance};
use crate::measure::solver::min_norm_point::{Bound, Shortest, shortest};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::WarmStart;
use nalgebra::Vector3;

/// Starts that are followed to the end: those with the shortest translations.
const FOLLOWED: usize = 3;

/// Largest gain that the next rounds together are taken to make, in units of the last one;
/// dimensionless.
///
/// Gains about halve from round to round. A larger value runs rounds in vain, a smaller one ends at
/// longer translations. Exercised by `translations_separate_and_few_are_shorter`.
const HOPE: f64 = 4.0;

/// Most planes kept at a time: those with the smallest gaps.
const PLANES: usize = 24;

/// Gap left between parts, in units of the accuracy of a distance times the smaller circumradius:
/// enough to prove that they are apart.
///
/// At most 1, parts could not be proven apart; a larger value returns translations longer by as
/// much. Exercised by `translations_separate_and_few_are_shorter`.
const MARGIN: f64 = 4.0;

/// A direction that separates one pair of parts.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Start {
    pub(in crate::measure) pair: (usize, usize),
    /// Unit vector, world frame.
    pub(in crate::measure) direction: Vector3<f64>,
    /// How far, proven; metres.
    pub(in crate::measure) depth: f64,
}

/// The starts of the deepest pairs.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Starts([Option<Start>; 8]);

impl Starts {
    /// Takes a start in the place of a free one or a shallower.
    pub(in crate::measure) fn push(&mut self, start: Start) {
        let depth = |start: &Option<Start>| start.map_or(f64::NEG_INFINITY, |start| start.depth);
        if let Some(least) = self.0.iter_mut().min_by(|p, q| depth(p).total_cmp(&depth(q)))
            && depth(least) < start.depth
        {
            *least = Some(start);
        }
    }

    pub(in crate::measure) fn is_empty(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }
}

/// Where a pair of parts is parted by a plane.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// Unit normal from B to A.
    normal: Vector3<f64>,
    /// What lies between the parts after the translation, metres; proven.
    gap: f64,
    /// Points of A, before the translation, and of B that lie next to it.
    x: Vector3<f64>,
    y: Vector3<f64>,
}

/// A pair of parts that would meet after a shorter translation: the normal of its plane times its
/// multiplier, a part of the direction, and where the parts touch.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Contact {
    pub(in crate::measure) weighted_normal: Vector3<f64>,
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) y: Vector3<f64>,
}

/// A separating translation; metres, world frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct SeparatingTranslation {
    /// Proven: after this much along the direction no parts meet, so that they touch at most.
    pub(in crate::measure) length: f64,
    pub(in crate::measure) direction: Vector3<f64>,
    /// Their weighted normals have the sum `direction`, the longest first; the others may be zero.
    pub(in crate::measure) contacts: [Contact; 3],
    /// Whether another direction was seen to be about as short, or another pair of parts to touch
    /// at the end.
    pub(in crate::measure) tied: bool,
    pub(in crate::measure) iterations: u32,
}

/// The shortest one found from these starts and a few more. None is shorter than
/// `least` metres; lengths that differ by at most what the options ask for count as the same.
pub(in crate::measure) fn separate(
    (a, pose_a): At<'_, impl Solid>,
    (b, pose_b): At<'_, impl Solid>,
    starts: &Starts,
    least: f64,
    asked: &Options<'_>,
) -> SeparatingTranslation {
    let radius = |parts: &[Body]| parts.iter().map(|part| part.circumscribed().radius).fold(0.0, f64::max);
    // Gaps are to be provable whatever accuracy the caller asks for.
    let options = asked.with_accuracy(asked.accuracy().min(1e-9)).unwrap_or(*asked);
    let narrow = |depth: f64| solid_tolerance(a, b, asked, depth);
    let (own_a, own_b) = (only_node(a.circumscribed()), only_node(b.circumscribed()));
    let mut search = Search {
        a: a.parts(),
        b: b.parts(),
        nodes: [nodes(a, &own_a), nodes(b, &own_b)],
        pose_a: pose_a.with_translation(Vector3::zeros()),
        pose_b: pose_b.with_translation(pose_b.translation() - pose_a.translation()),
        least,
        margin: MARGIN * options.accuracy() * radius(a.parts()).min(radius(b.parts())),
        options,
        iterations: 0,
    };
    let mut translations = [search.between_balls(a, b); FOLLOWED];
    for start in starts.0.into_iter().flatten().chain(search.more_starts(&translations[0])) {
        let limit = translations[FOLLOWED - 1].norm();
        if let Some(length) = search.exit(&start, limit) {
            translations[FOLLOWED - 1] = start.direction * length;
            translations.sort_by(|v, w| v.norm().total_cmp(&w.norm()));
        }
    }
    for k in 0..FOLLOWED {
        // There may be fewer than that, and one as short as can be is enough.
        let shortest = translations[..k].iter().map(Vector3::norm).fold(f64::INFINITY, f64::min);
        if k == 0 || translations[k] != translations[k - 1] && shortest - least > narrow(shortest) {
            translations[k] = search.shrink(translations[k], shortest);
        }
    }
    let best = translations.into_iter().min_by(|v, w| v.norm().total_cmp(&w.norm())).unwrap_or_default();
    let (length, direction) = (best.norm(), best.normalize());
    let (contacts, crowded) = search.contacts(&best, &direction);
    let from = pose_a.translation();
    let others = translations.iter().filter(|translation| translation.normalize().dot(&direction) < ELSEWHERE);
    SeparatingTranslation {
        length: length * (1.0 + 8.0 * f64::EPSILON) + 4.0 * f64::EPSILON * search.pose_b.translation().norm(),
        direction,
        contacts: contacts.map(|contact| Contact { x: contact.x + from, y: contact.y + from, ..contact }),
        tied: crowded || others.into_iter().any(|translation| translation.norm() <= length + narrow(length)),
        iterations: search.iterations,
    }
}

/// A search, in axes along those of the world from the translation of A on.
struct Search<'a> {
    a: &'a [Body],
    b: &'a [Body],
    /// Of the trees of A and of B.
    nodes: [&'a [PartNode]; 2],
    pose_a: Pose,
    pose_b: Pose,
    /// No separating translation is shorter: proven.
    least: f64,
    margin: f64,
    options: Options<'a>,
    iterations: u32,
}

impl<'a> Search<'a> {
    /// The trees with the gaps of their balls, A being at this pose.
    fn trees(&self, pose: &Pose) -> TreePair<'a, impl Fn(usize, usize) -> NodeBound + use<'a>> {
        let [a, b] = self.nodes;
        ball_gaps(a, b, SeenFrame::new(pose, &self.pose_b))
    }

    /// The translation that separates the circumscribed balls.
    fn between_balls(&self, a: &impl Solid, b: &impl Solid) -> Vector3<f64> {
        let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
        let (vector, apart, error) = across((&self.pose_a, &ball_a.center), (&self.pose_b, &ball_b.center));
        let direction = vector.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let reach = ball_a.radius + ball_b.radius;
        direction * ((reach - apart).max(0.0) + error + 16.0 * f64::EPSILON * (reach + apart))
    }

    /// The axes of A's frame and the direction between the middles.
    fn more_starts(&self, between_balls: &Vector3<f64>) -> impl Iterator<Item = Start> + use<> {
        let axis = |k: usize| {
            let mut axis = Vector3::zeros();
            axis[k % 3] = if k < 3 { 1.0 } else { -1.0 };
            axis
        };
        let turn = *self.pose_a.rotation();
        let middles = between_balls.try_normalize(0.0);
        let directions = middles.into_iter().chain((0..6).map(move |k| turn * axis(k)));
        directions.map(|direction| Start { pair: (usize::MAX, usize::MAX), direction, depth: 0.0 })
    }

    fn ended(&self) -> bool {
        self.options.stopped()
    }

    fn pose_after(&self, translation: &Vector3<f64>) -> Pose {
        self.pose_a.with_translation(*translation)
    }

    /// Whether a pair of parts is proven apart, A being at this pose.
    fn apart(&mut self, (i, j): (usize, usize), pose: &Pose) -> bool {
        let mut hint = WarmStart::default();
        let (a, b) = ((&self.a[i], pose), (&self.b[j], &self.pose_b));
        let found = settle(a, b, &StopCriterion::compare(0.0), &self.options, &mut hint);
        self.iterations += found.iterations;
        found.lower > 0.0
    }

    /// How far along n, proven, a plane across n parts the pair.
    fn depth_along(&mut self, (i, j): (usize, usize), n: &Vector3<f64>) -> f64 {
        let mut lowest = |body: &Body, pose: &Pose, n: Vector3<f64>| {
            let Ok(half_space) = HalfSpace::new(n, 0.0) else { return f64::NEG_INFINITY };
            let found = distance_to_half_space(body, pose, &half_space, &self.options, &mut WarmStart::default());
            self.iterations += found.iterations;
            found.lower
        };
        let (of_a, of_b) = (lowest(&self.a[i], &self.pose_a, *n), lowest(&self.b[j], &self.pose_b, -n));
        -(of_a + of_b) + 8.0 * f64::EPSILON * (of_a.abs() + of_b.abs())
    }

    /// A length at which, along the direction of the start, all pairs are proven apart; none that
    /// is below the limit.
    fn exit(&mut self, start: &Start, limit: f64) -> Option<f64> {
        let n = &start.direction;
        // Not 0: a translation has a direction.
        let mut length = start.depth.max(1e-3 * self.margin);
        loop {
            // Those that a longer translation brings together are met in the next turn.
            let before = length;
            if !(length < limit) {
                return None;
            }
            let trees = self.trees(&self.pose_after(&(n * length)));
            for pair in trees.within(0.0) {
                let pose = self.pose_after(&(n * length));
                if !(length < limit) || self.ended() {
                    return None;
                }
                let depth = if pair == start.pair { start.depth } else { self.depth_along(pair, n) };
                if depth > length && !self.apart(pair, &pose) {
                    length = depth;
                }
            }
            if length == before {
                return Some(length);
            }
        }
    }

    /// Whether all pairs are proven apart after a translation, or to touch at most.
    fn separates(&mut self, translation: &Vector3<f64>) -> bool {
        let (pose, length) = (self.pose_after(translation), translation.norm());
        let trees = self.trees(&pose);
        trees.within(0.0).all(|pair| {
            self.apart(pair, &pose) || length > 0.0 && self.depth_along(pair, &(translation / length)) <= length
        })
    }

    /// One at most as long that separates all pairs as well; not worked out if it does not get as
    /// short as `wanted`.
    fn shrink(&mut self, mut translation: Vector3<f64>, wanted: f64) -> Vector3<f64> {
        for _ in 0..40 {
            let Some(next) = self.beyond_planes(&translation, self.margin).and_then(|(_, found)| found) else { break };
            let mut next = next.v;
            // Pairs whose planes were left out may meet: less far then.
            let mut halvings = 0;
            while next.norm() < translation.norm() - self.margin && !self.ended() && !self.separates(&next) {
                next = if halvings < 3 { (next + translation) * 0.5 } else { translation };
                halvings += 1;
            }
            if self.ended() || next.norm() == 0.0 || !(next.norm() < translation.norm() - self.margin) {
                break;
            }
            let gained = translation.norm() - next.norm();
            translation = next;
            // The gain decreases from round to round.
            if translation.norm() - HOPE * gained > wanted {
                break;
            }
        }
        translation
    }

    /// The planes between the pairs of parts after a translation, and the shortest translation
    /// beyond them all, by a margin.
    fn beyond_planes(&mut self, translation: &Vector3<f64>, margin: f64) -> Option<(Planes, Option<Shortest>)> {
        let (pose, length) = (self.pose_after(translation), translation.norm());
        let mut planes = Planes::default();
        // The shortest w beyond planes that v is beyond has |w - v|² <= |v|² - |w|²: pairs that are
        // farther do not count.
        let far = (length * length - self.least * self.least).max(0.0).sqrt() + 4.0 * margin.max(self.margin);
        let trees = self.trees(&pose);
        for (i, j) in trees.within(far) {
            if self.ended() {
                return None;
            }
            let (a, b) = (&self.a[i], &self.b[j]);
            let mut hint = WarmStart::default();
            let far = StopCriterion::beyond(far);
            let found = settle((a, &pose), (b, &self.pose_b), &far, &self.options, &mut hint);
            self.iterations += found.iterations;
            if found.lower > far.far {
                continue;
            }
            let proven = found.normal.filter(|_| found.lower > 0.0);
            let (normal, gap, x, y) = if let Some(normal) = proven {
                (normal, found.lower, found.witness_a, found.witness_b)
            } else {
                let found = between((a, &pose), (b, &self.pose_b), &self.options, &mut hint);
                self.iterations += found.iterations;
                let Some(normal) = found.normal else { continue };
                (normal, found.lower, found.witness_a, found.witness_b)
            };
            planes.push(Plane { normal, gap, x: x - translation, y });
        }
        let mut bounds = [Bound { normal: Vector3::zeros(), floor: 0.0 }; PLANES];
        for (bound, plane) in bounds.iter_mut().zip(planes.all()) {
            *bound = Bound { normal: plane.normal, floor: plane.normal.dot(translation) - plane.gap + margin };
        }
        let found = shortest(&bounds[..planes.len]);
        Some((planes, found))
    }

    /// What touches at the end of a translation, and whether more does than decides it.
    fn contacts(&mut self, translation: &Vector3<f64>, direction: &Vector3<f64>) -> ([Contact; 3], bool) {
        let mut contacts = [Contact::default(); 3];
        contacts[0].weighted_normal = *direction;
        let Some((planes, found)) = self.beyond_planes(translation, 0.0) else { return (contacts, false) };
        if let Some(nearest) = planes.all().iter().min_by(|p, q| p.gap.total_cmp(&q.gap)) {
            (contacts[0].x, contacts[0].y) = (nearest.x, nearest.y);
        }
        let Some(found) = found.filter(|found| found.v.norm() > 0.5 * translation.norm()) else {
            return (contacts, true);
        };
        for (contact, (k, weight)) in contacts.iter_mut().zip(found.support()) {
            let Plane { normal, x, y, .. } = planes.all()[k];
            *contact = Contact { weighted_normal: normal * (weight / found.v.norm()), x, y };
        }
        contacts.sort_by(|p, q| q.weighted_normal.norm().total_cmp(&p.weighted_normal.norm()));
        let holds = |k: usize| found.support().any(|(other, _)| other == k);
        let crowded = planes.all().iter().enumerate().any(|(k, plane)| {
            let room = plane.normal.dot(&(found.v - translation)) + plane.gap;
            !holds(k) && room <= self.margin
        });
        (contacts, crowded)
    }
}

/// The planes with the smallest gaps.
struct Planes {
    planes: [Plane; PLANES],
    len: usize,
}

impl Default for Planes {
    fn default() -> Self {
        let none = Plane { normal: Vector3::zeros(), gap: 0.0, x: Vector3::zeros(), y: Vector3::zeros() };
        Self { planes: [none; PLANES], len: 0 }
    }
}

impl Planes {
    fn all(&self) -> &[Plane] {
        &self.planes[..self.len]
    }

    fn push(&mut self, plane: Plane) {
        if self.len < PLANES {
            self.planes[self.len] = plane;
            self.len += 1;
        } else if let Some(widest) = self.planes.iter_mut().max_by(|p, q| p.gap.total_cmp(&q.gap))
            && plane.gap < widest.gap
        {
            *widest = plane;
        }
    }
}
