//! What stands for the links of the arm, and the robots that this makes.

use std::collections::BTreeMap;
use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;

use sublevel::body::{Body, Shape};
use sublevel::fit::{FitOptions, fit_parts};
use sublevel::jobs::LinkFit;
use sublevel::robot::{Description, read_srdf, read_urdf};
use sublevel::scene::{Geometry, Ladder, Robot, RobotId};
use sublevel::store::RobotSource;

use super::arm::{Arm, ArmLink};
use super::rows::LinkRow;
use crate::comparison::FitCache;

/// How far a body of [`Representation::WithinGap`] may reach beyond its link, metres.
const MAX_GAP_M: f64 = 0.02;

/// How links are represented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Representation {
    /// The spheres of a second URDF, which leave parts of the links out.
    Spheres,
    /// Bodies of degree 2.
    Ellipsoids,
    /// Bodies of degree 4.
    Degree4,
    /// Bodies of degree 6.
    Degree6,
    /// What `sublevel robot` fits where nothing else is asked for: bodies of degree 6 with refined
    /// volumes.
    Default,
    /// Degrees 2, 4 and 6, coarsest first.
    Ladder,
    /// Two bodies of degree 6 per link, with refined volumes.
    Compound,
    /// One or two of those per link, whichever has the smaller gap.
    AtMostTwo,
    /// The cheapest bodies within a gap.
    WithinGap,
}

impl Representation {
    /// All of them.
    pub(super) const ALL: [Self; 9] = [
        Self::Spheres,
        Self::Ellipsoids,
        Self::Degree4,
        Self::Degree6,
        Self::Default,
        Self::Ladder,
        Self::Compound,
        Self::AtMostTwo,
        Self::WithinGap,
    ];

    /// Its name in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Spheres => "spheres of the URDF",
            Self::Ellipsoids => "ellipsoids",
            Self::Degree4 => "degree 4",
            Self::Degree6 => "degree 6",
            Self::Default => "degree 6 refined, as by default",
            Self::Ladder => "ladder 2-4-6",
            Self::Compound => "two parts of degree 6 refined",
            Self::AtMostTwo => "one or two parts, the smaller gap",
            Self::WithinGap => "within 2 cm",
        }
    }

    /// Whether motions are measured of it: they are proven for the finest rung of a ladder, which
    /// is there without the ladder, and those of one or two parts are between those of either.
    pub(super) fn has_motions(self) -> bool {
        !matches!(self, Self::Ladder | Self::AtMostTwo)
    }
}

/// The arm as a robot.
pub(crate) struct LoadedArm {
    pub(super) robot: Arc<Robot>,
    /// What a server loads.
    pub(super) source: RobotSource,
    /// Bodies of the links; none of spheres, which the URDF holds.
    pub(super) geometries: Vec<Geometry>,
    /// Convex pieces of all links.
    pub(crate) pieces: usize,
    /// What stands for each link; none of spheres.
    pub(super) links: Vec<LinkRow>,
}

impl Arm {
    /// The arm with links of a representation; fits are kept in the cache.
    ///
    /// # Errors
    /// Fits that fail, and files that make no robot.
    pub(crate) fn load(&self, links: Representation, cache: &FitCache) -> Result<LoadedArm, Box<dyn Error>> {
        if links == Representation::Spheres {
            let description = read_urdf(&self.sphere_urdf).map_err(|error| format!("panda_spherized.urdf: {error}"))?;
            return self.robot(&self.sphere_urdf, &description, BTreeMap::new());
        }
        let mut bodies = BTreeMap::new();
        for link in &self.links {
            bodies.insert(link.name.clone(), self.geometry(link, links, cache)?);
        }
        let mut loaded = self.robot(&self.urdf, &self.description, bodies.clone())?;
        for link in &self.links {
            let finest = bodies.get(&link.name).and_then(|geometry| geometry.rungs().last());
            loaded.links.extend(finest.map(|shape| LinkRow {
                representation: links.name().into(),
                link: link.name.to_string(),
                parts: parts(shape).len(),
                degree: parts(shape).iter().map(Body::degree).max().unwrap_or(0),
                gap_m: shape.gap_m().unwrap_or(f64::NAN),
            }));
        }
        Ok(loaded)
    }

