// Raw elements of accessors, so that vertices can be copied about without a change to their component type.
#include "scene/gltf_export_private.h"

#include "scene/gltf_accessors.h"

#include <math.h>
#include <string.h>

static void set_layout(const lx_gltf_accessor *accessor, lx_export_elements *out)
{
    out->count = accessor->count;
    out->component_type = accessor->component_type;
    out->component_size = accessor->component_size;
    out->components = accessor->components;
    const uint32_t columns = !accessor->matrix ? 1 : accessor->components == 4 ? 2 : accessor->components == 9 ? 3 : 4;
    out->rows = accessor->components / columns;
    out->size = (uint32_t)accessor->element_size;
    out->column_size = out->size / columns;
}

static lx_result store_element(void *user, const lx_gltf_accessor *accessor, uint32_t element, const uint8_t *bytes,
                               lx_error *error)
{
    (void)error;
    const lx_export_elements *out = user;
    memcpy(out->data + (size_t)element * out->size, bytes, accessor->element_size);
    return LX_OK;
}

lx_result lx_export_read_elements(lx_exporter *exporter, uint32_t index, lx_export_elements *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_accessor accessor;
    lx_export_elements elements = {0};
    if (index >= exporter->input_accessor_count)
        return lx_fail(error, LX_ERROR_FORMAT, "accessor %u does not exist", index);
    LX_TRY(lx_gltf_get_accessor(&exporter->input, index, &accessor, error));
    set_layout(&accessor, &elements);
    if (accessor.view >= 0 || accessor.sparse.count > 0) {
        elements.data = lx_calloc_array(elements.count, elements.size);
        if (!elements.data) return lx_fail_memory(error, accessor.object.label);
        LX_TRY(lx_gltf_visit_elements(&exporter->input, &accessor, store_element, &elements, error));
    }
    *out = elements;
    elements.data = NULL;
cleanup:
    lx_free(elements.data);
    return result;
}

void lx_export_elements_release(lx_export_elements *elements)
{
    lx_free(elements->data);
    *elements = (lx_export_elements){0};
}

static double component_value(const lx_export_elements *elements, const uint8_t *bytes)
{
    uint8_t raw[4] = {0};
    uint16_t half;
    uint32_t word;
    float number;
    memcpy(raw, bytes, elements->component_size);
    memcpy(&half, raw, 2);
    memcpy(&word, raw, 4);
    memcpy(&number, raw, 4);
    switch (elements->component_type) {
    case lx_gltf_i8: return (int8_t)raw[0];
    case lx_gltf_u8: return raw[0];
    case lx_gltf_i16: return (int16_t)half;
    case lx_gltf_u16: return half;
    case lx_gltf_u32: return word;
    default: return (double)number;
    }
}

static json_t *number_of(const lx_export_elements *elements, double value)
{
    if (elements->component_type != lx_gltf_f32) return json_integer((json_int_t)value);
    return json_real(isfinite(value) ? value : 0); // JSON knows no other; such a vertex was in the input
}

static void find_bounds(const lx_export_elements *elements, uint32_t component, double *low, double *high)
{
    const size_t offset = (size_t)component / elements->rows * elements->column_size +
                          (size_t)component % elements->rows * elements->component_size;
    *low = elements->data ? INFINITY : 0;
    *high = elements->data ? -INFINITY : 0;
    for (size_t i = 0; elements->data && i < elements->count; ++i) {
        const double value = component_value(elements, elements->data + i * elements->size + offset);
        if (value < *low) *low = value;
        if (value > *high) *high = value;
    }
}

lx_result lx_export_set_bounds(json_t *accessor, const lx_export_elements *elements, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *low = json_array(), *high = json_array();
    for (uint32_t c = 0; c < elements->components; ++c) {
        double least, greatest;
        find_bounds(elements, c, &least, &greatest);
        LX_TRY(lx_export_append(low, number_of(elements, least), error));
        LX_TRY(lx_export_append(high, number_of(elements, greatest), error));
    }
    LX_TRY(lx_export_set(accessor, "min", json_incref(low), error));
    LX_TRY(lx_export_set(accessor, "max", json_incref(high), error));
cleanup:
    json_decref(low);
    json_decref(high);
    return result;
}
