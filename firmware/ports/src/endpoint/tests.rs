use super::*;

#[test]
fn texts_round_trip() {
    for text in [
        "udpin:0.0.0.0:0",
        "udpout:gcs.local:14550",
        "udpout:[fe80::1%eth0]:14550",
        "udpbcast:192.168.1.255:14550",
        "tcpin:[::]:5760",
        "tcpout:127.0.0.1:5760",
        "serial:/dev/ttyAMA0:921600",
        "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0:57600",
    ] {
        assert_eq!(text.parse::<Endpoint>().unwrap().to_string(), text);
    }
}

#[test]
fn spellings_of_other_programs_are_accepted() {
    let by_path = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0";
    for (text, canonical) in [
        ("udp:[::1]:5", "udpin:[::1]:5"),
        ("udpin://0.0.0.0:14540", "udpin:0.0.0.0:14540"),
        ("udpin://0.0.0.0:14540/", "udpin:0.0.0.0:14540"),
        ("udp://:14550", "udpin:0.0.0.0:14550"),
        ("udpin::14550", "udpin:0.0.0.0:14550"),
        ("udpout://192.168.1.10:14550", "udpout:192.168.1.10:14550"),
        ("tcp:autopilot.local:5760", "tcpout:autopilot.local:5760"),
        ("tcp://127.0.0.1:5760", "tcpout:127.0.0.1:5760"),
        ("tcpin://:5760", "tcpin:0.0.0.0:5760"),
        ("serial:/dev/ttyACM0,115200", "serial:/dev/ttyACM0:115200"),
        ("serial:///dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:57600"),
        ("/dev/ttyACM0", "serial:/dev/ttyACM0:57600"),
        ("/dev/ttyACM0,115200", "serial:/dev/ttyACM0:115200"),
        (by_path, &format!("serial:{by_path}:57600")),
        (&format!("serial:{by_path},115200"), &format!("serial:{by_path}:115200")),
        ("  udpin:0.0.0.0:14540 ", "udpin:0.0.0.0:14540"),
    ] {
        assert_eq!(text.parse::<Endpoint>().unwrap().to_string(), canonical, "{text}");
    }
}

#[test]
fn each_fault_is_named() {
    use EndpointFault::*;
    for (text, fault) in [
        ("", Kind),
        ("14550", Kind),
        ("ttyAMA0", Kind),
        ("udpin:14550", Port),
        ("udpin:0.0.0.0", Port),
        ("udpin:0.0.0.0:http", Port),
        ("udpin:0.0.0.0:65536", Port),
        ("udpout:127.0.0.1:0", Port),
        ("tcpout:127.0.0.1:0", Port),
        ("udpout::14550", Host),
        ("udpin:[]:14550", Host),
        ("udpin:::1:14550", Brackets),
        ("serial:", Path),
        ("serial::115200", Path),
        ("serial:/dev/ttyAMA0:0", Baud),
        ("serial:/dev/ttyAMA0:115k2", Baud),
        ("serial:/dev/ttyAMA0:", Baud),
        ("serial:/dev/ttyAMA0,", Baud),
    ] {
        let error = text.parse::<Endpoint>().unwrap_err();
        assert_eq!(error.fault, fault, "{text}");
        assert!(error.to_string().starts_with(&format!("'{text}' is not an endpoint: ")));
    }
}

#[test]
fn a_wrong_endpoint_gets_the_right_one_suggested() {
    for (text, suggestion) in [
        ("14550", "udpin:0.0.0.0:14550"),
        (":14550", "udpin:0.0.0.0:14550"),
        ("udpin:14550", "udpin:0.0.0.0:14550"),
        ("tcpin:5760", "tcpin:0.0.0.0:5760"),
        ("udpin:0.0.0.0", "udpin:0.0.0.0:14550"),
        ("udpout:gcs.local", "udpout:gcs.local:14550"),
        ("tcpout:127.0.0.1", "tcpout:127.0.0.1:5760"),
        ("192.168.1.10:14550", "udpout:192.168.1.10:14550"),
        ("localhost:5760", "tcpout:localhost:5760"),
        ("upd:0.0.0.0:14550", "udp:0.0.0.0:14550"),
        ("UDPIN:0.0.0.0:14550", "udpin:0.0.0.0:14550"),
        ("udp-in:0.0.0.0:14550", "udpin:0.0.0.0:14550"),
        ("serail:/dev/ttyACM0", "serial:/dev/ttyACM0"),
        ("udpin:::1:14550", "udpin:[::1]:14550"),
        ("tcpout:fe80::1%eth0:5760", "tcpout:[fe80::1%eth0]:5760"),
        ("udpout::14550", "udpin:0.0.0.0:14550"),
        ("ttyACM0", "serial:/dev/ttyACM0"),
        ("dev/ttyACM0:115200", "serial:/dev/ttyACM0:115200"),
        ("serial:/dev/ttyAMA0:115k2", "serial:/dev/ttyAMA0:115200"),
        ("serial:/dev/ttyAMA0:", "serial:/dev/ttyAMA0:57600"),
    ] {
        let error = text.parse::<Endpoint>().unwrap_err();
        assert_eq!(error.suggestion.as_deref(), Some(suggestion), "{text}");
        assert!(error.to_string().ends_with(&format!(": did you mean {suggestion}?")));
    }
    let error = "modem".parse::<Endpoint>().unwrap_err().to_string();
    assert!(error.ends_with("as in udpin:0.0.0.0:14550 or serial:/dev/ttyAMA0:921600"), "{error}");
}
