use super::*;
use crate::recording::mcap::messages::{ImuValues, write_imu, write_numbers};

const ADVERTISED: &str = r#"{"op":"advertise","channels":[
    {"id":4,"topic":"/ft/wrench","encoding":"cdr","schemaName":"geometry_msgs/msg/WrenchStamped","schema":"","schemaEncoding":"ros2msg"},
    {"id":7,"topic":"/imu","encoding":"cdr","schemaName":"sensor_msgs/msg/Imu","schema":""},
    {"id":8,"topic":"/text","encoding":"json","schemaName":"geometry_msgs/msg/WrenchStamped","schema":""}, 17]}"#;

fn decoder(role: Role, topic: Option<&str>) -> Decoder {
    Decoder::new(Wanted::new(role, topic, true))
}

fn message(subscription: u32, bridge_ns: u64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![MESSAGE_DATA];
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(bridge_ns.to_le_bytes());
    bytes.extend(payload);
    bytes
}

#[test]
fn a_topic_is_subscribed_to_and_its_messages_are_samples() {
    let mut wrench = decoder(Role::Wrench, Some("/ft/wrench"));
    assert_eq!(wrench.text(r#"{"op":"serverInfo","name":"b","capabilities":["time"]}"#), Ok(None));
    let answer = wrench.text(ADVERTISED).unwrap().unwrap();
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    // As the protocol's document has it.
    assert_eq!(answer, serde_json::json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4}]}));
    let w = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let row = wrench.binary(&message(1, 99, &write_numbers(1_000, "S", &w))).unwrap().unwrap();
    assert_eq!(row, Row { time_ns: Some(1_000), values: w.to_vec() });
    // Of another subscription, late, without a stamp, cut.
    assert_eq!(wrench.binary(&message(2, 99, &write_numbers(2_000, "S", &w))), Ok(None));
    assert_eq!(wrench.binary(&message(1, 99, &write_numbers(1_000, "S", &w))), Ok(None));
    let row = wrench.binary(&message(1, 5_000, &write_numbers(0, "S", &w))).unwrap().unwrap();
    assert_eq!(row.time_ns, Some(5_000));
    for bad in [&[MESSAGE_DATA][..], &[MESSAGE_DATA, 1, 0, 0, 0, 1], &message(1, 1, &[0, 1, 0, 0])] {
        assert_eq!(wrench.binary(bad), Ok(None));
    }
    assert_eq!(wrench.binary(&[2, 1, 2, 3]), Ok(None));
    assert_eq!((wrench.losses.late, wrench.losses.damaged), (1, 3));
    let mut imu = decoder(Role::Imu, None);
    assert!(imu.text(ADVERTISED).unwrap().unwrap().contains("\"channelId\":7"));
    let values = ImuValues { accel: Some([1.0, 2.0, 3.0]), gyro: Some([4.0, 5.0, 6.0]) };
    let row = imu.binary(&message(1, 1, &write_imu(7, "U", &values, None, None))).unwrap().unwrap();
    assert_eq!((row.values, imu.groups), (w.to_vec(), vec![Group::Accel(0), Group::Gyro(0)]));
}

#[test]
fn missing_and_wrong_topics_are_reported_with_the_topics_there_are() {
    let mut absent = decoder(Role::Wrench, Some("/wrench"));
    assert_eq!(absent.text(ADVERTISED), Ok(None));
    assert!(
        absent.missing().contains("no topic /wrench; of that type there is /ft/wrench, /text"),
        "{}",
        absent.missing()
    );
    let mut wrong = decoder(Role::Wrench, Some("/imu"));
    let said = wrong.text(ADVERTISED).unwrap_err();
    assert!(said.contains("/imu is of sensor_msgs/msg/Imu") && said.contains("/ft/wrench"), "{said}");
    assert!(decoder(Role::Wrench, Some("/text")).text(ADVERTISED).unwrap_err().contains("json"));
    let mut several = decoder(Role::Wrench, None);
    assert_eq!(several.text(ADVERTISED), Ok(None));
    assert!(several.missing().contains("several topics") && several.missing().contains("?topic="));
    let mut none = decoder(Role::Pose, None);
    assert_eq!(none.text(ADVERTISED), Ok(None));
    assert!(
        none.missing().contains("no topic of geometry_msgs/msg/PoseStamped; there is /ft/wrench (geometry")
    );
    assert!(decoder(Role::Pose, None).missing().contains("no topics at all"));
    let mut useless = decoder(Role::Wrench, None);
    let said = (0..USELESS).find_map(|_| useless.binary(&message(1, 1, &[])).err()).unwrap();
    assert!(said.contains("cut off"), "{said}");
}
