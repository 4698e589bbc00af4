//! The tests of the page without a browser.

use super::*;

/// Returns the given number of links in a row, each with three markers on it, that sway for the given number
/// of frames.
fn swaying(links: usize, frames: usize) -> MotionPage {
    let at = |k: usize, j: usize| {
        let phase = k as f32 * 0.06 + j as f32;
        [
            0.2 * phase.sin() + 0.012 * k as f32,
            0.1 * (1.3 * phase).cos(),
            0.11 * j as f32 + 0.05 * (2.0 * phase).sin(),
        ]
    };
    // Noise of a millimetre or so on markers, and of a newton on forces.
    let noise = |k: usize, j: usize| ((k * 7919 + j * 104_729) % 1000) as f32 / 1000.0 - 0.5;
    let marker = |k: usize, j: usize| at(k, j / 3).map(|v| v + 2e-3 * noise(k, j));
    let force =
        |k: usize| [10.0, 20.0, 700.0 + 80.0 * (k as f32 * 0.06).sin()].map(|v| v + 5.0 * noise(k, 1));
    let bone = |j: usize| Bone { name: format!("link {j}"), ends: [j, j + 1], ..Bone::default() };
    let arrow = |name: &str| ForceArrow {
        name: name.to_owned(),
        at_m: (0..frames).map(|k| at(k, 0)).collect(),
        measured_n: (0..frames).map(force).collect(),
        predicted_n: (0..frames).map(force).collect(),
    };
    let curve = |name: &str| {
        let values: Vec<f32> = (0..frames).map(|k| force(k)[2]).collect();
        Curve {
            name: name.to_owned(),
            unit: "N".to_owned(),
            measured: values.clone(),
            identified: values.clone(),
            table: values,
        }
    };
    MotionPage {
        title: "Sway".to_owned(),
        rate_hz: 100.0,
        bones: (0..links).map(bone).collect(),
        points_m: (0..frames).map(|k| (0..=links).map(|j| at(k, j)).collect()).collect(),
        markers_m: (0..frames).map(|k| (0..3 * links).map(|j| marker(k, j)).collect()).collect(),
        com_m: (0..frames).map(|k| at(k, 7)).collect(),
        forces: vec![arrow("left plate"), arrow("right plate")],
        curves: ["Fx", "Fy", "Fz", "Mx", "My", "Mz"].map(curve).to_vec(),
        used: (0..frames).map(|k| k % 500 > 50).collect(),
        ..MotionPage::default()
    }
}

#[test]
fn two_minutes_of_a_person_of_fifteen_links_take_less_than_three_megabytes() {
    let mut motion = swaying(15, 12_000);
    let with_markers = motion.html().unwrap().len();
    motion.markers_m.clear();
    let without = motion.html().unwrap().len();
    assert!(with_markers < 3_000_000 && without < 1_500_000, "{with_markers} {without}");
}

#[test]
fn no_text_of_a_file_becomes_markup_or_script() {
    let text = "</script><script>alert(1)</script><!-- <b onclick='x'> & \u{2028} {last}";
    let mut motion = swaying(3, 5);
    motion.title = text.to_owned();
    motion.about = text.to_owned();
    motion.bones[0].name = text.to_owned();
    motion.forces[0].name = text.to_owned();
    motion.curves[0].name = text.to_owned();
    motion.curves[0].unit = text.to_owned();
    motion.errors = vec![ErrorRow { name: text.to_owned(), unit: text.to_owned(), ..ErrorRow::default() }];
    let page = motion.html().unwrap();
    // The data's element and the player's, as without such text.
    assert_eq!(page.matches("<script").count(), 2);
    assert_eq!(page.matches("</script").count(), 2);
    assert!(!page.contains("<!-- ") && !page.contains("<b onclick"));
    assert!(page.contains("<h1>&lt;/script&gt;") && page.contains("{last}</h1>"));
    let (_, rest) = page.split_once("id=\"motion\">").unwrap();
    let data: serde_json::Value = serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap();
    assert_eq!(data["bones"][0][0], text);
    assert_eq!(data["unused"], serde_json::json!([[0, 4]]));
}

#[test]
fn nothing_is_loaded_and_unknown_numbers_are_dashes() {
    let mut motion = swaying(3, 5);
    let nothing = Rms { value: f64::NAN, percent: f64::NAN };
    motion.errors =
        vec![ErrorRow { name: "Fx".to_owned(), identified: nothing, table: nothing, ..ErrorRow::default() }];
    let page = motion.html().unwrap();
    for loading in ["src=", "href=", "url(", "@import", "import(", "fetch(", "XMLHttpRequest"] {
        assert!(!page.contains(loading), "{loading}");
    }
    assert!(page.contains("default-src 'none'"));
    let (markup, _) = page.split_once("<script").unwrap();
    assert!(!markup.contains("NaN") && markup.contains("<td class=\"right\">–</td>"));
}

#[test]
fn a_motion_that_cannot_be_shown_is_named() {
    let good = swaying(3, 5);
    assert!(good.html().is_ok());
    let wrong = |change: &dyn Fn(&mut MotionPage)| {
        let mut motion = good.clone();
        change(&mut motion);
        motion.html().unwrap_err().to_string()
    };
    let short = |what: &str| format!("{what} of `Sway`: 1 entries where 5 are needed");
    assert_eq!(wrong(&|m| m.points_m.clear()), "the motion of `Sway` has no frames: keep at least one");
    assert_eq!(wrong(&|m| m.rate_hz = f64::NAN), "the frames of `Sway` come at NaN Hz: give a positive rate");
    assert_eq!(wrong(&|m| m.com_m.truncate(1)), short("centres of mass"));
    assert_eq!(wrong(&|m| m.used.truncate(1)), short("marks of frames used"));
    assert_eq!(wrong(&|m| m.markers_m.truncate(1)), short("frames of markers"));
    assert_eq!(wrong(&|m| m.forces[1].at_m.truncate(1)), short("points of application of `right plate`"));
    assert_eq!(wrong(&|m| m.curves[0].table.truncate(1)), short("values of curve `Fx`"));
    assert!(
        wrong(&|m| m.points_m[2].truncate(1)).starts_with("points of a frame of `Sway`: 1 entries where 4")
    );
    assert!(
        wrong(&|m| m.markers_m[2].truncate(1)).starts_with("markers of a frame of `Sway`: 1 entries where 9")
    );
    assert_eq!(
        wrong(&|m| m.bones[2].ends = [1, 4]),
        "bone `link 2` ends at point 4, and a frame of `Sway` has 4"
    );
}

#[test]
fn stretches_that_were_not_used_are_found() {
    let (yes, no) = (true, false);
    assert_eq!(page::unused(&[no, no, yes, no, yes, no]), [[0, 1], [3, 3], [5, 5]]);
    assert!(page::unused(&[]).is_empty() && page::unused(&[yes, yes]).is_empty());
}
