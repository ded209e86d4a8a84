#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/error.h"

namespace joulecast::history {

// Keeps a second program off the same file; the kernel releases it however the process ends.
class FileLock {
 public:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  // Creates the file where there is none. Fault::conflict when another program holds it.
  static Result<std::unique_ptr<FileLock>> acquire(const std::string& path);

 private:
  int descriptor_;
};

// Of a store: of the lock file beside it, which keeps others off before anything is read, and of the database
// itself, which holds where the lock file is deleted.
Result<std::vector<std::unique_ptr<FileLock>>> lock_store(const std::string& path);

}  // namespace joulecast::history
