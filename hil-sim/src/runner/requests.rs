//! The emulated board's requests to its sensor bus, over pipes.

use std::fs::File;
use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use rigident_shared::wire::bus::{Event, MAX_TRANSFER_BYTES, Operation, REQUEST_HEADER_BYTES, RequestHeader};

use super::sensor_bus::SensorBus;

/// Answers requests until the board closes its pipe. Once `leave` is set a poll is answered with
/// [`Event::Exit`].
///
/// # Errors
/// `InvalidData` on a request that is none; whatever reading or writing a pipe gives.
pub(super) fn answer_requests(
    requests: &mut File,
    answers: &mut File,
    bus: &mut dyn SensorBus,
    leave: &AtomicBool,
) -> io::Result<()> {
    let mut buffer = [0; REQUEST_HEADER_BYTES + MAX_TRANSFER_BYTES];
    let mut held = 0;
    loop {
        // The board sends one request and waits, so one read mostly brings exactly one.
        let n = match requests.read(&mut buffer[held..]) {
            Ok(0) => return Ok(()),
            Ok(n) => n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(e),
        };
        held += n;
        let Some((header, payload)) = buffer[..held].split_first_chunk_mut() else { continue };
        let header = RequestHeader::decode(*header)
            .map_err(|e| io::Error::new(io::ErrorKind::InvalidData, format!("not a bus request: {e:?}")))?;
        let Some(payload) = payload.get_mut(..usize::from(header.length)) else { continue };
        match header.operation {
            Operation::Poll => {
                let mut answer = bus.poll();
                if leave.load(Ordering::Acquire) {
                    answer.event = Event::Exit;
                }
                answers.write_all(&answer.encode())?;
            }
            Operation::TransferLoadCell => {
                bus.transfer_load_cell(payload);
                answers.write_all(payload)?;
            }
            Operation::TransferImu => {
                bus.transfer_imu(payload);
                answers.write_all(payload)?;
            }
            Operation::TransferSecondImu => {
                bus.transfer_second_imu(payload);
                answers.write_all(payload)?;
            }
            Operation::TransferFlash => {
                bus.transfer_flash(payload);
                answers.write_all(payload)?;
            }
            Operation::TransferFrame => {
                bus.transfer_frame(payload);
                answers.write_all(payload)?;
            }
        }
        held = 0;
    }
}
