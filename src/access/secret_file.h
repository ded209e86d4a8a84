#pragma once

#include <boost/core/noncopyable.hpp>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/text_file.h"
#include "base/try.h"

// Files of secrets, which commands change while a daemon reads them.
namespace joulecast::access {

// The content of a file. Fault::invalid where every user may write it or, if it is secret, read it.
Result<std::string> read_guarded_file(const std::string& path, bool secret,
                                      std::size_t max_bytes = max_text_file_bytes);
// That of a secret file without the whitespace around it; Fault::invalid also below `least` bytes.
Result<std::string> read_secret(const std::string& path, std::size_t least);

// Changes with a file's content, permissions and replacement.
struct FileStamp {
  std::int64_t changed_ns = 0, size = 0;
  std::uint64_t inode = 0;
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};
FileStamp stamp_of(const std::string& path);

// The new file next to the old one, as `<path>.new`, which exists only while it is written.
class FileReplacement : boost::noncopyable {
 public:
  explicit FileReplacement(std::string path) : path_(std::move(path)) {}
  ~FileReplacement();

  // Returns whether there is an old file. The new one gets its mode and owner (without an old one: mode
  // 0640). Fault::conflict while another program changes the file.
  Result<bool> begin();
  Result<void> commit(std::string_view text);

 private:
  std::string path_;
  int descriptor_ = -1;
};

// Replaces the file as a whole by the result of `change` on its content, which is empty without a file.
template <class Content>
Result<void> change_secret_file(const std::string& path, Result<Content> (*read)(const std::string&),
                                std::string (*text_of)(const Content&),
                                const std::function<Result<void>(Content&)>& change) {
  FileReplacement replacement(path);
  TRY_ASSIGN(const bool exists, replacement.begin());
  TRY_ASSIGN(Content content, exists ? read(path) : Content{});
  if (Result<void> changed = change(content); !changed) return changed;
  return replacement.commit(text_of(content));
}

}  // namespace joulecast::access
