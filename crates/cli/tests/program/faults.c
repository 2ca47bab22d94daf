/* Makes one call of the C library fail. tests/faults.sh and program/faults.rs preload this library into the program.

   The environment selects the calls:
     FAULT_CALLS   names of calls, each with its error: "write=ENOSPC,fsync=EIO". Repeated names are not allowed.
     FAULT_AT      number of the call that fails, counted from 1 over the selected calls of `main`. 0: none.
     FAULT_LOG     a file that receives the name of the failed call, and at the end the number of selected calls.
     FAULT_PROGRAM the name of the executable to which the faults apply. Its children run undisturbed.
   The error SHORT transfers half of the bytes of a read or write and is no error. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

/* Every name that FAULT_CALLS accepts. One name covers the variants of a call, such as open, open64 and openat. */
#define CALLS(X)                                                                                                       \
    X(open) X(opendir) X(readdir) X(read) X(pread) X(write) X(pwrite) X(fsync) X(ftruncate) X(fallocate) X(stat)        \
    X(statfs) X(flock) X(rename) X(link) X(symlink) X(unlink) X(mkdir) X(rmdir) X(readlink) X(realpath) X(copy)        \
    X(mmap) X(malloc) X(thread) X(pipe) X(spawn)

#define ENUM(name) CALL_##name,
enum call { CALLS(ENUM) CALL_COUNT };
#define NAME(name) #name,
static const char *const NAMES[] = {CALLS(NAME)};

static const struct { const char *name; int value; } ERRORS[] = {
    {"ENOSPC", ENOSPC}, {"EIO", EIO},     {"EINTR", EINTR},   {"EMFILE", EMFILE}, {"EACCES", EACCES},
    {"ENOMEM", ENOMEM}, {"EAGAIN", EAGAIN}, {"SHORT", -1},
};

static int error_of[CALL_COUNT]; /* 0: the call is not selected. */
static long fault_at;
static atomic_long count;
static int log_fd = -1;
/* Whether the program has installed its handler of SIGABRT, which gives an abort its exit code. Earlier calls are not counted,
   because the program cannot change how they end. */
static atomic_int has_handler;

static long real_syscall(long number, long a, long b, long c, long d) {
    static __typeof__(&syscall) real;
    if (!real) real = (__typeof__(&syscall))dlsym(RTLD_NEXT, "syscall");
    return real(number, a, b, c, d);
}

static void print_log(const char *name, long number) {
    char line[64];
    size_t len = 0;
    while (name[len] && len < 32) { line[len] = name[len]; len++; }
    line[len++] = ' ';
    char digits[20];
    int n = 0;
    do digits[n++] = (char)('0' + number % 10); while ((number /= 10) > 0);
    while (n > 0) line[len++] = digits[--n];
    line[len++] = '\n';
    if (log_fd >= 0) real_syscall(SYS_write, log_fd, (long)line, (long)len, 0);
}

/* Returns the error of this call: 0 for a call that succeeds, -1 for half of the bytes. */
static int fault(enum call call) {
    if (!error_of[call] || !atomic_load(&has_handler)) return 0;
    if (atomic_fetch_add(&count, 1) + 1 != fault_at) return 0;
    print_log(NAMES[call], fault_at);
    return error_of[call];
}

__attribute__((constructor)) static void start(void) {
    const char *program = getenv("FAULT_PROGRAM"), *calls = getenv("FAULT_CALLS"), *at = getenv("FAULT_AT");
    const char *log = getenv("FAULT_LOG");
    if (!program || !calls || !at || !log) return;
    char path[4096];
    ssize_t len = real_syscall(SYS_readlink, (long)"/proc/self/exe", (long)path, sizeof path - 1, 0);
    if (len <= 0) return;
    path[len] = 0;
    const char *slash = strrchr(path, '/');
    if (!slash || strcmp(slash + 1, program) != 0) return;
    log_fd = (int)real_syscall(SYS_openat, AT_FDCWD, (long)log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    fault_at = atol(at);
    int selected[CALL_COUNT] = {0};
    while (*calls) {
        size_t name = strcspn(calls, "="), end = strcspn(calls, ",");
        for (int c = 0; c < CALL_COUNT; c++)
            if (strlen(NAMES[c]) == name && strncmp(NAMES[c], calls, name) == 0)
                for (size_t e = 0; e < sizeof ERRORS / sizeof *ERRORS; e++)
                    if (strlen(ERRORS[e].name) == end - name - 1 && strncmp(ERRORS[e].name, calls + name + 1, end - name - 1) == 0)
                        selected[c] = ERRORS[e].value;
        calls += end + (calls[end] == ',');
    }
    memcpy(error_of, selected, sizeof selected);
}

__attribute__((destructor)) static void end(void) {
    memset(error_of, 0, sizeof error_of);
    if (log_fd >= 0) print_log("calls", atomic_load(&count));
}

/* Declares `real` as the function `name` of the C library. */
#define REAL(name)                                                                                                     \
    static __typeof__(&name) real;                                                                                     \
    if (!real) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name);

