#define _GNU_SOURCE // SOCK_CLOEXEC
#include "base/socket.h"

#include "base/error.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

lx_result lx_socket_listen_loopback(uint32_t port, int *out_socket, uint32_t *out_port, lx_error *error)
{
    enum { waiting_connections = 64 };
    if (port > 65535) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "port %u is above 65535", port);
    const int handle = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (handle < 0) return lx_fail(error, LX_ERROR_IO, "cannot open a socket: %s", strerror(errno));
    const int yes = 1; // a server that was stopped a moment ago does not hold the port
    setsockopt(handle, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof address;
    if (bind(handle, (struct sockaddr *)&address, sizeof address) != 0 || listen(handle, waiting_connections) != 0 ||
        getsockname(handle, (struct sockaddr *)&address, &length) != 0) {
        const lx_result result = lx_fail(error, LX_ERROR_IO, "cannot listen on port %u of 127.0.0.1: %s", port, strerror(errno));
        close(handle);
        return result;
    }
    *out_socket = handle;
    *out_port = ntohs(address.sin_port);
    return LX_OK;
}

void lx_socket_close(int socket)
{
    if (socket >= 0) close(socket);
}
