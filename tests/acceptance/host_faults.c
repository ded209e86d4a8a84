// Preloaded into a daemon: gives the host a wrong clock and a failing disk according to the file HOST_FAULTS, which
// the test changes at run time. It contains the clock's offset [s], the failing accesses (bits: 1 writes, 2 reads,
// 4 syncs) and their errno. HOST_FAULTS_FILE: only files with this in their names fail. HOST_FAULTS_FS: type of all file
// systems.
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/vfs.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum { WRITES = 1, READS = 2, SYNCS = 4 };

static const volatile int64_t* faults;
static const char* files;

__attribute__((constructor)) static void begin(void) {
  int file = open(getenv("HOST_FAULTS"), O_RDONLY | O_CLOEXEC);
  void* map = mmap(0, 3 * sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
  if (map != MAP_FAILED) faults = map;
  close(file);
  files = getenv("HOST_FAULTS_FILE");
}

int clock_gettime(clockid_t clock, struct timespec* t) {
  int code = syscall(SYS_clock_gettime, clock, t);
  if (clock == CLOCK_REALTIME && faults) t->tv_sec += faults[0];
  return code;
}

int statfs(const char* path, struct statfs* info) {
  int code = syscall(SYS_statfs, path, info);
  const char* type = getenv("HOST_FAULTS_FS");
  if (!code && type) info->f_type = strtol(type, NULL, 0);
  return code;
}

int gettimeofday(struct timeval* restrict t, void* restrict zone) {
  (void)zone;
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  t->tv_sec = now.tv_sec;
  t->tv_usec = now.tv_nsec / 1000;
  return 0;
}

// True if an access of that kind to the descriptor fails; sets errno.
static int fails(int descriptor, int kind) {
  if (!faults || !files || !(faults[1] & kind)) return 0;
  char link[64], name[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  ssize_t length = readlink(link, name, sizeof name - 1);
  if (length < 0) return 0;
  name[length] = 0;
  if (!strstr(name, files)) return 0;
  errno = (int)faults[2];
  return 1;
}

ssize_t write(int d, const void* bytes, size_t size) {
  return fails(d, WRITES) ? -1 : syscall(SYS_write, d, bytes, size);
}
ssize_t pwrite(int d, const void* bytes, size_t size, off_t at) {
  return fails(d, WRITES) ? -1 : syscall(SYS_pwrite64, d, bytes, size, at);
}
ssize_t pwrite64(int d, const void* bytes, size_t size, off64_t at) { return pwrite(d, bytes, size, at); }
ssize_t pwritev(int d, const struct iovec* parts, int count, off_t at) {
  // The kernel expects the offset in two halves; 64-bit kernels ignore the second.
  return fails(d, WRITES) ? -1 : syscall(SYS_pwritev, d, parts, count, at, 0L);
}
ssize_t pwritev64(int d, const struct iovec* parts, int count, off64_t at) { return pwritev(d, parts, count, at); }
int ftruncate(int d, off_t size) { return fails(d, WRITES) ? -1 : (int)syscall(SYS_ftruncate, d, size); }
int ftruncate64(int d, off64_t size) { return ftruncate(d, size); }
ssize_t read(int d, void* bytes, size_t size) { return fails(d, READS) ? -1 : syscall(SYS_read, d, bytes, size); }
ssize_t pread(int d, void* bytes, size_t size, off_t at) {
  return fails(d, READS) ? -1 : syscall(SYS_pread64, d, bytes, size, at);
}
ssize_t pread64(int d, void* bytes, size_t size, off64_t at) { return pread(d, bytes, size, at); }
int fsync(int d) { return fails(d, SYNCS) ? -1 : (int)syscall(SYS_fsync, d); }
int fdatasync(int d) { return fails(d, SYNCS) ? -1 : (int)syscall(SYS_fdatasync, d); }
