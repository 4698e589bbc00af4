//! Numbers as countries write them: the mark of the decimals and the mark between thousands.
//!
//! A cell rules forms out; a file has one that all its numbers agree with. Where two are left that read a
//! cell differently, none is taken.

use std::borrow::Cow;

/// A way of writing numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Form {
    decimal: char,
    group: Option<char>,
}

/// Every form, the plainest first.
const FORMS: [Form; 8] = [
    Form { decimal: '.', group: None },
    Form { decimal: '.', group: Some(',') },
    Form { decimal: '.', group: Some(' ') },
    Form { decimal: '.', group: Some('\'') },
    Form { decimal: ',', group: None },
    Form { decimal: ',', group: Some('.') },
    Form { decimal: ',', group: Some(' ') },
    Form { decimal: ',', group: Some('\'') },
];
const POINT: u8 = 0b0000_1111;
const COMMA: u8 = 0b1111_0000;
/// Thousands with commas, and with points.
const COMMA_GROUPS: u8 = 0b0000_0010;
const POINT_GROUPS: u8 = 0b0010_0000;
const MOST_MARKS: usize = 8;

/// The forms that are left, as bits, and the marks that were seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Forms {
    left: u8,
    commas: bool,
    points: bool,
}

/// Why there is no form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unclear {
    /// Nothing shows whether `1,234` has decimals or thousands.
    Comma,
    /// Nothing shows whether `1.234` has decimals or thousands.
    Point,
}

impl Forms {
    /// Every form.
    pub(crate) const ALL: Self = Self { left: 0xff, commas: false, points: false };

    /// The plainest form alone: a point, and nothing between thousands.
    pub(crate) const PLAIN: Self = Self { left: 1, ..Self::ALL };

    /// Returns those with a point, or a comma, before the decimals.
    pub(crate) fn with_decimal(comma: bool) -> Self {
        Self { left: if comma { COMMA } else { POINT }, ..Self::ALL }
    }

    /// Rules out the forms that a cell is no number in; a cell that is a number in none rules out nothing.
    /// Returns false where this leaves none.
    pub(crate) fn see(&mut self, cell: &str) -> bool {
        let (fits, commas, points) = fits(cell);
        if fits == 0 {
            return true;
        }
        if self.left & fits == 0 {
            return false;
        }
        self.left &= fits;
        self.commas |= commas;
        self.points |= points;
        true
    }

    /// Rules out forms as [`Forms::see`] does. Returns false for a cell that is no number, too.
    pub(crate) fn see_number(&mut self, cell: &str) -> bool {
        is_number(cell) && self.see(cell)
    }

    /// Returns true if a form is left.
    pub(crate) fn has(self, form: Form) -> bool {
        FORMS.iter().position(|own| *own == form).is_some_and(|k| self.left & (1 << k) != 0)
    }

    /// Returns true if decimals are seen to have a point.
    pub(crate) fn is_point(self) -> bool {
        self.points && self.left & COMMA == 0
    }

    /// Returns what both leave; the first where they leave none.
    pub(crate) fn and(self, other: Self) -> Self {
        let left = self.left & other.left;
        if left == 0 { self } else { Self { left, ..self } }
    }

    /// Returns the forms that both leave, as [`Forms::and`], with the marks that either saw.
    pub(crate) fn join(self, other: Self) -> Self {
        let both = self.and(other);
        Self { commas: self.commas || other.commas, points: self.points || other.points, ..both }
    }

    /// Returns the form of the numbers. Where they could have decimals or thousands after a point, they have
    /// decimals if `has_points`.
    ///
    /// # Errors
    /// [`Unclear`]: two forms are left that differ.
    pub(crate) fn form(self, has_points: bool) -> Result<Form, Unclear> {
        if self.commas && self.left & COMMA_GROUPS != 0 && self.left & COMMA != 0 {
            return Err(Unclear::Comma);
        }
        let is_point_unclear = self.points && self.left & POINT_GROUPS != 0 && self.left & POINT != 0;
        if is_point_unclear && !has_points {
            return Err(Unclear::Point);
        }
        let first = self.left.trailing_zeros() as usize;
        FORMS.get(first).copied().ok_or(Unclear::Comma)
    }
}

