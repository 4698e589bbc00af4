//! The pages that play the trials of `rigident body identify`.

use nalgebra::Vector3;

use rigident_identify::answer::person::LeftOut;
use rigident_io::motion_capture::ground::GroundWrench;
use rigident_io::motion_capture::trial::Trial;
use rigident_people::body_segments::Study;
use rigident_people::body_segments::left_out::LeftOutMotions;
use rigident_people::inverse_kinematics::skeleton::{Place, Skeleton};
use rigident_people::inverse_kinematics::subject::Subject;
use rigident_people::person::contact::pressure;
use rigident_people::person::track::SHOWN_S;
use rigident_people::person::{Person, Tracked};
use rigident_present::motion::{Bone, Curve, ErrorRow, ForceArrow, MotionError, MotionPage, Rms, Side};

/// Frames a second that are stored, at most.
const RATE_HZ: f64 = 100.0;
/// A total force below this has no point of application worth showing, N.
const LEAST_N: f64 = 25.0;
const NONE: [f32; 3] = [f32::NAN; 3];

/// Returns a page for every trial, with the name of its file; a trial that cannot be shown is left out.
pub(super) fn pages(
    person: &Person,
    study: &Study,
    trials: &[Trial],
    predicted: &LeftOutMotions,
) -> Vec<(String, String)> {
    let of = |(k, (tracked, trial)): (usize, (&Tracked, &Trial))| {
        let page = page(person, study, (k, tracked, trial), predicted);
        let name = match person.trials.len() {
            1 => "motion.html".to_owned(),
            _ => format!("motion-{}.html", k + 1),
        };
        Some((name, page.html().ok()?))
    };
    person.trials.iter().zip(trials).enumerate().filter_map(of).collect()
}

fn page(
    person: &Person,
    study: &Study,
    (k, tracked, trial): (usize, &Tracked, &Trial),
    predicted: &LeftOutMotions,
) -> MotionPage {
    let subject = &person.subject;
    let (step, shown, kept) = kept(trial);
    let figure = Figure::of(subject);
    let places = |frame: usize| tracked.places(subject, frame);
    let mut used = vec![false; shown];
    for frame in tracked.frames.iter().take_while(|frame| frame.number < shown) {
        used[frame.number] = true;
    }
    let wrench = Wrench::of(study, (k, tracked, shown), predicted);
    let markers = |frame: usize| -> Vec<[f32; 3]> {
        let own =
            |name: &String| trial.labels.iter().position(|l| l == name).and_then(|l| trial.point(frame, l));
        subject.markers.iter().map(|m| own(&m.name).map_or(NONE, single)).collect()
    };
    MotionPage {
        title: title(&tracked.name, shown < trial.frames()),
        rate_hz: trial.rate_hz / step as f64,
        forward: forward(&subject.skeleton, tracked, &kept),
        points_m: kept.iter().map(|f| figure.points(places(*f).as_deref())).collect(),
        bones: figure.bones,
        markers_m: kept.iter().map(|f| markers(*f)).collect(),
        marker_names: subject.markers.iter().map(|m| m.name.clone()).collect(),
        com_m: kept.iter().map(|f| person.table_centre(k, *f).map_or(NONE, single)).collect(),
        plates_m: plates(trial),
        forces: vec![wrench.arrow(&kept)],
        about: "the pelvis".to_owned(),
        curves: wrench.curves(&kept),
        used: kept.iter().map(|f| used[*f]).collect(),
        errors: predicted.by_trial.get(k).into_iter().flatten().map(error).collect(),
    }
}

/// Returns every how many frames one is kept, the frames that are shown, and those that are kept of them.
fn kept(trial: &Trial) -> (usize, usize, Vec<usize>) {
    let step = (trial.rate_hz / RATE_HZ).ceil().max(1.0) as usize;
    let shown = trial.frames().min((SHOWN_S * trial.rate_hz).ceil() as usize);
    (step, shown, (0..shown).step_by(step).collect())
}

fn title(name: &str, is_cut: bool) -> String {
    if is_cut { format!("{name}, the first {SHOWN_S} s") } else { name.to_owned() }
}

