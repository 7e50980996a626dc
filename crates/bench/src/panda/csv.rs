//! The rows as a CSV, and back.

use std::fmt::Write;

use super::rows::{LinkRow, MeshRow, MotionRow, SrdfRow, StateRow, Tables};
use crate::csv::{CsvError, MEASURED, Row, Table, significant};

/// Columns of the table of states.
const STATES: &str = "family,representation,pieces,known,kept,kept_self,random,random_free,contacts,cold_us,scene_us,\
                      given_us,self_us,distances_us,call_us,inside_us";
/// Columns of the table of motions.
const MOTIONS: &str = "family,representation,from,length_rad,problems,free,mean_us,median_us,p99_us,configurations,\
                       sampled_us,coal_us,certified_us,verify_us,verify_part,samples,contacts,coal_samples,coal_contacts";

/// Columns of the table of links.
const LINKS: &str = "representation,link,parts,degree,gap_m";

/// Columns of the table of states against meshes.
const MESHES: &str = "representation,states,free,free_self,contacts,missed";

/// Columns of the table of the SRDF.
const SRDF: &str = "representation,pairs,never,proven,wrong,overlap_m,witness,is_certain,boxes,seconds";

/// The tables, an empty line between them.
pub(super) fn written(Tables { states, motions, links, meshes, srdf }: &Tables) -> String {
    let mut text = format!("{STATES}\n");
    // Writing to a string cannot fail.
    for row in states {
        let StateRow { family, representation, pieces, known, kept, kept_self, random, random_free, .. } = row;
        let _ = write!(
            text,
            "{family},\"{representation}\",{pieces},{known},{kept},{kept_self},{random},{random_free},{}",
            maybe(row.contacts)
        );
        let times = [row.cold_us, row.scene_us, row.given_us, row.self_us, row.distances_us];
        for time in times.into_iter().chain([row.call_us, row.inside_us]) {
            let _ = write!(text, ",{}", number(time));
        }
        text.push('\n');
    }
    let _ = write!(text, "\n{MOTIONS}\n");
    for row in motions {
        let MotionRow { family, representation, from, length_rad, problems, free, .. } = row;
        let _ = write!(text, "{family},\"{representation}\",{from},{length_rad},{problems},{free}");
        let times = [row.mean_us, row.median_us, row.p99_us, row.configurations, row.sampled_us, row.coal_us];
        for time in times.into_iter().chain([row.certified_us, row.verify_us, row.verify_part]) {
            let _ = write!(text, ",{}", number(time));
        }
        let _ = writeln!(
            text,
            ",{},{},{},{}",
            row.samples,
            row.contacts,
            maybe(row.coal_samples),
            maybe(row.coal_contacts)
        );
    }
    let _ = write!(text, "\n{LINKS}\n");
    for LinkRow { representation, link, parts, degree, gap_m } in links {
        let _ = writeln!(text, "\"{representation}\",{link},{parts},{degree},{}", number(*gap_m));
    }
    let _ = write!(text, "\n{MESHES}\n");
    for MeshRow { representation, states, free, free_self, contacts, missed } in meshes {
        let _ = writeln!(text, "\"{representation}\",{states},{free},{free_self},{contacts},{missed}");
    }
    let _ = write!(text, "\n{SRDF}\n");
    for row in srdf {
        let SrdfRow { representation, pairs, never, proven, wrong, witness, is_certain, boxes, .. } = row;
        let (overlap, seconds) = (number(row.overlap_m), number(row.seconds));
        let _ = writeln!(
            text,
            "\"{representation}\",{pairs},{never},{proven},{wrong},{overlap},{witness},{is_certain},{boxes},{seconds}"
        );
    }
    text
}

/// Reads what [`written`] wrote; the tables after that of motions may be missing, and so may the
/// column `given_us` of states.
pub(super) fn read(csv: &str) -> Result<Tables, CsvError> {
    let mut parts = csv.split("\n\n");
    let mut table = || Table::read(parts.next().unwrap_or_default());
    let (states, motions) = (table()?, table()?);
    let mut later = || parts.next().map(Table::read).transpose();
    let (links, meshes, srdf) = (later()?, later()?, later()?);
    Ok(Tables {
        states: states.rows().map(state).collect::<Result<_, _>>()?,
        motions: motions.rows().map(motion).collect::<Result<_, _>>()?,
        links: links.iter().flat_map(Table::rows).map(link).collect::<Result<_, _>>()?,
        meshes: meshes.iter().flat_map(Table::rows).map(mesh).collect::<Result<_, _>>()?,
        srdf: srdf.iter().flat_map(Table::rows).map(of_srdf).collect::<Result<_, _>>()?,
    })
}

fn mesh(row: Row<'_>) -> Result<MeshRow, CsvError> {
    Ok(MeshRow {
        representation: row.text("representation")?.to_owned(),
        states: row.get("states")?,
        free: row.get("free")?,
        free_self: row.get("free_self")?,
        contacts: row.get("contacts")?,
        missed: row.get("missed")?,
    })
}

fn of_srdf(row: Row<'_>) -> Result<SrdfRow, CsvError> {
    Ok(SrdfRow {
        representation: row.text("representation")?.to_owned(),
        pairs: row.get("pairs")?,
        never: row.get("never")?,
        proven: row.get("proven")?,
        wrong: row.text("wrong")?.to_owned(),
        overlap_m: row.number("overlap_m")?,
        witness: row.text("witness")?.to_owned(),
        is_certain: row.get("is_certain")?,
        boxes: row.get("boxes")?,
        seconds: row.number("seconds")?,
    })
}

