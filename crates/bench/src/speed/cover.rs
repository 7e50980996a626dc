//! Balls that together contain every triangle of a mesh, which is what a body apart from the mesh
//! can come near to.
//!
//! The triangles are cut small and begin as one group; the group with the largest ball is halved
//! across its longest axis until there are as many as asked for.

use nalgebra::Vector3;
use sublevel::body::{Body, BodyError, Compound, CompoundError};
use sublevel::fit::{EnclosingBall, Mesh, smallest_ball};

/// Longest edge of a triangle, as a part of the size of the mesh.
const FINE: f64 = 0.02;
/// Balls are made larger by this part: rounding leaves no corner outside.
const SLACK: f64 = 1e-6;

/// A triangle by its corners.
type Triangle = [Vector3<f64>; 3];

/// At most `count` balls around a mesh, as one compound.
pub(super) fn cover(name: &str, mesh: &Mesh, count: usize) -> Result<Compound, CompoundError> {
    let mut groups = vec![Group::new(fine(mesh))];
    while groups.len() < count {
        let widest = groups.iter().enumerate().max_by(|a, b| a.1.ball.radius.total_cmp(&b.1.ball.radius));
        let Some((index, _)) = widest.filter(|(_, group)| group.triangles.len() > 1) else { break };
        let [one, other] = groups.swap_remove(index).halves();
        groups.extend([one, other]);
    }
    let ball = |(index, group): (usize, &Group)| -> Result<Body, BodyError> {
        let EnclosingBall { center, radius } = group.ball;
        Body::ball(&format!("ball {index}"), center, radius * (1.0 + SLACK))
    };
    let parts = groups.iter().enumerate().map(ball).collect::<Result<Vec<_>, _>>()?;
    Compound::new(name, parts)
}

/// Triangles that one ball is around.
struct Group {
    triangles: Vec<Triangle>,
    ball: EnclosingBall,
}

impl Group {
    fn new(triangles: Vec<Triangle>) -> Self {
        let corners: Vec<Vector3<f64>> = triangles.iter().flatten().copied().collect();
        Self { ball: around(&corners), triangles }
    }

    /// Two groups of as many triangles, divided across the axis along which they reach farthest.
    fn halves(mut self) -> [Self; 2] {
        let middle = |triangle: &Triangle| triangle.iter().sum::<Vector3<f64>>() / 3.0;
        let mean = self.triangles.iter().map(middle).sum::<Vector3<f64>>() / self.triangles.len() as f64;
        let far = |from: &Vector3<f64>| {
            let ways = self.triangles.iter().map(|triangle| middle(triangle) - from);
            ways.max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared())).unwrap_or_default()
        };
        let axis = far(&(mean + far(&mean)));
        self.triangles.sort_by(|a, b| axis.dot(&middle(a)).total_cmp(&axis.dot(&middle(b))));
        let rest = self.triangles.split_off(self.triangles.len() / 2);
        [Self::new(self.triangles), Self::new(rest)]
    }
}

/// A ball around points, the smallest but for [`SLACK`]: the smallest around a few of them, to
/// which the farthest is added until none is outside. Exact ones take a look at every point in
/// every one of thousands of steps.
fn around(points: &[Vector3<f64>]) -> EnclosingBall {
    let mut few: Vec<Vector3<f64>> = points.iter().take(1).copied().collect();
    loop {
        let ball = smallest_ball(&few);
        let apart = |x: &&Vector3<f64>| (*x - ball.center).norm();
        let Some(farthest) = points.iter().max_by(|a, b| apart(a).total_cmp(&apart(b))) else { return ball };
        if apart(&farthest) <= ball.radius * (1.0 + 0.5 * SLACK) || few.contains(farthest) {
            return EnclosingBall { radius: ball.radius.max(apart(&farthest)), ..ball };
        }
        few.push(*farthest);
    }
}

/// The triangles, cut in two across their longest edges until these are short.
fn fine(mesh: &Mesh) -> Vec<Triangle> {
    let (low, high) = mesh.points.iter().fold((mesh.points[0], mesh.points[0]), |(l, h), x| (l.inf(x), h.sup(x)));
    let most = FINE * (high - low).norm();
    let mut open: Vec<Triangle> = mesh.triangles.iter().map(|t| t.map(|corner| mesh.points[corner])).collect();
    let mut done = Vec::new();
    while let Some([a, b, c]) = open.pop() {
        let turned = [[a, b, c], [b, c, a], [c, a, b]];
        let edge = |[a, b, _]: &Triangle| (b - a).norm();
        let [a, b, c] = turned.into_iter().max_by(|s, t| edge(s).total_cmp(&edge(t))).unwrap_or([a, b, c]);
        if (b - a).norm() <= most {
            done.push([a, b, c]);
        } else {
            let middle = (a + b) * 0.5;
            open.extend([[a, middle, c], [middle, b, c]]);
        }
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Random;

    #[test]
    fn the_balls_contain_every_triangle_and_shrink_as_they_grow_more() {
        let corners: Vec<Vector3<f64>> =
            (0..8_u8).map(|i| Vector3::from_fn(|k, _| f64::from(i >> k & 1) * [1.0, 0.5, 0.1][k])).collect();
        let triangles = vec![[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]];
        let mesh = Mesh { points: corners, triangles };
        let mut random = Random(1);
        let mut last = f64::INFINITY;
        for count in [1, 8, 64] {
            let compound = cover("sheet", &mesh, count).unwrap();
            assert_eq!(compound.parts().len(), count);
            let widest = compound.parts().iter().map(|part| part.circumscribed().radius).fold(0.0, f64::max);
            assert!(widest < 0.7 * last, "{widest}");
            last = widest;
            for triangle in &mesh.triangles {
                for _ in 0..200 {
                    let w = Vector3::from_fn(|_, _| 1.0 + random.signed());
                    let x: Vector3<f64> = (0..3).map(|k| mesh.points[triangle[k]] * (w[k] / w.sum())).sum();
                    assert!(compound.parts().iter().any(|part| part.value(&x) <= 1.0), "{x:?}");
                }
            }
        }
    }
}
