//! The board that the calibration of a load cell belongs to.

use rigident_io::rig::RigFile;
use rigident_shared::wire::Identity;

/// Returns what is to be said where the load cell was calibrated with another board than this one. Nothing is
/// said where one of the two has no number.
pub fn another_board(rig: &RigFile, identity: &Identity) -> Option<String> {
    let calibrated = rig.load_cell.board_id.as_ref()?;
    let here = number(identity.unique_id)?;
    (!calibrated.eq_ignore_ascii_case(&here)).then(|| {
        format!(
            "the load cell was calibrated with board {calibrated} (load_cell.board_id), and this one is \
             {here}: gain and offset of its converter are others; calibrate with this board, or put its \
             number into the rig file if that was done"
        )
    })
}

/// Returns a chip's own number in hexadecimal digits; `None` if it has none.
pub fn number(unique_id: [u8; 12]) -> Option<String> {
    (unique_id != [0; 12]).then(|| unique_id.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use rigident_shared::wire::{ClockSource, Kept, Reason, ResetReason, StateName};

    use super::*;

    fn board(unique_id: [u8; 12]) -> Identity {
        Identity {
            protocol_version: 0,
            schema_hash: 0,
            firmware_version: [0; 3],
            firmware_hash: 0,
            board: [0; 16],
            unique_id,
            reset: ResetReason::PowerOn,
            ended: None,
            clock: ClockSource::Crystal,
            state: StateName::Idle,
            reason: Reason::Boot,
            kept: Kept::NoStorage,
        }
    }

    #[test]
    fn only_another_board_than_the_calibrated_one_is_reported() {
        let rig = |key: &str| RigFile::parse(&format!("[load_cell]\n{key}\n")).unwrap();
        let named = rig("board_id = \"0102030405060708090A0b0c\"");
        let [this, other] =
            [[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 13]];
        assert_eq!(another_board(&named, &board(this)), None);
        let said = another_board(&named, &board(other)).unwrap();
        assert!(
            said.contains("0102030405060708090A0b0c") && said.contains("0102030405060708090a0b0d"),
            "{said}"
        );
        // The simulator has no number, and most rig files name none.
        assert_eq!(another_board(&named, &board([0; 12])), None);
        assert_eq!(another_board(&rig(""), &board(other)), None);
    }
}
