//! The arm of the data: what its files say of it, and the meshes of its links.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use sublevel::cli::read;
use sublevel::fit::{Mesh, ReadOptions, read_mesh};
use sublevel::robot::{Description, Geometry as Piece, Kinematics, Link, MeshPaths, read_urdf};

/// A Franka Emika Panda.
pub(crate) struct Arm {
    pub(super) urdf: String,
    pub(super) srdf: String,
    /// The same arm with spheres for its links.
    pub(super) sphere_urdf: String,
    pub(super) description: Description,
    pub(super) kinematics: Kinematics,
    /// Links with meshes, in the order of the URDF.
    pub(super) links: Vec<ArmLink>,
    /// Folder with the meshes.
    pub(super) meshes: PathBuf,
}

/// A link with a mesh.
pub(super) struct ArmLink {
    pub(super) name: Arc<str>,
    /// Position in [`Kinematics::links`].
    pub(super) index: usize,
    /// Name of the file of its mesh, without the ending.
    pub(super) file: String,
    /// Frame of the mesh to the frame of the link, metres.
    pub(super) origin: Isometry3<f64>,
    /// Frame of the link, metres.
    pub(super) mesh: Mesh,
}

impl Arm {
    /// Reads `panda.urdf`, `panda.srdf`, `panda_spherized.urdf` and the meshes from the folder
    /// `panda` of the data.
    ///
    /// # Errors
    /// Files that are missing or that cannot be read.
    pub(crate) fn read(data: &Path) -> Result<Self, Box<dyn Error>> {
        let folder = data.join("panda");
        let urdf = read(&folder.join("panda.urdf"))?;
        let description = read_urdf(&urdf).map_err(|error| format!("panda.urdf: {error}"))?;
        let kinematics = Kinematics::new(&description)?;
        let paths = MeshPaths::new(&folder);
        let mut meshes = folder.clone();
        let mut links = Vec::new();
        for link in &description.links {
            if let Some((path, link)) = mesh_link(link, &kinematics, &paths)? {
                meshes = path.parent().map_or(meshes, Path::to_path_buf);
                links.push(link);
            }
        }
        let [srdf, sphere_urdf] = ["panda.srdf", "panda_spherized.urdf"].map(|name| read(&folder.join(name)));
        Ok(Self { urdf, srdf: srdf?, sphere_urdf: sphere_urdf?, description, kinematics, links, meshes })
    }

    /// World poses of the meshes of some links at a configuration (radians), base at the origin.
    pub(super) fn mesh_poses(
        &self,
        configuration: &[f64],
        links: impl Iterator<Item = usize>,
        frames: &mut Vec<Isometry3<f64>>,
    ) -> Vec<Isometry3<f64>> {
        self.kinematics.forward(&Isometry3::identity(), configuration, frames);
        links.map(|link| frames[self.links[link].index] * self.links[link].origin).collect()
    }

    /// The joint values of a configuration with this part of the way within all limits, radians.
    pub(super) fn within_limits(&self, mut part: impl FnMut() -> f64) -> Vec<f64> {
        let value = |lower: f64, upper: f64, part: f64| lower + (upper - lower) * part;
        let of = |variable: &sublevel::robot::Variable| {
            let part = part();
            variable.limits.map_or(0.0, |limits| value(limits.lower, limits.upper, part))
        };
        self.kinematics.variables().iter().map(of).collect()
    }
}

/// The file of the mesh of a link and the link; none of a link without collision elements.
fn mesh_link(
    link: &Link,
    kinematics: &Kinematics,
    paths: &MeshPaths,
) -> Result<Option<(PathBuf, ArmLink)>, Box<dyn Error>> {
    let collision = match &link.collisions[..] {
        [] => return Ok(None),
        [one] => one,
        more => return Err(format!("panda.urdf: link {} has {} collision elements", link.name, more.len()).into()),
    };
    let Piece::Mesh { uri, scale } = &collision.geometry else {
        return Err(format!("panda.urdf: link {} is no mesh", link.name).into());
    };
    if scale.iter().any(|factor| *factor != 1.0) {
        return Err(format!("panda.urdf: the mesh of link {} is scaled", link.name).into());
    }
    let path = paths.resolve(uri)?;
    let file = path.file_stem().and_then(|stem| stem.to_str()).ok_or("a mesh without a name")?.to_owned();
    let index = kinematics.link(&link.name).ok_or("a link that is not in the tree")?;
    let mut mesh = read_mesh(&path, &ReadOptions::default())?.mesh;
    for point in &mut mesh.points {
        *point = (collision.origin * Point3::from(*point)).coords;
    }
    let link = ArmLink { name: link.name.clone(), index, file, origin: collision.origin, mesh };
    Ok(Some((path, link)))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use sublevel_testkit::data;

    use super::*;

    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn the_arm_is_as_long_as_its_joints_say() {
        let arm = Arm::read(&data("")).expect("the files of the arm");
        assert_eq!((arm.links.len(), arm.kinematics.width()), (11, 7));
        let hand = arm.links.iter().position(|link| &*link.name == "panda_hand").expect("a hand");
        let mut frames = Vec::new();
        let mut hand_at =
            |angles: [f64; 7]| arm.mesh_poses(&angles, std::iter::once(hand), &mut frames)[0].translation.vector;
        // 0.333 + 0.316 + 0.384 up, then the wrist hangs down.
        let upright = hand_at([0.0; 7]);
        assert!((upright - Vector3::new(0.088, 0.0, 0.926)).norm() < 1e-9, "{upright:?}");
        let turned = hand_at([1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((turned.xy().norm() - 0.088).abs() < 1e-9 && turned.y > 0.08, "{turned:?}");
        // Both fingers are the same mesh, one of them turned about z.
        let fingers: Vec<_> = arm.links.iter().filter(|link| link.file == "finger").collect();
        assert_eq!(fingers.len(), 2);
        let furthest = |link: &ArmLink| link.mesh.points.iter().map(|point| point.xy().norm()).fold(0.0, f64::max);
        assert!((furthest(fingers[0]) - furthest(fingers[1])).abs() < 1e-9);
    }

    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn configurations_stay_within_the_limits() {
        let arm = Arm::read(&data("")).expect("the files of the arm");
        for part in [0.0, 0.3, 1.0] {
            let configuration = arm.within_limits(|| part);
            assert_eq!(arm.kinematics.check(&configuration), Ok(()));
        }
    }
}
