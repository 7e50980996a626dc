//! The `d` of an SVG path, in as few letters as it takes.

/// What a whole number of the caller's is in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    /// The same number.
    Whole,
    /// A tenth of it.
    Tenth,
}

/// Adds a line through these points, and back to the first if it is `closed`: where it begins, and
/// the steps from point to point. A point by itself is a line of no length.
pub(super) fn push_line(d: &mut String, points: &[[i64; 2]], closed: bool, unit: Unit) {
    let Some(&[x, y]) = points.first() else { return };
    d.push('M');
    push_pair(d, x, y, unit);
    let (mut at, mut command) = ([x, y], ' ');
    for &[x, y] in &points[1..] {
        let [right, down] = [x - at[0], y - at[1]];
        at = [x, y];
        let next = match (right, down) {
            (0, 0) => continue,
            (_, 0) => 'h',
            (0, _) => 'v',
            _ => 'l',
        };
        // A command holds until the next.
        let repeated = next == command;
        if !repeated {
            d.push(next);
        }
        match next {
            'l' => {
                if repeated && right >= 0 {
                    d.push(' ');
                }
                push_pair(d, right, down, unit);
            }
            _ => {
                let step = if next == 'h' { right } else { down };
                if repeated && step >= 0 {
                    d.push(' ');
                }
                d.push_str(&number(step, unit));
            }
        }
        command = next;
    }
    if command == ' ' {
        d.push_str("h0");
    }
    if closed {
        d.push('z');
    }
}

fn push_pair(d: &mut String, x: i64, y: i64, unit: Unit) {
    d.push_str(&number(x, unit));
    // The sign of a number ends the one before.
    if y >= 0 {
        d.push(' ');
    }
    d.push_str(&number(y, unit));
}

fn number(value: i64, unit: Unit) -> String {
    if unit == Unit::Whole {
        return value.to_string();
    }
    let (sign, size) = (if value < 0 { "-" } else { "" }, value.unsigned_abs());
    match (size / 10, size % 10) {
        (whole, 0) => format!("{sign}{whole}"),
        (0, tenths) => format!("{sign}.{tenths}"),
        (whole, tenths) => format!("{sign}{whole}.{tenths}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[[i64; 2]], closed: bool, unit: Unit) -> String {
        let mut d = String::new();
        push_line(&mut d, points, closed, unit);
        d
    }

    #[test]
    fn lines_are_steps_in_few_letters() {
        let points = [[100, 50], [110, 50], [125, 50], [120, 41], [130, 45], [130, 45], [130, 40]];
        assert_eq!(line(&points, false, Unit::Whole), "M100 50h10 15l-5-9 10 4v-5");
        assert_eq!(line(&points, true, Unit::Tenth), "M10 5h1 1.5l-.5-.9 1 .4v-.5z");
        assert_eq!(line(&[[-3, -4]], false, Unit::Whole), "M-3-4h0", "a dot");
        assert_eq!(line(&[], true, Unit::Whole), "");
    }
}
