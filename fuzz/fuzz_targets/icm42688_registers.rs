//! Any bytes to the IMU's model, with samples between them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident_sim::devices::Icm42688;

fuzz_target!(|bytes: &[u8]| {
    let mut imu = Icm42688::new();
    let mut rest = bytes;
    let mut time_ns = 0;
    while let [step, after @ ..] = rest {
        rest = after;
        if step % 2 == 0 {
            time_ns += 1_000_000;
            let value = f64::from(*step) - 128.0;
            imu.sample(time_ns, [value; 3], [value / 10.0; 3], value);
        } else {
            let (transfer, after) = rest.split_at(rest.len().min(usize::from(step / 2)));
            rest = after;
            imu.transfer(&mut transfer.to_vec());
        }
    }
});
