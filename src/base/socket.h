/// Listening on this machine's loopback address.
#ifndef LX_BASE_SOCKET_H
#define LX_BASE_SOCKET_H

#include "luxel/base.h"

/// A TCP socket that listens on 127.0.0.1 and nowhere else: programs of this machine alone can reach it. `port` 0: any free one.
/// The socket is the caller's (lx_socket_close).
lx_result lx_socket_listen_loopback(uint32_t port, int *out_socket, uint32_t *out_port, lx_error *error);
void lx_socket_close(int socket);

#endif