fn link(row: Row<'_>) -> Result<LinkRow, CsvError> {
    Ok(LinkRow {
        representation: row.text("representation")?.to_owned(),
        link: row.text("link")?.to_owned(),
        parts: row.get("parts")?,
        degree: row.get("degree")?,
        gap_m: row.number("gap_m")?,
    })
}

fn state(row: Row<'_>) -> Result<StateRow, CsvError> {
    Ok(StateRow {
        family: row.text("family")?.to_owned(),
        representation: row.text("representation")?.to_owned(),
        pieces: row.get("pieces")?,
        known: row.get("known")?,
        kept: row.get("kept")?,
        kept_self: row.get("kept_self")?,
        random: row.get("random")?,
        random_free: row.get("random_free")?,
        contacts: row.maybe("contacts")?,
        cold_us: row.number("cold_us")?,
        scene_us: row.number("scene_us")?,
        // Earlier runs did not have it.
        given_us: row.text("given_us").map_or(Ok(f64::NAN), |_| row.number("given_us"))?,
        self_us: row.number("self_us")?,
        distances_us: row.number("distances_us")?,
        call_us: row.number("call_us")?,
        inside_us: row.number("inside_us")?,
    })
}

fn motion(row: Row<'_>) -> Result<MotionRow, CsvError> {
    Ok(MotionRow {
        family: row.text("family")?.to_owned(),
        representation: row.text("representation")?.to_owned(),
        from: row.text("from")?.to_owned(),
        length_rad: row.number("length_rad")?,
        problems: row.get("problems")?,
        free: row.get("free")?,
        mean_us: row.number("mean_us")?,
        median_us: row.number("median_us")?,
        p99_us: row.number("p99_us")?,
        configurations: row.number("configurations")?,
        sampled_us: row.number("sampled_us")?,
        coal_us: row.number("coal_us")?,
        certified_us: row.number("certified_us")?,
        verify_us: row.number("verify_us")?,
        verify_part: row.number("verify_part")?,
        samples: row.get("samples")?,
        contacts: row.get("contacts")?,
        coal_samples: row.maybe("coal_samples")?,
        coal_contacts: row.maybe("coal_contacts")?,
    })
}

/// Four digits; nothing of what is not measured.
fn number(value: f64) -> String {
    if value.is_nan() { String::new() } else { significant(value, MEASURED).to_string() }
}

fn maybe(count: Option<usize>) -> String {
    count.map(|count| count.to_string()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back() {
        let state = StateRow {
            family: "box".into(),
            representation: "hulls, coal".into(),
            pieces: 11,
            known: 200,
            kept: 199,
            kept_self: 198,
            random: 300,
            random_free: 280,
            contacts: None,
            cold_us: 2.5,
            scene_us: 1.25,
            given_us: 0.75,
            self_us: 3.0,
            distances_us: 100.0,
            call_us: 4.0,
            inside_us: 3.5,
        };
        let motion = MotionRow {
            family: "all".into(),
            representation: "degree 6".into(),
            from: "goals".into(),
            length_rad: 0.5,
            problems: 100,
            free: 90,
            mean_us: 50.0,
            median_us: 40.0,
            p99_us: 400.0,
            configurations: 7.5,
            sampled_us: 200.0,
            coal_us: 300.0,
            certified_us: 60.0,
            verify_us: 9.0,
            verify_part: 0.1875,
            samples: 90_000,
            contacts: 0,
            coal_samples: Some(1530),
            coal_contacts: None,
        };
        let link = LinkRow {
            representation: "degree 6".into(),
            link: "panda_link1".into(),
            parts: 2,
            degree: 6,
            gap_m: 0.0125,
        };
        let mesh = MeshRow {
            representation: "degree 6".into(),
            states: 1000,
            free: 900,
            free_self: 800,
            contacts: 90,
            missed: 1,
        };
        let srdf = SrdfRow {
            representation: "degree 6 refined, as by default".into(),
            pairs: 55,
            never: 23,
            proven: 22,
            wrong: "link2 and link6".into(),
            overlap_m: 0.0625,
            witness: "0.0000 1.5000".into(),
            is_certain: true,
            boxes: 1 << 33,
            seconds: 2.5,
        };
        let (states, motions, links) = (vec![state], vec![motion], vec![link]);
        let all = Tables { states, motions, links, meshes: vec![mesh], srdf: vec![srdf] };
        let text = written(&all);
        assert_eq!(read(&text), Ok(all.clone()));
        // Earlier runs did not measure states at given poses.
        let without = text.replace("scene_us,given_us,", "scene_us,").replace(",1.25,0.75,", ",1.25,");
        let mut earlier = read(&without).expect("a CSV without the column");
        assert!(earlier.states[0].given_us.is_nan());
        earlier.states[0].given_us = 0.75;
        assert_eq!(earlier, all);
        assert!(read(&text.replace(",0.75,", ",fast,")).is_err());
        // Earlier runs wrote fewer tables.
        let tables: Vec<&str> = text.split("\n\n").collect();
        let before = |count: usize| read(&tables[..count].join("\n\n"));
        assert_eq!(before(4), Ok(Tables { srdf: Vec::new(), ..all.clone() }));
        assert_eq!(before(3), Ok(Tables { meshes: Vec::new(), srdf: Vec::new(), ..all.clone() }));
        let Tables { states, motions, .. } = all;
        assert_eq!(before(2), Ok(Tables { states, motions, ..Tables::default() }));
        assert!(before(1).is_err());
        assert!(read("family\nbox\n").is_err());
    }
}
