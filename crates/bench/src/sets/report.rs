//! The report and the CSV.

use std::fmt::Write;

use super::Sets;
use super::counterexample::Level;
use super::models::Model;
use super::pairs::Bracket;
use crate::blocks::block;
use crate::csv::{MEASURED, rounded_down, rounded_up, significant};

/// Decimal digits of bounds, whose differences are drawn down to 1e-9.
const BOUNDS: usize = 11;

impl Sets {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let flags = if self.quick { " --quick" } else { "" };
        let head = self.machine.head(&format!("sublevel-bench sets --data DIR{flags}"));
        let [widths, hierarchy, counterexample, models] =
            ["widths", "hierarchy", "counterexample", "models"].map(|name| block("sets.csv", name, ""));
        format!(
            "# Sets that need not be convex\n\n{head}\n\n\
             ## Brackets against time\n\n\
             Random pairs of polynomials `x^n + y^n + z^n` and random lower terms, whose sets bend inwards, 3 to 5 units apart. Branch \
             and bound is stopped after a number of divisions, each time from nothing; the width of its bracket is relative to the \
             distance found. Every bracket of a pair, by either method, meets every other: the run fails otherwise.\n\n{widths}\n\
             ## The hierarchy\n\n\
             The experiment of section IV-A of the paper: how often level 0 is exact for sets that are not convex. A bound is called exact \
             where it meets the distance of two points that are proven to be in the sets.\n\n{hierarchy}\n\
             All examples of the paper are exact at level 0. This pair is not: the set `(x^2 - 1)^2 + x/2 + y^2 + z^2 + 0.9 <= 1`, two wells of which \
             only the farther one is deep enough, and a ball of radius 0.1 m about (2, 0, 0) m.\n\n{counterexample}\n\
             ## Models of objects\n\n\
             Balls of 2 % of the diameter of an object, at random places 1 to 30 % of it away from the object's surface, some of them inside \
             of what it encloses. The error of a model is the mean difference of its distance from that of the mesh; a false contact is a \
             ball that touches the model and not the mesh. All queries cold, one thread, accuracy 1 % of the ball. Sets that could not be \
             proven are left out. The convex hull is exact, its distances are those of parry without proof.\n\n{models}"
        )
    }

    /// A row for each bracket and each model.
    pub fn csv(&self) -> String {
        let mut text = String::from("row,of,name,degree,steps,seconds,lower,upper,exact,error,false_contacts\n");
        for bracket in &self.brackets {
            let Bracket { degree, pair, method, steps, seconds, lower, upper, exact } = bracket;
            let exact = u8::from(*exact);
            let seconds = significant(*seconds, MEASURED);
            let (lower, upper) = (rounded_down(*lower, BOUNDS), rounded_up(*upper, BOUNDS));
            // Writing to a string cannot fail.
            let _ = writeln!(text, "pair,{pair},{method},{degree},{steps},{seconds},{lower},{upper},{exact},,");
        }
        for Level { level, seconds, lower, upper, exact } in &self.counterexample {
            let exact = u8::from(*exact);
            let seconds = significant(*seconds, MEASURED);
            let (lower, upper) = (rounded_down(*lower, BOUNDS), rounded_up(*upper, BOUNDS));
            let _ = writeln!(text, "counterexample,{level},,,,{seconds},{lower},{upper},{exact},,");
        }
        for Model { object, kind, name, error, false_contacts, seconds } in &self.models {
            let [seconds, error, false_contacts] =
                [seconds, error, false_contacts].map(|value| significant(*value, MEASURED));
            let _ = writeln!(text, "{kind},{object},{name},,,{seconds},,,,{error},{false_contacts}");
        }
        text
    }
}