impl Form {
    /// The form of numbers in the notation.
    pub(crate) const PLAIN: Self = FORMS[0];

    /// Returns the form that cells agree with, a point before three digits being one before decimals; `comma`
    /// is what a rig file says. `None` if there is none, or two.
    pub(crate) fn of<'a>(cells: impl IntoIterator<Item = &'a str>, comma: Option<bool>) -> Option<Self> {
        let mut forms = comma.map_or(Forms::ALL, Forms::with_decimal);
        let agree = cells.into_iter().all(|cell| forms.see(cell));
        agree.then(|| forms.form(true).ok()).flatten()
    }

    /// Returns its name, for people: the decimal mark and that of the thousands.
    pub(crate) fn name(self) -> String {
        let of = |mark: char| match mark {
            ',' => "comma",
            '.' => "point",
            ' ' => "blank",
            _ => "apostrophe",
        };
        let decimal = format!("decimal {}", of(self.decimal));
        self.group.map_or_else(|| decimal.clone(), |g| format!("{decimal}, thousands by {}", of(g)))
    }

    /// Returns true if a cell is a number in this form.
    pub(crate) fn fits(self, cell: &str) -> bool {
        let own = FORMS.iter().position(|form| *form == self).unwrap_or(0);
        fits(cell).0 & (1 << own) != 0
    }

    /// Returns a cell as the notation writes it, with a decimal point alone; as it is if it is no number.
    ///
    /// # Errors
    /// The cell is a number, and has other marks than this form.
    pub(crate) fn plain(self, cell: &str) -> Result<Cow<'_, str>, String> {
        let (forms, ..) = fits(cell);
        if forms == 0 {
            return Ok(Cow::Borrowed(cell));
        }
        if !self.fits(cell) {
            return Err(format!(
                "{cell:?} has other marks than the numbers of the file, which have a {}: correct it, or \
                 remove the row",
                self.name()
            ));
        }
        let (is_negative, unsigned) = signed(cell);
        // A sign before the digits, or none.
        let is_usual = cell.len() <= unsigned.len() + 1 && cell.ends_with(unsigned);
        if is_usual
            && (cell.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'-' | b'+' | b'e' | b'E'))
                || (self == Self::PLAIN && cell.is_ascii()))
        {
            return Ok(Cow::Borrowed(cell));
        }
        let mut plain = String::with_capacity(cell.len() + 1);
        if is_negative {
            plain.push('-');
        }
        for letter in unsigned.chars() {
            match mark(letter) {
                Some(own) if own == self.decimal => plain.push('.'),
                Some(_) => {}
                None => plain.push(letter),
            }
        }
        Ok(Cow::Owned(plain))
    }
}

/// Returns the mark that a letter is: point, comma, blank, apostrophe.
fn mark(letter: char) -> Option<char> {
    match letter {
        '.' | ',' => Some(letter),
        ' ' | '\u{a0}' | '\u{202f}' | '\u{2009}' => Some(' '),
        '\'' | '\u{2019}' => Some('\''),
        _ => None,
    }
}

/// Parts the sign off a number: `-5`, `- 5`, and as accounts write it `5-`, `(5)`.
fn signed(cell: &str) -> (bool, &str) {
    if let Some(inside) = cell.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')) {
        return (true, inside);
    }
    if let Some(unsigned) = cell.strip_prefix(['-', '\u{2212}']) {
        return (true, unsigned.trim_start());
    }
    if let Some(unsigned) = cell.strip_prefix('+') {
        return (false, unsigned.trim_start());
    }
    cell.strip_suffix(['-', '\u{2212}']).map_or((false, cell), |unsigned| (true, unsigned.trim_end()))
}

/// Returns true if a cell is a number in some form.
pub(crate) fn is_number(cell: &str) -> bool {
    fits(cell).0 != 0
}

