#include "server/diagnosis/confined.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <boost/core/noncopyable.hpp>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <new>
#include <optional>
#include <utility>

namespace joulecast::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int look_period_ms = 100;

// Frames from the process: a letter, the size of the content, and the content.
enum class Frame : char { progress = 'p', answer = 'a', error = 'e', out_of_memory = 'm' };

bool write_all(int to, const void* bytes, std::size_t size) {
  const char* at = static_cast<const char*>(bytes);
  while (size > 0) {
    const ssize_t n = write(to, at, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    size -= static_cast<std::size_t>(n);
  }
  return true;
}

bool send(int to, Frame kind, const void* bytes, std::uint64_t size) {
  return write_all(to, &kind, sizeof kind) && write_all(to, &size, sizeof size) && write_all(to, bytes, size);
}

// Pages of data that this process has, in bytes.
std::uint64_t data_bytes() {
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (file == nullptr) return 0;
  unsigned long long pages = 0;
  const int read = std::fscanf(file, "%*u %*u %*u %*u %*u %llu", &pages);
  std::fclose(file);
  return read == 1 ? pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) : 0;
}

void confine(const Confinement& limits, std::uint64_t had_bytes, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  // The kernel ends this process first when the machine runs out of memory.
  if (const int score = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC); score >= 0) {
    (void)write_all(score, "1000", 4);  // where that is forbidden, the limit below holds all the same
    close(score);
  }
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
// Sanitizers keep their shadow in the same memory.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const rlim_t most = had_bytes + limits.max_memory_bytes;
  const rlimit memory{most, most};
  if (had_bytes > 0) setrlimit(RLIMIT_DATA, &memory);
#else
  (void)had_bytes, (void)limits;
#endif
}

[[noreturn]] void work_alone(int to, const std::function<Result<std::string>(const Report&)>& work) {
  std::signal(SIGPIPE, SIG_IGN);
  try {
    std::mutex sending;
    auto last = Clock::time_point();
    const Report report = [&](double fraction) {
      const std::lock_guard lock(sending);
      const auto now = Clock::now();
      if (now - last < std::chrono::milliseconds(look_period_ms)) return true;
      last = now;
      return send(to, Frame::progress, &fraction, sizeof fraction);
    };
    const Result<std::string> answer = work(report);
    const std::string& text = answer ? *answer : answer.error().message;
    // A frame that cannot be sent, here and below, means that the parent is gone.
    (void)send(to, answer ? Frame::answer : Frame::error, text.data(), text.size());
  } catch (const std::bad_alloc&) {
    (void)send(to, Frame::out_of_memory, "", 0);
  } catch (const std::exception& error) {
    (void)send(to, Frame::error, error.what(), std::strlen(error.what()));
  }
  _exit(0);
}

// Splits received bytes into whole frames.
class Frames {
 public:
  void add(const char* bytes, std::size_t size) { came_.append(bytes, size); }
  std::optional<std::pair<Frame, std::string>> next() {
    std::uint64_t size = 0;
    constexpr std::size_t head = 1 + sizeof size;
    if (came_.size() < head) return std::nullopt;
    std::memcpy(&size, came_.data() + 1, sizeof size);
    if (came_.size() - head < size) return std::nullopt;
    std::pair frame(static_cast<Frame>(came_[0]), came_.substr(head, size));
    came_.erase(0, head + size);
    return frame;
  }

 private:
  std::string came_;
};

class Child : boost::noncopyable {
 public:
  Child(pid_t id, int from) : id_(id), from_(from) {}
  ~Child() {
    close(from_);
    kill(id_, SIGKILL);
    (void)wait();  // its status is of no interest: it was killed
  }
  int from() const { return from_; }
  int wait() {
    if (!status_) {
      int status = 0;
      while (waitpid(id_, &status, 0) < 0 && errno == EINTR) {
      }
      status_ = status;
    }
    return *status_;
  }

 private:
  pid_t id_;
  int from_;
  std::optional<int> status_;
};

std::string how_it_ended(int status) {
  if (!WIFSIGNALED(status)) return "the diagnosis ended without an answer";
  return "the diagnosis was ended by signal " + std::to_string(WTERMSIG(status)) + " (" +
         strsignal(WTERMSIG(status)) + ")";
}

}  // namespace

Result<std::string> run_confined(const Confinement& limits,
                                 const std::function<Result<std::string>(const Report&)>& work,
                                 const Report& on_progress) {
#ifdef __SANITIZE_ADDRESS__
  // The allocator of GCC 12's sanitizer, unlike that of the C library, does not hold its locks over a fork:
  // the process would wait for a lock of a thread that it does not have.
  if (std::distance(std::filesystem::directory_iterator("/proc/self/task"), {}) > 1) return work(on_progress);
#endif
  const auto until = Clock::now() + limits.deadline;
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    return fail(Fault::unavailable, "", std::string("no pipe: ") + std::strerror(errno));
  const std::uint64_t had_bytes = data_bytes();
  const pid_t parent = getpid();
  const pid_t id = fork();
  if (id < 0) {
    const std::string why = std::strerror(errno);
    close(ends[0]);
    close(ends[1]);
    return fail(Fault::unavailable, "", "no process for the diagnosis: " + why);
  }
  if (id == 0) {
    // Sockets and locks of the daemon must not outlive it here; the standard streams stay.
    if (ends[1] > 3) close_range(3, static_cast<unsigned>(ends[1]) - 1, 0);
    close_range(static_cast<unsigned>(ends[1]) + 1, ~0U, 0);
    confine(limits, had_bytes, parent);
    work_alone(ends[1], work);
  }
  close(ends[1]);
  Child child(id, ends[0]);
  const std::string memory = "the diagnosis needs more memory than diagnosis.max_memory_bytes, " +
                             std::to_string(limits.max_memory_bytes) + " B";
  Frames frames;
  double fraction = 0;
  std::array<char, 1 << 16> bytes{};
  for (;;) {
    if (!on_progress(fraction)) return fail(Fault::stopped, "", "the diagnosis was cancelled");
    if (Clock::now() >= until)
      return fail(
          Fault::too_large, "",
          "the diagnosis took longer than diagnosis.deadline_s, " +
              std::to_string(std::chrono::duration_cast<std::chrono::seconds>(limits.deadline).count()) +
              " s");
    pollfd wait{child.from(), POLLIN, 0};
    if (poll(&wait, 1, look_period_ms) <= 0) continue;
    const ssize_t n = read(child.from(), bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return fail(Fault::internal, "", how_it_ended(child.wait()));
    frames.add(bytes.data(), static_cast<std::size_t>(n));
    while (auto frame = frames.next()) {
      auto& [kind, text] = *frame;
      if (kind == Frame::answer) return std::move(text);
      if (kind == Frame::error) return fail(Fault::invalid, "", std::move(text));
      if (kind == Frame::out_of_memory) return fail(Fault::too_large, "", memory);
      if (text.size() == sizeof fraction) std::memcpy(&fraction, text.data(), sizeof fraction);
    }
  }
}

}  // namespace joulecast::server
