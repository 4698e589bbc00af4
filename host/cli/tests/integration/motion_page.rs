//! The page that plays a motion, in a browser: what a reader clicks, presses and sees. `RIGIDENT_BROWSER`
//! names the browser, as `cargo xtask setup` installs it.

mod browser;
mod figure;

use std::path::PathBuf;

use browser::Browser;
use rigident::present::motion::{Bone, Curve, ForceArrow, MotionPage};

/// The measured and the predicted force in the light page, and the measured in the dark one.
const MEASURED: [u8; 3] = [0x1f, 0x5f, 0xa8];
const PREDICTED: [u8; 3] = [0xc2, 0x57, 0x0c];
const MEASURED_IN_DARK: [u8; 3] = [0x6f, 0xb0, 0xf5];
const MARKER: [u8; 3] = [0x1d, 0x7a, 0x4f];
/// Pixels at edges that a browser smooths otherwise when it draws the same once more; what is hidden or
/// turned changes far more.
const SAME: f64 = 20.0;
const FRAME: &str = "+document.querySelector('#time').value";

/// Writes a page into the folder of tests' own files, where one can inspect it afterwards.
fn written(name: &str, motion: &MotionPage) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("motion_page");
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join(name);
    std::fs::write(&file, motion.html().unwrap()).unwrap();
    file
}

/// Opens a page that does not play by itself, in light colours.
fn opened(name: &str, motion: &MotionPage) -> Browser {
    let mut browser = Browser::start();
    browser.prefer(&[("prefers-reduced-motion", "reduce"), ("prefers-color-scheme", "light")]);
    browser.resize(1200, 1000);
    browser.open(&written(name, motion));
    browser.drawn();
    browser
}

/// Sets the slider to a frame.
fn slide(browser: &mut Browser, frame: u32) {
    browser.value(&format!(
        "(() => \
         {{ const s = document.querySelector('#time'); s.value = {frame}; s.dispatchEvent(new Event('input')); }})()"
    ));
}

/// Goes to a frame, and waits until the page is there.
fn seek(browser: &mut Browser, frame: u32) {
    slide(browser, frame);
    browser.wait(&format!("document.querySelector('#now').textContent.includes('frame {} of')", frame + 1));
}

fn text(browser: &mut Browser, selector: &str) -> String {
    browser.value(&format!("document.querySelector({selector:?}).textContent")).as_str().unwrap().to_owned()
}

const FITS_THE_WIDTH: &str = "document.documentElement.scrollWidth <= innerWidth";