/// Returns the forms in which a cell is a number, as bits, and whether it has commas and points.
fn fits(cell: &str) -> (u8, bool, bool) {
    const NONE: (u8, bool, bool) = (0, false, false);
    let (_, unsigned) = signed(cell);
    let (mantissa, exponent) = match unsigned.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (unsigned, None),
    };
    if let Some(exponent) = exponent {
        let digits = exponent.strip_prefix(['-', '+']).unwrap_or(exponent);
        if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
            return NONE;
        }
    }
    let (mut marks, mut runs) = ([' '; MOST_MARKS], [0_usize; MOST_MARKS + 1]);
    let mut count = 0;
    for letter in mantissa.chars() {
        if letter.is_ascii_digit() {
            runs[count] += 1;
        } else if let Some(mark) = mark(letter).filter(|_| count < MOST_MARKS) {
            marks[count] = mark;
            count += 1;
        } else {
            return NONE;
        }
    }
    if runs.iter().sum::<usize>() == 0 {
        return NONE;
    }
    let marks = &marks[..count];
    let mut bits = 0;
    for (k, form) in FORMS.iter().enumerate() {
        let has_decimals = marks.last() == Some(&form.decimal);
        let groups = count - usize::from(has_decimals);
        let is_grouped = marks[..groups].iter().all(|mark| form.group == Some(*mark))
            && (1..=3).contains(&runs[0])
            && !mantissa.starts_with('0')
            && runs[1..=groups].iter().all(|run| *run == 3)
            && exponent.is_none();
        if groups == 0 || is_grouped {
            bits |= 1 << k;
        }
    }
    (bits, marks.contains(&','), marks.contains(&'.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(cells: &[&str]) -> Result<Form, Unclear> {
        let mut forms = Forms::ALL;
        assert!(cells.iter().all(|cell| forms.see(cell)), "{cells:?}");
        forms.form(false)
    }

    #[test]
    fn numbers_of_one_form_are_read_and_unclear_ones_are_not() {
        for (cells, known) in [
            (&["1234.5", "-0.5", "7"][..], &["1234.5", "-0.5", "7"][..]),
            (&["1,5", "-0,25", "7", "1,5E-3"], &["1.5", "-0.25", "7", "1.5E-3"]),
            (&["1.234,5", "999", "1.234"], &["1234.5", "999", "1234"]),
            (&["1,234.5", "1,234"], &["1234.5", "1234"]),
            (&["1 234,5", "12\u{a0}345,5", "\u{2212}3\u{202f}000,0"], &["1234.5", "12345.5", "-3000.0"]),
            (&["1'234.5", "12’345"], &["1234.5", "12345"]),
            // A thousand has no zero before it.
            (&["0,123", "1,234"], &["0.123", "1.234"]),
            (&["0.123", "1.234"], &["0.123", "1.234"]),
            (&["1.234.567", "1.234"], &["1234567", "1234"]),
            (&["5.58-", "(5.58)", "- 5.58", "+ 7", "5-"], &["-5.58", "-5.58", "-5.58", "7", "-5"]),
            (&["5,58-", "(1.234,5)", "- 0,5"], &["-5.58", "-1234.5", "-0.5"]),
        ] {
            let form = form(cells).unwrap_or_else(|unclear| panic!("{cells:?}: {unclear:?}"));
            for (cell, known) in cells.iter().zip(known) {
                assert_eq!(form.plain(cell).as_deref(), Ok(*known), "{cells:?}");
            }
        }
        assert_eq!(form(&["1,234", "-12,345", "7"]), Err(Unclear::Comma));
        assert_eq!(form(&["1.234", "-12.345", "7"]), Err(Unclear::Point));
        let mut forms = Forms::ALL;
        assert!(forms.see("1,5") && !forms.see("2.5"));
        assert!(Form::PLAIN.plain("1,5").is_err());
        for none in [
            "", "-", ".", "abc", "1,23,456", "12:30", "1e", "0x10", "1.5.2", "nan", "()", "-5-", "(-5)",
            "1e-", "3-4",
        ] {
            assert!(FORMS.iter().all(|form| !form.fits(none)), "{none}");
        }
    }
}
