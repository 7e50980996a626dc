//! Why a program has no optimum that is verified.

use std::fmt;
use sublevel_core::body::Solver;

/// How clarabel ended short of its tolerance. Its numbers may be good enough all the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// It reached a hundred thousand times its tolerance (`AlmostSolved`).
    Almost,
    /// Its steps made no more progress (`InsufficientProgress`).
    Stalled,
    /// Its linear systems were lost in rounding (`NumericalError`).
    NumericalError,
    /// It did as many iterations as it may (`MaxIterations`).
    Iterations,
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Almost => "it ended almost solved, short of its tolerance",
            Self::Stalled => "it stalled",
            Self::NumericalError => "it met numerical errors",
            Self::Iterations => "it reached its limit of iterations",
        })
    }
}

/// What is wrong with a solver's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Objective minus its lower bound from the dual, too large.
    Gap(f64),
    /// Largest p - 1 at a point.
    Outside(f64),
    /// What the Gram matrix misses of the Hessian form.
    Residual(f64),
    /// The Gram matrix of the Hessian form has no definite inside by half the margin.
    Indefinite,
    /// Its Gram matrix, or the moment matrices of its dual numbers, are not definite.
    Singular,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Gap(gap) => write!(f, "its answer is only known to be within {gap:.1e} of the optimum"),
            Self::Outside(by) => write!(f, "its answer leaves points outside by {by:.1e}"),
            Self::Residual(by) => write!(f, "its Gram matrix misses the Hessian form by {by:.1e}"),
            Self::Indefinite => f.write_str("its Gram matrix of the Hessian form is not definite"),
            Self::Singular => f.write_str("its matrices are singular"),
        }
    }
}

/// Why a program has no optimum, without what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// A moment matrix lost its definiteness.
    #[error("the points do not span the polynomials of this degree numerically")]
    Singular,
    /// The solver has proven to its accuracy that the constraints contradict each other.
    #[error("its constraints contradict each other")]
    Infeasible,
    /// The solver has proven to its accuracy that nothing bounds the objective.
    #[error("nothing bounds its objective")]
    Unbounded,
    /// The solver's answer cannot be used.
    #[error("{}{fault}", .stop.map_or(String::new(), |stop| format!("{stop}, and ")))]
    Unusable {
        /// How the solver ended, if it was short of its tolerance.
        stop: Option<Stop>,
        /// What is wrong.
        fault: Fault,
    },
    /// Points were left outside again and again.
    #[error("points were still left outside after {0} rounds of adding them")]
    Rounds(usize),
    /// The solver has no answer.
    #[error("{0}")]
    Solver(&'static str),
    /// The solver refuses the program.
    #[error("it refuses the program: {0}")]
    Refused(String),
}

impl ProgramError {
    /// Of an answer whose matrices are not definite.
    pub(super) fn singular(stop: Option<Stop>) -> Self {
        if stop.is_some() { Self::Unusable { stop, fault: Fault::Singular } } else { Self::Singular }
    }

    /// Whether it is what too few points lead to.
    fn is_of_few_points(&self) -> bool {
        matches!(
            self,
            Self::Singular | Self::Infeasible | Self::Unbounded | Self::Unusable { fault: Fault::Singular, .. }
        )
    }
}

/// A solver that did not solve the program of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Which one.
    pub solver: Solver,
    /// Points in its last program, some of its own inside of the hull among them.
    pub points: usize,
    /// What happened.
    pub why: ProgramError,
}

/// The program of a fit, which no solver that was tried has solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Unsolved {
    /// Degree of the polynomial.
    pub degree: usize,
    /// Each solver that was tried, in this order.
    pub failures: Vec<Failure>,
    /// Whether another solver could be tried, and was not since this one was asked for.
    pub is_solver_fixed: bool,
}

