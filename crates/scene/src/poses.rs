//! Poses by slot, shared between snapshots page by page.

use std::sync::Arc;

use sublevel_core::measure::{Pose, PoseError};

use super::object::Slot;

/// Poses in one page. Small pages make an update of few poses cheap, large ones a copy of the list
/// of pages.
const PAGE: usize = 64;

/// World poses of all slots with the revision at which each was last set. Cloning shares
/// everything; a change copies the pages it touches.
#[derive(Clone, Debug, Default)]
pub(crate) struct Poses {
    pages: Arc<Vec<Arc<Page>>>,
}

#[derive(Clone, Debug)]
struct Page {
    poses: [Pose; PAGE],
    stamps: [u64; PAGE],
}

fn place(slot: Slot) -> (usize, usize) {
    let slot = slot as usize;
    (slot / PAGE, slot % PAGE)
}

impl Poses {
    /// Body frame to world frame.
    pub(crate) fn get(&self, slot: Slot) -> &Pose {
        let (page, entry) = place(slot);
        &self.pages[page].poses[entry]
    }

    /// Revision at which the pose was last set; 0: never.
    pub(crate) fn stamp(&self, slot: Slot) -> u64 {
        let (page, entry) = place(slot);
        self.pages[page].stamps[entry]
    }

    /// Whether a pose was set since the slot was last cleared.
    pub(crate) fn has(&self, slot: Slot) -> bool {
        let (page, entry) = place(slot);
        self.pages.get(page).is_some_and(|page| page.stamps[entry] != 0)
    }

    /// Forgets the pose of an object that is gone.
    pub(crate) fn clear(&mut self, slot: Slot) {
        let (page, entry) = place(slot);
        if let Some(page) = Arc::make_mut(&mut self.pages).get_mut(page) {
            Arc::make_mut(page).stamps[entry] = 0;
        }
    }

    /// Sets poses, making space for new slots.
    pub(crate) fn set(&mut self, poses: impl IntoIterator<Item = (Slot, Pose)>, revision: u64) {
        let pages = Arc::make_mut(&mut self.pages);
        for (slot, pose) in poses {
            let (page, entry) = place(slot);
            while pages.len() <= page {
                pages.push(Arc::new(Page { poses: [Pose::identity(); PAGE], stamps: [0; PAGE] }));
            }
            let page = Arc::make_mut(&mut pages[page]);
            page.poses[entry] = pose;
            page.stamps[entry] = revision;
        }
    }
}

/// The pose of a body that is held: its frame to the holder's, then the holder's to the world. It
/// is rounded once, and what is measured is true of the rounded pose.
///
/// # Errors
/// A product that is too far away to be a pose.
pub(crate) fn compose(holder: &Pose, held: &Pose) -> Result<Pose, PoseError> {
    let rotation = holder.rotation() * held.rotation();
    Pose::from_quaternion(holder.transform_point(held.translation()), normalized(rotation.coords))
}

/// The place of a body in its holder: the inverse of [`compose`].
///
/// # Errors
/// A place that is too far away to be a pose.
pub(crate) fn relative(holder: &Pose, world: &Pose) -> Result<Pose, PoseError> {
    let inverse = holder.rotation().inverse();
    let rotation = inverse * world.rotation();
    let translation = inverse * (world.translation() - holder.translation());
    Pose::from_quaternion(translation, normalized(rotation.coords))
}

fn normalized(coords: nalgebra::Vector4<f64>) -> [f64; 4] {
    (coords / coords.norm()).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    fn random(seeded: &mut Seeded) -> Pose {
        let mut number = || seeded.signed();
        let translation = Vector3::new(number(), number(), number());
        let q = nalgebra::Vector4::new(number(), number(), number(), number());
        Pose::from_quaternion(translation, normalized(q)).expect("a pose")
    }

    #[test]
    fn a_page_is_copied_only_where_it_changes() {
        let mut poses = Poses::default();
        let x = |x: f64| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
        poses.set((0..200).map(|slot| (slot, x(f64::from(slot)))), 1);
        let before = poses.clone();
        poses.set([(70, x(-1.0))], 2);
        assert_eq!((before.get(70), before.stamp(70)), (&x(70.0), 1));
        assert_eq!((poses.get(70), poses.stamp(70)), (&x(-1.0), 2));
        let shared = |page: usize| Arc::ptr_eq(&poses.pages[page], &before.pages[page]);
        assert_eq!([shared(0), shared(1), shared(2)], [true, false, true]);
    }

    #[test]
    fn relative_is_the_inverse_of_compose() {
        for seed in 0..100 {
            let mut seeded = Seeded(seed);
            let (holder, held) = (random(&mut seeded), random(&mut seeded));
            let product = compose(&holder, &held).expect("a pose");
            let back = relative(&holder, &product).expect("a pose");
            let error = (back.translation() - held.translation()).norm() + back.rotation().angle_to(held.rotation());
            assert!(error < 1e-14, "seed {seed}: {error:e}");
            let p = Vector3::new(0.3, -0.2, 0.7);
            let both = holder.transform_point(&held.transform_point(&p));
            let error = (product.transform_point(&p) - both).norm();
            assert!(error < 1e-14, "seed {seed}: {error:e}");
        }
    }
}
