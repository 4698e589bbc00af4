//! A platform driven by the library: what the program checks is checked, and nobody moves it without being
//! asked.

use std::sync::Mutex;

use rigident::answer::Status;
use rigident::application::driving::{
    Agreement, Attendant, Consent, DriveOptions, DrivingError, End, LoadBounds, Nobody, Programme, Request,
    TraceFile, prepare,
};
use rigident::application::{Caller, Error, Report};
use rigident::device::session::Observer;
use rigident::device::{platform, ports};
use rigident_shared::wire::ReadingMessage;
use rigident_sim::rig::MotionState;

use super::Served;

/// Agrees to everything, and remembers what was said and shown.
#[derive(Default)]
struct Trusting {
    heard: Mutex<Vec<String>>,
}

impl Trusting {
    fn heard(&self) -> String {
        self.heard.lock().unwrap().join("\n")
    }
}

impl Attendant for Trusting {
    fn hear(&self, words: &str) {
        self.heard.lock().unwrap().push(words.to_owned());
    }

    fn see(&self, consent: &Consent<'_>) {
        self.hear(&consent.to_string());
    }

    fn can_agree(&self) -> Result<(), DrivingError> {
        Ok(())
    }

    fn agree(&self) -> Result<Agreement, DrivingError> {
        Ok(Agreement { by: "the test", is_after_a_while: false })
    }

    fn count_down(&self) -> Result<(), DrivingError> {
        Ok(())
    }
}

/// Counts the readings of the experiment.
struct Counting(usize);

impl Observer for Counting {
    fn reading(&mut self, _reading: &ReadingMessage) -> Result<(), String> {
        self.0 += 1;
        Ok(())
    }
}

fn options(served: &Served) -> DriveOptions {
    DriveOptions {
        platform: served.address(),
        rig: served.path("rig.toml"),
        calibration: None,
        load: LoadBounds::default(),
        programme: Programme { duration_s: 20.0, plan: None },
        adaptive: false,
        end: End::default(),
        slow: None,
        warm_up_s: 0.0,
        stop: Default::default(),
        span: None,
        known: Default::default(),
        asked: Vec::new(),
    }
}

#[test]
fn the_library_weighs_checks_asks_and_drives() {
    let served = Served::new();
    let at = Trusting::default();
    let mut request = Request::new(options(&served), &at).unwrap();
    let mut platform = platform::connect(&served.address(), &request.geometry).unwrap();
    let mut session = ports::open(served.path("port").to_str().unwrap()).unwrap();
    let prepared = prepare(&mut request, platform.as_mut(), &mut session, &at).unwrap();
    for words in
        ["the load cell carries", "zero: mean wrench", "load guard ON", "motion guard ON", "condition up to"]
    {
        assert!(at.heard().contains(words), "{words}\n{}", at.heard());
    }
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
    let trace = TraceFile::create(served.path("trace.jsonl")).unwrap();
    let agreed = prepared.agreed(&request, platform.as_mut(), &mut session, (&at, &trace)).unwrap();
    let start = agreed.approached(&request, platform.as_mut(), &mut session, (&at, &trace)).unwrap();
    let mut counting = Counting(0);
    let mut driven = start.drive(&request, platform.as_mut(), &mut session, (&at, &mut counting)).unwrap();
    assert!(driven.take.broken.is_none() && counting.0 > 15_000, "{:?}, {}", driven.take.broken, counting.0);
    let loaded = driven.loaded(&request).unwrap();
    let fit = loaded.fit(None, 0, &Caller::default()).unwrap();
    let found = Report::of_recording(&loaded, "port").conclude(fit, &Caller::default()).unwrap();
    assert_eq!(found.answer.status, Status::Identified, "{:?}", found.answer.warnings);
    assert!((found.answer.mass_kg.unwrap() - served.rig.lock().unwrap().truth().body.mass_kg).abs() < 0.1);
}

#[test]
fn where_nobody_agrees_nothing_moves() {
    let served = Served::new();
    let mut request = Request::new(options(&served), &Nobody).unwrap();
    let mut platform = platform::connect(&served.address(), &request.geometry).unwrap();
    let mut session = ports::open(served.path("port").to_str().unwrap()).unwrap();
    let refused = prepare(&mut request, platform.as_mut(), &mut session, &Nobody).err().unwrap();
    let Error::Driving(refused) = refused else { panic!("{refused}") };
    assert!(
        matches!(*refused, DrivingError::NotAgreed(_)) && refused.to_string().contains("nothing was moved")
    );
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
}
