use super::*;
use crate::sources::socket::PATIENCE;

fn bytes(sequence: u32, status: u32, counts: [i32; 6]) -> Vec<u8> {
    let words = [sequence, sequence * 7, status].map(u32::to_be_bytes);
    words.into_iter().chain(counts.map(i32::to_be_bytes)).flatten().collect()
}

/// The request that streams without end is in the vendor's manual: 12 34 00 02 00 00 00 00.
#[test]
fn the_request_is_the_manuals() {
    assert_eq!(request(STREAM), [0x12, 0x34, 0, 2, 0, 0, 0, 0]);
}

#[test]
fn records_become_newtons_and_losses_are_counted() {
    let calibration = Calibration { newton: 1e-6, newton_metre: 2e-6, rate_hz: Some(500.0) };
    let mut decoder = Decoder::new(calibration);
    let counts = [1_000_000, -2_000_000, 3, 4_000_000, -5, i32::MIN];
    let row = decoder.datagram(&bytes(10, 0, counts)).unwrap();
    let expected = [1.0, -2.0, 3e-6, 8.0, -1e-5, 2e-6 * f64::from(i32::MIN)];
    assert!(row.values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{row:?}");
    assert_eq!(row.time_ns, Some(20_000_000));
    assert_eq!(decoder.datagram(&bytes(14, 0, counts)).unwrap().time_ns, Some(28_000_000));
    assert_eq!(decoder.datagram(&bytes(12, 0, counts)), None);
    assert_eq!(decoder.datagram(&bytes(15, 0x8002_0000, counts)), None);
    // Watchdog and latched conditions are no reason to leave a sample out.
    assert!(decoder.datagram(&bytes(16, 0x0001_0000, counts)).is_some());
    assert_eq!(decoder.datagram(&[0; 35]), None);
    let losses = decoder.losses;
    assert_eq!((losses.lost, losses.late, losses.damaged, losses.faulty), (3, 1, 1, 1));
    assert_eq!(losses.status, Some(0x8002_0000));
}

#[test]
fn units_of_the_page_and_of_the_port_are_known() {
    let page = |force: &str, torque: &str| {
        format!(
            "<?xml \
             version=\"1.0\"?>\n<netFTApi><comrdtrate>7000</comrdtrate><cfgcpf>1000000</cfgcpf><cfgcpt>500000</cfgcpt><scfgfu>{force}</scfgfu><scfgtu>{torque}</scfgtu></netFTApi>"
        )
    };
    let read = |force, torque| read_page(&page(force, torque)).unwrap();
    assert_eq!(read("N", "Nm"), Calibration { newton: 1e-6, newton_metre: 2e-6, rate_hz: Some(7000.0) });
    assert_eq!(read("N", "N-m"), read("N", "Nm"));
    let pounds = read("lbf", "in-lbf");
    assert!((pounds.newton * 1e6 - 4.448_221_615).abs() < 1e-8);
    assert!((pounds.newton_metre * 5e5 - 0.112_984_829).abs() < 1e-8);
    assert!((read("N", "lbf-ft").newton_metre * 5e5 - 1.355_817_948).abs() < 1e-8);
    assert!(read_page(&page("stone", "Nm")).unwrap_err().contains("stone"));
    assert!(read_page("<a/>").unwrap_err().contains("scfgfu"));
    assert!(read_page("").is_err() && read_page("<a").is_err());
    // READCALINFO: 12 34, N, N m, 1 000 000 and 500 000 counts.
    let mut answer = vec![0x12, 0x34, 2, 3];
    answer.extend(1_000_000_u32.to_be_bytes());
    answer.extend(500_000_u32.to_be_bytes());
    answer.extend([0; 12]);
    assert_eq!(read_calibration(&answer).unwrap(), Calibration { rate_hz: None, ..read("N", "Nm") });
    answer[2] = 9;
    assert!(read_calibration(&answer).unwrap_err().contains("unit 9"));
    assert!(read_calibration(&answer[1..]).is_err());
}

/// A page that comes a byte at a time, for as long as somebody waits.
#[test]
fn a_page_that_drips_is_left_in_time() {
    use std::io::Write as _;
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        while stream.write_all(b"H").is_ok() {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
    });
    let url: SourceUrl = "ati+udp://127.0.0.1".parse().unwrap();
    let begun = std::time::Instant::now();
    assert!(page(&url, "127.0.0.1", port).is_err());
    assert!(begun.elapsed() < PATIENCE * 2, "{:?}", begun.elapsed());
}
