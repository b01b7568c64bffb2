/* Stand-in for Zephyr's adc.h, and for a devicetree with one io-channel in zephyr,user; see kernel.h. */
#ifndef ZEPHYR_ADC_H
#define ZEPHYR_ADC_H

#include <zephyr/kernel.h>

#define DT_PATH(node) NODE_##node
#define PASTE(a, b) a##b
#define DT_NODE_HAS_PROP(node_id, prop) PASTE(node_id, _HAS_##prop)
#define NODE_zephyr_user_HAS_io_channels 1
#define ADC_DT_SPEC_GET(node_id) PASTE(node_id, _CHANNEL_0)
#define NODE_zephyr_user_CHANNEL_0 {.dev = &converter, .channel_id = 0, .channel_cfg_dt_node_exists = true, .resolution = 12}

struct device { const char *name; };
extern const struct device converter;

struct adc_dt_spec {
    const struct device *dev;
    uint8_t channel_id;
    bool channel_cfg_dt_node_exists;
    uint8_t resolution;
    uint8_t oversampling;
};

struct adc_sequence {
    uint32_t channels;
    void *buffer;
    size_t buffer_size; /* in bytes */
    uint8_t resolution;
    uint8_t oversampling;
};

bool adc_is_ready_dt(const struct adc_dt_spec *spec);
int adc_channel_setup_dt(const struct adc_dt_spec *spec);
int adc_sequence_init_dt(const struct adc_dt_spec *spec, struct adc_sequence *seq);
int adc_read_dt(const struct adc_dt_spec *spec, const struct adc_sequence *sequence);

#endif
