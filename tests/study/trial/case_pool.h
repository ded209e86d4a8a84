#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "base/error.h"
#include "tests/study/trial/case_files.h"

namespace joulecast::trial {

// Processor time of the calling thread.
[[nodiscard]] double thread_cpu_s();

// Where a case lies in a folder of cases.
[[nodiscard]] CaseFiles case_files_in(const std::filesystem::path& folder, std::size_t index);

// The folder of all cases: `keep`, or one of its own that goes with the object.
class CaseFolder {
 public:
  static Result<CaseFolder> open(const std::filesystem::path& keep);
  ~CaseFolder();
  CaseFolder(CaseFolder&& other) noexcept;
  CaseFolder(const CaseFolder&) = delete;
  CaseFolder& operator=(const CaseFolder&) = delete;

  CaseFiles files_of(std::size_t index) const { return case_files_in(root_, index); }
  // Removes the files of a case unless they are kept.
  void done_with(const CaseFiles& files) const;

 private:
  CaseFolder(std::filesystem::path root, bool kept) : root_(std::move(root)), kept_(kept) {}

  std::filesystem::path root_;
  bool kept_;
};

// Runs `count` cases, `jobs` in parallel. The outcomes are in order of the cases; the first error ends it.
// `done` is called after each case, by one thread at a time.
template <class Outcome>
Result<std::vector<Outcome>> run_cases(
    std::size_t count, std::size_t jobs, const std::filesystem::path& keep,
    const std::function<Result<Outcome>(std::size_t index, const CaseFiles& files)>& run_case,
    const std::function<void(const Outcome&)>& done) {
  const auto folder = CaseFolder::open(keep);
  if (!folder) return tl::unexpected(folder.error());
  std::vector<Outcome> outcomes(count);
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::optional<Error> error;
  const auto work = [&] {
    for (std::size_t k = next++; k < count; k = next++) {
      const CaseFiles files = folder->files_of(k);
      auto outcome = run_case(k, files);
      folder->done_with(files);
      const std::lock_guard lock(mutex);
      if (!outcome) {
        if (!error) error = outcome.error();
        next = count;
        return;
      }
      outcomes[k] = std::move(*outcome);
      if (done) done(outcomes[k]);
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t k = 1; k < jobs; ++k) others.emplace_back(work);
    work();
  }
  if (error) return tl::unexpected(*error);
  return outcomes;
}

}  // namespace joulecast::trial
