//! Times of day, and dates with them, as spreadsheets and loggers write them.

/// Nanoseconds of a day.
const DAY_NS: i128 = 86_400_000_000_000;
/// Beginnings of the names of the months: English, German, French, Italian, Spanish, Portuguese.
const MONTHS: [&[&str]; 12] = [
    &["jan", "gen", "ene"],
    &["feb", "fév", "fev"],
    &["mar", "mär", "mrz"],
    &["apr", "avr", "abr"],
    &["may", "mai", "mag"],
    &["jun", "juin", "giu"],
    &["jul", "juil", "lug"],
    &["aug", "aoû", "aou", "ago"],
    &["sep", "set"],
    &["oct", "okt", "ott", "out"],
    &["nov"],
    &["dec", "dez", "déc", "dic"],
];

/// A date as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Date {
    /// Days since 1970.
    Sure(i64),
    /// Two numbers that are day and month in an order that it does not say, and the year.
    Either(u32, u32, i64),
}

/// A time of day with its date, if it has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamp {
    date: Option<Date>,
    /// Since midnight.
    ns: i128,
}

/// The findings in the stamps of a column about their dates.
#[derive(Clone, Debug, Default)]
pub(crate) struct Survey {
    first: Option<Date>,
    differ: bool,
    day_first: bool,
    month_first: bool,
}

/// Reads a column's stamps in order.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    dates: Dates,
    /// Days since the first midnight, and the stamp before.
    days: i64,
    before_ns: i128,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dates {
    DayFirst,
    MonthFirst,
    /// Times count from midnight.
    Unused,
}

impl Survey {
    /// Examines a stamp.
    pub(crate) fn see(&mut self, stamp: &Stamp) {
        if let Some(Date::Either(a, b, _)) = stamp.date {
            self.day_first |= a > 12;
            self.month_first |= b > 12;
        }
        match (self.first, stamp.date) {
            (None, date) => self.first = date,
            (Some(first), Some(date)) => self.differ |= first != date,
            (Some(_), None) => self.differ = true,
        }
    }

    /// Returns the reader of the column, and what is to be said of it.
    ///
    /// # Errors
    /// Says why the dates have no meaning.
    pub(crate) fn clock(&self) -> Result<(Clock, Option<String>), String> {
        let (dates, said) = match (self.first, self.day_first, self.month_first) {
            (_, true, true) => {
                return Err(
                    "its dates have the day first in some rows and the month in others: write them as \
                            2026-12-31"
                        .to_owned(),
                );
            }
            (Some(Date::Either(..)), false, false) if self.differ => {
                return Err(
                    "nothing shows whether day or month comes first in its dates: write them as 2026-12-31"
                        .to_owned(),
                );
            }
            (Some(Date::Either(..)), false, false) => (
                Dates::Unused,
                Some(
                    "nothing shows whether day or month comes first in the date: times count from its \
                     midnight",
                ),
            ),
            (None, ..) => (Dates::Unused, None),
            (_, _, true) => (Dates::MonthFirst, None),
            _ => (Dates::DayFirst, None),
        };
        Ok((Clock { dates, days: 0, before_ns: 0 }, said.map(str::to_owned)))
    }
}

impl Clock {
    /// Returns a stamp in ns: since 1970 if dates count, otherwise since the first midnight.
    pub(crate) fn ns(&mut self, stamp: &Stamp) -> Option<i128> {
        let days = match (self.dates, stamp.date) {
            (Dates::Unused, _) => {
                // After midnight the day is the next one.
                self.days += i64::from(stamp.ns + DAY_NS / 2 < self.before_ns);
                self.before_ns = stamp.ns;
                self.days
            }
            (_, Some(Date::Sure(days))) => days,
            (Dates::DayFirst, Some(Date::Either(day, month, year))) => days(year, month, day)?,
            (Dates::MonthFirst, Some(Date::Either(month, day, year))) => days(year, month, day)?,
            (_, None) => return None,
        };
        Some(i128::from(days) * DAY_NS + stamp.ns)
    }
}

