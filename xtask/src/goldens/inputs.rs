//! Recordings that no command makes: a planar arm with joint torques, rig files, a real arm's recording in
//! our columns.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result};

/// Writes all inputs into the folder; the real arm's only where its data are.
pub fn write(folder: &Path, data: &Path) -> Result<()> {
    std::fs::write(folder.join("arm.urdf"), ARM)?;
    std::fs::write(folder.join("arm.csv"), arm())?;
    std::fs::write(folder.join("plain.rig.toml"), PLAIN)?;
    std::fs::write(folder.join("gains.rig.toml"), format!("{PLAIN}{GAINS}"))?;
    let real = data.join("robot_staubli_tx40");
    if real.is_dir() {
        std::fs::write(folder.join("staubli.csv"), staubli(&real)?)?;
    }
    Ok(())
}

/// Makes the files that follow from those a case wrote: of a recording as CSV its halves, and the rig that
/// makes a tenth of the body of it.
pub fn after(case: &str, folder: &Path) -> Result<()> {
    if case != "convert" {
        return Ok(());
    }
    let text = std::fs::read_to_string(folder.join("day2.csv"))?;
    let lines: Vec<&str> = text.lines().collect();
    let header = lines.iter().position(|line| line.starts_with("t_s")).context("no header in day2.csv")?;
    let (head, rows) = lines.split_at(header + 1);
    // The first half has poses and motion, as the second half of the motion has no still ones.
    let (first, second) = rows.split_at(rows.len() * 2 / 3);
    for (name, rows) in [("half1.csv", first), ("half2.csv", second)] {
        std::fs::write(folder.join(name), [head, rows].concat().join("\n") + "\n")?;
    }
    let column = |name: &str| format!("{name} = {{ name = \"{name}\", scale = 0.1 }}");
    let columns = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"].map(column).join(", ");
    let fixture = format!("[recording]\ncolumns = {{ {columns} }}\n{PLAIN}");
    std::fs::write(folder.join("fixture.rig.toml"), fixture)?;
    Ok(())
}

/// The rig of the simulated experiment without the noise of its load cell.
const PLAIN: &str = "[[imu]]
position_m = [0.06, -0.04, 0.02]
rotation_wxyz = [0.9205524972973222, 0.20012010810811354, -0.10006005405405677, 0.32019217297298164]
group_delay_s = 0.0006
gyro_noise_radps = 0.0018877551020408164

[load_cell]
group_delay_s = 0.0007496337890625
offset_n_nm = \"estimate\"
";
const GAINS: &str = "gain_uncertainty = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]\n";

/// Two links in a plane and a wrist about their long axis.
const ARM: &str = r#"<robot name="arm">
  <link name="ground"/>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
    <inertia ixx="0.005" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0.05 0 0"/><mass value="0.1"/>
    <inertia ixx="0.0002" iyy="0.0002" izz="0.0002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="ground"/><child link="upper"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" velocity="9" effort="99"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 -1 0"/>
    <origin xyz="0.4 0 0"/><limit lower="-3" upper="3" velocity="9" effort="99"/></joint>
  <joint name="wrist" type="revolute"><parent link="lower"/><child link="hand"/><axis xyz="1 0 0"/>
    <origin xyz="0.3 0 0"/><limit lower="-3" upper="3" velocity="9" effort="99"/></joint>
</robot>
"#;

