#define _POSIX_C_SOURCE 200809L
#include "base/thread.h"

#include "base/clock.h"
#include "base/error.h"
#include "base/memory.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>
#include <unistd.h>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

struct lx_mutex {
    pthread_mutex_t handle;
};

lx_mutex *lx_mutex_create(void)
{
    lx_mutex *mutex = lx_malloc_array(1, sizeof *mutex);
    if (mutex && pthread_mutex_init(&mutex->handle, NULL) != 0) {
        lx_free(mutex);
        return NULL;
    }
    return mutex;
}

void lx_mutex_destroy(lx_mutex *mutex)
{
    if (!mutex) return;
    pthread_mutex_destroy(&mutex->handle);
    lx_free(mutex);
}

void lx_mutex_lock(lx_mutex *mutex)
{
    pthread_mutex_lock(&mutex->handle);
}

void lx_mutex_unlock(lx_mutex *mutex)
{
    pthread_mutex_unlock(&mutex->handle);
}

uint32_t lx_core_count(void)
{
    const long count = sysconf(_SC_NPROCESSORS_ONLN);
    return count < 1 ? 1u : count > 1024 ? 1024u : (uint32_t)count;
}

void lx_flush_denormals(void)
{
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | 0x8040); // FTZ and DAZ
#endif
}

struct lx_pool {
    pthread_mutex_t mutex;
    pthread_cond_t work, progress;
    pthread_t *threads;
    uint32_t worker_count;
    bool quit;
    atomic_bool stopping; // result is not LX_OK; readable without the mutex

    // The job that runs. Guarded by `mutex`.
    lx_task task;
    void *user;
    const float *weights;
    size_t task_count, next_task, running;
    double weight_done;
    lx_result result;
    size_t failed_task;
    lx_error error;
};

typedef struct worker_start {
    lx_pool *pool;
    uint32_t index;
} worker_start;

static void *worker_main(void *argument)
{
    const worker_start start = *(worker_start *)argument;
    lx_free(argument);
    lx_pool *pool = start.pool;
    lx_flush_denormals();
    pthread_mutex_lock(&pool->mutex);
    for (;;) {
        while (!pool->quit && (pool->next_task >= pool->task_count || pool->result != LX_OK))
            pthread_cond_wait(&pool->work, &pool->mutex);
        if (pool->quit) break;
        const size_t index = pool->next_task++;
        ++pool->running;
        pthread_mutex_unlock(&pool->mutex);
        lx_error error = {0};
        const lx_result result = pool->task(pool->user, index, start.index, &error);
        pthread_mutex_lock(&pool->mutex);
        --pool->running;
        pool->weight_done += pool->weights ? (double)pool->weights[index] : 1.0;
        // Of several failures the one of the lowest task is reported, so that the message does not depend on timing
        // more than it has to.
        if (result != LX_OK && (pool->result == LX_OK || index < pool->failed_task)) {
            pool->result = result;
            pool->error = error;
            pool->failed_task = index;
            atomic_store(&pool->stopping, true);
        }
        pthread_cond_signal(&pool->progress);
    }
    pthread_mutex_unlock(&pool->mutex);
    return NULL;
}

lx_pool *lx_pool_create(uint32_t thread_count)
{
    if (thread_count == 0) thread_count = lx_core_count();
    lx_pool *pool = lx_calloc_array(1, sizeof *pool);
    if (!pool) return NULL;
    pool->threads = lx_calloc_array(thread_count, sizeof *pool->threads);
    if (!pool->threads) {
        lx_free(pool);
        return NULL;
    }
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->work, NULL);
    pthread_condattr_t attributes;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&pool->progress, &attributes);
    pthread_condattr_destroy(&attributes);
    for (uint32_t i = 0; i < thread_count; ++i) {
        worker_start *start = lx_malloc_array(1, sizeof *start);
        if (!start) break;
        *start = (worker_start){pool, i};
        if (pthread_create(&pool->threads[i], NULL, worker_main, start) != 0) {
            lx_free(start);
            break;
        }
        ++pool->worker_count;
    }
    if (pool->worker_count == 0) {
        lx_pool_destroy(pool);
        return NULL;
    }
    return pool;
}

