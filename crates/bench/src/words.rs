//! Numbers in sentences: ranges and lists.

/// From the least to the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) least: f64,
    pub(crate) most: f64,
}

impl Span {
    /// Of these values; none of no value.
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let wider = |span: Self, value: f64| Self { least: span.least.min(value), most: span.most.max(value) };
        values
            .fold(None, |span, value| Some(span.map_or(Self { least: value, most: value }, |span| wider(span, value))))
    }

    /// As "least to most", or one number where both are written alike.
    pub(crate) fn text(self, digits: usize) -> String {
        let [least, most] = [self.least, self.most].map(|value| format!("{value:.digits$}"));
        if least == most { least } else { format!("{least} to {most}") }
    }

    /// Of nanoseconds, as microseconds unless they are few.
    pub(crate) fn microseconds(self) -> String {
        if self.most < 100.0 {
            return format!("{} ns", self.text(0));
        }
        let [least, most] = [self.least, self.most].map(|ns| 1e-3 * ns);
        format!("{} µs", Self { least, most }.text(if most < 2.0 { 2 } else { 1 }))
    }
}

/// "a, b and c".
pub(crate) fn listed(items: impl IntoIterator<Item = String>) -> String {
    let items: Vec<String> = items.into_iter().collect();
    match &items[..] {
        [] => "none".into(),
        [one] => one.clone(),
        [some @ .., last] => format!("{} and {last}", some.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_and_lists_read_as_people_write_them() {
        let span = Span::of([281.0, 333.0, 300.0].into_iter()).unwrap();
        assert_eq!((span.text(0), span.microseconds()), ("281 to 333".into(), "0.28 to 0.33 µs".into()));
        assert_eq!(Span { least: 3620.0, most: 30_710.0 }.microseconds(), "3.6 to 30.7 µs");
        assert_eq!(Span { least: 1.6, most: 2.2 }.microseconds(), "2 ns");
        assert_eq!(Span { least: 1.01, most: 1.02 }.text(1), "1.0");
        assert_eq!(Span::of(std::iter::empty()), None);
        let list = |count: usize| listed(["a", "b", "c"].map(str::to_owned).into_iter().take(count));
        assert_eq!([0, 1, 2, 3].map(list), ["none", "a", "a and b", "a, b and c"]);
    }
}
