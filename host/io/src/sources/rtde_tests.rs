use super::*;

const TYPES: &[u8] = b"\x01DOUBLE,VECTOR6D,VECTOR3D,VECTOR6D";

fn payload(recipe: u8, time_s: f64) -> Vec<u8> {
    let mut numbers = vec![time_s];
    // A turn by 90 degrees about z.
    numbers.extend([
        1.0,
        2.0,
        3.0,
        4.0,
        5.0,
        6.0,
        7.0,
        8.0,
        9.0,
        0.1,
        0.2,
        0.3,
        0.0,
        0.0,
        std::f64::consts::FRAC_PI_2,
    ]);
    std::iter::once(recipe).chain(numbers.into_iter().flat_map(f64::to_be_bytes)).collect()
}

#[test]
fn packages_are_cut_out_of_any_pieces() {
    let mut bytes = package(VERSION, &2_u16.to_be_bytes());
    // As the guide has it: 00 05 56 00 02.
    assert_eq!(bytes, [0, 5, 0x56, 0, 2]);
    bytes.extend(package(START, &[]));
    let mut packages = Packages::default();
    let mut found = Vec::new();
    for byte in bytes {
        packages.feed(&[byte]);
        while let Some((kind, payload)) = packages.next().unwrap() {
            found.push((kind, payload.to_vec()));
        }
    }
    assert_eq!(found, [(VERSION, vec![0, 2]), (START, vec![])]);
    packages.feed(&[0, 2, 1]);
    assert!(packages.next().is_err());
}

#[test]
fn data_become_samples_and_missing_packages_are_counted() {
    let mut decoder = decoder_of_everything(TYPES).unwrap();
    let row = decoder.data(&payload(1, 100.0)).unwrap();
    assert_eq!(row.time_ns, Some(100_000_000_000));
    assert_eq!(row.values[..12], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.1, 0.2, 0.3]);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!(
        row.values[12..].iter().zip([half, 0.0, 0.0, half]).all(|(a, b)| (a - b).abs() < 1e-15),
        "{row:?}"
    );
    assert!(decoder.data(&payload(1, 100.002)).is_some());
    assert!(decoder.data(&payload(1, 100.012)).is_some());
    assert_eq!(decoder.data(&payload(1, 100.012)), None);
    for bad in [payload(2, 101.0), payload(1, f64::NAN), payload(1, 101.0)[..80].to_vec(), vec![], vec![1]] {
        assert_eq!(decoder.data(&bad), None);
    }
    let losses = decoder.losses;
    assert_eq!((losses.lost, losses.late, losses.damaged), (4, 1, 5));
}

#[test]
fn variables_missing_in_the_controller_are_reported() {
    let all = || variables(&"rtde://r".parse().unwrap(), &[Role::Wrench, Role::Imu]).unwrap();
    let said = |answer: &[u8]| Decoder::new(answer, all(), 500.0).unwrap_err();
    assert!(said(b"\x00DOUBLE,NOT_FOUND,VECTOR3D,VECTOR6D").contains("e-Series"));
    assert!(
        said(b"\x01DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D").contains("actual_tool_accelerometer is a VECTOR6D")
    );
    assert!(said(b"\x01DOUBLE").contains("4 variables"));
    let forced: SourceUrl = "rtde://r?wrench=actual_TCP_force".parse().unwrap();
    let refused = variables(&forced, &[Role::Wrench]).unwrap_err().to_string();
    assert!(refused.contains("zeroed") && refused.contains("ft_raw_wrench"), "{refused}");
}
