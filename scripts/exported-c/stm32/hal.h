/* The simulated peripherals, and the period that they are in. */
#ifndef HAL_H
#define HAL_H

#include "main.h"

extern ADC_HandleTypeDef hadc1;
extern UART_HandleTypeDef huart2;
extern TIM_HandleTypeDef htim6;
extern unsigned period; /* number of the next code */

#endif
