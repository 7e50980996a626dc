//! What pages show of `panda.csv`: tables and pictures.

use std::fmt::Write;

use sublevel::draw::ChartError;

use super::csv::read;
use super::pictures::{chart_of_families, chart_of_motions, chart_of_states};
use super::rows::{ALL, COAL, LinkRow, MeshRow, MotionRow, SrdfRow, StateRow, Tables};
use super::summary::{Figure, summary};
use crate::csv::CsvError;

/// The tables of a CSV.
pub(crate) struct Shown(Tables);

impl Shown {
    /// Reads what [`Panda::csv`](super::Panda::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        read(csv).map(Self)
    }

    /// The pictures by name.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        Ok(vec![
            ("panda-states.svg".into(), chart_of_states(&self.0.states)?),
            ("panda-families.svg".into(), chart_of_families(&self.0.states, &self.families())?),
            ("panda-motions.svg".into(), chart_of_motions(&self.0.states, &self.0.motions)?),
        ])
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "summary" => Some(self.summary()),
            "states" => Some(self.table_of_states()),
            "families" => Some(self.table_of_families()),
            "links" => Some(self.table_of_links()),
            "meshes" => Some(self.table_of_meshes()),
            "srdf" => Some(self.table_of_srdf()),
            "motions" => Some(self.table_of_motions()),
            "proofs" => Some(self.table_of_proofs()),
            "motions of families" => Some(self.table_of_motion_families()),
            _ => None,
        }
    }

    fn summary(&self) -> String {
        let mut text = String::from("| figure | value |\n|---|---|\n");
        for Figure { what, value, unit } in summary(&self.0) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| {what} | {} |", unit.text(value));
        }
        text
    }

    fn states_of(&self, family: &str) -> impl Iterator<Item = &StateRow> {
        self.0.states.iter().filter(move |row| row.family == family)
    }

    fn table_of_states(&self) -> String {
        // Earlier runs did not have it.
        let has_given = self.states_of(ALL).any(|row| row.given_us.is_finite());
        let [given_head, given_rule] = if has_given { [" poses given µs | of coal |", "---|---|"] } else { ["", ""] };
        let mut text = format!(
            "| links as | convex pieces | known-free states kept | with self-collision | contacts missed | cold µs | µs | \
             of coal |{given_head} with self-collision µs | all distances µs | of coal | gRPC µs | in process µs |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|{given_rule}\n",
        );
        let coal = self.states_of(ALL).find(|row| row.representation == COAL);
        let of_coal = |value: fn(&StateRow) -> f64, row: &StateRow| ratio(value(row) / coal.map_or(f64::NAN, value));
        for row in self.states_of(ALL) {
            let is_coal = row.representation == COAL;
            let kept_self = if is_coal { "-".into() } else { share(row.kept_self, row.known) };
            let missed = match row.contacts {
                Some(contacts) if !is_coal => {
                    format!("{contacts} of {}", coal.and_then(|row| row.contacts).unwrap_or(0))
                }
                _ => "-".into(),
            };
            let given = if has_given {
                format!(" {} | {} |", time(row.given_us), of_coal(|row| row.given_us, row))
            } else {
                String::new()
            };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {kept_self} | {missed} | {} | {} | {} |{given} {} | {} | {} | {} | {} |",
                row.representation,
                row.pieces,
                share(row.kept, row.known),
                time(row.cold_us),
                time(row.scene_us),
                of_coal(|row| row.scene_us, row),
                time(row.self_us),
                time(row.distances_us),
                of_coal(|row| row.distances_us, row),
                time(row.call_us),
                time(row.inside_us),
            );
        }
        text
    }

    /// States kept and µs per state, a column for each family.
    fn table_of_families(&self) -> String {
        let families = self.families();
        let mut text = format!("| links as | {} |\n|---|{}\n", families.join(" | "), "---|".repeat(families.len()));
        for row in self.states_of(ALL) {
            let cell = |family: &&str| {
                let found = self.states_of(family).find(|own| own.representation == row.representation);
                found.map_or("-".into(), |row| format!("{}, {}", share(row.kept, row.known), time(row.scene_us)))
            };
            let cells: Vec<String> = families.iter().map(cell).collect();
            let _ = writeln!(text, "| {} | {} |", row.representation, cells.join(" | "));
        }
        text
    }

    /// Parts, degree and gap of each link, a column for each representation.
    fn table_of_links(&self) -> String {
        let (mut representations, mut links): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
        for row in &self.0.links {
            for (known, name) in [(&mut representations, &row.representation), (&mut links, &row.link)] {
                if !known.contains(&name.as_str()) {
                    known.push(name);
                }
            }
        }
        let heads = representations.join(" | ");
        let mut text = format!("| link | {heads} |\n|---|{}\n", "---|".repeat(representations.len()));
        for link in links {
            let cell = |name: &&str| {
                let found = self.0.links.iter().find(|row| row.representation == **name && row.link == link);
                let Some(LinkRow { parts, degree, gap_m, .. }) = found else { return "-".into() };
                let parts = if *parts == 1 { String::new() } else { format!("{parts} of ") };
                let gap = if gap_m.is_nan() { "unknown".into() } else { format!("{:.1} mm", 1e3 * gap_m) };
                format!("{parts}degree {degree}, {gap}")
            };
            let cells: Vec<String> = representations.iter().map(cell).collect();
            let _ = writeln!(text, "| {link} | {} |", cells.join(" | "));
        }
        text
    }

    fn table_of_meshes(&self) -> String {
        let mut text = String::from(
            "| links as | states anywhere | proven free | with self-collision | meshes meet | of these called free |\n\
             |---|---|---|---|---|---|\n",
        );
        for MeshRow { representation, states, free, free_self, contacts, missed } in &self.0.meshes {
            let _ = writeln!(text, "| {representation} | {states} | {free} | {free_self} | {contacts} | {missed} |");
        }
        text
    }

    fn table_of_srdf(&self) -> String {
        let mut text = String::from(
            "| links as | pairs of links | Never, says the SRDF | of these proven | of these wrong | overlap | at rad | boxes | s |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for SrdfRow { representation, pairs, never, proven, wrong, overlap_m, witness, boxes, seconds, .. } in
            &self.0.srdf
        {
            let _ = writeln!(
                text,
                "| {representation} | {pairs} | {never} | {proven} | {wrong} | {:.1} mm | {witness} | {boxes} | {seconds:.1} |",
                1e3 * overlap_m
            );
        }
        text
    }

    /// Names of the families in their order.
    fn families(&self) -> Vec<&str> {
        let mut families: Vec<&str> = Vec::new();
        for row in &self.0.states {
            if row.family != ALL && !families.contains(&row.family.as_str()) {
                families.push(&row.family);
            }
        }
        families
    }

    fn table_of_motions(&self) -> String {
        let mut text = String::from(
            "| links as | edges from | rad | free edges | proof µs per rad | sampled at 1/32 rad µs per rad | proof of sampled | \
             coal, 32 states per rad µs per rad | proof of coal |\n|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in self.0.motions.iter().filter(|row| row.family == ALL) {
            let per_rad = |us: f64| time(us / row.length_rad);
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} of {} | {} | {} | {} | {} | {} |",
                row.representation,
                row.from,
                row.length_rad,
                row.free,
                row.problems,
                per_rad(row.mean_us),
                per_rad(row.sampled_us),
                ratio(row.mean_us / row.sampled_us),
                per_rad(row.coal_us),
                ratio(row.mean_us / row.coal_us),
            );
        }
        text
    }

    fn table_of_proofs(&self) -> String {
        let mut text = String::from(
            "| links as | edges from | rad | median µs | in state checks | in checks of samples | 99 % µs | in state checks | \
             in checks of samples | mean configurations | with certificate, of the proof | verification, of the proof | samples | in contact |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in self.0.motions.iter().filter(|row| row.family == ALL) {
            let own = self.states_of(ALL).find(|own| own.representation == row.representation);
            let state_us = own.map_or(f64::NAN, |own| own.self_us);
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                row.representation,
                row.from,
                row.length_rad,
                time(row.median_us),
                checks(row.median_us / state_us),
                checks(row.median_us / row.sample_us()),
                time(row.p99_us),
                checks(row.p99_us / state_us),
                checks(row.p99_us / row.sample_us()),
                checks(row.configurations),
                ratio(row.certified_us / row.mean_us),
                ratio(row.verify_part),
                row.samples,
                row.contacts,
            );
        }
        text
    }

    /// µs per radian that is proven, a column for each family.
    fn table_of_motion_families(&self) -> String {
        let families = self.families();
        let mut text = format!(
            "| links as | edges from | rad | {} |\n|---|---|---|{}\n",
            families.join(" | "),
            "---|".repeat(families.len())
        );
        for row in self.0.motions.iter().filter(|row| row.family == ALL) {
            let is_same = |own: &&MotionRow| {
                own.representation == row.representation && own.from == row.from && own.length_rad == row.length_rad
            };
            let cell = |family: &&str| {
                let found = self.0.motions.iter().filter(|own| own.family == *family).find(is_same);
                found.map_or("-".into(), |own| time(own.us_per_rad()))
            };
            let cells: Vec<String> = families.iter().map(cell).collect();
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} |",
                row.representation,
                row.from,
                row.length_rad,
                cells.join(" | ")
            );
        }
        text
    }
}

