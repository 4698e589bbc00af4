use std::fmt::Write as _;

use crate::recording::import::{Choices, Undecided, understand};
use crate::recording::{Recording, RecordingError};
use crate::rig::RigFile;

fn read(text: &str) -> Result<Recording, RecordingError> {
    Recording::from_csv_bytes("export.txt", text.as_bytes(), &RigFile::default())
}

fn rows(count: usize, row: impl Fn(usize) -> String) -> String {
    (0..count).fold(String::new(), |mut text, k| {
        let _ = writeln!(text, "{}", row(k));
        text
    })
}

const XSENS: &str =
    "// Start Time: Unknown\n// Sample rate: 100.0Hz\n// Scenario: 4.9\n// Firmware Version: 4.0.2\n";
const XSENS_NAMES: &str =
    "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tFreeAcc_X\tGyr_X\tGyr_Y\tGyr_Z\tMag_X\n";

#[test]
fn xsens_counters_make_the_time_over_a_lost_packet_and_a_turn() {
    // Packets 65 530 … 65 535, 0 …, one of them lost; no SampleTimeFine.
    let number = |k: usize| (65_530 + k + usize::from(k > 20)) % 65_536;
    let body = rows(40, |k| format!("{:05}\t\t0.5\t-0.25\t9.8\t0.01\t0.1\t-0.2\t0.0{k}\t0.4\t", number(k)));
    let recording = read(&format!("{XSENS}{XSENS_NAMES}{body}")).unwrap();
    let imu = &recording.imus[0];
    assert_eq!(imu.accel.as_ref().unwrap()[3], [0.5, -0.25, 9.8]);
    assert_eq!(imu.gyro.as_ref().unwrap()[3], [0.1, -0.2, 0.03]);
    assert_eq!(recording.time_ns[20], 200_000_000);
    assert_eq!(recording.time_ns[21], 220_000_000);
    assert!(recording.assumed.as_ref().unwrap().contains("as Xsens MT Manager writes them"));
    // A count that falls is no turn.
    let body = rows(40, |k| {
        format!("{}\t\t0.5\t-0.25\t9.8\t0.01\t0.1\t-0.2\t0.0{k}\t0.4\t", 5000 + k - 900 * (k / 30))
    });
    let said = read(&format!("{XSENS}{XSENS_NAMES}{body}")).unwrap_err().to_string();
    assert!(said.contains("line 36: the count of readings runs backwards, from 5029 to 4130"), "{said}");
    // A clock of 10 kHz comes before the count.
    let names = XSENS_NAMES.replace('\t', ";");
    let body = rows(40, |k| {
        format!(
            "{k:05};{};0.5;-0.25;9.8;0.01;0.1;-0.2;0.0{k};0.4",
            (4_294_966_000_u64 + 50 * k as u64) % (1 << 32)
        )
    });
    let recording = read(&format!("// Start Time: Unknown\n{names}{body}")).unwrap();
    assert_eq!((recording.rate_hz, recording.time_ns[39]), (Some(200.0), 195_000_000));
    // Without either nothing is guessed.
    let body = rows(40, |k| format!("{k}\t\t0.5\t-0.25\t9.8\t0.01\t0.1\t-0.2\t0.0{k}\t0.4"));
    let said = read(&format!("// Start Time: Unknown\n{XSENS_NAMES}{body}")).unwrap_err().to_string();
    assert!(said.contains("export it with SampleTimeFine"), "{said}");
}

fn vicon(separator: &str, moment: &str) -> String {
    let text = format!(
        "Devices\n1000\n,,Kistler Force Plate 1 - Force,,,Kistler Force Plate 1 - Moment,,,\n\
         Frame,Sub Frame,Fx,Fy,Fz,Mx,My,Mz\n,,N,N,N,{moment},{moment},{moment}\n"
    );
    let body = rows(60, |k| format!("{},{},0.5,-1.5,{},120,-3400,56", 3 + k / 10, k % 10, 700 + k));
    let markers = "\nTrajectories\n100\n,,A,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n3,0,1,2,3\n4,0,1,2,3\n";
    format!("{text}{body}{markers}").replace(',', separator)
}

