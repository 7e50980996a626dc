//! The section and the picture of the convex decompositions.

use super::parts::{Divided, Divider, OBJECTS};
use crate::blocks::block;
use crate::comparison::parry_version;
use crate::csv::{CsvError, MEASURED, Row, Table, significant};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter, Stairs};

const NOTES: &str = "\
- Ours is the search of `sublevel fit --parts`; by gain alone is what it was before, one cut after the other, and competes in it still. V-HACD is that of \
parry3d-f64 with exact hulls, resolutions of 64 and 128 voxels, a concavity limit of 1e-4, and defaults otherwise. It has half the number of parts for \
`max_convex_hulls`: parry makes up to twice as many, as it goes one level deeper and leaves out the step that merges parts again, which other \
implementations of V-HACD have. No answer: its hull code panics.
- Volume: of all hulls together, in volumes of the object (closed meshes) and of its convex hull. Concavity: the largest distance of 4 000 points, \
uniform on the surfaces of the hulls (seed 1 of SplitMix64), from the object, 0 inside of it, in its diameters; of open meshes from the surface. Left \
out: the largest distance of a vertex of the object from all hulls; ours leave out nothing, which is proven when bodies are fitted to them. Parts \
without volume are not counted. Seconds of the search alone, one thread.
";

/// The section, for the end of the report, but for what [`Shown`] writes into its block.
pub(super) fn markdown() -> String {
    let parry = parry_version();
    format!("## Convex parts\n\nParry is parry3d-f64 {parry}.\n\n{}", block("detail-parts.csv", "parts", ""))
}

/// The decompositions of a CSV.
pub(crate) struct Shown {
    divided: Vec<Divided>,
}

impl Shown {
    /// Reads what [`csv`] wrote.
    pub(crate) fn read(text: &str) -> Result<Self, CsvError> {
        let divided = Table::read(text)?.rows().map(|row| divided(&row)).collect::<Result<_, _>>()?;
        Ok(Self { divided })
    }

    /// The picture with its name.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        Ok(vec![("detail-parts.svg".to_owned(), picture(&self.divided)?)])
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        (name == "parts").then(|| table(&self.divided))
    }
}

fn divided(row: &Row<'_>) -> Result<Divided, CsvError> {
    let (object, by) = (row.text("object")?, row.text("by")?);
    let known = OBJECTS.into_iter().map(|(name, _)| name).find(|name| *name == object);
    let divider = Divider::ALL.into_iter().find(|divider| divider.name() == by);
    Ok(Divided {
        object: known.ok_or_else(|| row.error(format!("no object is named '{object}'")))?,
        divider: divider.ok_or_else(|| row.error(format!("nobody named '{by}' divides objects")))?,
        asked: row.get("asked")?,
        parts: row.get("parts")?,
        volume_m3: row.number("volume_m3")?,
        of_hull: row.number("volume_of_hull")?,
        of_object: row.maybe("volume_of_object")?,
        concavity_m: row.number("concavity_m")?,
        concavity: row.number("concavity")?,
        left_out_m: row.number("left_out_m")?,
        seconds: row.number("seconds")?,
    })
}

/// The picture, how to read the table, the table and the verdict.
fn table(divided: &[Divided]) -> String {
    let mut text = String::from("![detail-parts.svg](detail-parts.svg)\n\n");
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{NOTES}\n| object | parts asked | by | parts | volume, of the object | of its hull | concavity | left out m | seconds |\n\
         |---|---|---|---|---|---|---|---|---|"
    );
    for row in divided {
        if row.parts == 0 {
            let _ = writeln!(
                text,
                "| {} | {} | {} | no answer | - | - | - | - | - |",
                row.object,
                row.asked,
                row.divider.name()
            );
            continue;
        }
        let of_object = row.of_object.map_or("open".to_owned(), |of| format!("{of:.3}"));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {of_object} | {:.3} | {:.2} % | {:.1e} | {:.2} |",
            row.object,
            row.asked,
            row.divider.name(),
            row.parts,
            row.of_hull,
            100.0 * row.concavity,
            row.left_out_m,
            row.seconds
        );
    }
    text.push('\n');
    text + &verdict(divided)
}

/// Concavities that differ by less, as a part, count as equal: so far apart are those of samples of
/// one and the same hull.
const SAMPLING: f64 = 0.05;

