//! Normal probability plots: if a sample is normal, its sorted values lie on a straight line over the normal
//! quantiles.

use statrs::distribution::{ContinuousCDF, Normal};

use super::page::escape;
use super::plot::axis::Axis;
use super::plot::{beside, line, text};

/// Height and width of a panel's frame, user units.
const SIDE: (f64, f64) = (400.0, 360.0);
/// Room around it: left, top, right, bottom.
const ROOM: [f64; 4] = [68.0, 62.0, 18.0, 46.0];
/// Probabilities at the vertical axis.
const PROBABILITIES: [f64; 13] =
    [0.0005, 0.003, 0.01, 0.05, 0.10, 0.25, 0.50, 0.75, 0.90, 0.95, 0.99, 0.997, 0.9995];
/// Style of points and straight lines.
const STYLE: &str = "path{fill:none;stroke-linecap:round}.dot0,.dot1,.dot2{stroke-width:3.4}\
                     .line0,.line1,.line2{stroke-width:1;stroke-dasharray:5 4}\
                     .dot0,.line0{stroke:var(--a)}.dot1,.line1{stroke:var(--b)}.dot2,.line2{stroke:var(--c)}\
                     .key0{fill:var(--a)}.key1{fill:var(--b)}.key2{fill:var(--c)}";

/// A sample with its name.
#[derive(Clone, Debug)]
pub struct Sample {
    /// In the key.
    pub name: String,
    /// In any order.
    pub values: Vec<f64>,
}

/// A panel of up to three samples.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// The unit of the values.
    pub unit: String,
    /// At most three are distinguished by colour.
    pub samples: Vec<Sample>,
}

/// Returns the sorted values and the standard normal quantiles of `(i − ½)/N`; values that are not finite are
/// left out.
fn points(values: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (count, standard) = (sorted.len() as f64, Normal::standard());
    sorted.into_iter().enumerate().map(|(i, v)| (v, standard.inverse_cdf((i as f64 + 0.5) / count))).collect()
}

/// Returns the correlation of a sample's sorted values with the normal quantiles (Filliben 1975): 1 for a
/// normal sample, below 0.9992 in one of a hundred normal samples of 2 500. `None` for fewer than three
/// values, or equal ones.
pub fn straightness(values: &[f64]) -> Option<f64> {
    let points = points(values);
    let n = points.len() as f64;
    let mean = points.iter().map(|p| p.0).sum::<f64>() / n;
    let (mut xx, mut xz, mut zz) = (0.0, 0.0, 0.0);
    for (x, z) in &points {
        xx += (x - mean) * (x - mean);
        xz += (x - mean) * z;
        zz += z * z;
    }
    (points.len() >= 3 && xx > 0.0).then(|| xz / (xx * zz).sqrt())
}

/// Draws the panels beside each other, as an SVG that needs no style sheet. Each sample's straight line goes
/// through its quartiles.
pub fn svg(panels: &[Panel]) -> String {
    let drawn = panels.iter().map(|panel| (panel.title.clone(), panel.render()));
    beside(["probability", "Normal probability plot", STYLE], (SIDE, ROOM), drawn)
}

impl Panel {
    fn render(&self) -> String {
        let (w, h) = SIDE;
        let standard = Normal::standard();
        let all: Vec<Vec<(f64, f64)>> = self.samples.iter().map(|s| points(&s.values)).collect();
        let labelled = PROBABILITIES.iter().map(|p| standard.inverse_cdf(*p));
        let highest = 1.04 * labelled.chain(all.iter().flatten().map(|p| p.1)).fold(0.0, f64::max);
        let (low, high) = all
            .iter()
            .flatten()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.0), high.max(p.0)));
        let margin = 0.04 * (high - low);
        let axis = Axis::covering(low - margin, high + margin, 6);
        let x = |v: f64| w * axis.share(v);
        let y = |z: f64| h * 0.5 * (1.0 - z / highest);
        let mut svg = text("title", 0.0, -42.0, &self.title);
        for (k, sample) in self.samples.iter().enumerate() {
            let at = w * k as f64 / self.samples.len().max(1) as f64;
            let straight = straightness(&sample.values).map_or(String::new(), |r| format!(", r = {r:.4}"));
            svg.push_str(&format!("<circle class=\"key{k}\" cx=\"{:.1}\" cy=\"-20\" r=\"4\"/>", at + 4.0));
            svg.push_str(&text("", at + 13.0, -15.5, &format!("{}{straight}", sample.name)));
        }
        for p in PROBABILITIES {
            let at = y(standard.inverse_cdf(p));
            svg.push_str(&line("grid", 0.0, at, w, at));
            svg.push_str(&text("end", -7.0, at + 4.0, &escape(&format!("{} %", 100.0 * p))));
        }
        for tick in &axis.ticks {
            svg.push_str(&line("grid", x(*tick), 0.0, x(*tick), h));
            svg.push_str(&text("mid", x(*tick), h + 18.0, &axis.label(*tick)));
        }
        svg.push_str(&text("end", w, h + 37.0, &axis.unit(&self.unit)));
        svg.push_str(&line("axis", 0.0, h, w, h));
        svg.push_str(&line("axis", 0.0, 0.0, 0.0, h));
        for (k, points) in all.iter().enumerate() {
            let dots: String = points.iter().map(|(v, z)| format!("M{:.1} {:.1}h0", x(*v), y(*z))).collect();
            svg.push_str(&format!("<path class=\"dot{k}\" d=\"{dots}\"/>\n"));
            let quartile = |share: f64| points.get((share * points.len() as f64) as usize);
            if let (Some(a), Some(b)) = (quartile(0.25), quartile(0.75))
                && b.0 > a.0
            {
                let slope = (b.1 - a.1) / (b.0 - a.0);
                let at = |z: f64| x(a.0 + (z - a.1) / slope);
                svg.push_str(&format!(
                    "<path class=\"line{k}\" d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>\n",
                    at(-highest),
                    y(-highest),
                    at(highest),
                    y(highest)
                ));
            }
        }
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_normal_are_straight_and_those_of_others_are_not() {
        let standard = Normal::standard();
        let share = |i: u32| (f64::from(i) + 0.5) / 2500.0;
        let normal: Vec<f64> = (0..2500).rev().map(|i| 3.0 - 0.2 * standard.inverse_cdf(share(i))).collect();
        assert!((straightness(&normal).unwrap() - 1.0).abs() < 1e-12);
        // Of a uniform sample the correlation is √(3/π).
        let uniform: Vec<f64> = (0..2500).map(share).collect();
        assert!((straightness(&uniform).unwrap() - (3.0 / std::f64::consts::PI).sqrt()).abs() < 1e-3);
        assert_eq!(straightness(&[1.0, 1.0, 1.0]), None);
        assert_eq!(straightness(&[1.0, f64::NAN]), None);
    }

    #[test]
    fn the_figure_is_well_formed_whatever_the_sample() {
        for values in [vec![], vec![1.0], vec![f64::NAN, 2.0, 2.0], (0..50).map(f64::from).collect()] {
            let samples = vec![Sample { name: "a < b".to_owned(), values }];
            let panel = Panel { title: "x & y".to_owned(), unit: "mm".to_owned(), samples };
            let figure = svg(&[panel.clone(), panel]);
            let document = roxmltree::Document::parse(&figure).unwrap();
            let dots = document.descendants().filter(|n| n.attribute("class") == Some("dot0")).count();
            assert_eq!(dots, 2);
            assert!(!figure.contains("NaN") && !figure.contains("inf"), "{figure}");
        }
    }
}
