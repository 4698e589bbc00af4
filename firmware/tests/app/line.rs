//! The rate of the line: raised for a watch alone, and never for good.

use rigident_shared::wire::{Command, ErrorCode, LINE_RATE_MS, Reply, SettingName, Source, StateName};

use super::{Host, settings};

const RATE: Command = Command::LineRate { baud: 2_000_000 };
const LONG_NS: u64 = LINE_RATE_MS as u64 * 1_000_000;

/// Returns a host set to a robot to watch, on a board whose line goes up to 3 MBd.
fn configured() -> Host {
    let mut host = Host::new();
    host.app.line_goes_up_to(3_000_000);
    host.configured();
    host
}

#[test]
fn the_rate_is_raised_for_a_robot_to_watch_alone() {
    let mut host = Host::new();
    host.app.line_goes_up_to(3_000_000);
    assert_eq!(host.ask(&RATE), Err(ErrorCode::WrongState(StateName::Idle)));
    assert_eq!(host.ask(&Command::Configure(settings(Source::Injected))), Ok(Reply::Done));
    assert_eq!(host.ask(&RATE), Err(ErrorCode::WrongState(StateName::Configured)));
    let mut host = configured();
    for baud in [0, 9600, 3_000_001, u32::MAX] {
        let refused = Err(ErrorCode::BadSetting(SettingName::LineRate));
        assert_eq!((host.ask(&Command::LineRate { baud }), host.app.line_rate()), (refused, None));
    }
    assert_eq!((host.ask(&RATE), host.app.line_rate()), (Ok(Reply::Done), Some(2_000_000)));
    // A board with one rate says so.
    let mut host = Host::new();
    host.configured();
    assert_eq!(host.ask(&RATE), Err(ErrorCode::BadSetting(SettingName::LineRate)));
}

#[test]
fn the_rate_goes_back_when_the_watch_ends_however_it_does() {
    let ends: [fn(&mut Host); 4] = [
        |host| assert_eq!(host.ask(&Command::Hold), Ok(Reply::Done)),
        |host| assert_eq!(host.ask(&Command::Reset), Ok(Reply::Done)),
        // No frames come, whatever else does: a fault.
        |host| {
            assert_eq!(host.ask_at(&Command::Heartbeat, LONG_NS), Ok(Reply::Done));
            host.app.tick(LONG_NS + 10_000_000);
            assert_eq!(host.app.state().0, StateName::Fault);
        },
        |host| host.app.tick(LONG_NS + 10_000_000),
    ];
    for end in ends {
        let mut host = configured();
        assert_eq!((host.ask(&RATE), host.ask(&Command::Start)), (Ok(Reply::Done), Ok(Reply::Done)));
        host.app.tick(10_000_000);
        assert_eq!(host.app.line_rate(), Some(2_000_000));
        end(&mut host);
        host.app.tick(LONG_NS + 20_000_000);
        assert_eq!(host.app.line_rate(), None);
    }
}

#[test]
fn a_host_that_is_not_understood_at_the_new_rate_finds_the_old_one_after_a_second() {
    let mut host = configured();
    assert_eq!(host.ask(&RATE), Ok(Reply::Done));
    for ms in (0..900).step_by(5) {
        let now_ns = ms * 1_000_000;
        // What another rate makes of a command, its end included.
        for byte in [0xfe_u8, 0x80, 0x37, 0xc0, 0x00] {
            assert!(host.app.on_byte(byte, now_ns).is_none());
        }
        host.app.tick(now_ns);
        assert_eq!(host.app.line_rate(), Some(2_000_000), "{ms} ms");
    }
    host.app.tick(LONG_NS + 10_000_000);
    assert_eq!((host.app.line_rate(), host.app.state().0), (None, StateName::Configured));
    // What is whole is heard.
    assert_eq!(host.ask_at(&RATE, LONG_NS + 20_000_000), Ok(Reply::Done));
    assert_eq!(host.ask_at(&Command::Heartbeat, 2 * LONG_NS), Ok(Reply::Done));
    host.app.tick(3 * LONG_NS - 10_000_000);
    assert_eq!(host.app.line_rate(), Some(2_000_000));
}
