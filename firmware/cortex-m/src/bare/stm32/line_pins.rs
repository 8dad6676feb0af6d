//! Pins of the three serial lines, the same on all our boards: PA2 and PA3 link (USART2), PB10 and PB11 radio (USART3), PC10
//! log (UART4).

use super::Gpio;

/// Alternate function of USART2 and USART3.
const AF_USART_1_TO_3: u32 = 7;
/// Alternate function of UART4.
const AF_UART4: u32 = 8;

/// Gives the pins of ports A, B and C to the UARTs. Inputs are pulled up, so that an open line is idle.
pub fn give_line_pins([a, b, c]: [Gpio; 3]) {
    a.pull_up(3);
    b.pull_up(11);
    for (port, pin, function) in [
        (a, 2, AF_USART_1_TO_3),
        (a, 3, AF_USART_1_TO_3),
        (b, 10, AF_USART_1_TO_3),
        (b, 11, AF_USART_1_TO_3),
        (c, 10, AF_UART4),
    ] {
        port.alternate(pin, function);
    }
}
