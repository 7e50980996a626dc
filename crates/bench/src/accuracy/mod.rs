//! Accuracy: how near methods come to the distance in how much time and in how many iterations, and
//! where they stop coming nearer.

mod cases;
mod effort;
mod methods;
mod report;
mod shown;

use super::Machine;
use super::baselines::Clarabel;
use super::comparison::{Coal, ComparisonError, FitCache};
use cases::cases;
use effort::Effort;
use methods::{Cell, measure};
pub(crate) use shown::Shown;
use std::ops::ControlFlow;
use std::path::Path;

/// All methods on all cases.
pub struct Accuracy {
    machine: Machine,
    /// Version of coal, if it ran.
    coal: Option<String>,
    /// Version of clarabel, if it ran.
    solver: Option<String>,
    quick: bool,
    passes: usize,
    cases: Vec<Measured>,
}

/// All methods on a case.
struct Measured {
    name: String,
    size_m: f64,
    queries: usize,
    /// Median and largest half-width of the reference's bracket, as parts of the size.
    reference: [f64; 2],
    cells: Vec<Cell>,
}

/// Measures three pairs of the meshes in `data` at degrees 4 and 6, or one at degree 4 if `quick`,
/// and a pair of flat faces. Fits are kept in the `cache`; coal takes part where `SUBLEVEL_COAL`
/// names the program that times it, clarabel where its example is built. `progress` receives what
/// is going on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn accuracy(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Accuracy, ComparisonError> {
    let effort = if quick {
        Effort { pairs: 1, degrees: &[4], queries: 40, few: 20, programs: 3, points: &[100, 1000, 10_000], passes: 1 }
    } else {
        Effort {
            pairs: 3,
            degrees: &[4, 6],
            queries: 400,
            few: 100,
            programs: 20,
            points: &[100, 300, 1000, 3000, 10_000, 30_000, 100_000],
            passes: 3,
        }
    };
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    let peers = (Clarabel::find()?, Coal::from_environment()?);
    let mut measured = Vec::new();
    for case in cases(data, &effort, cache, &mut announce)? {
        let cells = measure(&case, &effort, cache, (peers.0.as_ref(), peers.1.as_ref()), &mut announce)?;
        let halves: Vec<f64> = case.queries.iter().map(|query| query.half_width / case.size_m).collect();
        let reference = [super::comparison::sweep::median(&halves), halves.iter().copied().fold(0.0, f64::max)];
        let (size_m, queries) = (case.size_m, case.queries.len());
        measured.push(Measured { name: case.name, size_m, queries, reference, cells });
    }
    Ok(Accuracy {
        machine: Machine::this(),
        coal: peers.1.as_ref().map(Coal::version),
        solver: peers.0.is_some().then(Clarabel::version),
        quick,
        passes: effort.passes,
        cases: measured,
    })
}

#[cfg(test)]
mod tests {
    use super::cases::Case;
    use super::methods::{Method, measure};
    use super::*;
    use crate::baselines::tests::{at, axes_apart};

    #[test]
    fn all_methods_approach_the_distance_of_ellipsoids() {
        let (a, b, ..) = axes_apart();
        let poses = (0..4).map(|i| {
            let x = 2.2 + 0.1 * f64::from(i);
            [at(x + 0.01, 0.3, 0.0), at(x, 0.3, 0.1)]
        });
        let case = Case::new("eggs".into(), [a, b], poses).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let cache = FitCache::new(folder.path()).unwrap();
        let effort =
            Effort { pairs: 0, degrees: &[], queries: 4, few: 4, programs: 0, points: &[100, 1000], passes: 1 };
        let cells = measure(&case, &effort, &cache, (None, None), &mut |_| Ok(())).unwrap();
        let of = |method| cells.iter().filter(move |cell| cell.method == method);
        let best = |method| of(method).map(|cell| cell.error[1]).fold(f64::INFINITY, f64::min);
        for method in [Method::Cold, Method::Warm, Method::NewtonPlain, Method::NewtonOurs, Method::NewtonBefore] {
            assert!(best(method) < 1e-11, "{method:?}: {}", best(method));
        }
        assert!(best(Method::Slsqp) < 1e-6, "{}", best(Method::Slsqp));
        let hulls: Vec<f64> = of(Method::Parry).map(|cell| cell.error[0]).collect();
        assert!(hulls[1] < 0.3 * hulls[0] && hulls[1] > 1e-6, "{hulls:?}");
        for cell in of(Method::Cold).chain(of(Method::Warm)) {
            let tolerance: f64 = cell.setting.parse().unwrap();
            assert!(cell.short != Some(0) || cell.width.unwrap()[1] <= tolerance, "{cell:?}");
            assert!(cell.error[1] <= cell.width.unwrap()[1] && cell.nanoseconds > 0.0, "{cell:?}");
        }
    }
}