/// Where ours or the better of the two of V-HACD comes closer, at equal numbers of parts asked for.
fn verdict(divided: &[Divided]) -> String {
    let pairs: Vec<(&Divided, f64, f64)> = divided
        .iter()
        .filter(|row| row.divider == Divider::Ours)
        .filter_map(|ours| {
            let others = peers_of(divided, ours);
            let least = others.clone().map(|row| row.volume_m3).min_by(f64::total_cmp)?;
            Some((ours, least, others.map(|row| row.concavity).min_by(f64::total_cmp)?))
        })
        .collect();
    let lost = |rows: Vec<String>| {
        let list = if rows.is_empty() { String::new() } else { format!(" ({})", rows.join(", ")) };
        format!("{} of {}{list}", rows.len(), pairs.len())
    };
    let place = |row: &Divided| format!("{} with {}", row.object, row.asked);
    let volumes = pairs.iter().filter(|(ours, least, _)| least < &ours.volume_m3);
    let volumes = volumes.map(|(ours, least, _)| {
        let less = 100.0 * (1.0 - least / ours.volume_m3);
        format!("{} by {less:.1} %", place(ours))
    });
    let concavities = pairs.iter().filter(|(ours, _, least)| *least < (1.0 - SAMPLING) * ours.concavity);
    let concavities = concavities
        .map(|(ours, _, least)| format!("{}: {:.2} to {:.2} %", place(ours), 100.0 * least, 100.0 * ours.concavity));
    let ratio = pairs.iter().map(|(ours, least, _)| (ours.volume_m3 / least).ln()).sum::<f64>() / pairs.len() as f64;
    format!(
        "The better of V-HACD's two answers has less volume than ours in {}, and less concavity, by more than the {:.0} % that samples of the same hull may differ, in {}. Ours has {:.2} times its volume in the \
         geometric mean.\n",
        lost(volumes.collect()),
        100.0 * SAMPLING,
        lost(concavities.collect()),
        ratio.exp()
    )
}

/// One line for each decomposition.
pub(super) fn csv(divided: &[Divided]) -> String {
    let mut text = String::from(
        "object,asked,by,parts,volume_m3,volume_of_object,volume_of_hull,concavity_m,concavity,left_out_m,seconds\n",
    );
    for row in divided {
        if row.parts == 0 {
            let _ = writeln!(text, "{},{},{},0,,,,,,,", row.object, row.asked, row.divider.name());
            continue;
        }
        let short = |value: f64| significant(value, MEASURED);
        let of_object = row.of_object.map_or(String::new(), |of| format!("{:e}", short(of)));
        let _ = writeln!(
            text,
            "{},{},{},{},{:e},{of_object},{:e},{:e},{:e},{:e},{:e}",
            row.object,
            row.asked,
            row.divider.name(),
            row.parts,
            short(row.volume_m3),
            short(row.of_hull),
            short(row.concavity_m),
            short(row.concavity),
            short(row.left_out_m),
            short(row.seconds)
        );
    }
    text
}

/// Volume as a part of V-HACD's against that: lower is better, and below the line better than
/// V-HACD.
fn picture(divided: &[Divided]) -> Result<String, ChartError> {
    let styles = [(Divider::Ours, Ink::Blue, Marker::Disc), (Divider::Greedy, Ink::Orange, Marker::Ring)];
    let groups: Vec<Group> = styles
        .into_iter()
        .map(|(divider, ink, marker)| {
            let rows = divided.iter().filter(|row| row.divider == divider && row.parts > 0);
            let points = rows.filter_map(|row| {
                let least = peers_of(divided, row).map(|other| other.volume_m3).min_by(f64::total_cmp)?;
                let label = match divider {
                    Divider::Ours => format!("{} {}", row.object, row.asked),
                    _ => String::new(),
                };
                Some(Point { x: least * row.of_hull / row.volume_m3, y: row.volume_m3 / least, label })
            });
            Group { label: divider.name(), ink, marker, points: points.collect(), joined: false }
        })
        .collect();
    let leftmost = groups.iter().flat_map(|group| &group.points).map(|point| point.x).fold(f64::INFINITY, f64::min);
    let equal = Stairs { label: "as V-HACD".into(), ink: Ink::Grey, dashed: true, points: vec![(leftmost, 1.0)] };
    Scatter {
        title: "Convex parts: total volume of the hulls, lower follows the object closer".into(),
        x_label: "volume of the better of V-HACD's two answers (volumes of the object's hull)".into(),
        y_label: "volume (of V-HACD's)".into(),
        groups,
        stairs: vec![equal],
        edge: None,
        named: None,
    }
    .to_svg()
}

/// What V-HACD made of the same object and number of parts.
fn peers_of<'a>(divided: &'a [Divided], of: &'a Divided) -> impl Iterator<Item = &'a Divided> + Clone {
    divided.iter().filter(|row| {
        let same = row.object == of.object && row.asked == of.asked && row.parts > 0;
        same && matches!(row.divider, Divider::Vhacd(_))
    })
}
