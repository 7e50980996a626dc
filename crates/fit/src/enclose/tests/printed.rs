//! The paper's program of section V as it is printed, in the primal, in one frame, given straight
//! to clarabel.

use super::*;
use crate::DEFAULT_MARGIN;
use crate::structure::{Pattern, Structure};
use crate::tests::primal::Program;
use sublevel_core::polynomial::{monomials, position};

/// Adds a Gram matrix' entries to the equations of its monomials, times a coefficient and a
/// monomial of its own each.
fn add(
    program: &mut Program,
    equations: &mut [Vec<(usize, f64)>],
    pattern: &Pattern,
    times: &[([u8; 3], f64)],
) -> Vec<usize> {
    let variables = program.matrix(pattern.size, 0.0);
    let order = monomials(12);
    for j in 0..pattern.size {
        for i in 0..=j {
            let twice = if i == j { 1.0 } else { 2.0 };
            for (e, coefficient) in times {
                let key = order[pattern.key(i, j)];
                let place = position(std::array::from_fn(|k| key[k] + e[k]));
                equations[place].push((variables[j * (j + 1) / 2 + i], twice * coefficient));
            }
        }
    }
    variables
}

/// Least `-log det P` over sos-convex p with `H ⪰ margin I` and `1 - p - τ_k (1 - g_k)` sums of
/// squares, all τ of degree 2.
fn printed(structure: &Structure, sets: &[Polynomial], margin: f64) -> f64 {
    let degree = structure.degree.max(4);
    let mut program = Program::default();
    let coefficients: Vec<usize> = structure.monomials.iter().map(|_| program.variable(0.0)).collect();
    let mut of_p: Vec<Vec<_>> = coefficients.iter().map(|&c| vec![(c, -1.0)]).collect();
    let p = add(&mut program, &mut of_p, &structure.gram, &[([0; 3], 1.0)]);
    let mut of_form: Vec<Vec<_>> =
        structure.derivative.iter().map(|&(m, factor)| vec![(coefficients[m], -factor)]).collect();
    let h = program.matrix(structure.hessian.size, 0.0);
    for j in 0..structure.hessian.size {
        for i in 0..=j {
            of_form[structure.hessian.key(i, j)].push((h[j * (j + 1) / 2 + i], if i == j { 1.0 } else { 2.0 }));
        }
    }
    of_p.into_iter().chain(of_form).for_each(|equation| program.row(equation, 0.0));
    let (squares, multiplier) = (Pattern::of_monomials(degree / 2), Pattern::of_monomials(1));
    let mut definite = vec![];
    for g in sets {
        let mut slack = vec![([0; 3], 1.0)];
        for &(e, c) in g.terms() {
            match slack.iter_mut().find(|term| term.0 == e) {
                Some(term) => term.1 -= c,
                None => slack.push((e, -c)),
            }
        }
        let mut equations = vec![vec![]; monomials(degree).len()];
        definite.push((add(&mut program, &mut equations, &squares, &[([0; 3], 1.0)]), squares.size));
        definite.push((add(&mut program, &mut equations, &multiplier, &slack), multiplier.size));
        for (&c, &e) in coefficients.iter().zip(&structure.monomials) {
            equations[position(e)].push((c, 1.0));
        }
        for (place, equation) in equations.into_iter().enumerate() {
            program.row(equation, if place == 0 { 1.0 } else { 0.0 });
        }
    }
    program.equations();
    definite.iter().for_each(|(variables, size)| program.semidefinite(None, variables, *size, 0.0));
    program.semidefinite(None, &h, structure.hessian.size, margin);
    program.log_det(&p, structure.gram.size);
    program.minimum()
}

#[test]
fn three_ellipsoids_agree_with_the_printed_program() {
    let bodies = three_ellipsoids(1.0, Vector3::zeros());
    for degree in [2, 4] {
        let ours = around(&bodies, degree);
        let Normalization { center, linear } = *ours.body.normalization();
        let inverse = linear.try_inverse().unwrap();
        let sets: Vec<Polynomial> = bodies
            .iter()
            .map(|body| {
                // |L_k (x - c_k)|² with x = c + L⁻¹ z
                let own = body.normalization();
                let (a, b) = (own.linear * inverse, own.linear * (center - own.center));
                let (square, line) = (a.transpose() * a, a.transpose() * b * 2.0);
                let mut terms = vec![([0, 0, 0], b.norm_squared())];
                for i in 0..3 {
                    let unit = |k: usize| u8::from(k == i);
                    terms.push((std::array::from_fn(unit), line[i]));
                    for j in i..3 {
                        let value = if i == j { square[(i, i)] } else { 2.0 * square[(i, j)] };
                        terms.push((std::array::from_fn(|k| unit(k) + u8::from(k == j)), value));
                    }
                }
                Polynomial::new(terms).unwrap()
            })
            .collect();
        let printed = printed(&Structure::new(degree), &sets, DEFAULT_MARGIN);
        println!("degree {degree}: {:.7}, as printed {printed:.7}", ours.objective_value);
        assert!((ours.objective_value - printed).abs() < 3e-5, "degree {degree}");
    }
}