#[test]
fn vicon_sections_are_read_by_their_rate_and_end() {
    for (separator, moment) in [(",", "N.mm"), ("\t", "mm.N"), (",", "N.m")] {
        let recording = read(&vicon(separator, moment)).unwrap();
        assert_eq!((recording.rows(), recording.rate_hz), (60, Some(1000.0)));
        let scale = if moment == "N.m" { 1.0 } else { 1e-3 };
        let own = recording.wrench.as_ref().unwrap()[59];
        assert_eq!(own[..3], [0.5, -1.5, 759.0]);
        assert_eq!(own[3..], [120.0 * scale, -3400.0 * scale, 56.0 * scale]);
        assert_eq!(recording.place(0), "line 6");
    }
    // A frame that is missing is a gap in time.
    let text = vicon(",", "N.m").replace("\n5,", "\n6,");
    assert!(read(&text).is_err() || read(&text).unwrap().time_ns[20] == 30_000_000);
    let said = read("Trajectories\n100\n,,A,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1,2,3\n").unwrap_err();
    assert!(said.to_string().contains("without the section Devices"), "{said}");
    let said = read(&vicon(",", "N.m").replace("1000", "?")).unwrap_err();
    assert!(said.to_string().contains("no rate"), "{said}");
}

#[test]
fn qualisys_plates_need_their_units_and_have_the_rate_of_the_header() {
    let keys = "NO_OF_SAMPLES\t40\nFREQUENCY\t500\nTIME_STAMP\t2026-11-20, \
                10:12:33.002\t12.5\nDATA_INCLUDED\tFORCE\n\
                FORCE_PLATE_TYPE\tBertec\nFORCE_PLATE_NAME\tForce-plate 1\nFORCE_PLATE_OFFSET_X\t0.000\n";
    let own = |k: usize| format!("0.5\t-1.5\t{}\t12\t-34\t56\t1.5\t2.5\t0", 700 + k);
    let (bare, named) =
        (rows(40, own), rows(40, |k| format!("{}\t{:.6}\t{}", k + 1, 0.002 * k as f64, own(k))));
    let names =
        "SAMPLE\tTIME\tForce_X\tForce_Y\tForce_Z\tMoment_X\tMoment_Y\tMoment_Z\tCOP_X\tCOP_Y\tCOP_Z\n";
    let folder = tempfile::tempdir().unwrap();
    for text in [format!("{keys}{bare}"), format!("{keys}{named}"), format!("{keys}{names}{named}")] {
        let said = read(&text).unwrap_err().to_string();
        assert!(said.contains("the unit of Force_X") && said.contains("written nowhere"), "{said}");
        let path = folder.path().join("plate.tsv");
        std::fs::write(&path, &text).unwrap();
        let found = understand(&path).unwrap();
        assert_eq!(found.written[0], ("program", "Qualisys Track Manager".to_owned()));
        let mut choices = Choices::default();
        assert!(matches!(found.proposal(&choices), Err(Undecided::Units(_))));
        for (what, unit) in [("Force", "N"), ("Moment", "N mm")] {
            for axis in ["X", "Y", "Z"] {
                choices.units.insert(format!("{what}_{axis}"), unit.to_owned());
            }
        }
        let columns = found.proposal(&choices).unwrap();
        let mut rig = RigFile::default();
        rig.recording.columns = crate::recording::import::sources(&columns);
        let recording = found.read(&rig).unwrap();
        assert_eq!((recording.rows(), recording.rate_hz), (40, Some(500.0)));
        assert_eq!(recording.wrench.unwrap()[39], [0.5, -1.5, 739.0, 0.012, -0.034, 0.056]);
    }
    // Analog channels are named in the header.
    let analog = "NO_OF_SAMPLES\t40\nTOT_NO_OF_CHAN\t6\nFREQUENCY\t500\nDATA_INCLUDED\tANALOG\n\
                  CHANNEL_NAMES\tFx [N]\tFy [N]\tFz [N]\tMx [Nm]\tMy [Nm]\tMz [Nm]\n";
    let text = format!("{analog}{}", rows(40, |k| format!("0.5\t-1.5\t{}\t12\t-34\t56", 700 + k)));
    assert_eq!(read(&text).unwrap().wrench.unwrap()[1], [0.5, -1.5, 701.0, 12.0, -34.0, 56.0]);
    let said = read("NO_OF_FRAMES\t2\nFREQUENCY\t100\nMARKER_NAMES\tA\tB\n1\t2\t3\t4\t5\t6\n").unwrap_err();
    assert!(said.to_string().contains("export them as C3D"), "{said}");
}

