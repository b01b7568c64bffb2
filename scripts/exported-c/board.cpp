/* An Arduino that a computer pretends to be: a sensor that moves, is unplugged for a moment, and a serial port that is stdout. */
#include "Arduino.h"

#include <cmath>
#include <cstdio>

SerialPort Serial;

void SerialPort::begin(unsigned long) { std::printf("ets Jul 29 2019 12:21:46\r\n"); }
int SerialPort::available() { return 0; }
int SerialPort::read() { return -1; }
void SerialPort::print(const char *text) { std::printf("%s", text); }
void SerialPort::print(unsigned long number) { std::printf("%lu", number); }
void SerialPort::print(double number, int digits) { std::printf("%.*f", digits, number); }
void SerialPort::println(const char *text) { std::printf("%s\r\n", text); }
void SerialPort::println(double number, int digits) { std::printf("%.*f\r\n", digits, number); }
void SerialPort::println(long number) { std::printf("%ld\r\n", number); }
void SerialPort::println(int number) { std::printf("%d\r\n", number); }
void SerialPort::println(unsigned number) { std::printf("%u\r\n", number); }

long map(long x, long in_least, long in_most, long out_least, long out_most) {
  return (x - in_least) * (out_most - out_least) / (in_most - in_least) + out_least;
}

/* About 50 ms from one look to the next, and soon beyond 32 bits. */
unsigned long micros(void) {
  static uint32_t now = 4294000000UL, looks = 0;
  return now += 45000 + looks++ * 7919 % 10000;
}

void delay(unsigned long) {}

/* Codes of a 10-bit converter: 1600 to 2400 ohm below 10 kohm; the rail while nothing is connected. */
int analogRead(uint8_t) {
  static int reading = 0;
  reading++;
  return reading >= 200 && reading < 210 ? 1023 : static_cast<int>(165.0 + 27.0 * std::sin(0.05 * reading));
}

uint32_t analogReadMilliVolts(uint8_t pin) { return static_cast<uint32_t>(analogRead(pin)) * 3300 / 1023; }

void setup();
void loop();

int main() {
  setup();
  for (int i = 0; i < 4000; i++) {
    loop();
  }
}