impl Stamp {
    /// Reads a time of day, or a date with one; `None` if it is none.
    pub(crate) fn parse(cell: &str) -> Option<Self> {
        if cell.len() > 64 {
            return None;
        }
        // A number has no colon.
        if !cell.contains(':') {
            return basic(cell).and_then(|extended| Self::parse(&extended));
        }
        if cell.contains(" day") {
            return elapsed(cell);
        }
        if let Some(plain) = weekday_first(cell) {
            return Self::parse(&plain);
        }
        let mut rest = cell.trim();
        let mut shift_ns = 0;
        if let Some(utc) = rest.strip_suffix(['Z', 'z']).or_else(|| rest.strip_suffix(" UTC")) {
            rest = utc;
        } else if let Some((local, zone)) = offset(rest) {
            (rest, shift_ns) = (local, zone);
        }
        let rest = rest.trim_end();
        let half = |marks: [&str; 2]| marks.iter().find_map(|mark| rest.strip_suffix(mark));
        let (clock, is_afternoon) = match (half(["AM", "am"]), half(["PM", "pm"])) {
            (Some(clock), _) => (clock.trim_end(), Some(false)),
            (_, Some(clock)) => (clock.trim_end(), Some(true)),
            _ => (rest, None),
        };
        let at = clock.rfind(|c: char| c == 'T' || c == '_' || c.is_whitespace());
        let (date, clock) = match at {
            Some(at) => {
                let (date, clock) = clock.split_at(at);
                (Some(date_of(date.trim().trim_end_matches(','))?), clock.trim_start_matches(['T', '_', ' ']))
            }
            None => (None, clock),
        };
        let ns = time_of_day(clock.trim(), is_afternoon)? - shift_ns;
        Some(Self { date, ns })
    }
}

/// Writes the basic form of ISO 8601, `20261120T101233.5`, in the extended one.
fn basic(cell: &str) -> Option<String> {
    let (date, clock) = cell.split_once('T')?;
    let is_number = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    let part = |text: &'_ str, from: usize, to: usize| {
        text.get(from..to).filter(|t| is_number(t)).map(str::to_owned)
    };
    let (year, month, day) = (part(date, 0, 4)?, part(date, 4, 6)?, part(date, 6, 8)?);
    let (hour, minute, second) = (part(clock, 0, 2)?, part(clock, 2, 4)?, part(clock, 4, 6)?);
    let rest = clock.get(6..).filter(|_| date.len() == 8)?;
    Some(format!("{year}-{month}-{day}T{hour}:{minute}:{second}{rest}"))
}

/// Reads a span as pandas writes it: `0 days 00:00:00.005`, `-1 days +23:59:59.9`.
fn elapsed(cell: &str) -> Option<Stamp> {
    let (days, rest) = cell.trim().split_once(" day")?;
    let clock = rest.strip_prefix('s').unwrap_or(rest).trim_start_matches([' ', '+', ',']);
    let days = days.parse::<i32>().ok()?;
    let ns = i128::from(days) * DAY_NS + time_of_day(clock, None)?;
    Some(Stamp { date: None, ns })
}

/// Writes `Fri Nov 20 10:12:33.5 2026` in the order of other dates.
fn weekday_first(cell: &str) -> Option<String> {
    const DAYS: [&str; 7] = ["Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"];
    let parts: Vec<&str> = cell.split_whitespace().collect();
    let [weekday, month, day, clock, year] = parts.as_slice() else { return None };
    DAYS.contains(weekday).then(|| format!("{day}-{month}-{year} {clock}"))
}

/// Parts `+01:00` off a text; ns.
fn offset(text: &str) -> Option<(&str, i128)> {
    let at = text.rfind(['+', '-'])?;
    let (local, zone) = text.split_at_checked(at)?;
    // A date's dash comes before the colons.
    if !local.contains(':') {
        return None;
    }
    let digits: String = zone.chars().skip(1).filter(|c| *c != ':').collect();
    if digits.len() != 4 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let (hours, minutes): (i128, i128) = (digits.get(..2)?.parse().ok()?, digits.get(2..)?.parse().ok()?);
    let ns = (60 * hours + minutes) * 60_000_000_000;
    Some((local, if zone.starts_with('-') { -ns } else { ns }))
}

