#pragma once

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <iosfwd>
#include <memory>
#include <string>
#include <string_view>

#include "base/error.h"

namespace joulecast {

inline constexpr std::size_t max_text_file_bytes = std::size_t{64} << 20;

// All bytes of a file. Fault::not_found where the file does not exist, ::invalid where it is no file,
// ::too_large where it holds more than `max_bytes` or never ends, or a line has more than `max_line_bytes`,
// ::unavailable where it cannot be read.
Result<std::string> read_text_file(const std::filesystem::path& path,
                                   std::size_t max_bytes = max_text_file_bytes,
                                   std::size_t max_line_bytes = std::string::npos);

// The same of an open stream; `name` names it in errors.
Result<std::string> read_text(std::istream& stream, const std::string& name, std::size_t max_bytes,
                              std::size_t max_line_bytes = std::string::npos);

enum class Existing { refuse, replace };

// Whether a file may be written there: Fault::conflict of `field` where there is one already, or a symbolic
// link, which is never followed. Existing::replace puts the file in the place of either. Devices, pipes and
// names in /dev may always be written.
Result<void> may_write(const std::string& field, const std::string& path, Existing existing);

// A file that appears under its name whole, in one step: it is written next to it, as
// `<path>.<process>.part`, and gets the permissions of the file that it replaces. Devices and pipes are
// written to directly.
class OutputFile {
 public:
  // Fault::conflict as may_write; ::unavailable when nothing can be written there.
  static Result<OutputFile> create(const std::string& path, Existing existing);
  OutputFile(OutputFile&&) = default;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();  // removes a file that was not committed

  // The path of the bytes until commit(), for callers that write them without write().
  const std::string& written_to() const { return part_.empty() ? path_ : part_; }

  Result<void> write(std::string_view bytes);
  // Puts the file in its place. Fault::unavailable when not every byte reached the disk, ::conflict when a
  // file came there meanwhile and is not to be replaced; then there is no new file.
  Result<void> commit();

 private:
  struct Closer {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };
  OutputFile(std::FILE* file, std::string path, std::string part, Existing existing);

  std::unique_ptr<std::FILE, Closer> file_;
  std::string path_;
  std::string part_;  // empty: written directly
  Existing existing_;
};

// Writes the whole file in one call.
Result<void> write_text_file(const std::string& path, std::string_view text, Existing existing);

}  // namespace joulecast
