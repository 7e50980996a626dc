use super::{ConicProgram, ConicSolution, Expression, geometric_mean, solve};
use crate::FitError;
use crate::progress::Watch;
use crate::unsolved::ProgramError;
use nalgebra::DMatrix;
use std::ops::ControlFlow;
use sublevel_testkit::Seeded;

fn solved(program: &ConicProgram) -> Result<ConicSolution, FitError> {
    let mut unwatched = |_| ControlFlow::Continue(());
    solve(program, 1e-9, 1.0, &mut Watch::new(&mut unwatched))
}

/// `min x1 + 2 x2 + ½ x2²` with `x1 >= |(3, 4, x2)|`: x1 = r, x2 the root of `x/r + 2 + x = 0`.
#[test]
fn values_and_multipliers_satisfy_the_optimality_conditions() {
    let mut program = ConicProgram::default();
    let [x1, x2] = [program.variable(1.0), program.variable(2.0)];
    program.add_quadratic(x2, &DMatrix::repeat(1, 1, 1.0));
    let rows = program.second_order([
        Expression::of(x1),
        Expression::constant(3.0),
        Expression::constant(4.0),
        Expression::of(x2),
    ]);
    let solution = solved(&program).unwrap();
    let (a, b) = (solution.variables[x1], solution.variables[x2]);
    // A gap of 1e-9 leaves the square root of that to variables.
    assert!((a - (25.0 + b * b).sqrt()).abs() < 1e-7);
    assert!((b / a + 2.0 + b).abs() < 1e-4, "{b}");
    // Qx + c = Σ z ∇e
    let z = solution.multipliers(rows);
    assert!((z[0] - 1.0).abs() < 1e-7 && (z[3] - (b + 2.0)).abs() < 1e-7, "{z}");
}

/// `min x + y` with `[[x, t], [t, y]] ⪰ 0`, `t = 1` and x at least 1/2: x = y = 1, multiplier
/// `[[1, -1], [-1, 1]]`.
#[test]
fn semidefinite_multipliers_are_matrices() {
    let mut program = ConicProgram::default();
    let [x, y, t] = [program.variable(1.0), program.variable(1.0), program.variable(0.0)];
    program.zero([Expression { constant: -1.0, ..Expression::of(t) }]);
    program.nonnegative([Expression { constant: -0.5, ..Expression::of(x) }]);
    let rows = program.semidefinite(2, |i, j| Expression::of([x, t, y][i + j]));
    let solution = solved(&program).unwrap();
    assert!([x, y, t].iter().all(|&v| (solution.variables[v] - 1.0).abs() < 1e-4));
    assert!((solution.variables[x] + solution.variables[y] - 2.0).abs() < 1e-8);
    let gram = solution.matrix_multiplier(rows, 2);
    assert!((gram - DMatrix::from_row_slice(2, 2, &[1.0, -1.0, -1.0, 1.0])).amax() < 1e-4);
}

#[test]
fn geometric_means_of_any_number_of_variables() {
    for bounds in [&[3.0][..], &[1.0, 4.0], &[1.0, 2.0, 4.0], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]] {
        let mut program = ConicProgram::default();
        let variables: Vec<usize> = bounds.iter().map(|_| program.variable(0.0)).collect();
        for (&variable, &bound) in variables.iter().zip(bounds) {
            program.nonnegative([Expression { constant: bound, ..Expression::default().plus(-1.0, variable) }]);
        }
        let mean = geometric_mean(&mut program, &variables);
        program.add_cost(mean, -1.0);
        let found = solved(&program).unwrap().variables[mean];
        let truth = bounds.iter().map(|bound: &f64| bound.ln()).sum::<f64>() / bounds.len() as f64;
        assert!((found - truth.exp()).abs() < 1e-7, "{bounds:?}: {found}");
    }
}

