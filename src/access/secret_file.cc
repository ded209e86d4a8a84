#include "access/secret_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace joulecast::access {

Result<std::string> read_guarded_file(const std::string& path, bool secret, std::size_t max_bytes) {
  TRY_ASSIGN(std::string text, read_text_file(path, max_bytes));
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return fail(Fault::unavailable, path, std::strerror(errno));
  if (secret && (status.st_mode & S_IROTH) != 0)
    return invalid(path, "may be read by every user of this machine: chmod o-r");
  if ((status.st_mode & S_IWOTH) != 0)
    return invalid(path, "may be written by every user of this machine: chmod o-w");
  return text;
}

Result<std::string> read_secret(const std::string& path, std::size_t least) {
  constexpr std::size_t most_bytes = 4096;
  TRY_ASSIGN(std::string text, read_guarded_file(path, true, most_bytes));
  constexpr const char* space = " \t\r\n";
  text.erase(0, text.find_first_not_of(space));
  text.erase(text.find_last_not_of(space) + 1);
  if (text.size() < least) return invalid(path, "must hold " + std::to_string(least) + " bytes at least");
  return text;
}

FileStamp stamp_of(const std::string& path) {
  struct stat now {};
  if (stat(path.c_str(), &now) != 0) return {};
  return {std::int64_t{now.st_ctim.tv_sec} * 1'000'000'000 + now.st_ctim.tv_nsec, std::int64_t{now.st_size},
          now.st_ino};
}

FileReplacement::~FileReplacement() {
  if (descriptor_ < 0) return;
  close(descriptor_);
  unlink((path_ + ".new").c_str());
}

Result<bool> FileReplacement::begin() {
  const std::string beside = path_ + ".new";
  struct stat old {};
  const bool exists = stat(path_.c_str(), &old) == 0;
  descriptor_ = open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor_ < 0 && errno == EEXIST)
    return fail(Fault::conflict, beside,
                "exists: another program changes " + path_ + ", or one died doing so; then delete it");
  if (descriptor_ < 0) return fail(Fault::unavailable, beside, std::strerror(errno));
  if (fchmod(descriptor_, exists ? old.st_mode & 07777 : 0640) != 0)
    return fail(Fault::unavailable, beside, std::strerror(errno));
  // Keeps the owner, so that the daemon can still read the file; only root may change it.
  if (exists && fchown(descriptor_, old.st_uid, old.st_gid) != 0 && geteuid() == 0)
    return fail(Fault::unavailable, beside, std::strerror(errno));
  return exists;
}

Result<void> FileReplacement::commit(std::string_view text) {
  const std::string beside = path_ + ".new";
  const bool written = write(descriptor_, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       fsync(descriptor_) == 0 && std::rename(beside.c_str(), path_.c_str()) == 0;
  if (!written) return fail(Fault::unavailable, path_, std::strerror(errno));
  close(descriptor_);
  descriptor_ = -1;
  return {};
}

}  // namespace joulecast::access
