//! The paper's pictures, redrawn from our fits: degrees, level sets, and the two Gram matrices.

use super::rows::{MESHES, Method};
use super::{Set, Subject, Table1};
use nalgebra::Vector3;
use sublevel::body::{Aabb, Body};
use sublevel::draw::{ChartError, Ink, Outline, Panel, Silhouettes, View, boundary_points, outline, shadow};
use sublevel::fit::Objective;

/// Boundary points that an outline is made of.
const POINTS: usize = 6000;
/// The levels of the paper's picture.
const LEVELS: [f64; 3] = [2.0, 1.0, 0.75];

/// Names of all pictures, in the order of the report.
pub(super) const PICTURES: [&str; 5] =
    ["table1.svg", "table1-degrees.svg", "table1-gram.svg", "table1-convexity.svg", "table1-levels.svg"];

impl Method {
    /// Whether the set is drawn.
    pub(super) fn is_drawn(self) -> bool {
        match self {
            Self::Convex(Objective::LogDetP | Objective::LogDetH, _, refined) => !refined,
            Self::Relaxed(_, Objective::LogDetP, degree) => degree >= 6,
            _ => false,
        }
    }
}

impl Table1 {
    /// The pictures by name, the most telling first: what could be built is drawn.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if nothing could be built.
    pub fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let drawn = [self.volume_against_time()?, self.degrees(), self.grams(), self.convexity(), self.levels()];
        Ok(PICTURES.map(str::to_owned).into_iter().zip(drawn).collect())
    }

    /// A row of bodies of rising degree around each of two meshes.
    fn degrees(&self) -> String {
        let rows = ["human", "chair"].map(|name| {
            let panel = |degree| {
                let method = Method::Convex(Objective::LogDetP, degree, false);
                self.panel(name, &format!("{name}, degree {degree}"), View::Front, &[(Ink::Orange, method)])
            };
            [2, 4, 6, 8].into_iter().filter_map(panel).collect()
        });
        let legend = vec![(Ink::Blue, "mesh".into()), (Ink::Orange, "sos-convex body, logdet-p".into())];
        Silhouettes { title: "Bodies of rising degree".into(), legend, rows: rows.into() }.to_svg()
    }

    /// The body of least log det of P beside that of H, of the highest degree that there is.
    fn grams(&self) -> String {
        let built = |&degree: &usize| self.body("chair", Method::Convex(Objective::LogDetH, degree, false)).is_some();
        let degree = [6, 4].into_iter().find(built).unwrap_or_default();
        let panel = |(name, view): (&str, View)| {
            let method = |objective| Method::Convex(objective, degree, false);
            let both = [(Ink::Orange, method(Objective::LogDetH)), (Ink::Green, method(Objective::LogDetP))];
            self.panel(name, &format!("{name}, {}", view.name()), view, &both)
        };
        let panels = [("chair", View::Front), ("chair", View::Top), ("octopus", View::Top)];
        let rows = vec![panels.into_iter().filter_map(panel).collect()];
        let legend =
            vec![(Ink::Blue, "mesh".into()), (Ink::Orange, "logdet-h".into()), (Ink::Green, "logdet-p".into())];
        let title = format!("Gram matrix of the Hessian form against that of p, degree {degree}");
        Silhouettes { title, legend, rows }.to_svg()
    }

    /// Sets of one degree that need be convex less and less.
    fn convexity(&self) -> String {
        let relaxed = |c, degree| Method::Relaxed(c, Objective::LogDetP, degree);
        let built = |&degree: &usize| self.set("chair", relaxed(100.0, degree)).is_some();
        let degree = [6, 4].into_iter().find(built).unwrap_or_default();
        let rows = [("human", View::Front), ("chair", View::Side), ("octopus", View::Top)].map(|(name, view)| {
            let convex = Method::Convex(Objective::LogDetP, degree, false);
            let columns = [("c = 0", convex), ("c = 10", relaxed(10.0, degree)), ("c = 100", relaxed(100.0, degree))];
            let panel = |(c, method): (&str, Method)| {
                self.panel(name, &format!("{name}, {c}, {}", view.name()), view, &[(Ink::Orange, method)])
            };
            columns.into_iter().filter_map(panel).collect()
        });
        let legend = vec![(Ink::Blue, "mesh".into()), (Ink::Orange, "p <= 1".into())];
        Silhouettes { title: format!("Less and less convex, degree {degree}"), legend, rows: rows.into() }.to_svg()
    }

    /// One body grown and shrunk by its level sets.
    fn levels(&self) -> String {
        let panel = |(name, _): &(&str, &str)| {
            let method = [6, 4].map(|degree| Method::Convex(Objective::LogDetP, degree, false));
            let body = method.into_iter().find_map(|method| self.body(name, method))?;
            let subject = self.subject(name)?;
            let inks = [Ink::Green, Ink::Orange, Ink::Purple];
            let bounds = grown(body);
            let sets = LEVELS.iter().zip(inks).map(|(&level, ink)| Outline {
                ink,
                polygons: shadow(|x| body.value(x), level, &bounds, View::Front),
                solid: false,
            });
            let outlines = std::iter::once(subject.picture(View::Front)).chain(sets).collect();
            Some(Panel { caption: format!("{name}, degree {}", body.degree()), outlines, spans: Vec::new() })
        };
        let rows = vec![MESHES[..3].iter().filter_map(panel).collect()];
        let legend = vec![
            (Ink::Blue, "mesh".into()),
            (Ink::Green, "p <= 2".into()),
            (Ink::Orange, "p <= 1".into()),
            (Ink::Purple, "p <= 0.75".into()),
        ];
        Silhouettes { title: "Growth and shrinkage by level sets".into(), legend, rows }.to_svg()
    }

    /// The bodies of these methods over the mesh, if they could be built.
    fn panel(&self, name: &str, caption: &str, view: View, methods: &[(Ink, Method)]) -> Option<Panel> {
        let mut outlines = vec![self.subject(name)?.picture(view)];
        for &(ink, method) in methods {
            outlines.push(match self.set(name, method)? {
                Set::Body(body) => {
                    let points = boundary_points(|direction| body.boundary_along(direction), POINTS);
                    Outline::body(ink, outline(&points, view))
                }
                set @ Set::Sos(_) => {
                    let polygons = shadow(|x| set.value(x), 1.0, set.bounding_box(), view);
                    Outline { ink, polygons, solid: false }
                }
            });
        }
        Some(Panel { caption: caption.into(), outlines, spans: Vec::new() })
    }

    fn subject(&self, name: &str) -> Option<&Subject> {
        self.subjects.iter().find(|subject| subject.name == name)
    }

    fn body(&self, name: &str, method: Method) -> Option<&Body> {
        match self.set(name, method)? {
            Set::Body(body) => Some(body),
            Set::Sos(_) => None,
        }
    }

    fn set(&self, name: &str, method: Method) -> Option<&Set> {
        let column = self.subjects.iter().position(|subject| subject.name == name)?;
        let (_, cells) = self.rows.iter().find(|(row, _)| row.method == method)?;
        cells.get(column)?.as_ref().ok()?.set.as_ref()
    }
}

impl Subject {
    fn picture(&self, view: View) -> Outline {
        Outline::surface(Ink::Blue, &self.mesh.points, &self.mesh.triangles, view)
    }
}

/// A box around the largest of the level sets: p is convex, so that {p <= 2} is no more than `(2 -
/// min p)/(1 - min p)` times as large as the body, about the point of the least value.
fn grown(body: &Body) -> Aabb {
    let factor = (LEVELS[0] - body.min_value()) / (1.0 - body.min_value());
    let (bounds, center) = (body.bounding_box(), body.interior_point());
    let away = |corner: &Vector3<f64>| center + (corner - center) * factor;
    Aabb { min: away(&bounds.min), max: away(&bounds.max) }
}
