/// A small thread pool: fixed task lists, results independent of who runs what.
#ifndef LX_BASE_THREAD_H
#define LX_BASE_THREAD_H

#include "luxel/base.h"

typedef struct lx_mutex lx_mutex;
lx_mutex *lx_mutex_create(void);
void lx_mutex_destroy(lx_mutex *mutex);
void lx_mutex_lock(lx_mutex *mutex);
void lx_mutex_unlock(lx_mutex *mutex);

/// Runs one task. `worker_index` < lx_pool_worker_count: for per-worker scratch memory. Denormals are flushed to zero.
/// A result other than LX_OK stops the pool from starting further tasks and is what lx_pool_run returns.
typedef lx_result (*lx_task)(void *user, size_t task_index, uint32_t worker_index, lx_error *error);

typedef struct lx_pool lx_pool;

/// `thread_count` 0: one per core. NULL: no memory or no thread could be started.
lx_pool *lx_pool_create(uint32_t thread_count);
void lx_pool_destroy(lx_pool *pool);
uint32_t lx_pool_worker_count(const lx_pool *pool);

/// Runs tasks 0 … task_count-1 on all workers and returns when they are done. `sink` (may be NULL) is called from the calling
/// thread with `stage` and the share of tasks done; if it returns false no further task starts and LX_ERROR_CANCELLED comes back.
/// Not re-entrant: a task must not call it on the same pool.
lx_result lx_pool_run(lx_pool *pool, size_t task_count, lx_task task, void *user, const char *stage,
                      const lx_progress_sink *sink, lx_error *error);

/// The same with shares given: task i counts `weights[i]` of their sum in the progress (NULL: all alike).
lx_result lx_pool_run_weighted(lx_pool *pool, size_t task_count, const float *weights, lx_task task, void *user,
                               const char *stage, const lx_progress_sink *sink, lx_error *error);

/// True once a run is to end early, because it was cancelled or a task failed. Long tasks ask now and then and return; what they had is
/// thrown away, so LX_OK will do.
bool lx_pool_is_stopping(const lx_pool *pool);

uint32_t lx_core_count(void);

/// Sets flush-to-zero for the calling thread; Embree slows down several times on denormals.
void lx_flush_denormals(void);

#endif
