//! The statements of a user about a file: read, checked, and brought together with what is found.

use std::collections::BTreeMap;

use super::{Choices, Undecided, Understood, sources};
use crate::recording::columns::{Known, TIME};
use crate::recording::conventions::{self, Meaning};
use crate::recording::{Recording, RecordingError};
use crate::rig::{DecimalMark, RecordingTable, RigFile, Unit, WrenchSign};

/// Known columns, each with its name in the file and its unit.
pub type Columns = BTreeMap<String, (String, Option<String>)>;

/// Why a statement about a file is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChoiceError {
    /// A column.
    #[error("`column` {words}: {why}")]
    Column {
        /// The statement.
        words: String,
        /// The fault in it.
        why: String,
    },
    /// A unit.
    #[error("`unit` {words}: {why}")]
    Unit {
        /// The statement.
        words: String,
        /// The fault in it.
        why: String,
    },
    /// No file has such a column.
    #[error("there is no column {name:?}; there are {}", names.join(", "))]
    NoColumn {
        /// The column.
        name: String,
        /// The columns of the file.
        names: Vec<String>,
    },
}

impl Choices {
    /// Reads statements: `fx_n=NAME` or `fx_n=NAME:UNIT` about columns, `NAME=UNIT` about units.
    ///
    /// # Errors
    /// [`ChoiceError`]: the first statement that is none.
    ///
    /// ```
    /// use rigident_io::recording::import::Choices;
    ///
    /// let choices = Choices::read(&["fx_n=Kraft x:kN".to_owned()], &["t=ms".to_owned()], None)?;
    /// assert_eq!(choices.columns["fx_n"], ("Kraft x".to_owned(), Some("kN".to_owned())));
    /// # Ok::<(), rigident_io::recording::import::ChoiceError>(())
    /// ```
    pub fn read(
        columns: &[String],
        units: &[String],
        decimal: Option<DecimalMark>,
    ) -> Result<Self, ChoiceError> {
        let mut choices = Self { decimal, ..Self::default() };
        for words in columns {
            let refuse = |why: String| ChoiceError::Column { words: words.clone(), why };
            let (known, rest) = words
                .split_once('=')
                .ok_or_else(|| refuse("write fx_n=NAME or fx_n=NAME:UNIT".to_owned()))?;
            if Known::parse(known).is_none() {
                let why = format!("{known} is no column of a recording (docs/formats.md has them)");
                return Err(refuse(why));
            }
            let (name, unit) = match rest.rsplit_once(':') {
                Some((name, unit)) if Unit::parse(unit).is_some() => (name, Some(unit.to_owned())),
                _ => (rest, None),
            };
            choices.columns.insert(known.to_owned(), (name.to_owned(), unit));
        }
        for words in units {
            let refuse = |why: String| ChoiceError::Unit { words: words.clone(), why };
            let (name, unit) = words.rsplit_once('=').ok_or_else(|| refuse("write NAME=UNIT".to_owned()))?;
            if Unit::parse(unit).is_none() {
                return Err(refuse(format!("{unit:?} is no unit that is known (docs/formats.md has them)")));
            }
            choices.units.insert(name.to_owned(), unit.to_owned());
        }
        Ok(choices)
    }

    /// Refuses a choice of a column that no file has.
    ///
    /// # Errors
    /// [`ChoiceError::NoColumn`].
    pub fn check(&self, files: &[Understood]) -> Result<(), ChoiceError> {
        let all = || files.iter().flat_map(|file| &file.columns).map(|column| &column.name);
        let chosen = self.columns.values().map(|(name, _)| name).chain(self.units.keys());
        match chosen.into_iter().find(|name| !all().any(|own| own == *name)) {
            Some(name) => Err(ChoiceError::NoColumn { name: name.clone(), names: all().cloned().collect() }),
            None => Ok(()),
        }
    }
}

impl Understood {
    /// Returns the known columns with where they are, by those choices that are about this file.
    ///
    /// # Errors
    /// [`Undecided`]: no column is known, or the unit of one is written nowhere.
    pub fn decided(&self, choices: &Choices) -> Result<Columns, Undecided> {
        let there = |name: &String| self.columns.iter().any(|column| column.name == *name);
        let own = choices.columns.iter().filter(|(_, (name, _))| there(name));
        let own = own.map(|(known, column)| (known.clone(), column.clone())).collect();
        let found = self.proposal(&Choices { columns: own, ..choices.clone() })?;
        let is_known = found.keys().any(|known| known != TIME) || !self.joints().is_empty();
        if is_known {
            return Ok(found);
        }
        let names: Vec<String> = self.columns.iter().map(|column| column.name.clone()).collect();
        let meanings: Vec<Option<Meaning>> = self.columns.iter().map(|c| c.meaning.clone()).collect();
        let repeated = conventions::repeated(&names, &meanings);
        Err(repeated.map_or(Undecided::NoneKnown, |(known, names)| Undecided::Twice { known, names }))
    }

    /// Reads the file with these columns, this sign of the wrench and this decimal mark.
    ///
    /// # Errors
    /// [`RecordingError`] of the file.
    pub fn read_as(
        &self,
        columns: &Columns,
        wrench_sign: WrenchSign,
        decimal: Option<DecimalMark>,
    ) -> Result<Recording, RecordingError> {
        let columns = sources(columns);
        let recording = RecordingTable { wrench_sign, decimal, columns, ..RecordingTable::default() };
        self.read(&RigFile { recording, ..RigFile::default() })
    }
}
