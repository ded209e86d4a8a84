#include "tests/study/trial/case_pool.h"

#include <time.h>

#include <cstdio>
#include <string>
#include <system_error>
#include <utility>

namespace joulecast::trial {

double thread_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

CaseFiles case_files_in(const std::filesystem::path& folder, std::size_t index) {
  char name[32];
  std::snprintf(name, sizeof name, "case-%04zu", index);
  return {folder / name};
}

Result<CaseFolder> CaseFolder::open(const std::filesystem::path& keep) {
  if (!keep.empty()) return CaseFolder(keep, true);
  std::string pattern = (std::filesystem::temp_directory_path() / "joulecast-trial-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) {
    return fail(Fault::unavailable, pattern, "cannot make a folder for the logs");
  }
  return CaseFolder(pattern, false);
}

CaseFolder::CaseFolder(CaseFolder&& other) noexcept
    : root_(std::move(other.root_)), kept_(std::exchange(other.kept_, true)) {}

CaseFolder::~CaseFolder() {
  std::error_code ignored;
  if (!kept_) std::filesystem::remove_all(root_, ignored);
}

void CaseFolder::done_with(const CaseFiles& files) const {
  std::error_code ignored;
  if (!kept_) std::filesystem::remove_all(files.folder, ignored);
}

}  // namespace joulecast::trial
