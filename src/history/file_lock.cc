#include "history/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/try.h"

namespace joulecast::history {

FileLock::~FileLock() {
  close(descriptor_);
}

Result<std::unique_ptr<FileLock>> FileLock::acquire(const std::string& path) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0)
    return fail(Fault::unavailable, "database", "cannot open " + path + ": " + std::strerror(errno));
  auto lock = std::make_unique<FileLock>(descriptor);
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0)
    return fail(Fault::conflict, "database",
                path + " is locked: another joulecast program, a daemon perhaps, has this store open");
  return lock;
}

Result<std::vector<std::unique_ptr<FileLock>>> lock_store(const std::string& path) {
  std::vector<std::unique_ptr<FileLock>> locks;
  for (const char* suffix : {".lock", ""}) {
    TRY_ASSIGN(auto lock, FileLock::acquire(path + suffix));
    locks.push_back(std::move(lock));
  }
  return locks;
}

}  // namespace joulecast::history