    /// The geometry of a link.
    fn geometry(&self, link: &ArmLink, links: Representation, cache: &FitCache) -> Result<Geometry, Box<dyn Error>> {
        let name = link.name.replace('_', "-");
        let of_degree = |degree: usize, refine: bool| {
            let options = FitOptions { degree, refine, ..FitOptions::default() };
            cache.body(&name, &link.mesh, &options)
        };
        let fit = |how: LinkFit| {
            let described = self.description.links.iter().find(|described| described.name == link.name);
            let described = described.ok_or("a link that is not in the description")?;
            Ok::<_, Box<dyn Error>>(Geometry::Solid(Arc::new(cache.link(described, &link.mesh, how)?)))
        };
        Ok(match links {
            Representation::Ellipsoids => of_degree(2, false)?.into(),
            Representation::Degree4 => of_degree(4, false)?.into(),
            Representation::Degree6 => of_degree(6, false)?.into(),
            Representation::Ladder => {
                let rung =
                    |degree: usize| Ok::<_, Box<dyn Error>>(Arc::new(Shape::Body(Box::new(of_degree(degree, false)?))));
                let rungs = [2, 4, 6].into_iter().map(rung).collect::<Result<Vec<_>, _>>()?;
                Geometry::Ladder(Arc::new(Ladder::new(&name, rungs)?))
            }
            Representation::Default => fit(LinkFit::default())?,
            Representation::WithinGap => fit(LinkFit::WithinGap(MAX_GAP_M))?,
            Representation::Spheres | Representation::Compound => {
                Geometry::Solid(Arc::new(two_parts(link, &name, cache)?))
            }
            Representation::AtMostTwo => {
                let (one, two) = (of_degree(6, true)?, two_parts(link, &name, cache)?);
                // Without a gap it is not known to be near.
                let [gap_of_one, gap_of_two] = [one.gap_m(), two.gap_m()].map(|gap| gap.unwrap_or(f64::INFINITY));
                if gap_of_one <= gap_of_two { one.into() } else { Geometry::Solid(Arc::new(two)) }
            }
        })
    }

    fn robot(
        &self,
        urdf: &str,
        description: &Description,
        bodies: BTreeMap<Arc<str>, Geometry>,
    ) -> Result<LoadedArm, Box<dyn Error>> {
        let semantics = read_srdf(&self.srdf, description).map_err(|error| format!("panda.srdf: {error}"))?;
        let id = RobotId::of(urdf, &self.srdf, bodies.iter().map(|(link, geometry)| (&**link, geometry.id())));
        let robot = Robot::new(id, description, &semantics, &bodies)?;
        let names = |robot: &Robot| robot.kinematics().variables().to_vec();
        if names(&robot).iter().map(|joint| &joint.name).ne(self.kinematics.variables().iter().map(|joint| &joint.name))
        {
            return Err("panda_spherized.urdf has other joints than panda.urdf".into());
        }
        let of_link = |geometry: &Geometry| geometry.rungs().last().map_or(1, |shape| parts(shape).len());
        let pieces = robot.links().iter().flatten().map(|link| of_link(&link.geometry)).sum();
        let source = RobotSource {
            urdf: urdf.to_owned(),
            srdf: self.srdf.clone(),
            bodies: bodies.iter().map(|(link, geometry)| (link.clone(), *geometry.id())).collect(),
        };
        Ok(LoadedArm {
            robot: Arc::new(robot),
            source,
            geometries: bodies.into_values().collect(),
            pieces,
            links: Vec::new(),
        })
    }
}

fn parts(shape: &Shape) -> &[Body] {
    match shape {
        Shape::Body(body) => std::slice::from_ref(body),
        Shape::Compound(compound) => compound.parts(),
    }
}

/// A link as two bodies of degree 6 with refined volumes.
fn two_parts(link: &ArmLink, name: &str, cache: &FitCache) -> Result<Shape, Box<dyn Error>> {
    let options = FitOptions { degree: 6, refine: true, ..FitOptions::default() };
    let fit = || {
        let fitted = fit_parts(name, &link.mesh, 2, &options, &mut |_| ControlFlow::Continue(()))?;
        Ok(Shape::Compound(Box::new(fitted.compound)))
    };
    Ok(cache.take(&format!("{name}-d6-refined-p2"), &link.mesh, &format!("{options:?} 2 parts"), fit)?)
}