/// Reads `h:mm:ss.fff`, `h:mm:ss:fff`, `h:mm:ss` or `mm:ss.fff`, ns since midnight.
fn time_of_day(text: &str, is_afternoon: Option<bool>) -> Option<i128> {
    // Two digits could be frames.
    if let Some((clock, fraction)) = text.rsplit_once(':')
        && clock.matches(':').count() == 2
        && matches!(fraction.len(), 3 | 6 | 9)
    {
        return time_of_day(&format!("{clock}.{fraction}"), is_afternoon);
    }
    let parts: Vec<&str> = text.split(':').collect();
    let number = |text: &str, most: i128| {
        let value = (1..=2).contains(&text.len()).then(|| text.parse::<i128>().ok()).flatten()?;
        (text.bytes().all(|b| b.is_ascii_digit()) && value <= most).then_some(value)
    };
    let (hours, minutes, seconds) = match parts.as_slice() {
        [h, m, s] => (number(h, 23)?, number(m, 59)?, *s),
        // Without a fraction it could be hours and minutes.
        [m, s] if s.contains(['.', ',']) && is_afternoon.is_none() => (0, number(m, 59)?, *s),
        _ => return None,
    };
    let (whole, fraction) = seconds.split_once(['.', ',']).unwrap_or((seconds, "0"));
    if fraction.is_empty() || fraction.len() > 18 || !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    // More than nine places are rounded to the nearest ns.
    let scaled: i128 = format!("{fraction:0<18}").parse().ok()?;
    let ns = (scaled + 500_000_000) / 1_000_000_000;
    let hours = match is_afternoon {
        Some(_) if !(1..=12).contains(&hours) => return None,
        Some(pm) => hours % 12 + if pm { 12 } else { 0 },
        None => hours,
    };
    Some(((60 * hours + minutes) * 60 + number(whole, 60)?) * 1_000_000_000 + ns)
}

/// Reads a date.
fn date_of(text: &str) -> Option<Date> {
    let mark = text.chars().find(|c| matches!(c, '-' | '/' | '.' | ' '))?;
    let parts: Vec<&str> = text.split(mark).map(str::trim).filter(|part| !part.is_empty()).collect();
    let [a, b, c] = parts.as_slice() else { return None };
    let number = |text: &str| -> Option<u32> {
        let is_number = text.bytes().all(|b| b.is_ascii_digit()) && text.len() <= 4;
        is_number.then(|| text.parse().ok()).flatten()
    };
    let year = |text: &str| {
        let year = i64::from(number(text)?);
        Some(if text.len() == 2 { 2000 + year } else { year }).filter(|_| matches!(text.len(), 2 | 4))
    };
    // 20-Nov-2026
    if let Some(month) = month(b) {
        return Some(Date::Sure(days(year(c)?, month, number(a)?)?));
    }
    if a.len() == 4 {
        return Some(Date::Sure(days(year(a)?, number(b)?, number(c)?)?));
    }
    if mark == '.' {
        return Some(Date::Sure(days(year(c)?, number(b)?, number(a)?)?));
    }
    let (a, b) = (number(a)?, number(b)?);
    let fits = |n: u32, most: u32| (1..=most).contains(&n);
    (fits(a, 31) && fits(b, 31) && (a <= 12 || b <= 12)).then_some(Date::Either(a, b, year(c)?))
}

fn month(text: &str) -> Option<u32> {
    let small = text.to_lowercase();
    let place = MONTHS.iter().position(|names| names.iter().any(|name| small.starts_with(name)))?;
    u32::try_from(place + 1).ok()
}

