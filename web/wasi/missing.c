// Symbols that Rust's standard library for wasm32-wasip1 names and Debian's wasi-libc does not have. There are no threads: the
// program starts none where `cfg(target_family = "wasm")`, and whatever would start one is refused here.
#include <errno.h>

int *__errno_location(void) { return &errno; }

int pthread_attr_init(void *attributes) {
    (void)attributes;
    return 0;
}

int pthread_attr_setstacksize(void *attributes, unsigned long bytes) {
    (void)attributes;
    (void)bytes;
    return 0;
}

int pthread_attr_destroy(void *attributes) {
    (void)attributes;
    return 0;
}

int pthread_create(void *thread, const void *attributes, void *(*run)(void *), void *argument) {
    (void)thread;
    (void)attributes;
    (void)run;
    (void)argument;
    return ENOTSUP;
}

int pthread_detach(void *thread) {
    (void)thread;
    return ENOTSUP;
}

int pthread_join(void *thread, void **result) {
    (void)thread;
    (void)result;
    return ENOTSUP;
}

// There are no links in the page's memory: a path that is asked for is refused as unknown.
char *realpath(const char *path, char *resolved) {
    (void)path;
    (void)resolved;
    errno = ENOSYS;
    return 0;
}

// That of Debian's wasi-libc gives the new name for both paths. All paths are below the one folder that is open, number 3.
#include <wasi/api.h>

int __wrap_link(const char *old, const char *new) {
    while (*old == '/') old++;
    while (*new == '/') new++;
    __wasi_errno_t error = __wasi_path_link(3, 0, old, 3, new);
    if (error == 0) return 0;
    errno = error;
    return -1;
}

int __wrap_linkat(int from, const char *old, int to, const char *new, int flags) {
    (void)from;
    (void)to;
    (void)flags;
    return __wrap_link(old, new);
}
