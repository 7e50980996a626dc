//! What a body takes before the first query: time and memory against its degree.

use super::effort::Effort;
use super::growth::{self, Growth, Line, Unit};
use crate::comparison::sweep::median;
use crate::comparison::{ComparisonError, FitCache, Subject};
use std::hint::black_box;
use std::time::Instant;
use sublevel::body::Body;
use sublevel::fit::FitOptions;

/// Repetitions of a pass, whose mean counts.
const REPEATS: usize = 5;

/// Against the degree of a body.
pub(super) fn bodies(
    subject: &Subject,
    effort: &Effort,
    cache: &FitCache,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Growth, ComparisonError> {
    let mut made = Line::new("made of its numbers", Unit::Nanoseconds);
    let mut read = Line::new("read from its file", Unit::Nanoseconds);
    let mut table_read = Line::new("table of heights read as text", Unit::Nanoseconds);
    let mut table = Line::new("table of heights", Unit::Bytes);
    let mut table_text = Line::new("table of heights as text", Unit::Bytes);
    let mut file = Line::new("file, without the table", Unit::Bytes);
    for &degree in effort.degrees {
        announce(&format!("body of degree {degree}"))?;
        let options = FitOptions { degree, ..FitOptions::default() };
        let body = cache.body(subject.name, &subject.mesh, &options)?;
        let failed = |what: String| ComparisonError::Representation {
            mesh: subject.name,
            method: format!("degree {degree}"),
            what,
        };
        let text = body.to_json();
        let heights = heights_as_text(&body);
        let size = degree as f64;
        let again = || {
            let (normalization, constraints) = (*body.normalization(), body.constraints().to_vec());
            Body::new(body.name(), normalization, constraints)
        };
        made.points.push((size, timed(effort.passes, again).map_err(|error| failed(error.to_string()))?));
        let loaded = timed(effort.passes, || Body::from_json(&text));
        read.points.push((size, loaded.map_err(|error| failed(error.to_string()))?));
        let numbers = timed(effort.passes, || serde_json::from_str::<Vec<f64>>(&heights));
        table_read.points.push((size, numbers.map_err(|error| failed(error.to_string()))?));
        table.points.push((size, body.heights_bytes() as f64));
        table_text.points.push((size, heights.len() as f64));
        file.points.push((size, text.len() as f64));
    }
    Ok(Growth {
        axis: growth::BODY,
        what: format!(
            "{} as a body of one constraint. Made of its numbers it is proven again, and the table of its support heights is made; read from its \
             file also every number of that is compared with the one that is made. Files do not hold the table: the text is what it would \
             add to them, and reading that comes before any proof.",
            subject.name
        ),
        lines: vec![made, read, table_read, table, table_text, file],
    })
}

/// As many heights as the table has, each with all its digits, as a file would hold them.
fn heights_as_text(body: &Body) -> String {
    let count = body.heights_bytes() / size_of::<f64>();
    let along = |index: usize| {
        // Any directions, all of them different.
        let angle = index as f64;
        body.height(&nalgebra::Vector3::new(angle.sin(), angle.cos(), (0.7 * angle).sin()))
    };
    let numbers: Vec<String> = (0..count).map(|index| format!("{:?}", along(index))).collect();
    format!("[{}]", numbers.join(","))
}

/// Nanoseconds of a piece of work, the median of the passes.
fn timed<T, E>(passes: usize, work: impl Fn() -> Result<T, E>) -> Result<f64, E> {
    let mut runs = Vec::new();
    for _ in 0..passes {
        let start = Instant::now();
        for _ in 0..REPEATS {
            black_box(work()?);
        }
        runs.push(start.elapsed().as_nanos() as f64 / REPEATS as f64);
    }
    Ok(median(&runs))
}

#[cfg(test)]
mod tests {
    use super::heights_as_text;
    use nalgebra::Vector3;
    use sublevel::body::Body;

    #[test]
    fn the_text_holds_as_many_numbers_as_the_table() {
        let body = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 0.7, 0.5)).unwrap();
        let numbers: Vec<f64> = serde_json::from_str(&heights_as_text(&body)).unwrap();
        assert!(numbers.len() > 100 && 8 * numbers.len() == body.heights_bytes());
        assert!(numbers.iter().all(|height| *height > 0.1 && *height < 2.0));
        let boxed = Body::cuboid("box", Vector3::repeat(1.0)).unwrap();
        assert_eq!(heights_as_text(&boxed), "[]", "boxes have no table");
    }
}
