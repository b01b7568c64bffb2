//! Boards by name: clock, memory and floating point, for budgets.

use super::cost::Processor;

/// A microcontroller board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// Name in `--budget board=NAME`.
    pub name: &'static str,
    /// Board and chip in words.
    pub title: &'static str,
    /// Clock of the processor, Hz.
    pub clock_hz: u32,
    /// Flash for a program without the bootloader, bytes; as `upload.maximum_size` of the board's Arduino core.
    pub flash: usize,
    /// Static RAM, bytes.
    pub ram: usize,
    /// Arithmetic of the processor.
    pub processor: Processor,
    /// Data sheet of the chip or module.
    pub source: &'static str,
}

const KIB: usize = 1024;
const MHZ: u32 = 1_000_000;

/// All boards. Flash and RAM are the chip's; flash is the module's if it is outside the chip.
pub const BOARDS: [Board; 11] = [
    Board {
        name: "uno",
        title: "Arduino Uno, ATmega328P",
        clock_hz: 16 * MHZ,
        // Optiboot takes 512 B.
        flash: 32 * KIB - 512,
        ram: 2 * KIB,
        processor: Processor::Avr,
        source: "Microchip DS40002061B",
    },
    Board {
        name: "nano",
        title: "Arduino Nano, ATmega328P",
        clock_hz: 16 * MHZ,
        // The older bootloader takes 2 KiB.
        flash: 30 * KIB,
        ram: 2 * KIB,
        processor: Processor::Avr,
        source: "Microchip DS40002061B",
    },
    Board {
        name: "nano33",
        title: "Arduino Nano 33 IoT, SAMD21G18",
        clock_hz: 48 * MHZ,
        // The bootloader takes 8 KiB.
        flash: 248 * KIB,
        ram: 32 * KIB,
        processor: Processor::Software,
        source: "Microchip DS40001882",
    },
    Board {
        name: "nano33ble",
        title: "Arduino Nano 33 BLE, nRF52840",
        clock_hz: 64 * MHZ,
        // The bootloader takes 64 KiB.
        flash: 960 * KIB,
        ram: 256 * KIB,
        processor: Processor::Single,
        source: "Nordic nRF52840 PS v1.7",
    },
    Board {
        name: "teensy40",
        title: "Teensy 4.0, i.MX RT1062",
        clock_hz: 600 * MHZ,
        flash: 1984 * KIB,
        // Half of 1 MiB: the tightly coupled part.
        ram: 512 * KIB,
        processor: Processor::Single,
        source: "NXP IMXRT1060CEC",
    },
    Board {
        name: "esp32",
        title: "ESP32-WROOM-32",
        clock_hz: 240 * MHZ,
        // Size of the larger one of Arduino's default partitions for a program.
        flash: 1280 * KIB,
        // Share of 520 KiB that the linker gives to static data.
        ram: 320 * KIB,
        processor: Processor::Single,
        source: "Espressif ESP32 Series v4.3",
    },
    Board {
        name: "esp32c3",
        title: "ESP32-C3-MINI-1",
        clock_hz: 160 * MHZ,
        flash: 1280 * KIB,
        ram: 320 * KIB,
        processor: Processor::Software,
        source: "Espressif ESP32-C3 Series v1.8",
    },
    Board {
        name: "rp2040",
        title: "Raspberry Pi Pico, RP2040",
        clock_hz: 125 * MHZ,
        flash: 2048 * KIB,
        ram: 264 * KIB,
        processor: Processor::Software,
        source: "Raspberry Pi RP-008371-DS",
    },
    Board {
        name: "stm32f1",
        title: "Blue Pill, STM32F103C8",
        clock_hz: 72 * MHZ,
        flash: 64 * KIB,
        ram: 20 * KIB,
        processor: Processor::Software,
        source: "ST DS5319",
    },
    Board {
        name: "stm32f4",
        title: "Black Pill, STM32F411CE",
        clock_hz: 100 * MHZ,
        flash: 512 * KIB,
        ram: 128 * KIB,
        processor: Processor::Single,
        source: "ST DS10314",
    },
    Board {
        name: "stm32l4",
        title: "Nucleo-L432KC, STM32L432KC",
        clock_hz: 80 * MHZ,
        flash: 256 * KIB,
        // SRAM1 and SRAM2.
        ram: 64 * KIB,
        processor: Processor::Single,
        source: "ST DS11451",
    },
];

/// Divisor of the time between two readings: half of it is left for the rest of the program, and for instructions of several
/// cycles.
const OF_TIME: f64 = 2.0;
/// Fraction of flash and RAM that a filter may take: a quarter is left for the rest of the program.
const OF_MEMORY: (usize, usize) = (3, 4);

impl Board {
    /// Returns the board of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        BOARDS.iter().find(|board| board.name == name)
    }

    /// Lists the names of all boards, for messages.
    pub fn names() -> String {
        BOARDS.map(|board| board.name).join(", ")
    }

    /// Returns the number of instructions that a step may take for readings every `dt_s` seconds.
    pub fn instructions(&self, dt_s: f64) -> usize {
        (f64::from(self.clock_hz) * dt_s / OF_TIME) as usize
    }

    /// Returns the flash that a filter may take, bytes.
    pub const fn flash_for_filter(&self) -> usize {
        self.flash / OF_MEMORY.1 * OF_MEMORY.0
    }

    /// Returns the RAM that a filter may take, stack included, bytes.
    pub const fn ram_for_filter(&self) -> usize {
        self.ram / OF_MEMORY.1 * OF_MEMORY.0
    }
}

#[cfg(test)]
mod tests {
    use super::{BOARDS, Board};

    #[test]
    fn names_are_short_and_each_stands_once() {
        for (k, board) in BOARDS.iter().enumerate() {
            assert!(board.name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit()), "{}", board.name);
            assert_eq!(BOARDS.iter().position(|other| other.name == board.name), Some(k));
        }
        assert_eq!(Board::named("uno").map(|board| board.flash), Some(32_256));
        assert_eq!(Board::named("due"), None);
    }

    #[test]
    fn half_of_the_time_and_three_quarters_of_the_memory_are_the_filters() {
        let uno = Board::named("uno").unwrap();
        assert_eq!(uno.instructions(0.02), 160_000);
        assert_eq!((uno.flash_for_filter(), uno.ram_for_filter()), (24_192, 1536));
    }
}