#[test]
fn what_has_no_optimum_is_an_error() {
    let mut unbounded = ConicProgram::default();
    let x = unbounded.variable(-1.0);
    unbounded.nonnegative([Expression::of(x)]);
    let mut contradictory = unbounded.clone();
    contradictory.zero([Expression { constant: 1.0, ..Expression::of(x) }]);
    assert_eq!(solved(&unbounded).unwrap_err(), ProgramError::Unbounded.into());
    assert_eq!(solved(&contradictory).unwrap_err(), ProgramError::Infeasible.into());

    let mut broken = ConicProgram::default();
    let x = broken.variable(f64::NAN);
    broken.nonnegative([Expression::of(x)]);
    assert!(matches!(solved(&broken), Err(FitError::Program(ProgramError::Solver(_)))));
}

/// Short of a tolerance that rounding does not leave, the answer says so, and is one all the same.
#[test]
fn answers_say_where_the_solver_stopped_short() {
    let mut unwatched = |_| ControlFlow::Continue(());
    for seed in 0..10 {
        let program = random_program(seed);
        let plain = solved(&program).unwrap();
        assert_eq!(plain.stop, None, "seed {seed}");
        let fine = solve(&program, 1e-30, 1.0, &mut Watch::new(&mut unwatched)).unwrap();
        println!("seed {seed}: {:?}", fine.stop);
        assert!(fine.stop.is_some(), "seed {seed}");
        // Of a flat optimum the variables may differ: its value may not.
        let cost = |solution: &ConicSolution| -> f64 {
            program.standard().1.iter().zip(&solution.variables).map(|(c, x)| c * x).sum()
        };
        let apart = (cost(&plain) - cost(&fine)).abs();
        assert!(apart < 1e-4, "seed {seed}: {apart}");
    }
}

/// A random program: `max log det`-like trace over an interval of matrices.
fn random_program(seed: u64) -> ConicProgram {
    let mut random = Seeded(seed);
    let size = 12;
    let root = DMatrix::from_fn(size, size, |_, _| random.signed());
    let bound = &root * root.transpose() + DMatrix::identity(size, size);
    let mut program = ConicProgram::default();
    let first = program.variables(size * (size + 1) / 2).start;
    let at = |i: usize, j: usize| first + j * (j + 1) / 2 + i;
    for j in 0..size {
        (0..=j).for_each(|i| program.add_cost(at(i, j), random.signed()));
    }
    program.semidefinite(size, |i, j| Expression {
        constant: bound[(i, j)],
        ..Expression::default().plus(-1.0, at(i, j))
    });
    program.semidefinite(size, |i, j| Expression { constant: bound[(i, j)], ..Expression::of(at(i, j)) });
    program
}

#[test]
fn every_iteration_can_stop_it() {
    let program = random_program(1);
    let mut count = 0;
    let mut counted = |_| {
        count += 1;
        ControlFlow::Continue(())
    };
    let mut watch = Watch::new(&mut counted);
    solve(&program, 1e-9, 1.0, &mut watch).unwrap();
    assert_eq!(watch.log().len(), watch.progress().iterations);
    assert!(watch.log().windows(2).all(|steps| steps[1].iteration == steps[0].iteration + 1));
    for last in 1..=count {
        let mut left = last;
        let mut stopped = |_| {
            left -= 1;
            if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let error = solve(&program, 1e-9, 1.0, &mut Watch::new(&mut stopped)).unwrap_err();
        assert_eq!((error, left), (FitError::Cancelled, 0));
    }
}

#[test]
fn who_waits_for_the_solver_can_stop() {
    let held = super::alone();
    let mut waits = 0;
    let mut stopped = |_| {
        waits += 1;
        if waits == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let error = solve(&random_program(1), 1e-9, 1.0, &mut Watch::new(&mut stopped)).unwrap_err();
    assert_eq!((error, waits), (FitError::Cancelled, 3));
    drop(held);
    solved(&random_program(1)).unwrap();
}

/// A serial BLAS is not made for two threads.
#[test]
fn solvers_of_several_threads_do_not_disturb_each_other() {
    let alone: Vec<_> = (0..4).map(|seed| solved(&random_program(seed)).unwrap().variables).collect();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for round in 0..20 {
                    let seed = round % 4;
                    assert_eq!(solved(&random_program(seed as u64)).unwrap().variables, alone[seed]);
                }
            });
        }
    });
}