#[test]
fn counts_of_a_net_ft_are_divided() {
    let head = "Start Time: 11/20/26 10:12 AM\nRDT Sample Rate: 7000\n\"PLEASE NOTE: The sample rate is read \
                …\"\n\
                Force Units: N\nCounts per Unit Force: 1000000.0\nTorque Units: Nm\nCounts per Unit Torque: \
                1000000.0\n\
                Status (hex), RDT Sequence, F/T Sequence, Fx, Fy, Fz, Tx, Ty, Tz, Time\n";
    let body = |fx: &str| {
        rows(40, |k| {
            format!(
                "0x00000000, {}, {}, {fx}, -250000, {}, 12000, -34000, 56, 11/20/26 10:12 AM",
                k + 1,
                k + 9,
                700 + k
            )
        })
    };
    let recording = read(&format!("{head}{}", body("1500000"))).unwrap();
    assert_eq!(recording.wrench.as_ref().unwrap()[0], [1.5, -0.25, 0.0007, 0.012, -0.034, 56e-6]);
    assert!((recording.rate_hz.unwrap() - 7000.0).abs() < 1e-3);
    // Numbers with decimals under the same lines are in units already, and have the times of their own
    // column.
    let decimals = rows(40, |k| {
        format!(
            "0x00000000, {}, {}, 1.5, -0.25, {}.0, 0.012, -0.034, 0.056, 11/20/26 10:12:33.{:03} AM",
            k + 1,
            k + 9,
            700 + k,
            2 * k
        )
    });
    let recording = read(&format!("{head}{decimals}")).unwrap();
    assert_eq!(recording.wrench.as_ref().unwrap()[0], [1.5, -0.25, 700.0, 0.012, -0.034, 0.056]);
    assert_eq!((recording.rate_hz, recording.time_ns[0]), (Some(500.0), 1_795_169_553_000_000_000));
    // Times of day with milliseconds give way to the count, too.
    let timed = body("1500000").replace("10:12 AM", "10:12:33.005 AM");
    assert!((read(&format!("{head}{timed}")).unwrap().rate_hz.unwrap() - 7000.0).abs() < 1e-3);
    // Without a column of time the count makes it, of numbers in units as of counts.
    let decimals = rows(40, |k| {
        format!("0x00000000, {}, {}, 1.5, -0.25, {}.0, 0.012, -0.034, 0.056", k + 1, k + 9, 700 + k)
    });
    let recording = read(&format!("{}{decimals}", head.replace(", Time", ""))).unwrap();
    assert_eq!(recording.wrench.as_ref().unwrap()[0], [1.5, -0.25, 700.0, 0.012, -0.034, 0.056]);
    assert!((recording.rate_hz.unwrap() - 7000.0).abs() < 1e-3);
    // Pounds stay pounds.
    let pounds = format!("{head}{}", body("1500000"))
        .replace("Units: Nm", "Units: lbf-in")
        .replace("Units: N\n", "Units: lbf\n");
    let own = read(&pounds).unwrap().wrench.unwrap()[0];
    assert!(
        (own[0] - 1.5 * 4.448_221_615).abs() < 1e-8 && (own[3] - 0.012 * 0.112_984_829).abs() < 1e-10,
        "{own:?}"
    );
}

#[test]
fn catman_names_its_time_above_lines_about_channels() {
    let words = |cells: [&str; 7]| cells.join("\t") + "\t\n";
    let about = (0..33).map(|k| {
        words(["x", "MX840A_0", "SlotInfo", "NullWert=0", "Typ", "1", "n/a"])
            .replace('x', &format!("Zeile {k}"))
    });
    let head = "HBM catman AP V5.5\nDatei: Versuch 7\n\n".to_owned()
        + &words(["Zeit  1 - Standardmessrate", "Fx", "Fy", "Fz", "Mx", "My", "Mz"])
        + &words(["s", "N", "N", "kN", "Nm", "Nm", "Nm"])
        + &about.collect::<String>();
    let body =
        rows(40, |k| format!("{},{:03}\t0,5\t-1,25\t{},5\t12,5\t-34\t5,6\t", k / 100, 10 * (k % 100), 7 + k));
    let recording = read(&(head.clone() + &body)).unwrap();
    assert_eq!(recording.wrench.as_ref().unwrap()[39], [0.5, -1.25, 46_500.0, 12.5, -34.0, 5.6]);
    assert_eq!((recording.rate_hz, recording.place(0)), (Some(100.0), "line 39".to_owned()));
    // Names with units, no more lines.
    let plain = "Time  1 - default sample rate [s];Fx [N];Fy [N];Fz [kN];Mx [Nm];My [Nm];Mz [Nm]\n"
        .to_owned()
        + &body.replace('\t', ";");
    assert_eq!(read(&plain).unwrap().wrench, recording.wrench);
    // Two rates have two times, and none is taken.
    let two = head.replace("Mx\tMy", "Zeit  2 - Schnelle Messrate\tMy") + &body;
    assert!(read(&two).is_err());
}

