//! Sign symmetries of a program: changes of the signs of coordinates under which no polynomial of
//! it changes (Löfberg, IEEE Trans. Autom. Control 54, 2009).
//!
//! A change of signs leaves a monomial as it is if it flips an even number of its factors. Those
//! that leave all monomials of all polynomials as they are, are the vectors over GF(2) orthogonal
//! to the parities of these monomials' exponents; monomials that all of them leave as they are have
//! a parity in the span of these. The mean of a functional over the changes is as good, and
//! vanishes on all other monomials: products of two monomials of a basis then count only where the
//! parities of the two differ by one in the span, and each matrix falls apart into blocks.
//!
//! Stored constraints are taken as they are. Coefficients of an objective are known up to the
//! rounding of poses: those whose enclosures contain zero count as zero in the program, and the
//! proof of the bound takes the enclosures off, as it does anyway.

use super::placed_set::PlacedSet;
use sublevel_core::polynomial::{PairExponents, PairPolynomial, Point};

/// Parities of six exponents, one bit each.
type Parity = u8;

/// The span of the parities of a program's monomials, over GF(2).
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SignSymmetry {
    /// A basis whose elements differ in their highest bits, the highest first.
    basis: Vec<Parity>,
}

fn parity(exponents: &PairExponents) -> Parity {
    exponents.iter().enumerate().fold(0, |bits, (k, e)| bits | (e & 1) << k)
}

impl SignSymmetry {
    /// Of objectives over points of sets.
    pub(super) fn new(objectives: &[PairPolynomial], sets: &[(&PlacedSet, Point)]) -> Self {
        let of_sets = sets.iter().flat_map(|(set, point)| {
            let terms = set.set.polynomials.iter().flat_map(|g| g.terms());
            terms.filter(|term| term.1 != 0.0).map(|term| point.exponents(term.0))
        });
        let mut symmetry = Self::default();
        for exponents in objectives.iter().flat_map(PairPolynomial::support).chain(of_sets) {
            symmetry.insert(parity(&exponents));
        }
        symmetry
    }

    /// Without any: one block for each matrix.
    #[cfg(test)]
    pub(super) fn none() -> Self {
        let mut symmetry = Self::default();
        (0..6).for_each(|k| symmetry.insert(1 << k));
        symmetry
    }

    fn insert(&mut self, parity: Parity) {
        let rest = self.rest(parity);
        if rest != 0 {
            self.basis.push(rest);
            self.basis.sort_unstable_by(|a, b| b.cmp(a));
        }
    }

    /// The same for parities that differ by one in the span, and 0 for these themselves.
    fn rest(&self, parity: Parity) -> Parity {
        self.basis.iter().fold(parity, |rest, element| rest.min(rest ^ element))
    }

    /// Whether all sign changes leave a monomial as it is.
    pub(super) fn keeps(&self, exponents: &PairExponents) -> bool {
        self.rest(parity(exponents)) == 0
    }

    /// The blocks of a matrix on products of a basis.
    pub(super) fn blocks(&self, basis: Vec<PairExponents>) -> Vec<Vec<PairExponents>> {
        let mut blocks: Vec<(Parity, Vec<PairExponents>)> = Vec::new();
        for exponents in basis {
            let class = self.rest(parity(&exponents));
            match blocks.iter_mut().find(|block| block.0 == class) {
                Some((_, block)) => block.push(exponents),
                None => blocks.push((class, vec![exponents])),
            }
        }
        blocks.into_iter().map(|block| block.1).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{SignSymmetry, parity};
    use sublevel_core::polynomial::PairExponents;
    use sublevel_testkit::Seeded;

    /// By trial of all 64 changes of signs: those that leave the monomials of a program as they are
    /// leave as they are what is kept, and products of two monomials of a block and of no others.
    #[test]
    fn blocks_are_those_that_all_sign_changes_leave() {
        let mut nontrivial = 0;
        for seed in 0..400 {
            let mut random = Seeded(seed);
            let mut draw = |count: usize| -> Vec<PairExponents> {
                (0..count).map(|_| std::array::from_fn(|_| [0, 0, 2, 1, 3][random.index(5)])).collect()
            };
            let (program, basis) = (draw(1 + seed as usize % 7), draw(20));
            let mut symmetry = SignSymmetry::default();
            program.iter().for_each(|e| symmetry.insert(parity(e)));
            let sign = |change: u8, e: &PairExponents| {
                let flips = (0..6).filter(|k| change >> k & 1 == 1).map(|k| u32::from(e[k])).sum::<u32>();
                if flips % 2 == 0 { 1 } else { -1 }
            };
            let changes: Vec<u8> = (0..64).filter(|&change| program.iter().all(|e| sign(change, e) == 1)).collect();
            nontrivial += usize::from(changes.len() > 1);
            let kept = |e: &PairExponents| changes.iter().all(|&change| sign(change, e) == 1);
            assert!(basis.iter().all(|e| symmetry.keeps(e) == kept(e)), "seed {seed}");
            let blocks = symmetry.blocks(basis.clone());
            assert_eq!(blocks.concat().len(), basis.len(), "seed {seed}");
            for (i, block) in blocks.iter().enumerate() {
                for (j, other) in blocks.iter().enumerate() {
                    for a in block {
                        for b in other {
                            let product = std::array::from_fn(|k| a[k] + b[k]);
                            assert_eq!(kept(&product), i == j, "seed {seed}: {a:?} {b:?}");
                        }
                    }
                }
            }
            assert!(SignSymmetry::none().blocks(basis).len() == 1, "seed {seed}");
        }
        assert!(nontrivial > 200, "{nontrivial}");
    }
}
