#include "base/text_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>
#include <utility>

#include "base/try.h"

namespace joulecast {

Result<std::string> read_text(std::istream& stream, const std::string& name, std::size_t max_bytes,
                              std::size_t max_line_bytes) {
  std::string text;
  std::size_t line_begin = 0;
  std::array<char, 1 << 16> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_bytes)
      return fail(Fault::too_large, name, "has more than " + std::to_string(max_bytes >> 20) + " MiB");
    if (text.size() - line_begin <= max_line_bytes) continue;
    if (const auto end = text.find_last_of("\r\n"); end != std::string::npos) line_begin = end + 1;
    if (text.size() - line_begin > max_line_bytes)
      return fail(Fault::too_large, name,
                  "has a line of more than " + std::to_string(max_line_bytes >> 20) + " MiB");
  }
  if (stream.bad())
    return fail(Fault::unavailable, name, std::string("cannot be read: ") + std::strerror(errno));
  return text;
}

Result<std::string> read_text_file(const std::filesystem::path& path, std::size_t max_bytes,
                                   std::size_t max_line_bytes) {
  std::error_code unknown;  // opening it reports the fault
  const std::filesystem::file_status status = std::filesystem::status(path, unknown);
  if (std::filesystem::is_directory(status)) return invalid(path.string(), "is a folder, must be a file");
  // Opening a pipe waits for a program that writes to it.
  if (std::filesystem::is_fifo(status)) return invalid(path.string(), "is a pipe, must be a file");
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return fail(errno == ENOENT || errno == ENOTDIR ? Fault::not_found : Fault::unavailable, path.string(),
                std::string("cannot be opened: ") + std::strerror(errno));
  return read_text(file, path.string(), max_bytes, max_line_bytes);
}

namespace {

tl::unexpected<Error> trouble(const std::string& path) {
  return fail(Fault::unavailable, path, std::string("cannot be written: ") + std::strerror(errno));
}

// Type and mode of the path; a link is not followed.
mode_t mode_of(const std::string& path) {
  struct stat there {};
  return lstat(path.c_str(), &there) == 0 ? there.st_mode : 0;
}

// /dev/stdout is a link to the file, pipe or terminal that the shell has opened.
bool is_written_directly(const std::string& path) {
  struct stat target {};
  if (path.starts_with("/dev/") && !path.starts_with("/dev/shm/")) return true;
  return stat(path.c_str(), &target) == 0 && !S_ISREG(target.st_mode) && !S_ISLNK(mode_of(path));
}

int put_in_place(const std::string& part, const std::string& path, Existing existing) {
  if (existing == Existing::replace) return std::rename(part.c_str(), path.c_str());
  const int done = renameat2(AT_FDCWD, part.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE);
  // Some network file systems have no such call.
  if (done != 0 && (errno == EINVAL || errno == ENOSYS) && mode_of(path) == 0)
    return std::rename(part.c_str(), path.c_str());
  return done;
}

}  // namespace

Result<void> may_write(const std::string& field, const std::string& path, Existing existing) {
  if (existing == Existing::replace || is_written_directly(path)) return {};
  const mode_t there = mode_of(path);
  if (there == 0) return {};
  return fail(Fault::conflict, field,
              path + (S_ISLNK(there) ? " is a symbolic link; --force puts a file in its place"
                                     : " already exists; --force overwrites it"));
}

OutputFile::OutputFile(std::FILE* file, std::string path, std::string part, Existing existing)
    : file_(file), path_(std::move(path)), part_(std::move(part)), existing_(existing) {}

OutputFile::~OutputFile() {
  if (file_ && !part_.empty()) unlink(part_.c_str());
}

Result<OutputFile> OutputFile::create(const std::string& path, Existing existing) {
  TRY(may_write("", path, existing));
  std::string part;
  int descriptor = -1;
  if (is_written_directly(path)) {
    descriptor = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  } else {
    part = path + "." + std::to_string(getpid()) + ".part";
    descriptor = open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (const mode_t there = mode_of(path); descriptor >= 0 && S_ISREG(there)) {
      // Failing this it has those of a new file.
      [[maybe_unused]] const int kept = fchmod(descriptor, there & 0777);
    }
  }
  std::FILE* file = descriptor < 0 ? nullptr : fdopen(descriptor, "wb");
  if (file == nullptr) return trouble(path);
  return OutputFile(file, path, std::move(part), existing);
}

Result<void> OutputFile::write(std::string_view bytes) {
  if (!file_) return fail(Fault::unavailable, path_, "is closed");
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) return trouble(path_);
  return {};
}

Result<void> OutputFile::commit() {
  if (!file_) return {};
  const bool direct = part_.empty();
  bool written = std::fflush(file_.get()) == 0 && (direct || fsync(fileno(file_.get())) == 0);
  written = std::fclose(file_.release()) == 0 && written;
  if (direct && written) return {};
  if (written && put_in_place(part_, path_, existing_) == 0) return {};
  const int why = errno;
  if (!direct) unlink(part_.c_str());
  if (why == EEXIST) return may_write(path_, path_, existing_);
  errno = why;
  return trouble(path_);
}

Result<void> write_text_file(const std::string& path, std::string_view text, Existing existing) {
  TRY_ASSIGN(auto file, OutputFile::create(path, existing));
  TRY(file.write(text));
  return file.commit();
}

}  // namespace joulecast