/// Returns the corners of the plates that have some.
fn plates(trial: &Trial) -> Vec<[[f32; 3]; 4]> {
    trial.ground.iter().filter_map(|p| Some(p.corners_m?.map(|c| c.map(|v| v as f32)))).collect()
}

/// Returns the page that plays a trial as it was measured: its markers, its plates, and what pushes on them.
///
/// # Errors
/// [`MotionError`]: the trial has no frames.
pub fn measured(trial: &Trial) -> Result<String, MotionError> {
    let (step, shown, kept) = kept(trial);
    let marker = |frame: usize, label: usize| trial.point(frame, label).map_or(NONE, single);
    let page = MotionPage {
        title: title(&trial.name, shown < trial.frames()),
        rate_hz: trial.rate_hz / step as f64,
        points_m: vec![Vec::new(); kept.len()],
        markers_m: kept.iter().map(|f| (0..trial.labels.len()).map(|l| marker(*f, l)).collect()).collect(),
        marker_names: trial.labels.clone(),
        plates_m: plates(trial),
        forces: trial.ground.iter().map(|plate| push(trial, plate, &kept)).collect(),
        ..MotionPage::default()
    };
    page.html()
}

/// Returns the push of a plate in the frames that are kept, at its centre of pressure on the plate's surface.
fn push(trial: &Trial, plate: &GroundWrench, kept: &[usize]) -> ForceArrow {
    let height_m = plate.corners_m.map_or(0.0, |corners| corners.iter().map(|c| c[2]).sum::<f64>() / 4.0);
    let of = |frame: &usize| {
        let sample = ((trial.time_s(*frame) - plate.first_s) * plate.rate_hz).round();
        let wrench = (sample >= 0.0).then(|| plate.wrench.get(sample as usize)).flatten();
        let wrench = wrench?.map(f64::from);
        let at = pressure(&wrench, height_m);
        let [fx, fy, fz, ..] = wrench.map(|v| v as f32);
        (wrench[2] > LEAST_N && at.iter().all(|v| v.is_finite())).then(|| (single(at), [fx, fy, fz]))
    };
    let (at_m, measured_n) = kept.iter().map(|frame| of(frame).unwrap_or((NONE, NONE))).unzip();
    ForceArrow { name: plate.name.clone(), at_m, measured_n, predicted_n: Vec::new() }
}

fn error(of: &LeftOut) -> ErrorRow {
    let percent = of.percent_of_weight;
    ErrorRow {
        name: capital(&of.name),
        unit: of.unit.clone(),
        identified: Rms { value: of.rms, percent },
        table: Rms { value: of.table_rms, percent: percent * of.table_rms / of.rms.max(f64::MIN_POSITIVE) },
    }
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_ascii_uppercase().to_string() + letters.as_str())
}

