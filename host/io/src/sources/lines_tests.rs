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
        "[recording.columns]\nt_s = { name = \"ms\", scale = 1e-3 }\nimu_ax_mps2 = \
         { name = \"ax\", scale = 9.80665 }\n\
         imu_ay_mps2 = { name = \"ay\", scale = 9.80665 }\nimu_az_mps2 = \
         { name = \"az\", scale = 9.80665 }\n",
    )
    .unwrap();
    let mut decoder = Decoder::new(Some("az;ms;ax;ay"), &rig, true);
    // The end of a line that was begun before is skipped.
    let rows = fed(&mut decoder, "0.5;1;2;3\n1;250;0;-2\n");
    assert_eq!(rows, [Row { time_ns: Some(250_000_000), values: vec![0.0, -19.6133, 9.80665] }]);
}

#[test]
fn lines_of_other_programs_are_samples_too() {
    let header = "Zeit [ms];Fx [N];Fy [N];Fz [kN];Mx [Nm];My [Nm];Mz [N mm]\n";
    let mut decoder = Decoder::new(None, &RigFile::default(), false);
    let rows = fed(
        &mut decoder,
        &format!("{header}0;0,5;1,5;2;-3,25;4;5\n2,5;1.234,5;1;1;1;1;1\n5;1,5;1;1;1;1;1\n"),
    );
    let first = Row { time_ns: Some(0), values: vec![0.5, 1.5, 2000.0, -3.25, 4.0, 0.005] };
    // Marks that the first line has not are not taken for others.
    assert_eq!((rows.len(), rows.first(), rows[1].time_ns), (2, Some(&first), Some(5_000_000)));
    assert_eq!(decoder.losses.damaged, 1);
    let mut unclear = Decoder::new(None, &RigFile::default(), false);
    let row = "0;1,234;1,234;1,234;1,234;1,234;1,234\n";
    let said = unclear.feed(format!("{header}{row}").as_bytes(), &mut Vec::new()).unwrap_err();
    assert!(said.contains("decimal ="), "{said}");
}

#[test]
fn lines_of_no_stream_are_reported() {
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

/// Returns a free port of this computer, and two sockets that send to it.
fn network(setting: &str) -> (SourceUrl, UdpSocket, UdpSocket) {
    let [taken, first, second] = [0; 3].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    let address = taken.local_addr().unwrap();
    drop(taken);
    for socket in [&first, &second] {
        socket.connect(address).unwrap();
    }
    let columns = "?columns=t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm";
    (format!("udp://{address}{columns}{setting}").parse().unwrap(), first, second)
}

/// Opens a source while `first` sends until it is heard.
fn opened(url: &SourceUrl, first: &UdpSocket) -> Lines {
    std::thread::scope(|scope| {
        let lines = scope.spawn(|| Lines::open(url, &RigFile::default()).unwrap());
        let mut k = 0;
        while !lines.is_finished() {
            k += 1;
            // Nobody may listen yet.
            let _ = first.send(format!("0.{k:06},1,2,3,4,5,6").as_bytes());
            std::thread::sleep(Duration::from_millis(5));
        }
        lines.join().unwrap()
    })
}

fn all(lines: &mut Lines) -> Vec<Row> {
    let mut rows = Vec::new();
    for _ in 0..400 {
        let (before, losses) = (rows.len(), lines.losses());
        lines.read(Duration::from_millis(30), &mut rows).unwrap();
        if rows.len() == before && lines.losses() == losses {
            break;
        }
    }
    rows
}

#[test]
fn datagrams_of_other_senders_are_counted_and_left_out() {
    let (url, first, second) = network("");
    let mut lines = opened(&url, &first);
    all(&mut lines);
    for k in 1..=20 {
        first.send(format!("1.{k:03},1,2,3,4,5,6").as_bytes()).unwrap();
        second.send(format!("1.{k:03}5,10,2,3,4,5,6").as_bytes()).unwrap();
    }
    let rows = all(&mut lines);
    assert_eq!(rows.len(), 20);
    assert!(rows.iter().all(|row| row.values[0] == 1.0));
    assert_eq!((lines.losses().others, lines.losses().damaged), (20, 0));
}

#[test]
fn garbage_and_a_time_far_ahead_do_not_end_a_stream() {
    let (url, first, _) = network("&from=localhost");
    let mut lines = opened(&url, &first);
    all(&mut lines);
    for _ in 0..150 {
        first.send(b"\xff\xfegarbage").unwrap();
    }
    first.send(b"100000,1,2,3,4,5,6").unwrap();
    assert!(all(&mut lines).is_empty());
    for k in 1..=20 {
        first.send(format!("1.{k:03},1,2,3,4,5,6").as_bytes()).unwrap();
    }
    assert_eq!(all(&mut lines).len(), 20);
    let losses = lines.losses();
    assert_eq!((losses.damaged, losses.late, losses.others), (151, 0, 0));
}

#[test]
fn only_the_host_that_is_asked_for_is_taken() {
    let sender = |only: &[&str]| Sender {
        only: only.iter().map(|ip| ip.parse().unwrap()).collect(),
        ..Sender::default()
    };
    let [a, b, c] =
        ["10.0.0.1:5", "10.0.0.1:6", "10.0.0.2:5"].map(|text| text.parse::<SocketAddr>().unwrap());
    let mut asked = sender(&["10.0.0.2"]);
    assert!(!asked.is_taken(a) && asked.is_taken(c));
    asked.take(c);
    assert!(!asked.is_taken(a) && asked.is_taken(c));
    let mut anybody = sender(&[]);
    anybody.take(a);
    assert!(anybody.is_taken(a) && !anybody.is_taken(b) && !anybody.is_taken(c));
    // It began anew.
    anybody.heard = Instant::now().checked_sub(SILENT * 2);
    assert!(anybody.is_taken(b) && !anybody.is_taken(c));
}

#[test]
fn a_clock_that_was_set_ahead_is_believed_once_it_goes_on() {
    let columns = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm";
    let mut decoder = Decoder::new(Some(columns), &RigFile::default(), false);
    let line = |t: &str| format!("{t},1,2,3,4,5,6\n");
    let times = ["0", "1", "100", "2", "300", "300.001", "300.002", "3"];
    let rows = fed(&mut decoder, &times.map(line).concat());
    let times: Vec<i64> = rows.iter().map(|row| row.time_ns.unwrap() / 1_000_000).collect();
    assert_eq!(times, [0, 1000, 2000, 300_001, 300_002]);
    assert_eq!((decoder.losses.damaged, decoder.losses.late), (2, 1));
}
