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

  // Creates the file if it is missing. Fault::conflict if another program holds the lock; with `names_holder`
  // the file contains its process, which the message names.
  static Result<std::unique_ptr<FileLock>> acquire(const std::string& path, bool names_holder);

 private:
  int descriptor_;
};

// The locks of a store: one on the lock file next to it, which excludes other programs before anything is
// read, and one on the database itself, which remains if the lock file is deleted.
Result<std::vector<std::unique_ptr<FileLock>>> lock_store(const std::string& path);

}  // namespace joulecast::history
