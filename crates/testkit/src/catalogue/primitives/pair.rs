//! Two shapes where they stand, and what is known of their distance.

use super::super::Case;
use super::shape::Shape;
use crate::random::shifted;
use sublevel_core::measure::{DEFAULT_ACCURACY, MAX_ITERATIONS, Options, Pose, WarmStart};

/// Two shapes at their poses whose signed distance is asked for, and what is known of it.
#[derive(Clone, Debug)]
pub struct Pair {
    pub a: Shape,
    pub pose_a: Pose,
    pub b: Shape,
    pub pose_b: Pose,
    /// Accuracy asked for, relative to [`Pair::size`].
    pub accuracy: f64,
    /// Most iterations, where the family is about that.
    pub limit: Option<u32>,
    /// The distance where it is known, metres, 0 in overlap.
    pub exact: Option<f64>,
    /// Largest error of our answers, metres, where the family asks for more than a true bracket.
    pub bound: Option<f64>,
    /// Largest width, metres, that the bracket of a case below the rounding floor may keep.
    pub floor: f64,
    /// Shapes and settings in words.
    pub what: String,
}

impl Pair {
    /// At the default accuracy, with nothing known.
    pub fn new(a: Shape, pose_a: Pose, b: Shape, pose_b: Pose, what: impl AsRef<str>) -> Self {
        let what = format!("{}-{} {}", a.name(), b.name(), what.as_ref());
        Self {
            a,
            pose_a,
            b,
            pose_b,
            accuracy: DEFAULT_ACCURACY,
            limit: None,
            exact: None,
            bound: None,
            floor: 0.0,
            what,
        }
    }

    /// The pair as a case of bodies, if both are.
    pub fn bodies(&self) -> Option<Case> {
        let (Shape::Body(a), Shape::Body(b)) = (&self.a, &self.b) else { return None };
        let Self { accuracy, limit, exact, bound, floor, .. } = *self;
        let what = self.what.clone();
        Some(Case {
            a: (**a).clone(),
            pose_a: self.pose_a,
            b: (**b).clone(),
            pose_b: self.pose_b,
            accuracy,
            limit,
            exact,
            bound,
            floor,
            what,
        })
    }

    /// The length that accuracies are relative to, metres: the smaller size of those that have one,
    /// of two points their distance.
    pub fn size(&self) -> f64 {
        let sizes = [self.a.reach_m(), self.b.reach_m()];
        let least = sizes.into_iter().filter(|size| *size > 0.0).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { (self.pose_a.translation() - self.pose_b.translation()).norm() }
    }

    /// Sum of the sizes, metres.
    pub fn sum(&self) -> f64 {
        self.a.reach_m() + self.b.reach_m()
    }

    /// What the pair asks for.
    pub fn options(&self) -> Options<'static> {
        let options = Options::default().with_accuracy(self.accuracy).expect("in range");
        options.with_max_iterations(self.limit.unwrap_or(MAX_ITERATIONS)).expect("in range")
    }

    /// With the second shape moved along the line of the nearest points until the gap is this,
    /// metres; first they are apart. As exact as a distance of the pair's accuracy.
    #[must_use]
    pub fn moved_to(mut self, gap: f64) -> Self {
        let found = self.solve(&self.options(), &mut WarmStart::default());
        if let Some(n) = found.normal {
            self.pose_b = shifted(&self.pose_b, n * (found.value - gap));
        }
        self
    }

    /// With the arguments swapped.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { a: self.b, pose_a: self.pose_b, b: self.a, pose_b: self.pose_a, ..self }
    }

    /// With both poses changed alike.
    #[must_use]
    pub fn carried(self, change: impl Fn(&Pose) -> Pose) -> Self {
        Self { pose_a: change(&self.pose_a), pose_b: change(&self.pose_b), ..self }
    }
}