impl fmt::Display for Unsolved {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { degree, failures, is_solver_fixed } = self;
        for (index, Failure { solver, points, why }) in failures.iter().enumerate() {
            match index {
                0 => write!(f, "{solver} did not solve the program of degree {degree} on {points} points: {why}")?,
                _ => write!(f, "; {solver} did not on {points} points: {why}")?,
            }
        }
        // Rounding stands in the way of programs that are large and of high degree; where points do
        // not bound a polynomial there are too few.
        let points = if failures.iter().any(|failure| failure.why.is_of_few_points()) {
            "add points"
        } else {
            "give fewer points"
        };
        let open = if *is_solver_fixed { "leave the choice of the solver open, " } else { "" };
        match degree {
            2 if open.is_empty() => write!(f, "; {points}"),
            2 => write!(f, "; {open}or {points}"),
            _ => write!(f, "; {open}lower the degree, or {points}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EncloseError, HierarchyError, NoCertificate, NoContainment};

    fn failure(solver: Solver, why: ProgramError) -> Failure {
        Failure { solver, points: 412, why }
    }

    /// Each text says what happened, in which program, and what to do, in one line.
    #[test]
    fn texts_name_what_happened_the_program_and_the_remedy() {
        let gap = |stop| ProgramError::Unusable { stop, fault: Fault::Gap(3.2e-4) };
        let alone = |why| Unsolved { degree: 6, failures: vec![failure(Solver::Clarabel, why)], is_solver_fixed: true };
        for (stop, words) in [
            (Stop::Almost, "it ended almost solved, short of its tolerance, and"),
            (Stop::Stalled, "it stalled, and"),
            (Stop::NumericalError, "it met numerical errors, and"),
            (Stop::Iterations, "it reached its limit of iterations, and"),
        ] {
            assert_eq!(
                alone(gap(Some(stop))).to_string(),
                format!(
                    "clarabel did not solve the program of degree 6 on 412 points: {words} its answer is only known to be \
                     within 3.2e-4 of the optimum; leave the choice of the solver open, lower the degree, or give fewer points"
                )
            );
        }
        for (fault, words) in [
            (Fault::Outside(2e-5), "its answer leaves points outside by 2.0e-5;"),
            (Fault::Residual(2e-5), "its Gram matrix misses the Hessian form by 2.0e-5;"),
            (Fault::Indefinite, "its Gram matrix of the Hessian form is not definite;"),
        ] {
            let text = alone(ProgramError::Unusable { stop: None, fault }).to_string();
            assert!(text.contains(&format!("points: {words}")) && text.ends_with("or give fewer points"), "{text}");
        }
        let singular = ProgramError::Unusable { stop: Some(Stop::Stalled), fault: Fault::Singular };
        for why in [ProgramError::Singular, ProgramError::Infeasible, ProgramError::Unbounded, singular] {
            let text = alone(why).to_string();
            assert!(text.ends_with("lower the degree, or add points"), "{text}");
        }
        let failures = vec![
            failure(Solver::Clarabel, gap(Some(Stop::Stalled))),
            failure(Solver::Structured, ProgramError::Rounds(60)),
        ];
        let both = Unsolved { degree: 2, failures, is_solver_fixed: false }.to_string();
        assert_eq!(
            both,
            "clarabel did not solve the program of degree 2 on 412 points: it stalled, and its answer is only known to be \
             within 3.2e-4 of the optimum; structured did not on 412 points: points were still left outside after 60 rounds \
             of adding them; give fewer points"
        );
    }

    /// So do those of groups, proofs and the hierarchy.
    #[test]
    fn texts_of_other_programs_name_them_too() {
        let why = || ProgramError::Unusable { stop: Some(Stop::NumericalError), fault: Fault::Singular };
        let clause = "it met numerical errors, and its matrices are singular";
        let enclosing =
            |source| EncloseError::Unsolved { degree: 6, multiplier_degree: 4, sets: 3, source }.to_string();
        let head = "clarabel found no body of degree 6 with multipliers of degree 4 around 3 set(s)";
        let lower = "lower the degree of the body or of the multipliers, or enclose fewer sets";
        assert_eq!(enclosing(why()), format!("{head}: {clause}; {lower}"));
        let raise = "raise the degree of the multipliers, or that of the body";
        assert_eq!(enclosing(ProgramError::Unbounded), format!("{head}: nothing bounds its objective; {raise}"));
        let hierarchy = |level| HierarchyError::Unsolved { level, rows: 412, why: why() }.to_string();
        let head = |level| {
            format!(
                "level: clarabel did not solve the program of level {level}, whose matrices have 412 entries: {clause}"
            )
        };
        assert_eq!(hierarchy(2), format!("{}; lower the level, or the degree of the sets", head(2)));
        assert_eq!(hierarchy(0), format!("{}; lower the degree of the sets, or raise the level", head(0)));
        assert_eq!(
            NoCertificate::Unsolved { degree: 8, why: why() }.to_string(),
            format!(
                "clarabel did not solve the program of a certificate of degree 8: {clause}; fit a body to points of the set \
                 instead"
            )
        );
        assert_eq!(
            NoContainment::Unsolved { degree: 8, multiplier_degree: 2, why: why() }.to_string(),
            format!(
                "clarabel did not solve the program of a proof of degree 8 with multipliers of degree 2: {clause}; take \
                 multipliers of another degree"
            )
        );
    }
}
