//! Queries of a round: all of one pair and one measure, drawn from the seed of their block.

// Unit tests of the measures draw the same queries, of types that are theirs.
use super::{Body, Options, Pose, WarmStart, distance, pose, shifted, turned};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_testkit::random::Seeded;

/// How the poses of a round are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    /// Independent poses from deep overlap to far apart.
    Random,
    /// Smooth motion: steps of a hundredth of the size and a degree.
    Trajectory,
    /// Moved along the normal to gaps of either sign, down to 1e-12 of the size.
    Grazing,
    /// Aligned axes, tilts of 1e-12 to 1e-2, integer offsets, coincident centres.
    Aligned,
    /// Both up to 1e9 m from the origin, or both scaled poses of long lever arms.
    Far,
}

const STYLES: [Style; 5] = [Style::Random, Style::Trajectory, Style::Grazing, Style::Aligned, Style::Far];

/// Where two bodies are, or what stands for the second one.
pub(crate) type Aim = fn((&Body, &Pose), (&Body, &Pose)) -> Option<(Vector3<f64>, f64)>;

/// Number of measures.
pub(crate) const MEASURES: usize = 7;

/// The pair, the measure and the poses of one round.
pub(crate) struct Draw<'a, 'r> {
    pub(crate) a: &'a Body,
    pub(crate) b: &'a Body,
    pub(crate) measure: usize,
    pub(crate) style: Style,
    /// Whether many poses are asked for at once.
    pub(crate) batches: bool,
    /// What grazing poses are made by.
    pub(crate) aim: Aim,
    random: &'r mut Seeded,
    at: (Pose, Pose),
    drift: (Vector3<f64>, Vector3<f64>),
    left: u32,
}

impl<'a, 'r> Draw<'a, 'r> {
    pub(crate) fn new(bodies: &'a [Body], random: &'r mut Seeded) -> Self {
        let (a, b) = (&bodies[random.index(bodies.len())], &bodies[random.index(bodies.len())]);
        // Distances in batches take the least time: most queries are of that kind.
        let (measure, batches) = match random.index(24) {
            0..12 => (0, true),
            12..16 => (0, false),
            16..18 => (1, false),
            18..20 => (2, false),
            k => (k - 17, false),
        };
        debug_assert!(measure < MEASURES);
        let style = STYLES[random.index(STYLES.len())];
        let at = (Pose::identity(), Pose::identity());
        let drift = (Vector3::zeros(), Vector3::zeros());
        Self { a, b, measure, style, batches, aim: between_bodies, random, at, drift, left: 0 }
    }

    fn sum(&self) -> f64 {
        self.a.circumscribed().radius + self.b.circumscribed().radius
    }

    /// Independent poses; the distance of the centres between overlap and a hundred sizes, mostly
    /// near.
    fn independent(&mut self) -> (Pose, Pose) {
        let sum = self.sum();
        let random = &mut *self.random;
        let reach = if random.index(4) == 0 { random.between(1.0, 100.0) } else { 1.6 * random.positive() };
        let first = pose(random.unit() * (0.1 * sum), &random.rotation());
        // About the interior points: the origin of a fitted body may lie at its foot.
        let turn = random.rotation();
        let center = first.transform_point(self.a.interior_point()) + random.unit() * (reach * sum);
        (first, pose(center - turn * self.b.interior_point(), &turn))
    }

    /// The poses of the next query, and whether they continue the last ones.
    pub(crate) fn next(&mut self) -> (Pose, Pose, bool) {
        let continues = self.style == Style::Trajectory && self.left > 0;
        self.at = match self.style {
            Style::Random => self.independent(),
            Style::Trajectory => self.along(),
            Style::Grazing => self.grazing(),
            Style::Aligned => self.aligned(),
            Style::Far => self.far(),
        };
        (self.at.0, self.at.1, continues)
    }

    fn along(&mut self) -> (Pose, Pose) {
        let sum = self.sum();
        if self.left == 0 {
            self.left = 200;
            let speed = 0.01 * sum * self.random.positive();
            self.drift = (self.random.unit() * speed, self.random.unit() * 0.017);
            return self.independent();
        }
        self.left -= 1;
        // Now and then a standstill or a turn of the way.
        match self.random.index(32) {
            0 => return self.at,
            1 => self.drift.0 = self.random.unit() * self.drift.0.norm(),
            _ => {}
        }
        (self.at.0, turned(&shifted(&self.at.1, self.drift.0), self.drift.1))
    }

    fn grazing(&mut self) -> (Pose, Pose) {
        let (first, second) = self.independent();
        let Some((normal, apart)) = (self.aim)((self.a, &first), (self.b, &second)) else { return (first, second) };
        let size = self.a.circumscribed().radius.min(self.b.circumscribed().radius);
        let sign = if self.random.index(3) == 0 { -1.0 } else { 1.0 };
        let gap = sign * size * self.random.between(1e-12, 1e-2);
        (first, shifted(&second, normal * (apart - gap)))
    }

    fn aligned(&mut self) -> (Pose, Pose) {
        let random = &mut *self.random;
        let axis = |random: &mut Seeded| [Vector3::x(), Vector3::y(), Vector3::z()][random.index(3)];
        let quarter = UnitQuaternion::from_scaled_axis(axis(random) * std::f64::consts::FRAC_PI_2);
        let turn = if random.index(2) == 0 { UnitQuaternion::identity() } else { quarter };
        let tilt = if random.index(3) == 0 { 0.0 } else { random.between(1e-12, 1e-2) };
        let turn = UnitQuaternion::from_scaled_axis(random.unit() * tilt) * turn;
        let direction = axis(random) * if random.index(2) == 0 { 1.0 } else { -1.0 };
        let length = match random.index(4) {
            0 => random.index(8) as f64,
            1 => random.between(1e-18, 1e-3),
            2 => self.a.circumscribed().radius + self.b.circumscribed().radius,
            _ => 2.0 * random.positive() * (self.a.circumscribed().radius + self.b.circumscribed().radius),
        };
        (Pose::identity(), pose(direction * length, &turn))
    }

    fn far(&mut self) -> (Pose, Pose) {
        let (first, second) = self.independent();
        let by = self.random.unit() * self.random.between(1.0, 1e9);
        (shifted(&first, by), shifted(&second, by))
    }
}

/// Their normal, from the second to the first, and about their distance, metres. Any solver's will
/// do: it only aims.
fn between_bodies(a: (&Body, &Pose), b: (&Body, &Pose)) -> Option<(Vector3<f64>, f64)> {
    let options = Options::default().with_accuracy(1e-6).expect("within range");
    let answer = distance(a.0, a.1, b.0, b.1, &options, &mut WarmStart::default());
    Some((answer.normal?, answer.upper))
}
