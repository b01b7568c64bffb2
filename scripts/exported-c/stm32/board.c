/* main.c of a CubeIDE project, as the exported README describes it. */
#include "ohmstrain_app.h"

#include "codes.h"
#include "hal.h"

void Error_Handler(void) { _exit(1); }

void HAL_TIM_PeriodElapsedCallback(TIM_HandleTypeDef *htim)
{
    if (htim == &htim6) {
        ohmstrain_app_tick();
    }
}

int main(void)
{
    if (ohmstrain_app_init(&hadc1, &huart2) != OHMSTRAIN_OK || HAL_TIM_Base_Start_IT(&htim6) != HAL_OK) {
        Error_Handler();
    }
    for (period = 0; period < sizeof CODES / sizeof *CODES; period++) {
        HAL_TIM_PeriodElapsedCallback(&htim6);
        if (CODES[period] != LATE) {
            ohmstrain_app_poll();
            ohmstrain_app_poll(); /* nothing is due */
        }
    }
    return 0;
}