/* Defines a function that returns `bad` if the fault of `call` is due. */
#define WRAP(call, bad, result, name, parameters, arguments)                                                           \
    result name parameters {                                                                                           \
        REAL(name)                                                                                                     \
        int error = fault(CALL_##call);                                                                                \
        if (error > 0) { errno = error; return bad; }                                                                  \
        return real arguments;                                                                                         \
    }

/* Defines a function that transfers `len` bytes, or half of them. */
#define WRAP_BYTES(call, name, parameters, arguments)                                                                  \
    ssize_t name parameters {                                                                                          \
        REAL(name)                                                                                                     \
        int error = fault(CALL_##call);                                                                                \
        if (error > 0) { errno = error; return -1; }                                                                   \
        if (error < 0 && len > 1) len /= 2;                                                                            \
        return real arguments;                                                                                         \
    }

/* Defines a function that opens a file. The mode exists only if the function may create the file. */
#define WRAP_OPEN(name, parameters, arguments)                                                                         \
    int name parameters {                                                                                              \
        mode_t mode = 0;                                                                                               \
        va_list list;                                                                                                  \
        va_start(list, flags);                                                                                         \
        if (flags & (O_CREAT | O_TMPFILE)) mode = va_arg(list, mode_t);                                                \
        va_end(list);                                                                                                  \
        REAL(name)                                                                                                     \
        int error = fault(CALL_open);                                                                                  \
        if (error > 0) { errno = error; return -1; }                                                                   \
        return real arguments;                                                                                         \
    }

WRAP_OPEN(open, (const char *path, int flags, ...), (path, flags, mode))
WRAP_OPEN(open64, (const char *path, int flags, ...), (path, flags, mode))
WRAP_OPEN(openat, (int at, const char *path, int flags, ...), (at, path, flags, mode))
WRAP_OPEN(openat64, (int at, const char *path, int flags, ...), (at, path, flags, mode))
WRAP(opendir, NULL, DIR *, opendir, (const char *path), (path))
WRAP(opendir, NULL, DIR *, fdopendir, (int fd), (fd))
WRAP(readdir, NULL, struct dirent *, readdir, (DIR *dir), (dir))
WRAP(readdir, NULL, struct dirent64 *, readdir64, (DIR *dir), (dir))
WRAP_BYTES(read, read, (int fd, void *to, size_t len), (fd, to, len))
WRAP_BYTES(pread, pread, (int fd, void *to, size_t len, off_t at), (fd, to, len, at))
WRAP_BYTES(pread, pread64, (int fd, void *to, size_t len, off64_t at), (fd, to, len, at))
WRAP_BYTES(write, write, (int fd, const void *from, size_t len), (fd, from, len))
WRAP_BYTES(pwrite, pwrite, (int fd, const void *from, size_t len, off_t at), (fd, from, len, at))
WRAP_BYTES(pwrite, pwrite64, (int fd, const void *from, size_t len, off64_t at), (fd, from, len, at))
WRAP(read, -1, ssize_t, readv, (int fd, const struct iovec *to, int parts), (fd, to, parts))
ssize_t writev(int fd, const struct iovec *from, int parts) {
    REAL(writev)
    int error = fault(CALL_write);
    if (error > 0) { errno = error; return -1; }
    return real(fd, from, error < 0 && parts > 1 ? 1 : parts);
}
WRAP(fsync, -1, int, fsync, (int fd), (fd))
WRAP(fsync, -1, int, fdatasync, (int fd), (fd))
WRAP(ftruncate, -1, int, ftruncate, (int fd, off_t len), (fd, len))
WRAP(ftruncate, -1, int, ftruncate64, (int fd, off64_t len), (fd, len))
WRAP(fallocate, -1, int, fallocate, (int fd, int mode, off_t at, off_t len), (fd, mode, at, len))
WRAP(fallocate, -1, int, fallocate64, (int fd, int mode, off64_t at, off64_t len), (fd, mode, at, len))
WRAP(stat, -1, int, statx, (int at, const char *path, int flags, unsigned mask, struct statx *to), (at, path, flags, mask, to))
WRAP(stat, -1, int, stat64, (const char *path, struct stat64 *to), (path, to))
WRAP(stat, -1, int, lstat64, (const char *path, struct stat64 *to), (path, to))
WRAP(stat, -1, int, fstat64, (int fd, struct stat64 *to), (fd, to))
WRAP(statfs, -1, int, statvfs64, (const char *path, struct statvfs64 *to), (path, to))
WRAP(statfs, -1, int, fstatfs64, (int fd, struct statfs64 *to), (fd, to))
WRAP(flock, -1, int, flock, (int fd, int how), (fd, how))
WRAP(rename, -1, int, rename, (const char *from, const char *to), (from, to))
WRAP(rename, -1, int, renameat, (int a, const char *from, int b, const char *to), (a, from, b, to))
WRAP(rename, -1, int, renameat2, (int a, const char *from, int b, const char *to, unsigned flags), (a, from, b, to, flags))
WRAP(link, -1, int, link, (const char *from, const char *to), (from, to))
WRAP(link, -1, int, linkat, (int a, const char *from, int b, const char *to, int flags), (a, from, b, to, flags))
WRAP(symlink, -1, int, symlink, (const char *target, const char *path), (target, path))
WRAP(unlink, -1, int, unlink, (const char *path), (path))
WRAP(unlink, -1, int, unlinkat, (int at, const char *path, int flags), (at, path, flags))
WRAP(mkdir, -1, int, mkdir, (const char *path, mode_t mode), (path, mode))
WRAP(rmdir, -1, int, rmdir, (const char *path), (path))
WRAP(readlink, -1, ssize_t, readlink, (const char *path, char *to, size_t len), (path, to, len))
WRAP(realpath, NULL, char *, realpath, (const char *path, char *to), (path, to))
WRAP_BYTES(copy, copy_file_range, (int a, off64_t *from, int b, off64_t *to, size_t len, unsigned flags), (a, from, b, to, len, flags))
WRAP_BYTES(copy, sendfile64, (int to, int from, off64_t *at, size_t len), (to, from, at, len))
WRAP(pipe, -1, int, pipe2, (int fds[2], int flags), (fds, flags))
WRAP(mmap, MAP_FAILED, void *, mmap, (void *at, size_t len, int access, int flags, int fd, off_t from), (at, len, access, flags, fd, from))
WRAP(mmap, MAP_FAILED, void *, mmap64, (void *at, size_t len, int access, int flags, int fd, off64_t from), (at, len, access, flags, fd, from))

int pthread_create(pthread_t *thread, const pthread_attr_t *options, void *(*run)(void *), void *input) {
    REAL(pthread_create)
    int error = fault(CALL_thread);
    return error > 0 ? error : real(thread, options, run, input);
}

int posix_spawnp(pid_t *child, const char *file, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *options,
                 char *const arguments[], char *const environment[]) {
    REAL(posix_spawnp)
    int error = fault(CALL_spawn);
    return error > 0 ? error : real(child, file, actions, options, arguments, environment);
}

int sigaction(int signal, const struct sigaction *action, struct sigaction *earlier) {
    REAL(sigaction)
    int result = real(signal, action, earlier);
    if (signal == SIGABRT && action) atomic_store(&has_handler, 1);
    return result;
}

/* dlsym allocates, so the functions that allocate call the C library by its second names. */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

static int is_memory_missing(void) {
    int error = fault(CALL_malloc);
    if (error > 0) errno = ENOMEM;
    return error > 0;
}
void *malloc(size_t len) { return is_memory_missing() ? NULL : __libc_malloc(len); }
void *calloc(size_t count_, size_t len) { return is_memory_missing() ? NULL : __libc_calloc(count_, len); }
void *realloc(void *at, size_t len) { return is_memory_missing() ? NULL : __libc_realloc(at, len); }
void *aligned_alloc(size_t align, size_t len) { return is_memory_missing() ? NULL : __libc_memalign(align, len); }
int posix_memalign(void **to, size_t align, size_t len) {
    if (is_memory_missing()) return ENOMEM;
    *to = __libc_memalign(align, len);
    return *to ? 0 : ENOMEM;
}

/* The standard library of Rust makes some calls by number. */
long syscall(long number, ...) {
    long a[6];
    va_list list;
    va_start(list, number);
    for (int i = 0; i < 6; i++) a[i] = va_arg(list, long);
    va_end(list);
    int error = 0;
    if (number == SYS_copy_file_range) error = fault(CALL_copy);
    if (number == SYS_statx) error = fault(CALL_stat);
    if (number == SYS_renameat2) error = fault(CALL_rename);
    if (error > 0) { errno = error; return -1; }
    REAL(syscall)
    return real(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