#[test]
#[ignore = "needs Chromium"]
fn in_a_browser_a_motion_plays_pauses_and_goes_to_the_frame_asked_for() {
    let mut browser = opened("plays.html", &figure::walk("Walk", 4.0));
    assert_eq!((browser.number(FRAME), text(&mut browser, "#play").trim()), (0.0, "Play"));

    browser.click("#play");
    browser.wait(&format!("{FRAME} > 5"));
    assert_eq!(text(&mut browser, "#play").trim(), "Pause");
    assert_eq!(browser.value("document.querySelector('#now').ariaLive"), "off");
    browser.click("#play");
    browser.drawn();
    let stays = browser.number(FRAME);
    (0..10).for_each(|_| browser.drawn());
    assert_eq!(browser.number(FRAME), stays);
    assert_eq!(browser.value("document.querySelector('#now').ariaLive"), "polite");

    let thumb = browser.point("#time", [stays / 399.0, 0.5]);
    let to = browser.point("#time", [0.5, 0.5]);
    browser.drag(thumb, to);
    browser.drawn();
    let found = browser.number(FRAME);
    assert!((found - 199.5).abs() < 12.0, "{found}");

    const SHIFT: u32 = 8;
    for (key, modifiers, frame) in [
        ("Home", 0, 0.0),
        ("ArrowRight", 0, 1.0),
        ("ArrowRight", SHIFT, 11.0),
        ("ArrowLeft", 0, 10.0),
        ("ArrowLeft", SHIFT, 0.0),
    ] {
        browser.key(key, modifiers);
        browser.drawn();
        assert_eq!(browser.number(FRAME), frame, "{key}");
    }
    browser.key("End", 0);
    browser.drawn();
    assert_eq!(browser.number(FRAME), 399.0);
    // From the end it begins anew.
    browser.key(" ", 0);
    browser.wait(&format!("{FRAME} > 3 && {FRAME} < 399"));
    browser.key(" ", 0);
    browser.drawn();
    assert_eq!(text(&mut browser, "#play").trim(), "Play");

    // The middle of a curve is the middle of the time, 3.99 s long; a drag goes on from there.
    let curve = ".curve:nth-of-type(3) svg svg";
    browser.click(curve);
    browser.drawn();
    assert!((browser.number(FRAME) - 199.5).abs() < 2.5);
    let [from, to] = [[0.5, 0.5], [0.75, 0.2]].map(|share| browser.point(curve, share));
    browser.drag(from, to);
    browser.drawn();
    assert!((browser.number(FRAME) - 299.25).abs() < 2.5);
    let x = browser.number("document.querySelector('.curve svg .cursor').getBoundingClientRect().left");
    assert!((x - browser.point(".curve svg svg", [0.75, 0.5])[0]).abs() < 3.0, "{x}");

    // Six hundredths of a second take more than half a second at a tenth of the speed, however busy the
    // machine.
    browser.value("(() => \
                   { const s = document.querySelector('#speed'); s.value = '0.1'; s.dispatchEvent(new Event('change')); })()");
    seek(&mut browser, 0);
    let begun = browser.number("performance.now()");
    browser.click("#play");
    browser.wait(&format!("{FRAME} >= 6"));
    assert!(browser.number("performance.now()") - begun > 500.0);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
#[ignore = "needs Chromium"]
fn in_a_browser_figure_and_forces_are_seen_and_can_be_hidden() {
    let mut browser = opened("shows.html", &figure::walk("Walk", 4.0));
    seek(&mut browser, 185);
    browser.picture("all", "#scene");
    assert!(browser.colours("all") > 100.0);
    // As figure.rs has it: 3 significant digits, and what of it is predicted.
    let now = text(&mut browser, "#now");
    assert!(now.contains("1.85 s, frame 186 of 400 · centre of mass 2.230, "), "{now}");
    assert!(now.contains("plate 3: measured 689 N, predicted 7"), "{now}");
    assert_eq!(text(&mut browser, ".curve:nth-of-type(3) .key.measured .value"), "676");
    for (toggle, colour) in [
        ("#show-measured", MEASURED),
        ("#show-predicted", PREDICTED),
        ("#show-markers", MARKER),
        ("#show-com, #show-trace", [0xa3, 0x19, 0x5b]),
    ] {
        let shown = browser.pixels_of("all", colour);
        assert!(shown > 30.0, "{toggle}: {shown}");
        let toggles: Vec<&str> = toggle.split(", ").collect();
        toggles.iter().for_each(|toggle| browser.click(toggle));
        browser.picture("less", "#scene");
        assert_eq!(browser.pixels_of("less", colour), 0.0, "{toggle}");
        toggles.iter().for_each(|toggle| browser.click(toggle));
        browser.picture("again", "#scene");
        assert!(browser.difference("all", "again") < SAME, "{toggle}");
    }
    seek(&mut browser, 320);
    browser.picture("later", "#scene");
    assert!(browser.difference("all", "later") > 5000.0);
    assert_eq!(browser.pixels_of("later", MEASURED), 0.0, "no foot is on a plate");
    assert!(text(&mut browser, "#now").contains("not used"));
    assert_eq!(text(&mut browser, ".curve .key.measured .value"), "–");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
#[ignore = "needs Chromium"]
fn in_a_browser_the_figure_is_turned_shifted_zoomed_and_reset() {
    let mut browser = opened("turns.html", &figure::walk("Walk", 4.0));
    seek(&mut browser, 185);
    browser.picture("start", "#scene");
    let mut seen = vec!["start"];
    let [middle, aside] = [[0.5, 0.5], [0.7, 0.4]].map(|share| browser.point("#scene", share));
    let new = |browser: &mut Browser, seen: &mut Vec<&'static str>, name: &'static str| {
        browser.picture(name, "#scene");
        for other in seen.iter() {
            let difference = browser.difference(name, other);
            assert!(difference > 2000.0, "{name} is like {other}: {difference}");
        }
        seen.push(name);
    };
    browser.drag(middle, aside);
    new(&mut browser, &mut seen, "turned");
    browser.wheel(middle, -400.0);
    new(&mut browser, &mut seen, "nearer");
    for view in ["front", "side", "top"] {
        browser.click(&format!("#{view}"));
        new(&mut browser, &mut seen, view);
    }
    browser.click("#reset");
    browser.picture("reset", "#scene");
    assert!(browser.difference("start", "reset") < SAME);
    browser.click("#follow");
    new(&mut browser, &mut seen, "whole way");
    browser.click("#follow");
    browser.key("s", 0);
    browser.picture("by key", "#scene");
    assert!(browser.difference("side", "by key") < SAME);

    // Without a mouse: Tab leads to the picture first, and there the arrow keys turn it.
    browser.click("#reset");
    browser.value(
        "document.activeElement.blur(); document.querySelector('h1').tabIndex = -1; \
                   document.querySelector('h1').focus()",
    );
    browser.key("Tab", 0);
    assert_eq!(browser.value("document.activeElement.id"), "scene");
    let frame = browser.number(FRAME);
    (0..4).for_each(|_| browser.key("ArrowRight", 0));
    new(&mut browser, &mut seen, "turned by keys");
    assert_eq!(browser.number(FRAME), frame);
    browser.value("document.activeElement.blur()");
    browser.click("#side");

    // The person is in the middle; the name stays while the pointer does.
    browser.mouse("mouseMoved", middle);
    browser.wait("!document.querySelector('#hover').hidden");
    let name = text(&mut browser, "#hover");
    assert!(["pelvis", "thorax"].contains(&name.as_str()) || name.starts_with("right "), "{name}");
    browser.mouse("mouseMoved", away_from(middle));
    browser.wait("document.querySelector('#hover').hidden");

    for (width, height) in [(420, 800), (1600, 900)] {
        browser.resize(width, height);
        browser.wait("(() => \
                      { const c = document.querySelector('#scene'); return c.width === Math.round(c.getBoundingClientRect().width); })()");
        assert_eq!(browser.value(FITS_THE_WIDTH), true, "{width} wide");
        browser.picture("resized", "#scene");
        assert!(browser.colours("resized") > 100.0 && browser.pixels_of("resized", MEASURED) > 60.0);
    }
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
#[ignore = "needs Chromium"]
fn in_a_browser_a_page_in_the_dark_plays_by_itself_and_its_titles_stay_text() {
    let title = "</title></script><script>document.body.id = 'hit'</script><img src=x \
                 onerror=\"document.body.id = 'hit'\">&amp;{last}";
    let mut motion = figure::walk(title, 4.0);
    for name in
        [&mut motion.bones[0].name, &mut motion.forces[2].name, &mut motion.curves[0].name, &mut motion.about]
    {
        *name = title.to_owned();
    }
    let mut browser = Browser::start();
    browser.prefer(&[("prefers-color-scheme", "dark")]);
    browser.resize(1200, 1000);
    browser.open(&written("dark.html", &motion));
    browser.wait(&format!("{FRAME} > 3"));
    assert_eq!(text(&mut browser, "h1"), title);
    assert_eq!(text(&mut browser, "figcaption b"), title);
    assert_eq!(browser.value("document.body.id"), "");

    // At its end it begins again, unless that is switched off.
    slide(&mut browser, 395);
    browser.wait(&format!("{FRAME} < 200"));
    browser.click("#repeat");
    slide(&mut browser, 395);
    browser
        .wait(&format!("{FRAME} === 399 && document.querySelector('#play').textContent.trim() === 'Play'"));

    seek(&mut browser, 185);
    assert!(text(&mut browser, "#now").contains(title));
    browser.picture("dark", "#scene");
    assert!(browser.pixels_of("dark", MEASURED_IN_DARK) > 60.0);
    // White is in the ball of the centre of mass alone.
    assert!(browser.pixels_of("dark", [255, 255, 255]) < 2000.0);
    // The reader's preference may change under way.
    browser.prefer(&[("prefers-color-scheme", "light")]);
    browser.picture("light", "#scene");
    assert!(
        browser.pixels_of("light", MEASURED) > 60.0 && browser.pixels_of("light", MEASURED_IN_DARK) < 5.0
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Far from the person.
fn away_from([x, y]: [f64; 2]) -> [f64; 2] {
    [x - 400.0, y - 100.0]
}

#[test]
#[ignore = "needs Chromium"]
fn in_a_browser_motions_of_little_or_nothing_are_shown_without_an_error() {
    let unknown = [f32::NAN; 3];
    let bone = Bone { name: "bone".to_owned(), ends: [0, 1], radius_m: Some(-1.0), ..Bone::default() };
    let force =
        ForceArrow { at_m: vec![unknown; 3], measured_n: vec![[1e30; 3]; 3], ..ForceArrow::default() };
    let curve = Curve { measured: vec![f32::INFINITY; 3], ..Curve::default() };
    let least = MotionPage { rate_hz: 50.0, points_m: vec![vec![]], ..MotionPage::default() };
    let unseen = MotionPage {
        points_m: vec![vec![unknown; 2]; 3],
        markers_m: vec![vec![unknown]; 3],
        com_m: vec![unknown; 3],
        plates_m: vec![[unknown; 4]],
        forward: [f32::NAN; 2],
        bones: vec![bone.clone()],
        forces: vec![force.clone()],
        curves: vec![curve],
        used: vec![false; 3],
        ..least.clone()
    };
    let huge = MotionPage {
        points_m: vec![vec![[1e30; 3], [-1e30; 3]], vec![[0.0; 3]; 2], vec![[1e-30; 3], unknown]],
        com_m: vec![[1e30; 3]; 3],
        plates_m: vec![[[1e30; 3]; 4]],
        forces: vec![ForceArrow { at_m: vec![[0.0; 3]; 3], ..force }],
        ..unseen.clone()
    };
    // Markers alone are examined as a figure is.
    let walk = figure::walk("Markers", 1.0);
    let markers = MotionPage { points_m: vec![vec![]; 100], markers_m: walk.markers_m, ..least.clone() };
    let mut browser = opened("markers.html", &markers);
    browser.picture("markers", "#scene");
    assert!(browser.pixels_of("markers", MARKER) > 30.0);
    for (name, motion) in [("least", least), ("unseen", unseen), ("huge", huge)] {
        let mut browser = opened(&format!("{name}.html"), &motion);
        for key in ["End", "Home", "t", "f", " ", " "] {
            browser.key(key, 0);
            browser.drawn();
        }
        assert!(text(&mut browser, "#now").starts_with("0.0"), "{name}");
        assert_eq!(browser.complaints, Vec::<String>::new(), "{name}");
    }
}