void lx_pool_destroy(lx_pool *pool)
{
    if (!pool) return;
    pthread_mutex_lock(&pool->mutex);
    pool->quit = true;
    pthread_cond_broadcast(&pool->work);
    pthread_mutex_unlock(&pool->mutex);
    for (uint32_t i = 0; i < pool->worker_count; ++i) pthread_join(pool->threads[i], NULL);
    pthread_cond_destroy(&pool->work);
    pthread_cond_destroy(&pool->progress);
    pthread_mutex_destroy(&pool->mutex);
    lx_free(pool->threads);
    lx_free(pool);
}

bool lx_pool_is_stopping(const lx_pool *pool)
{
    return atomic_load_explicit(&pool->stopping, memory_order_relaxed);
}

uint32_t lx_pool_worker_count(const lx_pool *pool)
{
    return pool->worker_count;
}

static bool report(const lx_progress_sink *sink, const char *stage, double fraction, double start)
{
    if (!sink || !sink->func) return true;
    const lx_progress progress = {.stage = stage, .fraction = fraction, .seconds = lx_seconds() - start};
    return sink->func(sink->user, &progress);
}

lx_result lx_pool_run_weighted(lx_pool *pool, size_t task_count, const float *weights, lx_task task, void *user,
                               const char *stage, const lx_progress_sink *sink, lx_error *error)
{
    const double start = lx_seconds();
    double total = 0;
    for (size_t i = 0; i < task_count; ++i) total += weights ? (double)weights[i] : 1.0;
    if (!(total > 0)) total = 1;
    bool go_on = report(sink, stage, 0.0, start);

    pthread_mutex_lock(&pool->mutex);
    pool->task = task;
    pool->user = user;
    pool->weights = weights;
    pool->next_task = 0;
    pool->weight_done = 0;
    pool->result = go_on ? LX_OK : LX_ERROR_CANCELLED;
    atomic_store(&pool->stopping, !go_on);
    pool->failed_task = 0;
    pool->task_count = task_count;
    pthread_cond_broadcast(&pool->work);
    while (pool->running > 0 || (pool->next_task < pool->task_count && pool->result == LX_OK)) {
        struct timespec until;
        clock_gettime(CLOCK_MONOTONIC, &until);
        until.tv_nsec += 100 * 1000 * 1000;
        if (until.tv_nsec >= 1000000000) {
            until.tv_nsec -= 1000000000;
            ++until.tv_sec;
        }
        // Wakes at every finished task; reports at most every tenth of a second.
        while ((pool->running > 0 || (pool->next_task < pool->task_count && pool->result == LX_OK)) &&
               pthread_cond_timedwait(&pool->progress, &pool->mutex, &until) != ETIMEDOUT) {
        }
        const double fraction = pool->weight_done / total;
        pthread_mutex_unlock(&pool->mutex);
        go_on = report(sink, stage, fraction < 1.0 ? fraction : 1.0, start);
        pthread_mutex_lock(&pool->mutex);
        if (!go_on && pool->result == LX_OK) {
            pool->result = LX_ERROR_CANCELLED;
            atomic_store(&pool->stopping, true);
        }
    }
    const lx_result result = pool->result;
    if (error && result != LX_OK) {
        if (result == LX_ERROR_CANCELLED)
            lx_fail(error, result, "cancelled");
        else
            *error = pool->error;
    }
    pool->task_count = pool->next_task = 0;
    pool->weights = NULL;
    pthread_mutex_unlock(&pool->mutex);
    if (result == LX_OK) report(sink, stage, 1.0, start);
    return result;
}

lx_result lx_pool_run(lx_pool *pool, size_t task_count, lx_task task, void *user, const char *stage,
                      const lx_progress_sink *sink, lx_error *error)
{
    return lx_pool_run_weighted(pool, task_count, NULL, task, user, stage, sink, error);
}
