//! Errors of a file.

/// The reasons why parts cannot be read of a C3D file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum C3dError {
    /// Another format.
    #[error("it is no C3D file: its second byte is not 0x50")]
    NotC3d,
    /// The system cannot read it.
    #[error("it cannot be read: {0}")]
    Unreadable(String),
    /// The file ends before what it promises.
    #[error(
        "it is cut off: {what} would end at byte {needed}, and the file has {bytes} bytes; copy it again \
         from where it was recorded"
    )]
    Truncated {
        /// The missing part.
        what: &'static str,
        /// Bytes that would be needed.
        needed: u64,
        /// Bytes that are there.
        bytes: u64,
    },
    /// A number format that is none.
    #[error("its processor type {0} is none of Intel (84), DEC (85) and MIPS (86)")]
    Processor(u8),
    /// A parameter that says nothing that can be.
    #[error("parameter {group}:{name}: {reason}")]
    Parameter {
        /// Group.
        group: &'static str,
        /// Name.
        name: &'static str,
        /// The fault in it.
        reason: String,
    },
}

/// Returns what is wrong with a parameter.
pub(super) fn parameter(group: &'static str, name: &'static str, reason: String) -> C3dError {
    C3dError::Parameter { group, name, reason }
}
