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
