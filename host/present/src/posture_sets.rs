//! Sets of postures with their rank and condition as a figure.

use super::plot::{line, open_alone, text as word};
use rigident_fit::figures::significant;

/// Sets that are drawn; of more those that come first.
const MOST: usize = 40;
/// Height of a bar and the step to the next, user units.
const BAR: (f64, f64) = (16.0, 24.0);
/// Width for names and for bars.
const WIDTH: (f64, f64) = (230.0, 520.0);
const TOP: f64 = 58.0;
const STYLE: &str = ".full{fill:var(--a)}.less{fill:var(--sand)}";

/// A set of postures.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Names of its postures.
    pub name: String,
    /// The rank of the set.
    pub rank: usize,
    /// The condition number of the set.
    pub condition: f64,
}

/// Returns a bar for every set of postures: its condition number on a logarithmic scale, with its rank.
pub fn figure(sets: &[Bar]) -> String {
    let drawn: Vec<&Bar> = sets.iter().take(MOST).collect();
    let full = sets.iter().map(|set| set.rank).max().unwrap_or(0);
    let decade = |condition: f64| condition.max(1.0).log10();
    let most = drawn.iter().map(|set| decade(set.condition)).fold(1.0, f64::max).ceil();
    let x = |condition: f64| WIDTH.0 + WIDTH.1 * decade(condition) / most;
    let height = TOP + BAR.1 * drawn.len() as f64 + 40.0;
    let mut svg = open_alone(
        "posture-sets",
        "Sets of postures",
        "Condition number and rank of every set of postures",
        WIDTH.0 + WIDTH.1 + 90.0,
        height,
        STYLE,
    );
    svg.push_str(&word("title", 14.0, 24.0, "Condition number of every set of postures, and its rank"));
    svg.push_str(&word("", 14.0, 42.0, &format!("Dark: rank {full}, all that these postures determine")));
    let bottom = height - 34.0;
    for tick in 0..=most as i32 {
        let at = x(10_f64.powi(tick));
        svg.push_str(&line("grid", at, TOP, at, bottom));
        svg.push_str(&word("mid", at, bottom + 18.0, &format!("1e{tick}")));
    }
    for (k, set) in drawn.iter().enumerate() {
        let y = TOP + BAR.1 * k as f64 + 4.0;
        let class = if set.rank == full { "full" } else { "less" };
        let end = x(set.condition);
        svg.push_str(&word("end", WIDTH.0 - 8.0, y + 13.0, &shortened(&set.name)));
        svg.push_str(&format!(
            "<rect class=\"{class}\" x=\"{:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{}\"/>\n",
            WIDTH.0,
            (end - WIDTH.0).max(1.0),
            BAR.0
        ));
        let words = format!("rank {}, {}", set.rank, significant(set.condition, 3));
        svg.push_str(&word("ink", end + 6.0, y + 13.0, &words));
    }
    svg.push_str(&line("axis", WIDTH.0, TOP, WIDTH.0, bottom));
    svg.push_str("</svg>\n");
    svg
}

/// Shortens a name until it fits.
fn shortened(name: &str) -> String {
    const FITS: usize = 34;
    if name.chars().count() <= FITS {
        return name.to_owned();
    }
    let start: String = name.chars().take(FITS - 1).collect();
    format!("{start}…")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_has_a_bar_as_long_as_its_condition() {
        let sets = [
            Bar { name: "a".to_owned(), rank: 10, condition: 10.0 },
            Bar { name: "a, b & c".to_owned(), rank: 16, condition: 100.0 },
        ];
        let svg = figure(&sets);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let bars: Vec<f64> = document
            .descendants()
            .filter(|n| n.has_tag_name("rect"))
            .map(|n| n.attribute("width").unwrap().parse().unwrap())
            .collect();
        assert!(bars.len() == 2 && (bars[1] - 2.0 * bars[0]).abs() < 0.2, "{bars:?}");
        assert!(svg.contains("a, b &amp; c") && svg.contains("rank 16"), "{svg}");
    }
}
