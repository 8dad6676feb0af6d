//! Arbitrary bytes on the autopilot's port: nothing panics, and nothing that is not finite is believed or sent.

use gleaner_link::{
    Component, FrameDecoder, Parameters, Settings, Signing, SigningKey, SigningTime, Status, SystemState,
};
use gleaner_units::{Duration, Instant};

pub fn run(data: &[u8]) {
    let Ok(settings) = Settings::new(None, 191) else { return };
    let mut component = Component::new(settings, Parameters::default());
    let mut signing = Signing::new(SigningKey::new([7; 32]), 1, SigningTime::default(), None);
    let status = Status { state: SystemState::Active, may_engage: true, may_return: true };
    // The first byte chooses the size of the pieces and whether they are datagrams.
    let (&first, rest) = data.split_first().unwrap_or((&1, &[]));
    let (size, are_datagrams) = (usize::from(first >> 1).max(1), first & 1 == 1);
    let mut now = Instant::ZERO;
    for piece in rest.chunks(size) {
        if are_datagrams {
            component.receive_datagram(now, piece);
        } else {
            component.receive(now, piece);
        }
        now = now + Duration::from_millis(700);
        component.poll(now, &status);
        while component.next_event().is_some() {}
        let position = component.autopilot().position(now, Duration::from_secs(60));
        assert!(position.is_none_or(|position| position.position.is_finite()));
        verify_sent(&mut component, &mut signing);
    }
}

/// Everything that leaves is a frame, can be signed, and is accepted with its signature.
fn verify_sent(component: &mut Component, signing: &mut Signing) {
    let mut buffer = [0; 172];
    loop {
        let length = component.transmit(&mut buffer);
        let Some(sent) = buffer.get(..length).filter(|sent| !sent.is_empty()) else { return };
        let signed = signing.sign(sent).expect("a frame of ours can be signed");
        let mut receiver = Signing::new(SigningKey::new([7; 32]), 2, SigningTime::default(), None);
        let mut rest = &*signed;
        let frame = FrameDecoder::new().read(&mut rest).expect("what leaves is a frame");
        assert!(rest.is_empty());
        assert_eq!(receiver.check(&frame), Ok(()));
    }
}
