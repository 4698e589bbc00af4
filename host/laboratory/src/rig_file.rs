//! The rig files of the simulated rig, as a user would have written them.

use rigident_sim::links::SecondLink;
use rigident_sim::rig::Rig;

use rigident_io::rig::{
    BodyTable, Calibrated, ImuClass, ImuTable, Joint, LinkTable, LoadCellClass, LoadCellTable,
    RecordingTable, RigFile, TruthTable,
};

/// Returns what a user would have written into the rig file of this rig.
pub fn rig_file(rig: &Rig, body_name: &str) -> RigFile {
    let config = rig.config();
    let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
    let truth = rig.truth();
    let positive = |v: f64| (v > 0.0 && v.is_finite()).then_some(v);
    // Noise that is switched off still leaves the converter's: without σ it is estimated from the residuals.
    let noise = cell.noise_n_nm.iter().all(|v| *v > 0.0).then_some(cell.noise_n_nm);
    RigFile {
        recording: RecordingTable {
            rate_hz: Some(config.adc_hz),
            gravity_mps2: config.gravity_mps2,
            ..RecordingTable::default()
        },
        imu: vec![ImuTable {
            position_m: config.imu.position_m,
            rotation_wxyz: normalised(config.imu.rotation_wxyz),
            accel_scale: Calibrated::Numbers([1.0; 3]),
            group_delay_s: config.imu_group_delay_s(),
            rate_hz: Some(config.imu_hz),
            range_mps2: positive(imu.accel_range_mps2),
            range_radps: positive(imu.gyro_range_radps),
            accel_noise_mps2: positive(imu.accel_noise_mps2.iter().copied().fold(0.0, f64::max)),
            gyro_noise_radps: positive(imu.gyro_noise_radps.iter().copied().fold(0.0, f64::max)),
            class: Some(ImuClass::Exact),
            serial: Some("simulated".to_owned()),
            ..ImuTable::default()
        }],
        load_cell: LoadCellTable {
            noise_n_nm: noise,
            class: Some(LoadCellClass::Exact),
            gain_uncertainty: cell
                .gain_error
                .spread
                .iter()
                .any(|s| *s > 0.0)
                .then_some(cell.gain_error.spread),
            calibration: Some(config.gauge_calibration),
            group_delay_s: config.load_cell_group_delay_s(),
            range_n_nm: cell.range_n_nm.iter().all(|v| v.is_finite()).then_some(cell.range_n_nm),
            serial: Some("simulated".to_owned()),
            ..LoadCellTable::default()
        },
        // A customer's frame that is not S, so that the difference can be seen.
        body: Some(BodyTable {
            name: body_name.to_owned(),
            position_m: [0.0, 0.0, 0.02],
            rotation_wxyz: [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
        }),
        truth: Some(TruthTable {
            mass_kg: truth.body.mass_kg,
            com_m: truth.body.com_m,
            inertia_com_kgm2: truth.body.inertia_com_kgm2,
            apparent_offset_n_nm: Some(truth.apparent_offset_n_nm),
        }),
        ..RigFile::default()
    }
}

fn normalised(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / norm)
}

/// Returns what a user would have written into the rig file of the simulated rig with an arm.
pub fn two_link_file(rig: &Rig, second: &SecondLink) -> RigFile {
    let one = rig_file(rig, "");
    let imu = one.imu.first().cloned().unwrap_or_default();
    let link = |name: &str, nominal: (f64, [f64; 3], [f64; 6])| LinkTable {
        name: name.to_owned(),
        parent: None,
        joint: None,
        axis: None,
        second_axis: None,
        position_m: None,
        rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
        initial_wxyz: None,
        nominal_mass_kg: Some(nominal.0),
        nominal_com_m: Some(nominal.1),
        nominal_inertia_com_kgm2: Some(nominal.2),
    };
    RigFile {
        imu: vec![
            imu.clone(),
            ImuTable {
                link: 1,
                position_m: second.imu.position_m,
                rotation_wxyz: normalised(second.imu.rotation_wxyz),
                ..imu
            },
        ],
        link: vec![
            // As a drawing may have them: bodies that are not quite these.
            link("body", (18.0, [0.0, 0.0, 0.06], [0.3, 1.0, 1.0, 0.0, 0.0, 0.0])),
            LinkTable {
                parent: Some("body".to_owned()),
                joint: Some(Joint::Spherical),
                position_m: Some(second.joint_m),
                initial_wxyz: Some(second.swing.attitude_wxyz(0.0)),
                ..link("arm", (5.5, [0.03, -0.02, 0.11], [0.1, 0.1, 0.05, 0.0, 0.0, 0.0]))
            },
        ],
        body: None,
        // It is of one body.
        truth: None,
        ..one
    }
}