/// Returns the days from 1970 to a date of the Gregorian calendar; `None` if there is no such day.
fn days(year: i64, month: u32, day: u32) -> Option<i64> {
    let is_leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let lengths = [31, if is_leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let index = usize::try_from(month.checked_sub(1)?).ok()?;
    if !(1..=*lengths.get(index)?).contains(&day) || year < 1 {
        return None;
    }
    let before: u32 = lengths.iter().take(index).sum();
    let past = year - 1;
    let leaps = |y: i64| y / 4 - y / 100 + y / 400;
    Some(365 * (year - 1970) + leaps(past) - leaps(1969) + i64::from(before + day - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ns(cells: &[&str]) -> Result<Vec<i128>, String> {
        let mut survey = Survey::default();
        let stamps: Vec<Stamp> =
            cells.iter().map(|cell| Stamp::parse(cell).unwrap_or_else(|| panic!("{cell}"))).collect();
        stamps.iter().for_each(|stamp| survey.see(stamp));
        let mut clock = survey.clock()?.0;
        Ok(stamps.iter().map(|stamp| clock.ns(stamp).unwrap()).collect())
    }

    #[test]
    fn one_moment_is_one_number_in_every_country() {
        // 2026-11-20T10:12:33.002Z
        let known = 1_795_169_553_002_000_000_i128;
        for cell in [
            "2026-11-20T10:12:33.002Z",
            "2026-11-20 10:12:33.002",
            "2026/11/20 10:12:33,002",
            "2026-11-20T11:12:33.002+01:00",
            "20.11.2026 10:12:33,002",
            "20.11.26 10:12:33,002",
            "11/20/2026 10:12:33.002 AM",
            "11/20/26 10:12:33.002",
            "20/11/2026 10:12:33.002",
            "20-Nov-2026 10:12:33.002",
            "20 Nov 2026 10:12:33.002",
            "20261120T101233.002",
            "20261120T101233,002Z",
            "20261120T111233.002+0100",
            "Fri Nov 20 10:12:33.002 2026",
            "20 nov. 2026 10:12:33,002",
            "20.11.2026 10:12:33:002",
        ] {
            assert_eq!(ns(&[cell]), Ok(vec![known]), "{cell}");
        }
        assert_eq!(ns(&["11/20/26 12:00:00.5 AM"]).unwrap()[0] % DAY_NS, 500_000_000);
        assert_eq!(ns(&["11/20/26 12:00:00 PM"]).unwrap()[0] % DAY_NS, DAY_NS / 2);
        // As pandas writes spans of time.
        assert_eq!(ns(&["0 days 00:00:00", "0 days 00:00:00.005000"]), Ok(vec![0, 5_000_000]));
        assert_eq!(
            ns(&["-1 days +23:59:59.5", "1 days 00:00:01"]),
            Ok(vec![-500_000_000, DAY_NS + 1_000_000_000])
        );
        for (names, number) in
            [(["juin", "giugno"], 6), (["juil.", "lug"], 7), (["déc.", "dic"], 12), (["Août", "ago"], 8)]
        {
            assert!(names.iter().all(|name| month(name) == Some(number)), "{names:?}");
        }
        assert_eq!(days(1970, 1, 1), Some(0));
        assert_eq!(days(2000, 2, 29), Some(11_016));
        assert_eq!(days(2026, 2, 29), None);
    }

    #[test]
    fn days_pass_at_midnight_and_unclear_dates_are_refused() {
        assert_eq!(ns(&["23:59:59.9", "00:00:00.1"]), Ok(vec![DAY_NS - 100_000_000, DAY_NS + 100_000_000]));
        assert_eq!(ns(&["12:33,5", "12:34,0"]), Ok(vec![753_500_000_000, 754_000_000_000]));
        // One date, whichever it is: from its midnight.
        assert_eq!(
            ns(&["03/04/2026 00:00:01", "03/04/2026 00:00:02"]),
            Ok(vec![1_000_000_000, 2_000_000_000])
        );
        assert!(ns(&["03/04/2026 00:00:01", "04/04/2026 00:00:02"]).is_err());
        // A day above twelve decides.
        assert!(ns(&["03/12/2026 23:59:59", "03/13/2026 00:00:02"]).is_ok());
        for none in [
            "",
            "12",
            "12:30",
            "25:00:00",
            "10:60:00",
            "10:12:33.",
            "31.02.2026 10:12:33",
            "13/13/2026 1:00:00",
            "a:b:c",
            "20261120T1012",
            "20261120",
            "10:12:33:25",
            "2026-11-20T101233",
        ] {
            assert_eq!(Stamp::parse(none), None, "{none}");
        }
    }
}
