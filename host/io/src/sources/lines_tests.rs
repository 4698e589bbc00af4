use super::*;

fn fed(decoder: &mut Decoder, text: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    decoder.feed(text.as_bytes(), &mut rows).unwrap();
    rows
}

#[test]
fn lines_of_a_header_are_samples_and_their_losses_are_counted() {
    let mut decoder = Decoder::new(None, &RigFile::default(), false);
    let header = "seq,t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,temperature\n";
    let mut rows = fed(&mut decoder, header);
    rows.extend(fed(&mut decoder, "7,1700000000.001,1,2,3,4,5,6,21.5\r\n# remark\n\n8,17000"));
    rows.extend(fed(&mut decoder, "00000.002,-1,2,3,4,5,6.5,21.5\n11,1700000000.005,0,0,0,0,0,0,x\n"));
    // Twice, cut, no number, the header again.
    rows.extend(fed(
        &mut decoder,
        "11,1700000000.006,0,0,0,0,0,0,1\n12,1,2\n12,1700000000.007,a,0,0,0,0,0,1\n",
    ));
    rows.extend(fed(&mut decoder, header));
    assert_eq!(decoder.groups(), [Group::Wrench]);
    assert_eq!(rows.len(), 3);
    assert_eq!(
        rows[0],
        Row { time_ns: Some(1_700_000_000_001_000_000), values: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] }
    );
    assert_eq!(rows[1].values, [-1.0, 2.0, 3.0, 4.0, 5.0, 6.5]);
    let losses = decoder.losses;
    assert_eq!((losses.lost, losses.late, losses.damaged), (2, 1, 2));
}

#[test]
fn a_sensor_that_begins_with_no_numbers_is_waited_for() {
    let mut decoder = Decoder::new(Some("t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm"), &RigFile::default(), false);
    let rows = fed(&mut decoder, "0,nan,nan,NaN,0,0,0\n1,inf,0,0,0,0,0\n2,1,2,3,4,5,6\n3,nan,2,3,4,5,6\n");
    assert_eq!(rows, [Row { time_ns: Some(2_000_000_000), values: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] }]);
    assert_eq!(decoder.losses.damaged, 3);
}

#[test]
fn names_units_and_order_come_from_the_rig_file() {
    let rig = RigFile::parse(
        "[recording.columns]\nt_s = { name = \"ms\", scale = 1e-3 }\nimu_ax_mps2 = { name = \"ax\", scale = 9.80665 }\n\
         imu_ay_mps2 = { name = \"ay\", scale = 9.80665 }\nimu_az_mps2 = { name = \"az\", scale = 9.80665 }\n",
    )
    .unwrap();
    let mut decoder = Decoder::new(Some("az;ms;ax;ay"), &rig, true);
    // The end of a line that was begun before is skipped.
    let rows = fed(&mut decoder, "0.5;1;2;3\n1;250;0;-2\n");
    assert_eq!(rows, [Row { time_ns: Some(250_000_000), values: vec![0.0, -19.6133, 9.80665] }]);
}

#[test]
fn what_is_no_stream_is_said() {
    let said = |text: &str| {
        let mut decoder = Decoder::new(None, &RigFile::default(), false);
        decoder.feed(text.as_bytes(), &mut Vec::new()).unwrap_err()
    };
    assert!(said("fx_n,fy_n\n1,2\n").contains("missing"));
    assert!(said("fx_lbf,t_s\n1,2\n").contains("fx_n"));
    let strange = said("a,b\n1,2\n");
    assert!(
        strange.contains("a, b are of no wrench") && strange.contains("[recording.columns]"),
        "{strange}"
    );
    let noise = format!("t_s,fx_n\n{}", "hello\n".repeat(100));
    assert!(said(&noise).contains("\"hello\""));
    let mut long = Decoder::new(None, &RigFile::default(), false);
    assert!(long.feed(&[b'x'; 20_000], &mut Vec::new()).is_ok() && long.line.len() <= MOST + 1);
}
