#include "history/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <utility>

#include "base/try.h"

namespace joulecast::history {
namespace {

// ", process 123", which the file contains; empty without it.
std::string holder_of(int descriptor) {
  std::array<char, 16> text{};
  int process = 0;
  if (const auto size = pread(descriptor, text.data(), text.size(), 0); size > 0)
    std::from_chars(text.data(), text.data() + size, process);
  return process > 0 ? ", process " + std::to_string(process) : "";
}

}  // namespace

FileLock::~FileLock() {
  close(descriptor_);
}

Result<std::unique_ptr<FileLock>> FileLock::acquire(const std::string& path, bool names_holder) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0)
    return fail(Fault::unavailable, "database", "cannot open " + path + ": " + std::strerror(errno));
  auto lock = std::make_unique<FileLock>(descriptor);
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    const std::string holder = names_holder ? holder_of(descriptor) : "";
    return fail(
        Fault::conflict, "database",
        path + " is locked: another joulecast program" + holder + ", a daemon perhaps, has this store open");
  }
  if (names_holder && ftruncate(descriptor, 0) == 0) {
    const std::string own = std::to_string(getpid());
    [[maybe_unused]] const auto written = write(descriptor, own.data(), own.size());
  }
  return lock;
}

Result<std::vector<std::unique_ptr<FileLock>>> lock_store(const std::string& path) {
  std::vector<std::unique_ptr<FileLock>> locks;
  for (const char* suffix : {".lock", ""}) {
    TRY_ASSIGN(auto lock, FileLock::acquire(path + suffix, *suffix != '\0'));
    locks.push_back(std::move(lock));
  }
  return locks;
}

}  // namespace joulecast::history