/// Writes twenty seconds at 200 Hz of the arm with the hand held: torques by the closed form of a planar
/// double pendulum whose links have 2.1 and 1.2 kg at 0.21 and 0.16 m, friction, and noise of a linear
/// congruential generator.
fn arm() -> String {
    let mut text = "t_s,shoulder_rad,elbow_rad,wrist_rad,shoulder_nm,elbow_nm,wrist_nm\n".to_owned();
    let (m1, m2, l1, c1, c2, i1, i2, g) = (2.1, 1.2, 0.4, 0.21, 0.16, 0.035, 0.012, 9.80665);
    let mut state = 12345_u64;
    let mut noise = || {
        let twelve: f64 = (0..12)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum();
        twelve - 6.0
    };
    for n in 0..4000 {
        let t = f64::from(n) / 200.0;
        // Angle, rate, acceleration of a sum of two sines.
        let joint = |a: f64, u: f64, b: f64, v: f64| {
            let (p, q) = (u * t, v * t + 0.4);
            (
                a * p.sin() + b * q.sin(),
                a * u * p.cos() + b * v * q.cos(),
                -a * u * u * p.sin() - b * v * v * q.sin(),
            )
        };
        let (q1, v1, a1) = joint(0.7, 2.1, 0.3, 5.3);
        let (q2, v2, a2) = joint(0.9, 3.3, 0.2, 7.1);
        let h = m2 * l1 * c2;
        let second = i2 + m2 * c2 * c2;
        let first = i1 + m1 * c1 * c1 + m2 * l1 * l1 + second + 2.0 * h * q2.cos();
        let cross = second + h * q2.cos();
        let weight2 = m2 * c2 * g * (q1 + q2).cos();
        let weight1 = (m1 * c1 + m2 * l1) * g * q1.cos() + weight2;
        let tau1 = first * a1 + cross * a2 - h * q2.sin() * (2.0 * v1 * v2 + v2 * v2)
            + weight1
            + 0.8 * v1
            + 0.5 * v1.signum();
        let tau2 = cross * a1 + second * a2 + h * q2.sin() * v1 * v1 + weight2 + 0.3 * v2 + 0.2 * v2.signum();
        let noisy = [tau1, tau2, 0.0].map(|tau| tau + 0.02 * noise());
        // Writing into a string does not fail.
        let _ = writeln!(text, "{t:.3},{q1:.9},{q2:.9},0,{:.6},{:.6},{:.6}", noisy[0], noisy[1], noisy[2]);
    }
    text
}

/// Converts motor angles and motor torques to joint angles and torques: the wrist's last motor turns with two
/// joints.
fn staubli(folder: &Path) -> Result<String> {
    const RATIO: [f64; 6] = [32.0, 32.0, 45.0, -48.0, 45.0, 32.0];
    let rows = |name: &str| -> Result<Vec<[f64; 6]>> {
        let text = std::fs::read_to_string(folder.join(name)).with_context(|| name.to_owned())?;
        let row = |line: &str| -> Result<[f64; 6]> {
            let cells: Vec<f64> = line.split(',').map(|c| c.trim().parse()).collect::<Result<_, _>>()?;
            cells.try_into().map_err(|_| anyhow::anyhow!("{name}: not six cells"))
        };
        text.lines().skip(1).map(row).collect()
    };
    let (motor, current) = (rows("pos_read_data_rows0_29999.csv")?, rows("curr_data_rows0_29999.csv")?);
    let names = |unit: &str| (1..=6).map(|k| format!("joint_{k}_{unit}")).collect::<Vec<_>>().join(",");
    let mut text = format!("t_s,{},{}\n", names("rad"), names("nm"));
    for (n, (motor, current)) in motor.iter().zip(&current).enumerate() {
        let mut q: [f64; 6] = std::array::from_fn(|k| motor[k] / RATIO[k]);
        let mut tau: [f64; 6] = std::array::from_fn(|k| current[k] * RATIO[k]);
        q[5] -= q[4];
        q[1] -= std::f64::consts::FRAC_PI_2;
        q[2] += std::f64::consts::FRAC_PI_2;
        tau[4] += 32.0 * current[5];
        let cells = q.iter().chain(&tau).map(|v| format!("{v:e}")).collect::<Vec<_>>().join(",");
        let _ = writeln!(text, "{:.4},{cells}", n as f64 * 2e-4);
    }
    Ok(text)
}
