/* Stand-ins for the HAL: a converter that replays codes, and a UART that is the simulated board's console. */
#include "hal.h"

#include <stdio.h>

#include "codes.h"
#include "ohmstrain.h"

ADC_HandleTypeDef hadc1;
UART_HandleTypeDef huart2;
TIM_HandleTypeDef htim6;
unsigned period;
static int is_started;

HAL_StatusTypeDef HAL_ADC_Start(ADC_HandleTypeDef *hadc)
{
    is_started = hadc == &hadc1;
    return is_started ? HAL_OK : HAL_ERROR;
}

HAL_StatusTypeDef HAL_ADC_PollForConversion(ADC_HandleTypeDef *hadc, uint32_t Timeout)
{
    (void)hadc;
    return !is_started || Timeout == 0 ? HAL_ERROR : CODES[period] == FAILS ? HAL_TIMEOUT : HAL_OK;
}

uint32_t HAL_ADC_GetValue(const ADC_HandleTypeDef *hadc) { (void)hadc; return (uint32_t)CODES[period]; }

HAL_StatusTypeDef HAL_ADC_Stop(ADC_HandleTypeDef *hadc)
{
    (void)hadc;
    is_started = 0;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Transmit(UART_HandleTypeDef *huart, const uint8_t *pData, uint16_t Size, uint32_t Timeout)
{
    (void)Timeout;
    return huart == &huart2 && fwrite(pData, 1, Size, stdout) == Size ? HAL_OK : HAL_ERROR;
}

HAL_StatusTypeDef HAL_TIM_Base_Start_IT(TIM_HandleTypeDef *htim) { return htim == &htim6 ? HAL_OK : HAL_ERROR; }
uint32_t HAL_GetTick(void) { return (uint32_t)(1e3f * OHMSTRAIN_DT_S * (float)period + 0.5f); }
