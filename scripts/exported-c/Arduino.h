/* As much of Arduino's interface as the exported sketch uses: enough to compile it without an Arduino. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <math.h>
#include <stdint.h>

#define A0 14
#define A1 15
#define A2 16
#define A3 17

int analogRead(uint8_t pin);
uint32_t analogReadMilliVolts(uint8_t pin);
long map(long x, long in_least, long in_most, long out_least, long out_most);
unsigned long micros(void);
void delay(unsigned long milliseconds);

struct SerialPort {
  void begin(unsigned long baud);
  int available();
  int read();
  void print(const char *text);
  void print(char letter);
  void print(unsigned long number);
  void print(double number, int digits);
  void println(const char *text);
  void println(double number, int digits);
  void println(int number);
  void println(long number);
  void println(unsigned number);
};
extern SerialPort Serial;

#endif
