//! The section and the picture of the convex decompositions.

use super::parts::{Divided, Divider};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

const NOTES: &str = "\
- Ours is the search of `sublevel fit --parts`; by gain alone is what it was before, one cut after the other, and competes in it still; V-HACD is that of \
parry3d-f64 with exact hulls, a resolution of 128 voxels (96 or 64 where its hull code panics; no answer if it always does), a concavity limit of 1e-4 and a number of hulls that lets it make as many parts as are asked for (parry makes up to twice `max_convex_hulls`).
- Volume: of all hulls together, in volumes of the object (closed meshes) and of its convex hull. Concavity: the largest distance of 4 000 points, \
uniform on the surfaces of the hulls (seed 1 of SplitMix64), from the object, 0 inside of it, in its diameters; of open meshes from the surface. Left \
out: the largest distance of a vertex of the object from all hulls; ours leave out nothing, which is proven when bodies are fitted to them. Parts \
without volume are not counted. Seconds of the search alone, one thread.
";

/// The section, for the end of the report.
pub(super) fn markdown(divided: &[Divided], picture: Option<&str>) -> String {
    let mut text = String::from("## Convex parts\n\n");
    if let Some(name) = picture {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "![{name}]({name})\n");
    }
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
    text
}

/// One line for each decomposition.
pub(super) fn csv(divided: &[Divided]) -> String {
    let mut text = String::from(
        "object,asked,by,parts,volume_m3,volume_of_object,volume_of_hull,concavity_m,concavity,left_out_m,seconds\n",
    );
    for row in divided.iter().filter(|row| row.parts > 0) {
        let of_object = row.of_object.map_or(String::new(), |of| format!("{of:e}"));
        let _ = writeln!(
            text,
            "{},{},{},{},{:e},{of_object},{:e},{:e},{:e},{:e},{:e}",
            row.object,
            row.asked,
            row.divider.name(),
            row.parts,
            row.volume_m3,
            row.of_hull,
            row.concavity_m,
            row.concavity,
            row.left_out_m,
            row.seconds
        );
    }
    text
}

/// Concavity against volume: lower and further to the left is better.
pub(super) fn picture(divided: &[Divided]) -> Result<String, ChartError> {
    let styles = [(Ink::Blue, Marker::Disc), (Ink::Orange, Marker::Ring), (Ink::Green, Marker::Triangle)];
    let groups = Divider::ALL.into_iter().zip(styles).map(|(divider, (ink, marker))| {
        let rows = divided.iter().filter(|row| row.divider == divider && row.parts > 0 && row.concavity > 0.0);
        let label = |row: &Divided| match divider {
            Divider::Ours => format!("{} {}", row.object, row.asked),
            _ => String::new(),
        };
        let points = rows.map(|row| Point { x: row.of_hull, y: 100.0 * row.concavity, label: label(row) });
        Group { label: divider.name().into(), ink, marker, points: points.collect(), joined: false }
    });
    Scatter {
        title: "Convex parts: lower and further left follows the object closer".into(),
        x_label: "total volume of the parts (volumes of the object's hull)".into(),
        y_label: "concavity (% of the diameter)".into(),
        groups: groups.collect(),
        stairs: Vec::new(),
        edge: None,
        named: None,
    }
    .to_svg()
}