#[test]
fn bioware_times_are_absolute() {
    let head = "BioWare Export\nFile Name: walk\n".to_owned() + &"x: y\n".repeat(14);
    let names = "abs time (s)\tFx\tFy\tFz\tMx\tMy\tMz\tAx\tAy\ns\tN\tN\tN\tN.m\tN.m\tN.m\tm\tm\n";
    let body = rows(40, |k| {
        format!("{:.6}\t0.5\t-1.25\t{}.125\t12.5\t-34.0\t5.6\t0.1\t0.2", 0.001 * k as f64, 700 + k)
    });
    let recording = read(&format!("{head}{names}{body}")).unwrap();
    assert_eq!(recording.wrench.as_ref().unwrap()[39], [0.5, -1.25, 739.125, 12.5, -34.0, 5.6]);
    assert_eq!(recording.rate_hz, Some(1000.0));
}

#[test]
fn joints_of_a_universal_robot_become_those_of_its_model() {
    let of = |what: &str| (0..6).map(|k| format!("{what}_{k}")).collect::<Vec<_>>().join(" ");
    let head = format!("timestamp {} {} {}\n", of("actual_q"), of("actual_qd"), of("actual_current"));
    let row = |k: usize| {
        let of = |scale: f64| {
            (0..6).map(|j| format!("{:.4}", scale * (k + j) as f64)).collect::<Vec<_>>().join(" ")
        };
        format!("{:.3} {} {} {}", 7.0 + 0.002 * k as f64, of(0.01), of(0.1), of(0.3))
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.csv");
    for separator in [" ", ","] {
        std::fs::write(&path, (head.clone() + &rows(40, row)).replace(' ', separator)).unwrap();
        let found = understand(&path).unwrap();
        assert_eq!(found.written[0], ("program", "Universal Robots RTDE".to_owned()));
        let joints = found.joints();
        assert_eq!((joints.len(), joints[2].name), (6, "elbow_joint"));
        assert_eq!((joints[2].position.as_str(), joints[2].effort.as_deref()), ("actual_q_2", None));
        let columns = found.proposal(&Choices::default()).unwrap();
        assert_eq!(columns["t_s"], ("timestamp".to_owned(), Some("s".to_owned())));
        let sign = crate::rig::WrenchSign::OnBody;
        let text = crate::recording::import::rig_text(&[(&found, columns)], &[None], sign, None);
        let rig = RigFile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!(rig.joint.len(), 6, "{text}");
        assert!(text.contains("actual_current_2 is a current, A, and no torque"), "{text}");
        let recording = found.read(&rig).unwrap();
        assert_eq!((recording.rate_hz, recording.rows()), (Some(500.0), 40));
    }
    // Torques that the controller makes of the currents are efforts.
    let torque = head.replace("actual_current_", "actual_current_as_torque_") + &rows(40, row);
    std::fs::write(&path, torque).unwrap();
    let joints = understand(&path).unwrap().joints();
    assert_eq!(joints[5].effort.as_deref(), Some("actual_current_as_torque_5"));
}

/// As `logToCSV` of libfranka writes them: the time is in ms.
#[test]
fn joints_of_a_franka_become_those_of_its_model() {
    let of = |what: &str| (0..7).map(|k| format!("{what}[{k}]")).collect::<Vec<_>>().join(", ");
    let names = ["state.q", "state.q_d", "state.dq", "state.tau_J"].map(of).join(",");
    let row = |k: usize| {
        let cells: Vec<String> = (0..28).map(|j| format!("{:.4}", 0.01 * (k + j) as f64)).collect();
        format!("{},1,{}", 4000 + k, cells.join(","))
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.csv");
    std::fs::write(&path, format!("time, success_rate, {names}\n{}", rows(40, row))).unwrap();
    let found = understand(&path).unwrap();
    assert_eq!(found.written[0], ("program", "libfranka".to_owned()));
    let joints = found.joints();
    assert_eq!((joints.len(), joints[2].name), (7, "fr3_joint3"));
    assert_eq!(joints[2].position, "state.q[2]");
    assert_eq!(joints[2].effort.as_deref(), Some("state.tau_J[2]"));
    let columns = found.decided(&Choices::default()).unwrap();
    assert_eq!(columns["t_s"], ("time".to_owned(), Some("ms".to_owned())));
    let sign = crate::rig::WrenchSign::OnBody;
    let text = crate::recording::import::rig_text(&[(&found, columns)], &[None], sign, None);
    let rig = RigFile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!((rig.joint.len(), rig.joint[6].rate.is_some()), (7, true), "{text}");
    let recording = found.read(&rig).unwrap();
    assert_eq!((recording.rate_hz, recording.time_ns[0]), (Some(1000.0), 4_000_000_000));
}

/// Two plates, as Vicon exports them.
#[test]
fn a_quantity_of_two_columns_is_named_with_both() {
    let head = "Devices\n200\n,,FP1 - Force,,,FP1 - Moment,,,FP2 - Force,,,FP2 - Moment,,\n\
                Frame,Sub Frame,Fx,Fy,Fz,Mx,My,Mz,Fx,Fy,Fz,Mx,My,Mz\n\
                ,,N,N,N,N.mm,N.mm,N.mm,N,N,N,N.mm,N.mm,N.mm\n";
    let body = rows(40, |k| format!("{k},0,1,2,700,4,5,6,1,2,3,4,5,6"));
    let said = read(&format!("{head}{body}")).unwrap_err().to_string();
    assert!(said.contains("fx_n could be \"FP1 - Force Fx\" and \"FP2 - Force Fx\""), "{said}");
}

/// LabVIEW without a column of times, of two devices.
#[test]
fn labview_channels_that_are_not_at_the_same_times_are_refused() {
    let file = |clock: &str, x0: &str, delta: &str| {
        let six = |first: &str, other: &str| format!("{}\t{}", [first; 6].join("\t"), [other; 6].join("\t"));
        let head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tNo\n\
                    Date\t2026/11/20\nTime\t10:12:33.5\n***End_of_Header***\t\n\nChannels\t12\n";
        let names = "Fx\tFy\tFz\tMx\tMy\tMz\tAccX\tAccY\tAccZ\tGyrX\tGyrY\tGyrZ";
        let body = rows(40, |k| format!("\t0.5\t1.5\t{}\t1\t2\t3\t0.1\t0.2\t9.8\t0.1\t0.2\t0.3", 70 + k));
        read(&format!(
            "{head}Date\t{}\nTime\t{}\nY_Unit_Label\tN\tN\tN\tNm\tNm\tNm\tm/s^2\tm/s^2\tm/s^2\trad/s\trad/s\
             \trad/s\nX0\t{}\nDelta_X\t{}\n***End_of_Header***\nX_Value\t{names}\tComment\n{body}",
            six("2026/11/20", "2026/11/20"),
            six("10:12:33.5", clock),
            six("0.0", x0),
            six("0.005", delta)
        ))
    };
    assert_eq!(file("10:12:33.5", "0.0", "0.005").unwrap().rate_hz, Some(200.0));
    // A later stamp and as much less before it.
    assert!(file("10:12:33.6", "-1.0E-1", "0.005").is_ok());
    for (clock, x0, delta, begins) in [
        ("10:12:33.5", "5.0E-2", "0.005", "0.050000"),
        ("10:12:36.5", "0.0", "0.005", "3.000000"),
        ("10:12:33.5", "0.0", "0.004", "0.000000"),
    ] {
        let said = file(clock, x0, delta).unwrap_err().to_string();
        let wanted = format!("AccX begins {begins} s after Fx, with steps of {delta} s and 0.005 s");
        assert!(said.contains(&wanted), "{said}");
    }
}

/// Recorders that were asked for forces alone.
#[test]
fn forces_of_universal_robots_have_their_time_in_seconds() {
    let names: Vec<String> = (0..6).map(|k| format!("actual_TCP_force_{k}")).collect();
    let body = rows(40, |k| format!("{}.{:03} 1.5 -2.5 30.25 0.5 0.25 -0.125", 4000 + k / 500, 2 * k % 1000));
    let text = format!("timestamp {}\n{body}", names.join(" "));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rtde.csv");
    std::fs::write(&path, text).unwrap();
    let columns = understand(&path).unwrap().proposal(&Choices::default()).unwrap();
    assert_eq!(columns["t_s"], ("timestamp".to_owned(), Some("s".to_owned())));
}
