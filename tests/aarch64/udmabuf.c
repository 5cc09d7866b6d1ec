/* Stands for /dev/udmabuf, from which libcamera's virtual cameras take their buffers, where a program is emulated.
 *
 *     cc -shared -fPIC -O2 -o udmabuf.so udmabuf.c
 *     qemu-aarch64 -E LD_PRELOAD=udmabuf.so program
 *
 * qemu-user passes on neither its ioctls nor those of the buffers that it makes, and not every machine has it. A buffer is here the
 * memory that it was to be made of: shared and mapped in the same way, and coherent without being asked to.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/udmabuf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

/* Programs with 64-bit offsets call it by the second name. */
int open64(const char *path, int flags, ...) __attribute__((alias("open")));

int open(const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    if (strcmp(path, "/dev/udmabuf") == 0)
        path = "/dev/null";
    return syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int ioctl(int fd, unsigned long request, ...) {
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    if (request == UDMABUF_CREATE) {
        const struct udmabuf_create *create = argument;
        return fcntl(create->memfd, F_DUPFD_CLOEXEC, 0);
    }
    if (request == DMA_BUF_IOCTL_SYNC)
        return 0;
    return syscall(SYS_ioctl, fd, request, argument);
}
