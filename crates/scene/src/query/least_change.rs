//! The smallest change of joint values that moves several pairs apart, to first order.

/// Sweeps over all rows; each takes a fraction of a microsecond.
const MAX_SWEEPS: usize = 500;

/// Sum of squares of a gradient below which a pair does not depend on the joints.
const NO_GRADIENT: f64 = 1e-18;

/// Change of a multiplier, relative to the largest, at which the sweeps end.
const SETTLED: f64 = 1e-9;

/// Minimises |d|² subject to g·d >= b for each row (g, b), and to `ranges`, the least and largest
/// change of each value; by coordinate ascent of the dual (Hildreth 1957). Values that would leave
/// their ranges are fixed at the end of these, and the others found again. Rows that no value
/// changes are left out; none where nothing is left, or where the rows contradict each other.
pub(super) fn least_change(rows: &[(Vec<f64>, f64)], ranges: &[[f64; 2]]) -> Option<Vec<f64>> {
    let mut fixed: Vec<Option<f64>> = vec![None; ranges.len()];
    for _ in 0..=ranges.len() {
        let change = with_fixed(rows, &fixed)?;
        let outside = |place: &usize| fixed[*place].is_none() && !inside(change[*place], ranges[*place]);
        let outside: Vec<usize> = (0..ranges.len()).filter(outside).collect();
        if outside.is_empty() {
            return Some(change);
        }
        for place in outside {
            fixed[place] = Some(change[place].clamp(ranges[place][0].min(0.0), ranges[place][1].max(0.0)));
        }
    }
    None
}

fn inside(change: f64, [least, most]: [f64; 2]) -> bool {
    (least.min(0.0)..=most.max(0.0)).contains(&change)
}

fn with_fixed(rows: &[(Vec<f64>, f64)], fixed: &[Option<f64>]) -> Option<Vec<f64>> {
    let mut change: Vec<f64> = fixed.iter().map(|fixed| fixed.unwrap_or(0.0)).collect();
    let is_free = |place: usize| fixed[place].is_none();
    let squares: Vec<f64> = rows
        .iter()
        .map(|(g, _)| (0..g.len()).filter(|&place| is_free(place)).map(|place| g[place] * g[place]).sum())
        .collect();
    if squares.iter().all(|square| *square <= NO_GRADIENT) {
        return None;
    }
    let mut multipliers = vec![0.0_f64; rows.len()];
    for _ in 0..MAX_SWEEPS {
        let (mut moved, mut largest) = (0.0_f64, f64::MIN_POSITIVE);
        for (((g, b), square), multiplier) in rows.iter().zip(&squares).zip(&mut multipliers) {
            if *square <= NO_GRADIENT {
                continue;
            }
            let missing = b - g.iter().zip(&change).map(|(g, change)| g * change).sum::<f64>();
            let raised = (*multiplier + missing / square).max(0.0);
            let by = raised - *multiplier;
            *multiplier = raised;
            for place in (0..g.len()).filter(|&place| is_free(place)) {
                change[place] += by * g[place];
            }
            (moved, largest) = (moved.max(by.abs()), largest.max(raised));
        }
        if moved <= SETTLED * largest {
            break;
        }
    }
    change.iter().all(|change| change.is_finite()).then_some(change)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    #[test]
    fn one_row_is_solved_by_its_gradient() {
        let change = least_change(&[(vec![3.0, 4.0], 1.0)], &[FREE; 2]).expect("a solution");
        assert!((change[0] - 0.12).abs() < 1e-12 && (change[1] - 0.16).abs() < 1e-12, "{change:?}");
    }

    #[test]
    fn rows_that_are_met_already_change_nothing() {
        assert_eq!(least_change(&[(vec![1.0, 0.0], -1.0)], &[FREE; 2]), Some(vec![0.0; 2]));
    }

    #[test]
    fn two_rows_are_met_at_once() {
        // The corner of x >= 1 and x + y >= 3: the nearest point of the origin is (1.5, 1.5).
        let rows = [(vec![1.0, 0.0], 1.0), (vec![1.0, 1.0], 3.0)];
        let change = least_change(&rows, &[FREE; 2]).expect("a solution");
        assert!((change[0] - 1.5).abs() < 1e-6 && (change[1] - 1.5).abs() < 1e-6, "{change:?}");
        // With y at most 0.5 the other value does the rest.
        let change = least_change(&rows, &[FREE, [-1.0, 0.5]]).expect("a solution");
        assert!((change[0] - 2.5).abs() < 1e-6 && (change[1] - 0.5).abs() < 1e-12, "{change:?}");
    }

    #[test]
    fn rows_that_no_value_changes_have_no_solution() {
        assert_eq!(least_change(&[(vec![0.0; 2], 1.0)], &[FREE; 2]), None);
        assert_eq!(least_change(&[(vec![1.0, 0.0], 1.0)], &[[0.0, 0.0], FREE]), None);
    }
}