fn single(v: Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Returns the horizontal direction, a unit vector, in which the person faces on average.
fn forward(skeleton: &Skeleton, tracked: &Tracked, kept: &[usize]) -> [f32; 2] {
    let pose = |frame: usize| tracked.coordinates.pose(skeleton, frame);
    let sum: Vector3<f64> = kept.iter().filter_map(|f| pose(*f)).map(|p| p.attitude * Vector3::x()).sum();
    let flat = sum.xy().try_normalize(1e-9).unwrap_or_default();
    [flat.x as f32, flat.y as f32]
}

/// Joints and ends of links, with the bones between them.
struct Figure {
    bones: Vec<Bone>,
    /// Points on links, link axes.
    points: Vec<(usize, Vector3<f64>)>,
}

impl Figure {
    fn of(subject: &Subject) -> Self {
        let links = &subject.model.links;
        let mut figure = Self {
            bones: Vec::new(),
            points: (0..links.len()).map(|link| (link, Vector3::zeros())).collect(),
        };
        for (i, link) in links.iter().enumerate().skip(1) {
            let parent = &links[link.link.parent];
            let thick = matches!(parent.name.as_str(), "pelvis" | "torso" | "lumbar" | "chest")
                && side(&link.name) == Side::Middle;
            figure.bones.push(Bone {
                name: parent.name.clone(),
                ends: [link.link.parent, i],
                side: side(&link.name),
                radius_m: thick.then_some(0.09),
            });
        }
        let length = |name: &str| subject.person.length(name).unwrap_or(0.1);
        for (i, link) in links.iter().enumerate() {
            let (from, to, radius) = match link.name.trim_start_matches(['l', 'r']).trim_start_matches('_') {
                "head" => (Vector3::zeros(), Vector3::z() * length("head"), Some(0.085)),
                "hand" => (Vector3::zeros(), -Vector3::z() * length("hand"), None),
                "foot" => {
                    let (foot, down) = (length("foot"), -0.7 * length("ankle_height"));
                    (Vector3::new(-0.2 * foot, 0.0, down), Vector3::new(0.7 * foot, 0.0, down), Some(0.03))
                }
                _ => continue,
            };
            let at = figure.points.len();
            figure.points.extend([(i, from), (i, to)]);
            let ends = [at, at + 1];
            figure.bones.push(Bone {
                name: link.name.clone(),
                ends,
                side: side(&link.name),
                radius_m: radius,
            });
        }
        figure
    }

    fn points(&self, places: Option<&[Place]>) -> Vec<[f32; 3]> {
        let of = |(link, at): &(usize, Vector3<f64>)| {
            places.and_then(|p| p.get(*link)).map_or(NONE, |(turn, origin)| single(origin + turn * at))
        };
        self.points.iter().map(of).collect()
    }
}

fn side(name: &str) -> Side {
    match name.get(..2) {
        Some("l_") => Side::Left,
        Some("r_") => Side::Right,
        _ => Side::Middle,
    }
}

/// Measured and predicted wrenches of a trial by frames; NaN where there is none.
struct Wrench {
    measured: Vec<[f32; 6]>,
    own: Vec<[f32; 6]>,
    table: Vec<[f32; 6]>,
    /// Centre of pressure of the total force, in frames that are used.
    pressed: Vec<[f32; 3]>,
}

impl Wrench {
    fn of(study: &Study, (k, tracked, shown): (usize, &Tracked, usize), predicted: &LeftOutMotions) -> Self {
        let none = || vec![[f32::NAN; 6]; shown];
        let mut all = Self { measured: none(), own: none(), table: none(), pressed: vec![NONE; shown] };
        for (motion, [own, table]) in study.motions.iter().zip(&predicted.predictions) {
            if motion.trial != k {
                continue;
            }
            for (own, table) in own.iter().zip(table) {
                // The filter is about the middle of its width, which may lie between two frames.
                let frame = (own.time_s * tracked.report.rate_hz + 0.25).round().max(0.0) as usize;
                let six = |v: &[f64]| std::array::from_fn(|c| v.get(c).map_or(f32::NAN, |v| *v as f32));
                if frame < all.measured.len() {
                    all.measured[frame] = six(&own.measured);
                    all.own[frame] = six(&own.predicted);
                    all.table[frame] = six(&table.predicted);
                }
            }
        }
        for frame in tracked.frames.iter().take_while(|frame| frame.number < shown) {
            let [_, _, fz, mx, my, _] = frame.wrench.map(f64::from);
            if fz > LEAST_N {
                // On the floor: M = p × F with z = 0.
                all.pressed[frame.number] = [(-my / fz) as f32, (mx / fz) as f32, 0.0];
            }
        }
        all
    }

    fn arrow(&self, kept: &[usize]) -> ForceArrow {
        let force = |w: &[f32; 6]| [w[0], w[1], w[2]];
        ForceArrow {
            name: "total".to_owned(),
            at_m: kept.iter().map(|f| self.pressed[*f]).collect(),
            measured_n: kept.iter().map(|f| force(&self.measured[*f])).collect(),
            predicted_n: kept.iter().map(|f| force(&self.own[*f])).collect(),
        }
    }

    fn curves(&self, kept: &[usize]) -> Vec<Curve> {
        let names = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"];
        let curve = |(c, name): (usize, &str)| {
            let of = |all: &[[f32; 6]]| kept.iter().map(|f| all[*f][c]).collect();
            Curve {
                name: name.to_owned(),
                unit: if c < 3 { "N" } else { "N m" }.to_owned(),
                measured: of(&self.measured),
                identified: of(&self.own),
                table: of(&self.table),
            }
        };
        names.into_iter().enumerate().map(curve).collect()
    }
}
