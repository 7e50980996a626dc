//! Several charts of one thing in one picture, one below the other.

/// One document of several of [`LineChart::to_svg`](super::LineChart::to_svg) or
/// [`Scatter::to_svg`](super::Scatter::to_svg), each below the one before.
pub fn stacked(charts: &[String]) -> String {
    let size = |chart: &str, name: &str| -> u32 {
        let value = chart.split_once(&format!("{name}=\"")).and_then(|(_, rest)| rest.split('"').next());
        value.and_then(|value| value.parse().ok()).unwrap_or(0)
    };
    let width = charts.iter().map(|chart| size(chart, "width")).max().unwrap_or(0);
    let height: u32 = charts.iter().map(|chart| size(chart, "height")).sum();
    let mut svg = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n"
    );
    let mut top = 0;
    for chart in charts {
        let inner = chart.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
        svg.push_str(&inner.replacen("<svg", &format!("<svg y=\"{top}\""), 1));
        top += size(chart, "height");
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::stacked;

    #[test]
    fn charts_stand_below_each_other() {
        let chart = |height: u32, body: &str| {
            format!(
                "<svg width=\"760\" height=\"{height}\" viewBox=\"0 0 7600 {height}0\" xmlns=\"http://www.w3.org/2000/svg\">{body}</svg>\n"
            )
        };
        assert_eq!(
            stacked(&[chart(400, "<g/>"), chart(500, "<path/>")]),
            "<svg width=\"760\" height=\"900\" viewBox=\"0 0 760 900\" xmlns=\"http://www.w3.org/2000/svg\">\n\
             <svg y=\"0\" width=\"760\" height=\"400\" viewBox=\"0 0 7600 4000\"><g/></svg>\n\
             <svg y=\"400\" width=\"760\" height=\"500\" viewBox=\"0 0 7600 5000\"><path/></svg>\n</svg>\n"
        );
    }
}
