//! Which pairs of links can touch at all.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;

use serde::Serialize;

use crate::cli::progress::progress_bar;
use crate::jobs::derive;
use crate::robot::counted;
use crate::robot::motion::{DEFAULT_DERIVE_RESOLUTION_M, DEFAULT_MAX_BOXES, PairClass};
use crate::store::{DeriveOutcome, DeriveRequest, DerivedLinkPair, LoadedRobot};

/// What was proven of the pairs of links of a robot.
#[derive(Serialize)]
pub(super) struct Pairs {
    /// Names of the joints, in the order of witnesses.
    joints: Vec<String>,
    #[serde(flatten)]
    outcome: DeriveOutcome,
}

/// Looks at every pair of links with geometry.
pub(super) fn derived(loaded: &LoadedRobot) -> Result<Pairs, Box<dyn Error>> {
    let request = DeriveRequest {
        robot: *loaded.robot.id(),
        margin_m: 0.0,
        max_boxes: DEFAULT_MAX_BOXES,
        resolution_m: DEFAULT_DERIVE_RESOLUTION_M,
    };
    let bar = progress_bar("pairs");
    let outcome = derive(&request, loaded, &mut |at| {
        if at.boxes % 256 == 0 {
            bar.set_message(format!("{} of {}, {}", at.done + 1, at.pairs, counted(at.boxes, "box", "boxes")));
        }
        ControlFlow::Continue(())
    })?;
    bar.finish_and_clear();
    let joints = loaded.robot.kinematics().variables().iter().map(|variable| variable.name.to_string()).collect();
    Ok(Pairs { joints, outcome })
}

impl Pairs {
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let pairs = &self.outcome.pairs;
        let name = |pair: &DerivedLinkPair| format!("{} {}", pair.links[0], pair.links[1]);
        let width = pairs.iter().map(|pair| name(pair).chars().count()).max().unwrap_or(0).max(5);
        writeln!(out, "{:width$}  {:<10}  least mm    boxes  SRDF", "pair", "touch")?;
        for pair in pairs {
            let least = pair.upper_m.map_or_else(|| "-".to_owned(), |upper| format!("{:.1}", 1e3 * upper));
            let reason = match &pair.srdf_reason {
                None => "checked",
                Some(reason) if reason.is_empty() => "disabled",
                Some(reason) => reason,
            };
            let class = class_name(pair.class);
            writeln!(out, "{:width$}  {class:<10}  {least:>8}  {:>7}  {reason}", name(pair), pair.boxes)?;
        }
        let count = |class| pairs.iter().filter(|pair| pair.class == class).count();
        let classes =
            [PairClass::Adjacent, PairClass::Never, PairClass::Always, PairClass::Collides, PairClass::Undecided];
        let counts = classes.map(|class| format!("{} {}", count(class), class_name(class)));
        let all = counted(pairs.len(), "pair", "pairs");
        writeln!(out, "{all} in {:.1} s: {}", self.outcome.seconds, counts.join(", "))?;
        self.write_srdf(out)
    }

    /// What the SRDF says against what was proven, reason by reason.
    fn write_srdf(&self, out: &mut impl Write) -> io::Result<()> {
        let mut reasons: BTreeMap<&str, Vec<&DerivedLinkPair>> = BTreeMap::new();
        for pair in &self.outcome.pairs {
            if let Some(reason) = &pair.srdf_reason {
                reasons.entry(reason).or_default().push(pair);
            }
        }
        for (reason, pairs) in &reasons {
            let count = |is: fn(&DerivedLinkPair) -> bool| pairs.iter().filter(|pair| is(pair)).count();
            writeln!(
                out,
                "SRDF, {}: {}, {} proven, {}, {} can touch, {} undecided",
                if reason.is_empty() { "without a reason" } else { reason },
                counted(pairs.len(), "pair", "pairs"),
                count(|pair| pair.is_proven() && !pair.contradicts_srdf()),
                counted(count(|pair| pair.class == PairClass::Adjacent), "neighbour", "neighbours"),
                count(DerivedLinkPair::contradicts_srdf),
                count(|pair| pair.class == PairClass::Undecided)
            )?;
        }
        for pair in self.outcome.pairs.iter().filter(|pair| pair.contradicts_srdf()) {
            let values: Vec<String> = match &pair.witness {
                Some(witness) if witness.len() == self.joints.len() => {
                    self.joints.iter().zip(witness).map(|(name, value)| format!("{name} {value:.4}")).collect()
                }
                witness => witness.iter().flatten().map(|value| format!("{value:.4}")).collect(),
            };
            let [a, b] = &pair.links;
            let depth = pair.upper_m.map_or(0.0, |upper| -1e3 * upper);
            let hulls =
                if pair.is_certain { "and so do the hulls of the links" } else { "what the links do is not proven" };
            writeln!(
                out,
                "the SRDF leaves out {a} and {b}; their bodies overlap by {depth:.1} mm ({hulls}) at {}",
                values.join(", ")
            )?;
        }
        Ok(())
    }
}

fn class_name(class: PairClass) -> &'static str {
    match class {
        PairClass::Adjacent => "adjacent",
        PairClass::Never => "never",
        PairClass::Always => "always",
        PairClass::Collides => "can touch",
        PairClass::Undecided => "undecided",
    }
}
