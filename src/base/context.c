#include "base/context.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

lx_context_desc lx_context_desc_default(void)
{
    return (lx_context_desc){.thread_count = 0};
}

lx_result lx_context_create(const lx_context_desc *desc, lx_context **out_context, lx_error *error)
{
    static const char *const known_isas[] = {"sse2", "sse4.2", "avx", "avx2", "avx512"};
    lx_result result = LX_OK;
    lx_context *context = lx_calloc_array(1, sizeof *context);
    if (!context) return lx_fail_memory(error, "context");
    if (desc->isa) {
        bool known = false;
        for (size_t i = 0; i < sizeof known_isas / sizeof *known_isas; ++i) known |= strcmp(desc->isa, known_isas[i]) == 0;
        if (!known) {
            result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "unknown instruction set '%s' (sse2, sse4.2, avx, avx2, avx512)",
                             desc->isa);
            goto cleanup;
        }
        strcpy(context->isa, desc->isa);
    }
    if (desc->thread_count > 1024) {
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%u threads are more than the 1024 allowed", desc->thread_count);
        goto cleanup;
    }
    context->log = lx_log_create(desc->logger);
    context->pool = lx_pool_create(desc->thread_count);
    if (!context->log || !context->pool) {
        result = lx_fail_memory(error, "context");
        goto cleanup;
    }
    *out_context = context;
    context = NULL;
cleanup:
    lx_context_destroy(context);
    return result;
}

void lx_context_destroy(lx_context *context)
{
    if (!context) return;
    lx_pool_destroy(context->pool);
    lx_log_destroy(context->log);
    lx_free(context);
}