fn share(part: usize, of: usize) -> String {
    format!("{:.2} %", 100.0 * part as f64 / of as f64)
}

/// Microseconds with three digits.
fn time(us: f64) -> String {
    match us {
        _ if us.is_nan() => "-".into(),
        _ if us < 10.0 => format!("{us:.2}"),
        _ if us < 100.0 => format!("{us:.1}"),
        _ => format!("{us:.0}"),
    }
}

fn ratio(value: f64) -> String {
    if value.is_nan() { "-".into() } else { format!("{value:.2}") }
}

fn checks(value: f64) -> String {
    if value.is_nan() { "-".into() } else { format!("{value:.1}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_at_given_poses_are_shown_where_they_were_measured() {
        let heads = "family,representation,pieces,known,kept,kept_self,random,random_free,contacts,cold_us,scene_us";
        let motions = "family,representation\n";
        let table = |given: &str, ours: &str, coal: &str| {
            let csv = format!(
                "{heads},{given}self_us,distances_us,call_us,inside_us\n\
                 all,\"degree 6\",11,200,199,198,300,280,0,2.5,2.0,{ours}3.0,50,4.0,3.5\n\
                 all,\"hulls, coal\",11,200,200,0,300,279,21,10,8.0,{coal},100,,\n\n{motions}"
            );
            Shown::read(&csv).expect("a CSV").block("states").expect("a table")
        };
        let (with, without) = (table("given_us,", "1.6,", "8.0,"), table("", "", ""));
        assert!(
            with.contains("| cold µs | µs | of coal | poses given µs | of coal | with self-collision µs |"),
            "{with}"
        );
        assert!(with.contains("| 2.50 | 2.00 | 0.25 | 1.60 | 0.20 | 3.00 | 50.0 | 0.50 |"), "{with}");
        assert!(with.contains("| 10.0 | 8.00 | 1.00 | 8.00 | 1.00 | - | 100 | 1.00 |"), "{with}");
        assert!(
            !without.contains("given") && without.contains("| 2.50 | 2.00 | 0.25 | 3.00 | 50.0 | 0.50 |"),
            "{without}"
        );
        for table in [with, without] {
            let cells: Vec<usize> = table.lines().map(|line| line.matches('|').count()).collect();
            assert!(cells.len() == 4 && cells.iter().all(|count| *count == cells[0]), "{table}");
        }
    }
}
