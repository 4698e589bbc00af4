//! The commands whose output is stored.

/// One command.
pub struct Case {
    /// Name of its golden.
    pub name: &'static str,
    /// Words after `rigident`; `{data}` and `{docs}` are folders.
    pub command: &'static str,
    /// Takes more than a few seconds.
    pub slow: bool,
    /// The factors come from the device: bit for bit.
    pub device: bool,
    /// Another case's golden that this one must give.
    pub as_another: Option<&'static str>,
}

impl Case {
    /// Returns the golden that this case must give.
    pub fn golden(&self) -> &'static str {
        self.as_another.unwrap_or(self.name)
    }
}

const fn batch(name: &'static str, command: &'static str) -> Case {
    Case { name, command, slow: false, device: false, as_another: None }
}

const fn device(name: &'static str, command: &'static str) -> Case {
    Case { name, command, slow: false, device: true, as_another: None }
}

const fn slow(case: Case) -> Case {
    Case { slow: true, ..case }
}

/// Returns a case in the emulator, whose golden is that of the firmware in this process.
const fn emulated(name: &'static str, golden: &'static str, command: &'static str) -> Case {
    Case { name, command, slow: true, device: true, as_another: Some(golden) }
}

/// Every case, in the order in which they run.
pub const CASES: &[Case] = &[
    // The simulated experiment through the firmware.
    device("demo", "demo --out demo"),
    device("demo-seed-2", "demo --seed 2 --duration-s 30 --out day2"),
    device("demo-vertical", "demo --body vertical --seed 7 --duration-s 30 --out vertical"),
    device("demo-vertical-seed-3", "demo --body vertical --seed 3 --out vertical3"),
    device("demo-ideal", "demo --ideal --seed 3 --duration-s 20 --out ideal"),
    device("demo-ideal-vertical", "demo --ideal --body vertical --duration-s 20 --out ideal-vertical"),
    device("demo-short", "demo --seed 5 --duration-s 20 --out short"),
    emulated("demo-short-qemu", "demo-short", "demo --seed 5 --duration-s 20 --mcu qemu --out short-qemu"),
    device("demo-forget", "demo --forget 20 --out demo-forget"),
    device("demo-window", "demo --window 20 --out demo-window"),
    device("demo-known", "demo --known mass_kg=20.0±0.005 --out demo-known"),
    device("demo-symmetry", "demo --symmetry y±0.002 --symmetry x --out demo-symmetry"),
    device(
        "demo-known-symmetry",
        "demo --seed 4 --duration-s 20 --known com_z_m=0.053±0.0002 --symmetry y±0.002 --out demo-ks",
    ),
    device("demo-until", "demo --until m=0.05,Ixx=0.01 --estimate m,Ixx --out demo-until"),
    device("demo-until-go-on", "demo --until m=0.05 --go-on --duration-s 30 --out demo-until-go-on"),
    device("demo-two-links", "demo --body two-links --out two-links"),
    device(
        "demo-two-links-ideal",
        "demo --body two-links --ideal --seed 2 --duration-s 20 --out two-links-ideal",
    ),
    device("demo-human34", "demo --body human34 --duration-s 30 --out human34"),
    slow(device("demo-human34-seed-2", "demo --body human34 --seed 2 --out human34-2")),
    // A tenth of the body, and both halves of a recording: made of the CSV when it is there.
    batch("convert", "convert day2/demo.mcap day2.csv"),
    batch("factor-fixture", "factor day2.csv --rig fixture.rig.toml -o fixture.factor"),
    // Recordings through the firmware.
    device("replay", "replay demo/demo.mcap --out replay"),
    device("replay-forget", "replay demo/demo.mcap --forget 20 --out replay-forget"),
    device("replay-window", "replay demo/demo.mcap --window 20 --out replay-window"),
    device("replay-known", "replay demo/demo.mcap --known mass_kg=20.0±0.005 --out replay-known"),
    device("replay-until", "replay demo/demo.mcap --until m=0.05,Ixx=0.01 --out replay-until"),
    device("replay-tare", "replay demo/demo.mcap --tare fixture.factor --out replay-tare"),
    device("replay-two-links", "replay two-links/demo.mcap --out replay-two-links"),
    device("replay-human34", "replay human34/demo.csv --model human34 --out replay-human34"),
    device("replay-short", "replay short/demo.mcap --out replay-short"),
    device(
        "replay-poses",
        "replay {data}/endeffector_ati_gamma_imu/0-calibration_fts-accel.csv --rig \
         {docs}/endeffector.rig.toml --estimate m,mc,offset --out replay-poses",
    ),
    // One body in batch.
    batch("identify", "identify demo/demo.mcap --out identify"),
    batch("identify-vertical", "identify vertical/demo.mcap --out identify-vertical"),
    batch("identify-ideal", "identify ideal/demo.mcap --out identify-ideal"),
    batch("identify-forget", "identify demo/demo.mcap --forget 20 --out identify-forget"),
    batch("identify-window", "identify demo/demo.mcap --window 20 --out identify-window"),
    batch("identify-known", "identify demo/demo.mcap --known mass_kg=20.0±0.005 --out identify-known"),
    batch(
        "identify-contradicted",
        "identify demo/demo.mcap --known mass_kg=21±0.005 --out identify-contradicted",
    ),
    batch(
        "identify-symmetry",
        "identify day2/demo.mcap --symmetry y±0.002 --symmetry x --out identify-symmetry",
    ),
    batch("identify-tare", "identify demo/demo.mcap --tare fixture.factor --out identify-tare"),
    batch("identify-csv", "identify day2.csv --out identify-csv"),
    batch("identify-gains", "identify demo/demo.mcap --rig gains.rig.toml --out identify-gains"),
    batch("identify-noise-unstated", "identify demo/demo.mcap --rig plain.rig.toml --out identify-unstated"),
    batch(
        "identify-poses",
        "identify {data}/endeffector_ati_gamma_imu/0-calibration_fts-accel.csv --rig \
         {docs}/endeffector.rig.toml --estimate m,mc,offset --out identify-poses",
    ),
    batch(
        "identify-poses-accelerometer",
        "identify {data}/endeffector_ati_gamma_imu/0-calibration_fts-accel.csv --rig \
         {docs}/endeffector-accelerometer.rig.toml --estimate m,mc,offset --out \
         identify-poses-accelerometer",
    ),
    batch(
        "identify-turn",
        "identify {data}/endeffector_ati_gamma_imu --rig {docs}/endeffector-turn.rig.toml --estimate \
         m,mc,offset --out identify-turn",
    ),
    // Factors.
    batch("factor", "factor demo/demo.mcap -o demo.factor"),
    batch("factor-seed-2", "factor day2/demo.mcap -o day2.factor"),
    batch("factor-two", "factor demo/demo.mcap day2/demo.mcap -o two.factor"),
    batch("factor-vertical", "factor vertical/demo.mcap -o vertical.factor"),
    batch("factor-gains", "factor demo/demo.mcap --rig gains.rig.toml -o gains.factor"),
    batch("merge", "merge demo.factor day2.factor -o both.factor"),
    batch("factor-halves", "factor half1.csv half2.csv --rig day2.rig.toml --shared-offset -o shared.factor"),
    batch("factor-first-half", "factor half1.csv --rig day2.rig.toml -o half1.factor"),
    batch("factor-second-half", "factor half2.csv --rig day2.rig.toml -o half2.factor"),
    batch("merge-shared-offset", "merge half1.factor half2.factor --shared-offset -o shared2.factor"),
    batch("merge-other-body", "merge demo.factor vertical.factor -o never.factor"),
    batch("solve", "solve both.factor --estimate m,mc,I --out solve"),
    batch("solve-shared", "solve shared.factor --out solve-shared"),
    batch("solve-gains", "solve gains.factor --out solve-gains"),
    batch("solve-known", "solve both.factor --known mass_kg=20±0.002 --symmetry y±0.001 --out solve-known"),
    batch("solve-tare", "solve demo.factor --tare fixture.factor --out solve-tare"),
    batch("solve-device-factor", "solve demo/demo.factor --out solve-device"),
    // Trees in batch.
    batch("identify-two-links", "identify {docs}/two-links.csv --out identify-two-links"),
    batch("identify-two-links-demo", "identify two-links/demo.mcap --out identify-two-links-demo"),
    batch("identify-human34", "identify human34/demo.csv --model human34 --out identify-human34"),
    slow(batch(
        "identify-human34-symmetric",
        "identify human34/demo.csv --model human34 --symmetric-sides --out identify-human34-symmetric",
    )),
    batch(
        "identify-arm",
        "identify arm.csv --model arm.urdf --friction viscous,coulomb,offset --out identify-arm",
    ),
    batch(
        "identify-arm-plain",
        "identify arm.csv --model arm.urdf --friction viscous,coulomb --lock wrist --out identify-arm-plain",
    ),
    slow(batch(
        "identify-staubli",
        "identify staubli.csv --model {data}/robot_staubli_tx40/tx40_mdh_modified.urdf --friction \
         viscous,coulomb,offset,rotor --drive m6=joint_5+joint_6 --out identify-staubli",
    )),
    // Models.
    batch("base-params-human34", "model base-params human34 --json"),
    batch("base-params-two-links", "model base-params {docs}/two-links.rig.toml --floating --json"),
    batch("base-params-arm", "model base-params arm.urdf --json"),
    batch(
        "base-params-panda",
        "model base-params {data}/urdf/panda.urdf --lock panda_finger_joint1,panda_finger_joint2 --json",
    ),
    batch("base-params-solo", "model base-params {data}/urdf/solo12.urdf --floating --json"),
    batch("check-panda", "model check {data}/urdf/panda.urdf --json"),
    batch("check-g1", "model check {data}/urdf/g1_29dof_rev_1_0.urdf --json"),
    // Monte Carlo and plans.
    batch("montecarlo", "montecarlo --runs 40 --json"),
    batch("montecarlo-gain", "montecarlo --runs 20 --noise gain --body vertical --json"),
    batch("montecarlo-device", "montecarlo --runs 20 --mcu inproc --json"),
    batch("montecarlo-poses", "montecarlo poses --runs 20"),
    batch("plan-poses", "plan poses --n 4 --json"),
    batch("plan-poses-worst", "plan poses --n 5 --objective worst-uncertainty --out poses.json --json"),
    device("demo-plan-poses", "demo --plan poses.json --estimate m,mc --out demo-poses"),
    batch("plan-spheres", "plan motion --objective spheres --duration-s 20 --json"),
    slow(batch("plan-d-optimal", "plan motion --duration-s 20 --json")),
    batch("workspace", "workspace --step-deg 15 --json"),
];

/// A difference that was asked for.
pub struct Exception {
    /// Beginning of the names of the cases.
    pub case: &'static str,
    /// Beginning of what differs.
    pub what: &'static str,
    /// Why.
    pub reason: &'static str,
}

/// Differences from the goldens that were asked for, with the reason.
pub const EXCEPTIONS: &[Exception] = &[];
